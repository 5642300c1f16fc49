"""The table of docs/verdict.md: for each row of the lectures, who else says that it is right."""

import re
from pathlib import Path

import pytest

from comparisons.renderers import PLACES
from comparisons.results.rungs import RUNGS
from comparisons.truth.case import cases

PAGE = Path(__file__).parents[2] / "docs" / "verdict.md"

OF_MITSUBA = {"files", "geometry", "direct", "whitted", "layers", "statistics"}
"""Rungs in which something of Mitsuba's own is the second source."""

OF_OTHERS = {"files", "solids", "geometry", "sampling", "stability", *PLACES} - {"mitsuba"}
"""Rungs, commands and witnesses that ask somebody else than us and Mitsuba."""

NO_PICTURE = {"T22", "T23"}
"""Rows of which no picture tells anything: they have no case of truth."""


def rows(text: str) -> list[list[str]]:
    """Cells of each row: its number, what it is, and who says so."""
    (table,) = re.findall(r"<!-- rows -->\n(.*?)<!-- end -->", text, re.DOTALL)
    return [[cell.strip() for cell in line[1:-1].split(" |")] for line in table.splitlines()[2:]]


ROWS = rows(PAGE.read_text(encoding="utf-8"))


def names(cell: str) -> set[str]:
    return set(re.findall(r"`([^`]+)`", cell))


def test_every_row_is_there_once() -> None:
    assert [row[0] for row in ROWS] == [f"T{k}" for k in range(1, 24)]
    assert all(len(row) == 5 for row in ROWS)


@pytest.mark.parametrize("row", ROWS, ids=[row[0] for row in ROWS])
def test_who_is_named_exists_and_is_not_our_own_plugin_alone(row: list[str]) -> None:
    number, what, mitsuba, others, truth = row
    assert len(what) > 2
    assert names(mitsuba) <= OF_MITSUBA
    assert names(others) <= OF_OTHERS
    assert names(truth) <= set(cases())
    assert {*OF_MITSUBA, *OF_OTHERS} - {"stability", *PLACES} <= set(RUNGS)
    assert names(others) | names(truth) or number in NO_PICTURE
    assert names(truth) or number in NO_PICTURE
    assert names(mitsuba) or names(others)
