"""The pictures of a case on a terminal, as blocks."""

import numpy as np
import pytest
from rich.text import Text

from comparisons.report.terminal_pictures import COLUMNS, ROWS, pictures_of
from comparisons.results.case import Case, Images, RungResult
from reference_rt.cli.picture_row import row_of


def case(candidate, reference, *, rung="statistics", sides=("ours", "Mitsuba's")):
    rungs = (RungResult(rung, "agree", ""),)
    return Case("some", "agree", "", rungs, None, {}, Images(candidate, reference), sides=sides)


def side_by_side(case, columns):
    """What is printed on a terminal of so many columns."""
    return row_of(pictures_of(case), "blocks", min(columns, COLUMNS), ROWS)


def grey(height, width, *values):
    """A picture of columns of these radiances."""
    columns = np.repeat(np.array(values, float), width // len(values))
    return np.broadcast_to(columns[None, :, None], (height, len(columns), 3)).copy()


def colour_at(text: Text, row: int, column: int):
    """The foreground of a cell."""
    at = sum(len(line) + 1 for line in text.plain.split("\n")[:row]) + column
    (span,) = (span for span in text.spans if span.start <= at < span.end)
    return tuple(span.style.color.triplet)


@pytest.mark.parametrize("columns", [30, 80, 200])
@pytest.mark.parametrize("shape", [(4, 6), (40, 64), (64, 40), (1, 1), (7, 300)])
def test_rows_are_of_one_width_and_fit(columns, shape):
    picture = np.ones((*shape, 3))
    lines = side_by_side(case(picture, picture), columns).plain.split("\n")
    assert len({len(line) for line in lines}) == 1
    assert len(lines[0]) <= columns
    assert len(lines) <= 17
    assert lines[1].count("▀") % 3 == 0


def test_what_is_where():
    """Ours, theirs with one bright column, and ours less theirs: blue where ours is darker."""
    shown = side_by_side(case(grey(4, 8, 0, 0, 0, 0), grey(4, 8, 0, 0, 0, 1)), 80)
    assert shown.plain.split("\n")[0].split() == ["ours", "Mitsuba'", "differen"]
    left, right = (colour_at(shown, 1, 8 + 2 + k) for k in (0, 7))
    assert left == (0, 0, 0)
    assert right == (255, 255, 255)
    assert colour_at(shown, 1, 7) == (0, 0, 0)
    same, darker = (colour_at(shown, 1, 20 + k) for k in (0, 7))
    assert same == (255, 255, 255)
    assert darker[2] > darker[0]


def test_pictures_of_two_sizes_have_no_difference():
    shown = side_by_side(case(grey(4, 8, 1, 1), grey(8, 4, 1, 1), sides=("mine", "yours")), 80)
    lines = shown.plain.split("\n")
    assert lines[0].split() == ["mine", "your"]
    assert [line.count("▀") for line in lines[1:]] == [12, 12, 4, 4]


def test_derivatives_are_signed():
    """Of values of both signs: from blue to red, as on the page."""
    shown = side_by_side(case(grey(2, 2, -1, 1), grey(2, 2, -1, 1), rung="derivative"), 80)
    below, above = colour_at(shown, 1, 0), colour_at(shown, 1, 1)
    assert below[2] > below[0]
    assert above[0] > above[2]
