"""The numbers of the statistics as a table, and what stands below a headline."""

import io

import pytest
from rich.console import Console

from comparisons.report.biases import biases_of, tell
from comparisons.results.case import Case, RungResult


def case(numbers, reason="input, statistics: numbers", name="statistics"):
    return Case("a", "differ", reason, (RungResult(name, "differ", "why", numbers),), None, {})


def statistics(**more):
    return {
        "relative_bias": {"R": 0.01, "G": 0.011, "B": 0.012},
        "detectable_bias": {"R": 0.002, "G": 0.0035, "B": 0.001},
        "limit": 0.005,
        "tiles": {"differ": 3, "tested": 64, "worst_bias": -0.12},
        "pixels": {"differ": 1, "tested": 16384, "worst_bias": 2.0},
        "lines": {"differ": 0, "tested": 256, "median_detectable_bias": 0.013},
        **more,
    }


def columns(numbers):
    table = biases_of(case(numbers))
    return list(zip(table.head, *table.cells, strict=True))


def test_a_column_for_the_image_and_each_family():
    modes = {"tested": 8, "differ": 1, "worst_bias": -0.02, "worst_half_width": 0.004}
    assert columns(statistics(modes=modes)) == [
        ("bias", "measured", "would have been seen", "limit"),
        ("image mean", "R +1.0, G +1.1, B +1.2 %", "0.35 %", "±0.50 %"),
        ("64 tiles", "3 differ; worst -12 %", "", ""),
        ("16,384 pixels", "1 differ; worst +200 %", "", ""),
        ("8 smooth patterns", "1 differ; worst -2.0 ± 0.40 %", "", ""),
    ]


@pytest.mark.parametrize(("known", "would"), [(True, "1.3 % in half of them"), (False, "")])
def test_rows_and_columns_have_one_where_they_differ(known, would):
    lines = statistics()["lines"] | {"differ": 1, "worst_margin": 0.01}
    *_, of_lines = columns(statistics(lines=lines, noise_known=known))
    assert of_lines == ("256 rows and columns", "1 differ", would, "±1.0 %")
    assert columns(statistics(noise_known=known))[1][2] == ("0.35 %" if known else "unknown")


def test_edges_are_judged_apart():
    modes = {"shift in x": {"bias": 0.1, "detectable": 0.25, "margin": 0.5}}
    edges = {"inside": 5000, "inside_wrong": 0, "edge": 20, "edge_wrong": 3, "modes": modes}
    assert columns(edges | {"tolerance": 0.001, "codes": True})[1:] == [
        ("5,000 pixels inside surfaces", "none differs", "", "±0.10 % and half a code"),
        ("20 pixels on edges", "3 differ", "", "what their footprints see"),
        ("edges: shift in x", "+0.1", "0.25", "±0.5"),
    ]


@pytest.mark.parametrize("numbers", [{}, {"relative_bias": {"R": 0.1}, "detectable_bias": {}}])
def test_a_case_without_these_numbers_has_no_table(numbers):
    assert biases_of(case(numbers)) is None


@pytest.mark.parametrize(
    ("reason", "is_table"),
    [("input, statistics: numbers", True), ("geometry: beyond the statistics: [x]", False)],
)
def test_the_table_or_the_reason_stands_below_a_headline(reason, is_table):
    file = io.StringIO()
    tell(Console(file=file, width=120), case(statistics(), reason))
    assert ("would have been seen" in file.getvalue()) == is_table
    assert (f"  {reason}\n" == file.getvalue()) != is_table
