"""The pictures of a case on a terminal: both, and their difference, side by side in blocks."""

from collections.abc import Sequence
from itertools import zip_longest

from rich.text import Text

from comparisons.report.thumbnails import Thumbnail, thumbnails
from comparisons.results.case import Case, FloatArray, Images
from reference_rt.cli.terminal_picture import half_blocks

_MOST_COLUMNS, _MOST_ROWS = 32, 16
"""Of one picture, in cells."""

_GAP = "  "


def side_by_side(case: Case, columns: int) -> Text:
    """Titles above the pictures of a case that has some;  columns: of the terminal."""
    assert case.images is not None
    made = thumbnails(case.images, case.is_signed)
    shown = [(made.candidate, case.sides[0]), (made.reference, case.sides[1])]
    if made.difference is not None:
        shown.append((made.difference, f"difference, ±{made.span:.2g}"))
    return Text.from_ansi(_in_blocks(shown, columns), no_wrap=True)


def so_far(ours: FloatArray | None, theirs: FloatArray) -> str:
    """The two pictures of a case that is being rendered; ours may be still to come."""
    made = thumbnails(Images(theirs if ours is None else ours, theirs))
    shown = [(made.reference, "Mitsuba's")]
    if ours is not None:
        shown = [(made.candidate, "ours"), *shown]
    return _in_blocks(shown, len(shown) * (_MOST_COLUMNS + len(_GAP)))


def _in_blocks(shown: Sequence[tuple[Thumbnail, str]], columns: int) -> str:
    """Pictures side by side, each with its title above it."""
    each = max(1, min(_MOST_COLUMNS, columns // len(shown) - len(_GAP)))
    blocks = [half_blocks(picture.pixels, each, _MOST_ROWS).splitlines() for picture, _ in shown]
    widths = [lines[0].count("▀") for lines in blocks]
    titles = [title[:width].ljust(width) for (_, title), width in zip(shown, widths, strict=True)]
    rows = [
        [part or " " * width for part, width in zip(parts, widths, strict=True)]
        for parts in zip_longest(*blocks)
    ]
    return "\n".join(map(_GAP.join, [titles, *rows]))
