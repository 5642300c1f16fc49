"""The pictures of a case on a terminal: both, and their difference, side by side."""

from comparisons.report.thumbnails import LONGEST, decoded, thumbnails
from comparisons.results.case import Case, FloatArray, Images
from reference_rt.cli.picture_row import Titled

COLUMNS, ROWS = 102, 16
"""Of the terminal's cells at most: of three pictures, and of each."""

_LONGEST = 4 * LONGEST
"""Pixels of a picture's longer side, at most: for terminals that draw as many."""


def pictures_of(case: Case) -> list[Titled]:
    """Of a case that has some."""
    assert case.images is not None
    made = thumbnails(case.images, case.is_signed, _LONGEST)
    shown = [(made.candidate, case.sides[0]), (made.reference, case.sides[1])]
    if made.difference is not None:
        shown.append((made.difference, f"difference, ±{made.span:.2g}"))
    return [(title, decoded(picture.url)) for picture, title in shown]


def so_far(ours: FloatArray | None, theirs: FloatArray) -> str:
    """The two pictures of a case that is being rendered, a line each: the data: URL of a PNG, and
    its title; ours may be still to come."""
    made = thumbnails(Images(theirs if ours is None else ours, theirs))
    mine = [] if ours is None else [f"{made.candidate.url} ours"]
    return "\n".join([*mine, f"{made.reference.url} Mitsuba's"])


def pictures_in(text: str) -> list[Titled]:
    """What `so_far` has written."""
    lines = (line.partition(" ") for line in text.splitlines())
    return [(title, decoded(url)) for url, _, title in lines]
