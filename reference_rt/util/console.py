"""Progress display: a bar on a terminal, else one line per step; on standard error only."""

import time
from collections.abc import Iterable
from types import TracebackType
from typing import Self

from rich.console import Console, RenderableType
from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from reference_rt.util.errors import printable

_WORDS = {"compile": "compiling kernels", "render": "rendering"}
_PATIENCE = 0.4
"""Seconds before compiling is mentioned: kernels from the cache load faster than that."""


_REFRESHED = 4.0
"""Times a second that bars are drawn."""

_MOST_COLUMNS, _MOST_ROWS = 64, 20


class _Topped(Progress):
    """Bars, and what stands above them."""

    top: RenderableType = ""

    def get_renderables(self) -> Iterable[RenderableType]:
        if self.top:
            yield self.top
        yield from super().get_renderables()


class Bar:
    """A progress bar on a terminal, nothing elsewhere: the base of all progress displays.

    columns: shown to the right of the bar.
    """

    def __init__(self, *columns: ProgressColumn, console: Console | None = None) -> None:
        self._console = console or Console(stderr=True, highlight=False)
        self._bar = _Topped(
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            *columns,
            console=self._console,
            transient=True,
            refresh_per_second=_REFRESHED,
        )

    def __enter__(self) -> Self:
        if self.is_terminal:
            self._bar.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self.is_terminal:
            self._bar.stop()

    @property
    def is_terminal(self) -> bool:
        return self._console.is_terminal

    @property
    def room(self) -> tuple[int, int]:
        """Columns and rows for a picture above the bars: small, since it is sent again and again,
        perhaps over a network."""
        return min(self._console.width, _MOST_COLUMNS), min(self._console.height // 2, _MOST_ROWS)

    def line(self, text: str) -> None:
        """Prints a line that remains when the bar disappears."""
        self._console.print(printable(text), markup=False, soft_wrap=True)


class ProgressLine(Bar):
    """A `render.Progress` callback: called with the name of a step and the fraction of it done."""

    def __init__(self) -> None:
        percentage = TextColumn("{task.percentage:>3.0f}%")
        super().__init__(percentage, TimeElapsedColumn(), TimeRemainingColumn())
        self._tasks: dict[str, TaskID] = {}
        self._started: dict[str, float] = {}

    def __call__(self, what: str, fraction: float) -> None:
        words = _WORDS.get(what, what)
        if what not in self._tasks:
            if fraction >= 1.0:  # there was nothing to do
                return
            # A bar without a total pulses, until something is done.
            self._tasks[what] = self._bar.add_task(words, total=None)
            self._started[what] = time.perf_counter()
        task = self._tasks[what]
        if fraction > 0.0:
            self._bar.update(task, completed=fraction, total=1.0)
        if fraction >= 1.0:
            self._bar.remove_task(self._tasks.pop(what))
            seconds = time.perf_counter() - self._started[what]
            if not self.is_terminal and seconds > _PATIENCE:
                self.line(f"{words}: {seconds:.1f} s")

    def note(self, text: str) -> None:
        """Shows a few words beside the bar of the present step, on a terminal."""
        for what, task in self._tasks.items():
            words = _WORDS.get(what, what)
            self._bar.update(task, description=f"{words}, {text}" if text else words)

    def compiling(self, done: int, total: int) -> None:
        """The step "compile", by the numbers of kernels that are compiled, and of all."""
        self("compile", done / total)
        if done < total:
            words = f"{_WORDS['compile']}: {done} of {total}"
            self._bar.update(self._tasks["compile"], description=words)
