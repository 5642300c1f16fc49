"""Pictures side by side on a terminal, each with its title above it, as the terminal draws them."""

from collections.abc import Sequence
from itertools import zip_longest

import numpy as np
from rich.console import Console, ConsoleOptions, RenderableType, RenderResult
from rich.segment import ControlType, Segment
from rich.text import Text

from reference_rt.cli.terminal_picture import (
    Pixels,
    cell,
    fitted,
    half_blocks,
    in_kitty,
    in_sixels,
    own_number,
)

Titled = tuple[str, Pixels]
"""The title of a picture, "" for none, and its pixels (height, width, 3)."""

GAP = "  "

NO_CELLS = ((ControlType.CURSOR_FORWARD, 0),)
"""Marks text that takes no cells."""


def row_of(
    shown: Sequence[Titled], protocol: str, columns: int, rows: int, replaces: bool = False
) -> RenderableType:
    """Pictures in so many columns and, without their titles, rows of cells.  protocol: kitty,
    sixel or blocks;  replaces: whether they take the place of the last that did."""
    each = max(1, columns // len(shown) - len(GAP) * (len(shown) > 1))
    if protocol == "blocks":
        return Text.from_ansi(_in_blocks(shown, each, rows), no_wrap=True)
    return PixelRow(shown, protocol, each, rows, replaces)


def _in_blocks(shown: Sequence[Titled], columns: int, rows: int) -> str:
    blocks = [half_blocks(pixels, columns, rows).splitlines() for _, pixels in shown]
    widths = [lines[0].count("▀") for lines in blocks]
    parted = [
        [part or " " * width for part, width in zip(parts, widths, strict=True)]
        for parts in zip_longest(*blocks)
    ]
    return "\n".join(map(GAP.join, [*_titles(shown, widths), *parted]))


def _titles(shown: Sequence[Titled], widths: Sequence[int]) -> list[list[str]]:
    """The line of titles, if there are any."""
    named = [title[:width].ljust(width) for (title, _), width in zip(shown, widths, strict=True)]
    return [named] if any(title for title, _ in shown) else []


class PixelRow:
    """Pictures of pixels: a line of titles, and lines whose cells the pixels cover.

    lines: all of them;  sizes: of the pictures in pixels;  numbers: of the pictures of kitty's
    protocol that are replaced;  is_drawn: whether the pixels stand on the terminal already.
    """

    def __init__(
        self, shown: Sequence[Titled], protocol: str, columns: int, rows: int, replaces: bool
    ) -> None:
        width, height = cell()
        scaled = [_scaled(pixels, columns * width, rows * height) for _, pixels in shown]
        self.sizes = tuple(pixels.shape for pixels in scaled)
        count = len(shown) if protocol == "kitty" and replaces else 0
        self.numbers = range(own_number(), own_number() + count)
        self.is_drawn = False
        widths = [-(-pixels.shape[1] // width) for pixels in scaled]
        self._covered = max(-(-len(pixels) // height) for pixels in scaled)
        self._titles = [GAP.join(line) for line in _titles(shown, widths)]
        self.lines = len(self._titles) + self._covered
        # The lines are made first, since pixels below the screen would scroll it.
        parts, at = ["\n" * self._covered, f"\x1b[{self._covered}A"], 0
        for k, pixels in enumerate(scaled):
            drawn = (
                in_sixels(pixels)
                if protocol == "sixel"
                else in_kitty(pixels, self.numbers[k] if self.numbers else 0)
            )
            parts.append("\r" + (f"\x1b[{at}C" if at else "") + f"\x1b7{drawn}\x1b8")
            at += widths[k] + len(GAP)
        self._pixels = "".join(parts) + "\r"

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        for title in self._titles:
            yield Text(title, no_wrap=True)
        if not self.is_drawn:
            self.is_drawn = True
            yield Segment(self._pixels, None, NO_CELLS)
        for _ in range(self._covered):
            yield Segment.line()


def _scaled(pixels: Pixels, width: int, height: int) -> Pixels:
    """Small pictures as many times as large, so that each pixel is a square; others smaller."""
    times = min(width // pixels.shape[1], height // pixels.shape[0])
    if times > 1:
        return np.repeat(np.repeat(pixels, times, axis=0), times, axis=1)
    return fitted(pixels, width, height)
