"""A bar with pictures above it, drawn as its terminal says that it can."""

from collections.abc import Sequence
from types import TracebackType
from typing import Self

from rich.console import Console, ConsoleRenderable, RenderableType, RenderHook
from rich.control import Control
from rich.progress import ProgressColumn
from rich.segment import Segment

from reference_rt.cli.picture_row import NO_CELLS, PixelRow, Titled, row_of
from reference_rt.cli.terminal_answer import chosen, protocol
from reference_rt.cli.terminal_picture import without_kitty
from reference_rt.util.console import Bar, ProgressLine


class Standing(RenderHook):
    """Lets pixels above a bar stand where a refresh of the bar would erase them and send them
    again: a hook of a console that comes after that of rich's live displays.

    These begin each output by moving up over all that they have printed, and by erasing it.
    """

    def __init__(self) -> None:
        self.row: RenderableType = ""
        self._last: PixelRow | None = None

    def process_renderables(self, renderables: list[ConsoleRenderable]) -> list[ConsoleRenderable]:
        """See `rich.console.RenderHook`."""
        row, last = self.row if isinstance(self.row, PixelRow) else None, self._last
        self._last = row
        if last is None:
            return renderables
        erased, *printed, _ = renderables
        if row is not None and row.sizes == last.sizes and isinstance(erased, Control):
            if all(isinstance(one, Control) for one in printed):
                up, up_only = "\x1b[1A\x1b[2K" * row.lines, f"\x1b[{row.lines}A"
                moved = erased.segment.text
                if moved.endswith(up):
                    return [_control(moved.removesuffix(up) + up_only), *renderables[1:]]
        if row is not None:
            row.is_drawn = False
        gone = set(last.numbers) - set(row.numbers if row is not None else ())
        return [_control("".join(map(without_kitty, gone))), *renderables]


def _control(text: str) -> Control:
    made = Control()
    made.segment = Segment(text, None, NO_CELLS)
    return made


class Pictured(Bar):
    """A bar with pictures above it."""

    def __init__(self, *columns: ProgressColumn, console: Console | None = None) -> None:
        super().__init__(*columns, console=console)
        self._standing = Standing()

    def __enter__(self) -> Self:
        super().__enter__()
        if self._console.is_interactive:
            self._console.push_render_hook(self._standing)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._console.is_interactive:
            self.show_pictures(())
            self._bar.refresh()
            self._console.pop_render_hook()
        super().__exit__(kind, error, trace)

    @property
    def draws(self) -> bool:
        """Whether pictures are shown: on terminals with colours, unless the environment says
        otherwise.  Raises UsageError."""
        if not self.is_terminal:
            return False
        if given := chosen():
            return given != "none"
        return self._console.color_system is not None and not self._console.no_color

    def row(self, shown: Sequence[Titled], columns: int, rows: int) -> RenderableType:
        """Pictures that remain where they are printed, see `row_of`."""
        return row_of(shown, protocol(self._console.file), columns, rows)

    def show_pictures(self, shown: Sequence[Titled]) -> None:
        """Show pictures above the bar in place of those before; none if there are none."""
        row: RenderableType = ""
        if shown and self.draws:
            row = row_of(shown, protocol(self._console.file), *self.room, replaces=True)
        self._standing.row = self._bar.top = row


class PicturedLine(ProgressLine, Pictured):
    """A `ProgressLine` with pictures above it."""
