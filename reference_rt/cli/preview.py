"""`reference-rt preview`: a picture that becomes less noisy, in a window, a terminal or a file."""

import itertools
import os
import sys
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from reference_rt.cli.guarded import say
from reference_rt.cli.picture_above import first_look, pixels_of
from reference_rt.cli.pictured import PicturedLine
from reference_rt.cli.quantities import percentage
from reference_rt.cli.terminal_answer import protocol
from reference_rt.cli.terminal_picture import Pixels, half_blocks, kitty, room, sixels
from reference_rt.cli.watching import POLLED, Stamp, stamp
from reference_rt.rendering.loop import Limits
from reference_rt.rendering.picture import Picture
from reference_rt.rendering.render import Session, with_settings
from reference_rt.rendering.scene import Scene
from reference_rt.scene.build import BuiltScene
from reference_rt.scene.model import SceneModel
from reference_rt.util.errors import SceneError, UsageError
from reference_rt.util.files import check_writable

_DRAWN: Mapping[str, Callable[[Pixels, int, int], str]] = {
    "kitty": kitty,
    "sixel": sixels,
    "blocks": half_blocks,
}

PLACES = ("window", "terminal", *_DRAWN)
"""What `--to` may be besides the name of a .png file."""


class Closed(Exception):  # noqa: N818 - it is no error
    """The window was closed."""


class View(Protocol):
    """A place where a picture is shown."""

    def show(self, picture: Picture) -> None:
        """Show the picture in place of the one before."""

    def pump(self) -> None:
        """Called a few times per second while rendering.  Raises Closed."""

    def wait(self) -> None:
        """Return when the last picture need not be shown any more."""


class Wanted(NamedTuple):
    """spp, error: the picture is finished with so many samples per pixel, or at most this relative
    standard error.  Samplers without random numbers have their own number of samples."""

    spp: int
    error: float
    threads: int | None


def preview(scene: Scene, view: View, wanted: Wanted) -> None:
    """Show the picture until it is finished, or until the view is closed."""
    with suppress(Closed):
        _show_all(scene, view, wanted, lambda: None)
        view.wait()


def watch(load: Callable[[], Scene], path: Path, view: View, wanted: Wanted) -> None:
    """`preview` of the scene that `load` returns, and again whenever its file, `path`, or one that
    it names has changed, until the view is closed.  What is wrong with a scene is printed."""
    paths = [path]
    with suppress(Closed):
        while True:
            files = _Files()
            files.add(paths)
            try:
                scene = load()
                paths = [path, *files_of(scene)]
                files.add(paths)
                _show_all(scene, view, wanted, files.check)
            except SceneError as wrong:
                for one in (wrong, *wrong.others):
                    say(f"error: {one}", err=True)
            except _ChangedError:
                continue
            with suppress(_ChangedError):
                while True:
                    files.check()
                    view.pump()
                    time.sleep(_PUMPED)


_PUMPED = 0.05
"""Seconds between two calls of a view that waits."""


class _ChangedError(Exception):
    """A file has changed."""


class _Files:
    """Files that may change."""

    def __init__(self) -> None:
        self._stamps: dict[Path, Stamp] = {}
        self._next = 0.0

    def add(self, paths: Iterable[Path]) -> None:
        """Watch these files, too, from now on."""
        for path in paths:
            self._stamps.setdefault(path, stamp(path))

    def check(self) -> None:
        """Called often, looks now and then.  Raises _ChangedError."""
        if time.monotonic() >= self._next:
            self._next = time.monotonic() + POLLED
            if any(stamp(path) != known for path, known in self._stamps.items()):
                raise _ChangedError


def files_of(scene: Scene) -> list[Path]:
    """The files that a scene names."""
    shapes = [*scene.shapes, *itertools.chain(*scene.groups.values())]
    for shape in shapes:
        shapes += getattr(shape, "of", ())
    parts = [*scene.textures.values(), *shapes, *scene.lights]
    names = dict.fromkeys(getattr(part, "file", None) for part in parts)
    return [scene.folder / name for name in names if name is not None]


def _show_all(scene: Scene, view: View, wanted: Wanted, check: Callable[[], None]) -> None:
    scene = scene.changed(film=scene.film.model_copy(update={"layers": ()}))
    # A picture of one sample is there at once; the first pass of another has 16.
    for count in (1, wanted.spp) if _is_noisy(scene) else (None,):
        _show(with_settings(scene, spp=count), view, wanted, check)


def _show(scene: BuiltScene, view: View, wanted: Wanted, check: Callable[[], None]) -> None:
    """Render, and show the picture again and again: each second at first, later after a tenth of
    the time so far.  check: called a few times per second."""
    error, threads = wanted.error, wanted.threads
    with PicturedLine() as progress, first_look(scene, progress) as compiling:
        limits = Limits(error=error) if _is_noisy(scene) else Limits()
        session = Session(scene, threads=threads, compiling=compiling, limits=limits)
    began = due = time.monotonic()

    def watch() -> None:
        nonlocal due
        check()
        view.pump()
        now = time.monotonic()
        picture = session.preview() if now >= due else None
        if picture is not None and picture.taken is not None and picture.taken.fewest > 0:
            view.show(picture)
            due = now + max(1.0, (now - began) / 10.0)

    with session:
        session.run(lambda what, fraction: None, watch)
        view.show(session.picture())


def _is_noisy(scene: SceneModel) -> bool:
    return hasattr(scene.resolved_sampler, "seed")


def words(picture: Picture) -> str:
    """The samples and the noise of a picture in a line."""
    taken, scene = picture.taken, picture.scene
    assert taken is not None
    assert scene is not None
    count = f"{taken.fewest} to {taken.most}" if taken.most > taken.fewest else f"{taken.most}"
    text = f"{count} sample{'s' if taken.most > 1 else ''} per pixel"
    if not _is_noisy(scene):
        return f"{text}, no noise"
    return text if taken.error is None else f"{text}, relative error {percentage(taken.error)}"


def view_of(to: str, scene: Scene) -> View:
    """The view for `--to`; "": a window where there can be one, else a file beside the caller.
    Raises UsageError."""
    if to == "":
        window = _window(scene)
        return window or File(Path(f"{scene.name}.preview.png"))
    if to == "window":
        window = _window(scene)
        if window is None:
            raise UsageError("--to window: there is no display; expected 'terminal' or a .png file")
        return window
    if to in PLACES:
        return Terminal(_DRAWN.get(to))
    if Path(to).suffix.lower() != ".png":
        known = ", ".join(PLACES)
        raise UsageError(f"--to: expected one of {known} or a .png file, got '{to}'")
    return File(Path(to))


class File:
    """A PNG file, which viewers that watch their file show again whenever it is rewritten."""

    def __init__(self, path: Path) -> None:
        check_writable(path)
        self.path = path

    def show(self, picture: Picture) -> None:
        picture.save(self.path)
        say(f"{self.path}: {words(picture)}", err=True)

    def pump(self) -> None:
        """Nothing to do: files do not respond."""

    def wait(self) -> None:
        """Nothing to do: the file remains."""


class Terminal:
    """The terminal that standard output goes to.

    draw: makes text of pixels, columns and rows; None: as the terminal says that it can.
    """

    def __init__(self, draw: Callable[[Pixels, int, int], str] | None = None) -> None:
        self._draw = draw or _DRAWN.get(protocol(sys.stdout), half_blocks)
        self._begun = False

    def show(self, picture: Picture) -> None:
        text = self._draw(pixels_of(picture), *room())
        # Home, and the first time also clear: later pictures cover the one before.
        sys.stdout.write(("\x1b[H" if self._begun else "\x1b[2J\x1b[H") + text)
        sys.stdout.write(f"\x1b[K{words(picture)}\n")
        sys.stdout.flush()
        self._begun = True

    def pump(self) -> None:
        """Nothing to do: Ctrl-C ends the program."""

    def wait(self) -> None:
        """Nothing to do: the picture remains."""


class Window:
    """A window of Tk.  root: a `tkinter.Tk`."""

    def __init__(self, root: Any, title: str) -> None:
        self._root, self._title, self._open = root, title, True
        import tkinter

        self._label = tkinter.Label(root, borderwidth=0)
        self._label.pack()
        root.title(title)
        root.protocol("WM_DELETE_WINDOW", self.close)
        root.bind("<Escape>", lambda event: self.close())

    def close(self) -> None:
        """Close the window; the next `pump` raises Closed."""
        self._open = False

    def show(self, picture: Picture) -> None:
        from PIL import Image, ImageTk

        photo = ImageTk.PhotoImage(Image.fromarray(pixels_of(picture)), master=self._root)
        self._label.configure(image=photo)
        self._photo = photo  # Tk itself holds no reference
        self._root.title(f"{self._title}: {words(picture)}")
        self.pump()

    def pump(self) -> None:
        if self._open:
            self._root.update()
        if not self._open:
            self._root.destroy()
            raise Closed

    def wait(self) -> None:
        while True:
            self._root.after(50)  # milliseconds
            self.pump()


def _window(scene: Scene) -> Window | None:
    """A window, or None where there is no display or no Tk."""
    if sys.platform not in ("win32", "darwin") and not os.environ.get("DISPLAY"):
        return None  # Tk has no Wayland: it needs DISPLAY there, too
    try:
        import tkinter

        return Window(tkinter.Tk(className="reference-rt"), scene.name)
    except (ImportError, RuntimeError):
        return None
    except Exception as error:
        if type(error).__name__ == "TclError":  # the display does not answer
            return None
        raise
