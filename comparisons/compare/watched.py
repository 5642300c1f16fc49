"""What a comparison tells as it goes on: lines, and its pictures so far to who watches them."""

import time
from collections.abc import Callable, Sequence

import numpy as np

from reference_rt.core.arrays import FloatArray

Say = Callable[[str], None]
"""Called with a line of text about each step."""

_BETWEEN = 0.5
"""Seconds between two pictures, at least."""


class Watched:
    """A `Say` whose pictures are shown, too.  show: called with what `so_far` makes of them."""

    def __init__(self, say: Say, show: Callable[[str], None]) -> None:
        self._say, self._show = say, show
        self._due = 0.0

    def __call__(self, line: str) -> None:
        self._say(line)

    def pictures(self, ours: Sequence[FloatArray], theirs: Sequence[FloatArray]) -> None:
        """Replicates of both sides, of Mitsuba's at least one."""
        if time.monotonic() < self._due:
            return
        from comparisons.report.terminal_pictures import so_far

        mean = np.mean(ours, axis=0) if ours else None
        self._show(so_far(mean, np.mean(theirs, axis=0)))
        self._due = time.monotonic() + _BETWEEN
