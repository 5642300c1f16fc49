"""The results of truth for people and machines: a table, `results.json`, a page, a badge."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt
from rich.console import Console

from comparisons.report.table import Column, Table, table_of
from comparisons.report.templates import template
from comparisons.report.templates import write as write_text
from comparisons.report.thumbnails import BLUE, RED, WHITE, png_url
from comparisons.results.files import plain, write_json
from comparisons.statistics.metrics import encode, white_level
from comparisons.truth.case import AREAS, Case, Derivative, Expected, FloatArray
from comparisons.truth.judge import LEVEL, Judged
from reference_rt.util.files import replacing

SCHEMA = 1
"""Increased whenever a reader of the former layout would misread the new one."""

Status = Literal["right", "off", "noisy", "invalid", "not run", "not comparable"]

SIGNS: dict[Status, str] = {
    "right": "✓",
    "off": "✗",
    "noisy": "?",
    "invalid": "!",
    "not run": "!",
    "not comparable": "–",
}


@dataclass(frozen=True)
class Row:
    """One case by one renderer.  judged: None where there are no pictures;  seconds: of them all;
    pictures: data: URLs of formula, picture and difference, by their titles."""

    case: Case
    renderer: str
    status: Status
    reason: str
    judged: Judged | None = None
    seconds: float | None = None
    pictures: tuple[tuple[str, str], ...] = ()

    @classmethod
    def of(
        cls,
        case: Case,
        renderer: str,
        judged: Judged,
        expected: Expected,
        pictures: FloatArray,
        seconds: float | None = None,
    ) -> "Row":
        """The row of pictures (replicates, height, width, 3) that were judged."""
        shown = () if judged.verdict == "invalid" else _shown(expected, pictures.mean(axis=0))
        return cls(case, renderer, judged.verdict, judged.reason, judged, seconds, shown)


def exit_code(rows: Sequence[Row]) -> int:
    """As that of a suite: 4 if a case could not be run, or there is none; 3 for invalid pictures; 1
    for one that is off or noisy; else 0."""
    found = {row.status for row in rows}
    if not rows or "not run" in found:
        return 4
    return 3 if "invalid" in found else int(bool(found & {"off", "noisy"}))


class Score(NamedTuple):
    """right: cases of an area that a renderer has right;  judged: cases that could be judged."""

    area: str
    renderer: str
    right: int
    judged: int

    @property
    def words(self) -> str:
        return f"{self.right} of {self.judged}"


def scores(rows: Sequence[Row]) -> list[Score]:
    """By area and renderer."""
    found: list[Score] = []
    for renderer in dict.fromkeys(row.renderer for row in rows):
        for area in AREAS:
            some = [r for r in rows if (r.renderer, r.case.area) == (renderer, area)]
            judged = [r for r in some if r.status != "not comparable"]
            if judged:
                right = sum(r.status == "right" for r in judged)
                found.append(Score(area, renderer, right, len(judged)))
    return found


def write(out: Path, rows: Sequence[Row], provenance: Mapping[str, Any]) -> None:
    """`results.json`, `report.html`, and a badge `truth-RENDERER.svg` for each renderer; each whole
    or not at all.

    {"schema": 1, "provenance": {...}, "false_alarm": of a case, "areas": [[area, renderer, right,
     judged]], "rows": [{"case", "area", "renderer", "status", "reason", "value", "expected",
     "errors", "threshold", "percent", "power", "worst", "seconds"}]}
    """
    document = {
        "schema": SCHEMA,
        "provenance": dict(provenance),
        "false_alarm": LEVEL,
        "areas": scores(rows),
        "rows": [_flat(row) for row in rows],
    }
    write_json(out / "results.json", plain(document))
    totals = {}
    for renderer in dict.fromkeys(row.renderer for row in rows):
        of = [score for score in scores(rows) if score.renderer == renderer]
        totals[renderer] = sum(s.right for s in of), sum(s.judged for s in of)
    page = template("truth.html.jinja", "truth").render(
        totals=[(renderer, *total) for renderer, total in totals.items()],
        provenance=provenance,
        level=LEVEL,
        score=Table(SCORE, scores(rows)),
        areas=[(AREAS[a], [r for r in rows if r.case.area == a]) for a in AREAS],
        signs=SIGNS,
        plain=plain_formula,
        numbers_of=_numbers,
    )
    write_text(out / "report.html", page)
    for renderer, (right, judged) in totals.items():
        with replacing(out / f"truth-{renderer}.svg") as temporary:
            temporary.write_text(_badge(right, judged), encoding="utf-8")


def _flat(row: Row) -> dict[str, Any]:
    found: dict[str, Any] = {"case": row.case.name, "area": row.case.area, "renderer": row.renderer}
    found |= {"status": row.status, "reason": row.reason, "seconds": row.seconds}
    if row.judged is not None and row.judged.value:
        names = ("value", "expected", "errors", "threshold", "percent", "power", "worst")
        found |= {name: getattr(row.judged, name) for name in names}
    return found


def _badge(right: int, judged: int) -> str:
    """An SVG of 110 x 20, in the usual look of badges."""
    colour = "#1a6b35" if right == judged else "#a81b1b"
    text = 'fill="#fff" font-family="Verdana,sans-serif" font-size="11" text-anchor="middle"'
    return (
        '<svg xmlns="http://www.w3.org/2000/svg" width="110" height="20" role="img">'
        f"<title>truth: {right} of {judged}</title>"
        '<rect width="45" height="20" fill="#555"/>'
        f'<rect x="45" width="65" height="20" fill="{colour}"/>'
        f'<g {text}><text x="22" y="14">truth</text>'
        f'<text x="77" y="14">{right} / {judged}</text></g></svg>\n'
    )


def _of_numbers(written: Callable[[Judged], str]) -> Callable[[Row], str]:
    """What is written of a row's numbers, if it has any."""
    return lambda row: written(row.judged) if row.judged is not None and row.judged.value else ""


COLUMNS = (
    Column[Row]("case", lambda row: row.case.name),
    Column[Row]("renderer", lambda row: row.renderer),
    Column[Row]("", lambda row: row.status),
    Column[Row](
        "standard errors",
        _of_numbers(lambda j: f"{_number(j.errors)} of {j.threshold:.2g}"),
        right=True,
    ),
    Column[Row]("percent", _of_numbers(lambda j: f"{j.percent:+.3f}"), right=True),
    Column[Row]("± percent", _of_numbers(lambda j: f"{j.power:.2g}"), right=True),
    Column[Row]("reason", lambda row: "" if row.status == "right" else row.reason),
)

SCORE = (
    Column[Score]("area", lambda score: AREAS[score.area]),
    Column[Score]("renderer", lambda score: score.renderer),
    Column[Score]("right", lambda score: score.words, right=True),
)


def show(console: Console, rows: Sequence[Row]) -> None:
    """Print a line for each case and renderer, and, if there are several, right cases by area."""
    console.print(Table(COLUMNS, rows).terminal(console.width))
    if len(rows) > 1:
        console.print(Table(SCORE, scores(rows)).terminal(console.width))


def _numbers(row: Row) -> Table[Any] | None:
    """What the page says of a row's numbers; None if there are none."""
    if (j := row.judged) is None or not j.value:
        return None
    errors = f"{_number(j.errors)} of {j.threshold:.2g} ({j.worst})"
    rows = [
        ("value", _triple(j.value)),
        ("formula", _triple(j.expected)),
        ("off, percent", f"{j.percent:+.4f} ± {j.power:.2g}"),
        ("standard errors", errors),
    ]
    return table_of(("", ""), rows)


def markdown(rows: Sequence[Row], provenance: Mapping[str, Any]) -> str:
    """The tables of docs/truth.md: a line for each case, with what docs/make_pictures.py shows."""
    renderers = list(dict.fromkeys(row.renderer for row in rows))
    if all(isinstance(row.case, Derivative) for row in rows):
        by_case = [[*some] for _, some in groupby(rows, lambda row: row.case.name)]
        where = _where(provenance, "truth --derivatives")
        return "\n".join([*Table(CASES[1:], by_case).markdown(), *where])
    right = {(score.area, score.renderer): score.words for score in scores(rows)}
    areas = [area for area in AREAS if any(row.case.area == area for row in rows)]
    card = [[AREAS[a], *(right.get((a, renderer), "") for renderer in renderers)] for a in areas]
    text = table_of(["area", *renderers], card).markdown()
    for area in areas:
        of_area = [row for row in rows if row.case.area == area]
        table = Table(CASES, [[*some] for _, some in groupby(of_area, lambda row: row.case.name)])
        text += ["", f"### {AREAS[area].capitalize()}", "", *table.markdown()]
    return "\n".join([*text, *_where(provenance)])


def _where(provenance: Mapping[str, Any], command: str = "truth") -> list[str]:
    where = f"{provenance['machine']}, {provenance['cores']} cores, {provenance['date'][:10]}"
    return ["", f"`reference-rt {command}`; {where}.", ""]


CASES = (
    Column[list[Row]]("picture", lambda rows: _picture(rows[0].case.name)),
    Column[list[Row]]("case", lambda rows: _words(rows)),
)
"""Of the rows of each case."""


def _picture(name: str) -> str:
    return f"![{name}](pictures/truth/{name}.png)"


def _words(rows: Sequence[Row]) -> str:
    """What a page says about a case: one cell of a table."""
    case = rows[0].case
    source = "" if case.source == "elementary" else f" ({case.source})"
    large = re.sub(r"\$([^$]*\\(?:frac|sum|int)[^$]*)\$", r"$\\displaystyle \1$", case.formula)
    parts = [
        f"`{case.name}`: {case.tests}",
        f"{large}{source}",
        case.derivation.replace("*", "\\*"),
        "; ".join(f"{row.renderer}: {_cell(row)}" for row in rows),
    ]
    return "<br>".join(parts)


def _cell(row: Row) -> str:
    j = row.judged
    if j is None or not j.value:
        return row.status
    sign = "" if row.status == "right" else f"**{row.status}** "
    return f"{sign}{j.percent:+.3f} ± {j.power:.2g} %"


def plain_formula(formula: str) -> str:
    """A case's formula without LaTeX, for pages that do not typeset it."""
    text, before = formula.replace("$", "").replace(r"\cdot", "."), ""
    while text != before:  # innermost braces first
        before = text
        text = re.sub(r"_\{(\w+)\}", r"_\1", text)
        text = re.sub(r"\\sqrt\{([^{}]*)\}", r"sqrt(\1)", text)
        text = re.sub(r"\\frac\{([^{}]*)\}\{([^{}]*)\}", _quotient, text)
    text = re.sub(r"\\([A-Za-z]+)", r" \1", text)
    return re.sub(r"\( +", "(", " ".join(text.split()))


def _quotient(found: re.Match[str]) -> str:
    above, below = found.groups()
    above = f"({above})" if re.search(" [+-] ", above) else above
    return f"{above} / ({below})" if " " in below else f"{above} / {below}"


def _number(x: float) -> str:
    return f"{x:.3g}" if np.isfinite(x) else "∞"


def _triple(values: Sequence[float]) -> str:
    """Three channels, or one number where they are equal."""
    shown = [f"{x:.6g}" for x in values]
    return shown[0] if len(set(shown)) == 1 else ", ".join(shown)


def formula_picture(expected: Expected) -> FloatArray:
    """(height, width, 3), from 0 to 255; what the formula does not state is grey."""
    stated = expected.stated[..., None]
    truth = np.where(stated, expected.pixels, 0.0)
    return np.where(stated, 255.0 * encode(truth, white_level(truth)), 128.0)


def _shown(expected: Expected, mean: FloatArray) -> tuple[tuple[str, str], ...]:
    """Formula, picture and difference; what the formula does not state is grey."""
    stated = expected.stated[..., None]
    truth = np.where(stated, expected.pixels, 0.0)
    difference = np.where(stated, mean - truth, 0.0)
    span = float(np.abs(difference).max()) or 1.0
    if (truth < 0.0).any():
        largest = float(np.abs(truth).max())
        formula, picture = (_red_blue(some, stated, largest) for some in (truth, mean))
    else:
        formula = formula_picture(expected)
        picture = 255.0 * encode(np.maximum(mean, 0.0), white_level(truth))
    return (
        ("formula", png_url(formula)),
        ("picture", png_url(picture)),
        (f"difference, up to {span:.2g}", png_url(_red_blue(difference, stated, span))),
    )


def _red_blue(values: FloatArray, stated: npt.NDArray[np.bool_], span: float) -> FloatArray:
    """Red above 0 and blue below, of each pixel the channel farthest from 0; from -span to span."""
    worst = np.take_along_axis(values, np.abs(values).argmax(axis=-1)[..., None], axis=-1)
    end = np.where(worst > 0.0, RED, BLUE)
    share = np.minimum(np.abs(worst) / span, 1.0)
    return np.where(stated, WHITE + share * (end - np.array(WHITE)), 128.0)
