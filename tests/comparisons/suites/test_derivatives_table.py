"""The table of the suite of derivatives: a parameter a row, an integrator a column."""

from dataclasses import replace
from pathlib import Path

import pytest
from builders import SCENES
from command_line import invoke

from comparisons.results.case import Case, Cause, RungResult
from comparisons.suites import derivatives as suite
from comparisons.translator.derivative import Differentiator

BIASES = {"R": -0.02, "G": 0.3, "B": None}
BIAS = {"relative_bias": BIASES, "half_width_of_bias": {"G": 0.1}, "differs": True}


def case(verdict: str, cause: str = "", adjoint: str = "agree", **numbers: object) -> Case:
    rungs = (
        ("derivative", verdict, "2 tiles differ, the worst", numbers),
        ("adjoint", adjoint, "", {}),
    )
    return Case(
        scene="colour_bleeding.materials.white.reflectance.prb",
        verdict=verdict,  # type: ignore[arg-type]
        reason="",
        rungs=tuple(RungResult(*rung) for rung in rungs),  # type: ignore[arg-type]
        metrics=None,
        seconds={"candidate": {"render": 8.0}},
        cause=Cause(cause, "", 1.0) if cause else None,
    )


@pytest.mark.parametrize(
    ("found", "cell"),
    [
        (case("agree", candidate_error=0.005), "agrees (2 s)"),
        (case("differ", "the sign", candidate_error=0.02), "differs: the sign"),
        (case("differ", image=BIAS), "differs: G +30 ± 10 %"),
        (case("differ", image={**BIAS, "differs": False}), "differs: 2 tiles differ"),
        (case("differ", adjoint="differ", image=BIAS), "differs: forward and reverse mode"),
        (case("inconclusive", samples_factor=123.4), "too noisy: x 1.2e+02"),
        (case("inconclusive", samples_factor=None), "too noisy: x ?"),
        (case("inconclusive", samples_factor=0.5, step_adds=0.05), "our step adds up to 5 %"),
        (case("not-comparable"), "refused"),
    ],
    ids=lambda x: x if isinstance(x, str) else "",
)
def test_a_cell(found: Case, cell: str) -> None:
    assert suite.verdict_on(found) == cell


def test_a_cell_of_a_case_that_was_given_up() -> None:
    told = "took longer than 90 s; see stderr.txt"
    found = replace(case("invalid"), rungs=(RungResult("run", "invalid", told),))
    assert suite.verdict_on(found) == "took longer than 90 s"


def test_rows_and_columns() -> None:
    """What was not run is said, and a case that no integrator was asked for is empty."""
    both = [Differentiator("prb"), Differentiator("prb_projective", "none")]
    asked = suite.load()
    planned = suite.plan(asked, SCENES, both, ["colour_bleeding.*", "*.fov.prb"])
    table = suite.table(planned, [case("agree")])
    assert table.head == ["scene", "parameter", "prb", "prb_projective, guiding none"]
    assert table.cells == [
        ["cornell_box", "`camera.fov`", "not run", ""],
        ["colour_bleeding", "`materials.white.reflectance`", "agrees", "not run"],
    ]


def test_a_time_limit_that_is_none(tmp_path: Path) -> None:
    found = invoke("derivatives", "--time-limit", "soon", "-o", str(tmp_path))
    assert found.exit_code == 2
    assert "--time-limit" in found.stderr
