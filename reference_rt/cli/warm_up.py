"""`reference-rt warm-up`: compiles kernels ahead of time."""

import os
import time
from collections.abc import Sequence
from itertools import accumulate
from pathlib import Path
from typing import NamedTuple

import numba
from rich.console import Console
from rich.progress import TextColumn, TimeElapsedColumn, TimeRemainingColumn

from reference_rt.jit.kernel import CACHE_FOLDER, is_cached, precompile
from reference_rt.jit.kernel_cache import cache_root
from reference_rt.jit.parallel_compile import Call, compile_all
from reference_rt.rendering.kernels import cost
from reference_rt.rendering.scene import Scene
from reference_rt.rendering.warm_up import all_calls, picture_calls
from reference_rt.util.console import Bar
from reference_rt.util.errors import ImageError, UsageError
from reference_rt.util.files import check_writable


class Warmed(NamedTuple):
    """What `warm_up` did.  compiled, cached: the numbers of kernels that were compiled, and that
    were in the cache before;  folder: where they are."""

    compiled: int
    cached: int
    seconds: float
    folder: str


def warm_up(scenes: Sequence[Scene], threads: int | None) -> Warmed:
    """Compile all kernels, those of these scenes too.

    threads: the number of processes, default all cores.  Shows the progress on standard error.
    Kernels are kept one by one, so that what is compiled before an interruption stays.  Raises
    UsageError if nothing is compiled here, ImageError if kernels cannot be kept.
    """
    folder = _folder()
    began = time.monotonic()
    with CountBar() as progress:
        own = (call for scene in scenes for call in picture_calls(scene))
        calls = [*dict.fromkeys((*all_calls(), *own))]
        missing = [call for call in calls if not is_cached(*call)]
        progress.begin(missing)
        compile_all(missing, threads or os.cpu_count() or 1, progress)
    _check_kept(missing, folder)
    seconds = time.monotonic() - began
    return Warmed(len(missing), len(calls) - len(missing), seconds, folder)


def _folder() -> str:
    """The folder of kernels.  Raises UsageError, ImageError."""
    if numba.config.DISABLE_JIT:
        raise UsageError("NUMBA_DISABLE_JIT is set, so that nothing is compiled; expected it unset")
    folder = Path(CACHE_FOLDER or cache_root() / "kernels")
    try:
        check_writable(folder / "kernel")
    except ImageError as error:
        raise ImageError(
            f"kernels cannot be kept: {error} (REFERENCE_RT_CACHE selects another)"
        ) from None
    if CACHE_FOLDER is None:
        raise ImageError(f"{folder}: could not be written when the program began; try again")
    return CACHE_FOLDER


def _check_kept(calls: Sequence[Call], folder: str) -> None:
    """Raise what prevents kernels from being in the cache now."""
    lost = [call for call in calls if not is_cached(*call)]
    for call in lost:
        precompile(*call)  # again, in this process: an error in a child is not seen
        if not is_cached(*call):
            raise ImageError(
                f"{folder}: {len(lost)} of {len(calls)} kernels cannot be written; expected free "
                "space"
            )


class CountBar(Bar):
    """A `Report` callback.  On a terminal a bar with a count and the time that is left; elsewhere
    one line, at the beginning."""

    def __init__(self, console: Console | None = None) -> None:
        columns = TimeElapsedColumn(), TextColumn("left:"), TimeRemainingColumn()
        super().__init__(*columns, console=console)
        self._task = self._bar.add_task("listing kernels", total=None)
        self._spent: list[float] = []

    def begin(self, calls: Sequence[Call]) -> None:
        """What will be compiled, in this order."""
        # By cost, since the first kernels take as long as hundreds of the last.
        self._spent = [0.0, *accumulate(cost(call) for call in calls)]
        self._bar.reset(self._task, total=self._spent[-1])
        if calls and not self.is_terminal:
            self.line(f"compiling {len(calls)} kernels")

    def __call__(self, done: int, total: int) -> None:
        words = f"compiling {min(done + 1, total)} of {total}"
        self._bar.update(self._task, description=words, completed=self._spent[done])
