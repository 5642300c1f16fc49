"""One table in all its forms: on a terminal, as Markdown, JSON, CSV and on a page."""

import csv
import io
import json
import math
import re

import numpy as np
from rich.console import Console
from rich.text import Text

from comparisons.report.table import Cell, Column, Table, table_of
from comparisons.report.templates import template


def halved(value):
    return Cell(f"{value / 2:g}", "a half", "good")


COLUMNS = (
    Column("name | of", lambda row: row[0]),
    Column(None, lambda row: row[0].upper(), key="who"),
    Column("half", lambda row: row[1], halved, right=True, look="more", key="value"),
    Column("", lambda row: Text(row[0], "red")),
)
ROWS = [("one", 1.0), ("a | b", np.float64(math.nan)), ("<three>", math.inf)]
TABLE = Table(COLUMNS, ROWS, lambda row: "failed" if row[0] == "one" else "")


def printed(table, width=80, **options):
    file = io.StringIO()
    Console(file=file, width=width, highlight=False, **options).print(table.terminal(width))
    return file.getvalue()


def page(table):
    macro = template("macros.html.jinja").module.numbers
    return re.sub(r">\s+<", "><", str(macro("a <name>", table, "look")))


def test_people_see_columns_with_headings_and_machines_those_with_keys():
    assert TABLE.head == ["name | of", "half", ""]
    assert TABLE.records() == [
        {"who": "ONE", "value": 1.0},
        {"who": "A | B", "value": None},
        {"who": "<THREE>", "value": None},
    ]


def test_records_are_strict_json_and_the_csv_has_the_same(tmp_path):
    json.dumps(TABLE.records(), allow_nan=False)
    TABLE.write_csv(tmp_path / "t.csv")
    with (tmp_path / "t.csv").open(encoding="utf-8", newline="") as file:
        lines = list(csv.DictReader(file))
    assert lines == [
        {key: "" if value is None else str(value) for key, value in record.items()}
        for record in TABLE.records()
    ]
    Table(COLUMNS, []).write_csv(tmp_path / "t.csv")
    assert (tmp_path / "t.csv").read_bytes() == b"who,value\n"


def test_markdown_has_a_cell_for_each_column_whatever_the_text():
    lines = TABLE.markdown()
    assert lines == [
        "| name \\| of | half |  |",
        "|---|---|---|",
        "| one | 0.5 | one |",
        "| a \\| b | nan | a \\| b |",
        "| <three> | inf | <three> |",
    ]
    assert TABLE.markdown(lambda text: f"({text})")[2] == "| (one) | (0.5) | (one) |"


def test_a_page_has_every_cell_its_look_and_its_remark():
    found = page(TABLE)
    assert 'aria-label="a &lt;name&gt;"' in found
    assert '<table class="numbers look"><thead><tr><th scope="col">name | of</th>' in found
    assert '<th scope="col" class="more">half</th>' in found
    assert '<tr class="failed"><th scope="row">one</th>' in found
    assert '<td class="more good">0.5<small>a half</small></td>' in found
    assert '<tr><th scope="row">&lt;three&gt;</th>' in found
    assert "<thead>" not in page(table_of(("", ""), [("a", "b")]))


def test_a_mark_is_a_style_and_no_cell_is_markup():
    shown = printed(TABLE, force_terminal=True, color_system="standard")
    assert re.search(r"\x1b\[1;31mone", shown)
    assert "\x1b[1;31m<three>" not in shown
    lines = printed(table_of(("a", "b"), [("[bold]x[/]", "[red]")])).splitlines()
    assert lines[1].split() == ["[bold]x[/]", "[red]"]


def test_a_column_is_aligned_as_it_says():
    rows = [("x", "1"), ("y", "22")]
    lines = printed(table_of(("a", "b"), rows, right=(1,))).splitlines()
    assert [line.split() for line in lines] == [["a", "b"], ["x", "1"], ["y", "22"]]
    assert lines[1].index("1") == lines[2].index("22") + 1
    lines = printed(table_of(("a", "b"), rows)).splitlines()
    assert lines[1].index("1") == lines[2].index("22")


def test_columns_without_text_are_left_out_on_a_terminal():
    rows = [("x", "", "1"), ("y", Text(""), "22")]
    lines = printed(table_of(("a", "b", "c"), rows, right=(2,))).splitlines()
    assert lines[0].split() == ["a", "c"]
    assert lines[1].index("1") == lines[2].index("22") + 1
