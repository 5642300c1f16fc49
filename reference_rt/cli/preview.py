"""`reference-rt preview`: a picture that becomes less noisy, in a window, a terminal or a file."""

import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

from reference_rt.cli.guarded import say
from reference_rt.cli.terminal_picture import Pixels, draws_sixels, half_blocks, room, sixels
from reference_rt.rendering.image import display, eight_bits, write_png
from reference_rt.rendering.progressive import Stage, progressive
from reference_rt.rendering.provenance import provenance
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import UsageError
from reference_rt.util.files import check_writable

PLACES = ("window", "terminal", "sixel", "blocks")
"""What `--to` may be besides the name of a .png file."""


class Closed(Exception):  # noqa: N818 - it is no error
    """The window was closed."""


class View(Protocol):
    """A place where stages of a picture are shown."""

    def show(self, stage: Stage) -> None:
        """Show the picture in place of the one before."""

    def pump(self) -> None:
        """Called a few times per second while rendering.  Raises Closed."""

    def wait(self) -> None:
        """Return when the last picture need not be shown any more."""


def preview(scene: Scene, view: View, spp: int, noise: float, threads: int | None) -> None:
    """Show the picture until it has `spp` samples per pixel, or at most `noise` as the relative
    standard error of a typical pixel, or until the view is closed."""
    stages = progressive(scene, spp=spp, threads=threads, progress=lambda what, part: view.pump())
    try:
        for stage in stages:
            view.show(stage)
            if stage.noise <= noise:
                break
        view.wait()
    except Closed:
        return


def words(stage: Stage) -> str:
    """A stage in a line."""
    count = "1 sample" if stage.spp == 1 else f"{stage.spp} samples"
    if stage.noise == 0.0:
        return f"{count} per pixel, no noise"
    known = f", noise {100.0 * stage.noise:.2g} %" if stage.noise < 1e3 else ""
    return f"{count} per pixel{known}"


def view_of(to: str, scene: Scene) -> View:
    """The view for `--to`; "": a window where there can be one, else a file beside the caller.
    Raises UsageError."""
    if to == "":
        window = _window(scene)
        return window or File(Path(f"{scene.name}.preview.png"), scene)
    if to == "window":
        window = _window(scene)
        if window is None:
            raise UsageError("--to window: there is no display; expected 'terminal' or a .png file")
        return window
    if to in PLACES:
        return Terminal({"sixel": sixels, "blocks": half_blocks}.get(to))
    if Path(to).suffix.lower() != ".png":
        known = ", ".join(PLACES)
        raise UsageError(f"--to: expected one of {known} or a .png file, got '{to}'")
    return File(Path(to), scene)


def pixels_of(stage: Stage) -> Pixels:
    """The picture as the command `render` would write it to a .png file."""
    return eight_bits(display(stage.picture))


class File:
    """A PNG file, which viewers that watch their file show again whenever it is rewritten."""

    def __init__(self, path: Path, scene: Scene) -> None:
        check_writable(path)
        self.path, self._header = path, provenance(scene)

    def show(self, stage: Stage) -> None:
        write_png(self.path, display(stage.picture), self._header)
        say(f"{self.path}: {words(stage)}", err=True)

    def pump(self) -> None:
        """Nothing to do: files do not respond."""

    def wait(self) -> None:
        """Nothing to do: the file remains."""


class Terminal:
    """The terminal that standard output goes to.

    draw: makes text of pixels, columns and rows; None: sixels if the terminal says that it draws
    them, else half blocks.
    """

    def __init__(self, draw: Callable[[Pixels, int, int], str] | None = None) -> None:
        self._draw = draw or (sixels if draws_sixels() else half_blocks)
        self._begun = False

    def show(self, stage: Stage) -> None:
        text = self._draw(pixels_of(stage), *room())
        # Home, and the first time also clear: later pictures cover the one before.
        sys.stdout.write(("\x1b[H" if self._begun else "\x1b[2J\x1b[H") + text)
        sys.stdout.write(f"\x1b[K{words(stage)}\n")
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

    def show(self, stage: Stage) -> None:
        from PIL import Image, ImageTk

        photo = ImageTk.PhotoImage(Image.fromarray(pixels_of(stage)), master=self._root)
        self._label.configure(image=photo)
        self._photo = photo  # Tk itself holds no reference
        self._root.title(f"{self._title}: {words(stage)}")
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
