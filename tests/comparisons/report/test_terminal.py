"""Tables at any width: nothing is lost, and no cell is folded more than twice."""

import io
import random

import pytest
from rich.console import Console
from rich.text import Text

from comparisons.report.table import table_of
from comparisons.report.terminal import MOST_LINES, console
from comparisons.results.case import Case, Cause, RungResult
from comparisons.suites.run import summarise


def printed(what, width):
    file = io.StringIO()
    Console(file=file, width=width, highlight=False).print(what)
    return [line.rstrip() for line in file.getvalue().splitlines()]


def texts(seed, columns, rows):
    """Random cells, of one to thirty words of one to twelve letters."""
    rng = random.Random(seed)
    letters = "abcdefghijklmnopqrstuvwxyz"

    def cell():
        count = rng.choice([1, 1, 2, 3, 8, 30])
        return " ".join("".join(rng.choices(letters, k=rng.randint(1, 12))) for _ in range(count))

    return [[f"row{k}", *(cell() for _ in range(columns - 1))] for k in range(rows)]


@pytest.mark.parametrize("width", [20, 40, 80, 132, 400])
@pytest.mark.parametrize("seed", range(6))
def test_every_word_is_there_and_no_cell_is_long(width, seed):
    rows = texts(seed, columns=2 + seed, rows=5)
    names = [f"name{j}" for j in range(2 + seed)]
    lines = printed(table_of(names, rows).terminal(width), width)
    words = " ".join(lines).split()
    for row in rows:
        for cell in row:
            assert set(cell.split()) <= set(words)
    is_table = "name1" in lines[0]
    if is_table:
        starts = [k for k, line in enumerate(lines) if line.startswith("row")]
        ends = [*starts[1:], len(lines)]
        assert all(end - start <= MOST_LINES for start, end in zip(starts, ends, strict=True))
        assert starts[0] <= MOST_LINES
    else:
        assert sum(line.startswith("row") for line in lines) == len(rows)
    assert all(len(line) <= width for line in lines)


@pytest.mark.parametrize(("columns", "width"), [("72", 72), ("nonsense", 180), (None, 180)])
def test_a_pipe_obeys_columns(columns, width, monkeypatch, capsys):
    monkeypatch.delenv("FORCE_COLOR", raising=False)
    if columns is None:
        monkeypatch.delenv("COLUMNS", raising=False)
    else:
        monkeypatch.setenv("COLUMNS", columns)
    made = console()
    assert made.width == width
    made.print(Text("x" * 10, "bold red"))
    assert capsys.readouterr().out == "x" * 10 + "\n"


CAUSE = Cause("half-pixel shift in x", "by 0.5, 0 pixels", 0.99)
STATISTICS = RungResult(
    "statistics",
    "differ",
    "of numbers",
    {"tiles": {"differ": 25, "tested": 64, "worst_bias": 0.12}},
)


def cases():
    return [
        Case("mesh_knot", "differ", "statistics: of numbers", (STATISTICS,), None, {}, cause=CAUSE),
        Case("cornell_box", "agree", "all agree", (), None, {}),
        Case("csg_dice", "not-comparable", "scene: lit solids have no counterpart", (), None, {}),
    ]


def summary(monkeypatch, capsys, columns, **options):
    monkeypatch.setenv("COLUMNS", str(columns))
    summarise(cases(), {"mesh_knot": 3.25, "cornell_box": 1.0}, {}, **options)
    return capsys.readouterr().err


@pytest.mark.parametrize("columns", [60, 80, 200])
def test_the_end_of_a_run(columns, monkeypatch, capsys):
    """Verdict, cause and first difference of what has failed; with `every`, of all."""
    text = summary(monkeypatch, capsys, columns)
    assert "\x1b" not in text
    assert all(len(line) <= columns for line in text.splitlines() if "slowest" not in line)
    for word in ("mesh_knot", "differ", "half-pixel", "statistics:", "25", "64", "+12", "3.2"):
        assert word in text
    assert "cornell_box" not in text.partition("slowest")[0]
    every = summary(monkeypatch, capsys, columns, every=True)
    assert "cornell_box" in every.partition("slowest")[0]
    assert every.index("mesh_knot") < every.index("cornell_box")
