"""`reference-rt render`: a picture in a file, with limits, checkpoints and previews."""

import itertools
import math
import time
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from reference_rt.cli.options import Where
from reference_rt.cli.picture_above import Growing, first_look
from reference_rt.cli.pictured import PicturedLine
from reference_rt.cli.quantities import bytes_of, duration, percentage, seconds_of, share_of
from reference_rt.integrators import Light
from reference_rt.jit.kernel_cache import cache_root
from reference_rt.rendering import image
from reference_rt.rendering.checkpoint import delete_old
from reference_rt.rendering.loop import Limits
from reference_rt.rendering.picture import Picture
from reference_rt.rendering.query import intersect
from reference_rt.rendering.render import Session, Storage
from reference_rt.rendering.scene import Scene
from reference_rt.scene.build import BuiltScene
from reference_rt.scene.likely_mistakes import likely_mistakes
from reference_rt.util.errors import ImageError, UsageError
from reference_rt.util.files import check_writable
from reference_rt.util.processes import exit_code_of
from reference_rt.util.workers import Processes

AFTER = 60.0
"""Seconds of rendering after which a render without --checkpoint is stored."""

_PREVIEWED = 10.0
"""Seconds between two previews, or as many as make them a tenth of the time."""

_FIRST_LINE, _MOST_BETWEEN_LINES = 10.0, 600.0
"""Seconds before the first line of progress without a terminal; the time between lines doubles."""


class Stored(NamedTuple):
    """The options of the command line about where a render is stored."""

    checkpoint: Path | None = None
    no_checkpoint: bool = False
    resume: bool = False
    more_spp: int = 0

    def storage(self) -> Storage | None:
        """Where the render is stored.  Raises UsageError, ImageError."""
        if self.checkpoint is not None:
            if self.no_checkpoint:
                raise UsageError("--no-checkpoint contradicts --checkpoint; expected one of them")
            check_writable(self.checkpoint / "render" / "band")
            return Storage(self.checkpoint, more=self.more_spp)
        goes_on = self.resume or self.more_spp > 0
        if self.no_checkpoint:
            if goes_on:
                raise UsageError("--no-checkpoint: a render that goes on needs a checkpoint")
            return None
        folder = cache_root() / "renders"
        delete_old(folder)
        return Storage(folder, AFTER, goes_on, self.more_spp)


class Limited(NamedTuple):
    """The options of the command line about what limits a render, as they are given."""

    time_limit: str | None = None
    target_error: str | None = None
    memory: str | None = None

    def limits(self) -> Limits:
        """What ends the render early.  Raises UsageError."""
        return Limits(
            math.inf if self.time_limit is None else seconds_of(self.time_limit, "--time-limit"),
            0.0 if self.target_error is None else share_of(self.target_error, "--target-error"),
        )

    def bytes(self) -> int | None:
        """The memory that may be used.  Raises UsageError."""
        return None if self.memory is None else bytes_of(self.memory, "--memory")


def render_to_file(
    scene: Scene,
    output: Path,
    where: Where,
    limited: Limited,
    stored: Stored,
    preview: Path | None,
) -> tuple[str, int]:
    """Render a scene to a file.  Returns what is to be said at the end, and the exit code: that of
    an interruption if one ended the render.  What there was by then is written.

    Raises SceneError, UsageError; ImageError, also for pixels that are not finite, which are
    written.
    """
    if preview is not None:
        image.check_suffix(preview)
        check_writable(preview)
    if isinstance(scene.integrator, Light) and stored == Stored():
        stored = Stored(no_checkpoint=True)  # it has none, see `Session`
    memory, limits, storage = limited.bytes(), limited.limits(), stored.storage()
    where.check()
    code = 0
    with PicturedLine() as progress, first_look(scene, progress) as compiling:
        session = Session(
            scene,
            threads=where.threads,
            workers=partial(where.open, Processes) if where.is_elsewhere else None,
            compiling=compiling,
            limits=limits,
            storage=storage,
            memory=memory,
        )
        with session:
            if stored.resume:
                _check_resumed(session)
            try:
                session.run(progress, Watch(session, progress, preview))
            except KeyboardInterrupt as error:
                code = exit_code_of(error)
            if session.loop.save_error:
                progress.line(f"warning: the checkpoint is not complete: {session.loop.save_error}")
            return _write(session, output, limits, code), code


def _check_resumed(session: Session) -> None:
    """Raise UsageError if nothing is stored."""
    if session.loop.had == 0.0 and session.store is not None:
        folder = session.store.folder
        raise UsageError(
            f"--resume: {folder} has no samples of this scene, of these settings and of this "
            "version; expected a render that was interrupted"
        )


def _write(session: Session, output: Path, limits: Limits, code: int) -> str:
    """Write the picture, unless it is one of an interruption that lacks pixels; what to say."""
    taken, loop, film = session.taken, session.loop, session.scene.film
    stored = session.store is not None and session.store.is_used
    goes_on = f"; --resume goes on from {loop.fraction:.0%}" if stored else ""
    if taken.fewest == 0:
        if code:
            return f"interrupted; nothing was written: not all pixels have samples{goes_on}"
        raise UsageError("--time-limit: over before all pixels had samples; expected more time")
    found = session.save(output)
    seconds = session.seconds
    text = (
        f"{output}: {film.width} x {film.height}, {seconds['tables']:.2f} s to build, "
        f"{seconds['compile']:.2f} s to compile or load kernels, {seconds['render']:.2f} s to "
        "render"
    )
    if found.nonfinite:
        places = ", ".join(f"({x}, {y})" for x, y in found.places)
        raise ImageError(
            f"{output}: {found.nonfinite} pixels are not finite; (column, row): {places}"
            + (", ..." if found.nonfinite > len(found.places) else "")
        )
    if found.black:
        _warn_of_black(session.scene)
    if code:
        return f"interrupted; {output} is partial, {taken.partial}{goes_on}"
    return text + _reached(session, limits)


def _warn_of_black(scene: BuiltScene) -> None:
    """Issue a warning of a black picture, with its cause, unless one has said why already."""
    if likely_mistakes(scene, scene.tables):
        return
    around = np.array([*itertools.product((-1.0, 0.1, 0.9), repeat=3)])
    seen = intersect(scene.tables, scene.camera.eye, around)
    leaving = seen.shape[(seen.n * around).sum(axis=1) > 0.0]
    shape = int(np.bincount(leaving, minlength=1).argmax())
    if (seen.shape >= 0).all() and np.count_nonzero(leaving == shape) > len(around) // 2:
        kind = scene.shapes[shape].type
        scene.warn(
            f"the picture is black: the eye is inside shapes[{shape}], a {kind}; expected it "
            "outside, or a light inside",
            *("camera", "eye"),
        )
    else:
        scene.warn("the picture is black: no light reaches the camera", "camera")


def _reached(session: Session, limits: Limits) -> str:
    """Which limit was reached, and which was not."""
    taken, loop = session.taken, session.loop
    text = ""
    if loop.stopped:
        which = "time limit" if loop.stopped == "time" else "target error"
        text = f"; {which} reached: {taken.partial or f'{taken.most} samples per pixel'}"
    if taken.error is not None and limits != Limits():
        text += f"; relative error {percentage(taken.error)}"
        # The error falls with the root of the number of samples.
        times = (taken.error / limits.error) ** 2 if limits.error > 0.0 else 0.0
        if times > 1.0:
            wanted = percentage(limits.error)
            text += f", not {wanted}: that takes about {times:.1f} times the samples"
    return text


class Watch:
    """Shows the progress of a session, and writes previews of it: called a few times a second."""

    def __init__(self, session: Session, progress: PicturedLine, preview: Path | None) -> None:
        self._session, self._progress, self._preview = session, progress, preview
        self._began = time.monotonic()
        self._next_line, self._between = self._began + _FIRST_LINE, _FIRST_LINE
        self._next_preview = self._began if preview is not None else math.inf
        self._growing = Growing(progress)

    def __call__(self) -> None:
        now = time.monotonic()
        loop = self._session.loop
        error = "" if loop.error is None else f"error {percentage(loop.error)}"
        self._progress.note(error)
        if now >= self._next_line and not self._progress.is_terminal and loop.fraction < 1.0:
            self._between = min(2.0 * self._between, _MOST_BETWEEN_LINES)
            self._next_line = now + self._between
            self._progress.line(self._line(now - self._began, error))
        if self._growing.is_due and (picture := self._so_far()) is not None:
            self._growing.show(picture, now)
        if now >= self._next_preview and self._preview is not None:
            self._write_preview(self._preview, now)

    def _so_far(self) -> Picture | None:
        """The picture, once all pixels have samples."""
        picture = self._session.preview()
        if picture is None or picture.taken is None or picture.taken.fewest == 0:
            return None
        return picture

    def _line(self, elapsed: float, error: str) -> str:
        loop = self._session.loop
        parts = [f"rendering: {loop.fraction:.1%} after {duration(elapsed)}"]
        if loop.fraction > loop.had:
            left = elapsed * (1.0 - loop.fraction) / (loop.fraction - loop.had)
            parts.append(f"about {duration(left)} left")
        return ", ".join([*parts, error] if error else parts)

    def _write_preview(self, path: Path, now: float) -> None:
        picture = self._so_far()
        if picture is None:
            return
        with suppress(ImageError):  # the next one may be written
            picture.save(path)
        self._next_preview = now + max(_PREVIEWED, 10.0 * (time.monotonic() - now))
