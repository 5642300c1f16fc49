"""The pictures of a case on a terminal: both, and their difference, side by side in blocks."""

from itertools import zip_longest

from rich.text import Text

from comparisons.report.thumbnails import thumbnails
from comparisons.results.case import Case
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
    each = max(1, min(_MOST_COLUMNS, columns // len(shown) - len(_GAP)))
    blocks = [half_blocks(picture.pixels, each, _MOST_ROWS).splitlines() for picture, _ in shown]
    widths = [lines[0].count("▀") for lines in blocks]
    titles = [title[:width].ljust(width) for (_, title), width in zip(shown, widths, strict=True)]
    rows = [
        [part or " " * width for part, width in zip(parts, widths, strict=True)]
        for parts in zip_longest(*blocks)
    ]
    return Text.from_ansi("\n".join(map(_GAP.join, [titles, *rows])), no_wrap=True)
