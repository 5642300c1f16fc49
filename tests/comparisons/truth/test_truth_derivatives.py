"""Derivatives of truth: formulas that are those of their pictures, and ours against them."""

import inspect
import json
from pathlib import Path

import numpy as np
import pytest
from command_line import invoke
from matplotlib.mathtext import MathTextParser

from comparisons.mitsuba.backend import LLVM, backend
from comparisons.truth.case import AREAS, Derivative, chosen, derivatives
from comparisons.truth.judge import judge
from comparisons.truth.outputs import plain_formula
from comparisons.truth.renderers import (
    DIFFERENTIATED,
    derivative_rows,
    load,
    our_derivative,
    with_truncation,
)
from reference_rt.scene.parameters import parameter

SCENES = Path(__file__).parents[3] / "scenes" / "truth"
CASES = derivatives()

QUICK = {
    "point_over_floor_by_height", "diffuse_furnace_by_reflectance", "spot_falloff_by_cutoff",
    "sphere_lamp_by_radius", "path_lengths_by_reflectance", "sphere_outline_by_radius",
}  # fmt: skip
"""Those that take less than two seconds."""

OURS = [pytest.param(n, marks=[] if n in QUICK else [pytest.mark.slow]) for n in CASES]


def value_of(case: Derivative) -> float | np.ndarray:
    """The parameter's value in the scene, one number where all are equal."""
    value = parameter(load(SCENES / f"{case.of.name}.yaml"), case.parameter).value
    return float(np.ravel(value)[0]) if len({*np.ravel(value)}) == 1 else np.array(value)


WITHOUT = {"whitted", "signal", "media", "scattering", "atmospheres"}
"""Areas of which no case states a derivative."""


def test_there_are_as_many_as_are_promised_from_all_areas_that_have_some():
    assert len({case.of.name for case in CASES.values()}) >= 24
    assert {case.area for case in CASES.values()} >= {*AREAS} - WITHOUT
    for case in CASES.values():
        assert min(len(case.formula), len(case.derivation)) > 2, case.name
        assert case.name.startswith(f"{case.of.name}_by_")
        for part in case.formula.split("$")[1::2]:
            MathTextParser("path").parse(f"${part}$")
        assert not set("$\\{}") & set(plain_formula(case.formula)), case.name
    assert [one.name for one in chosen(["disk_l*"], CASES)] == ["disk_lamp_by_radius"]


@pytest.mark.cases(20)
@pytest.mark.parametrize("name", CASES)
def test_a_formula_is_the_derivative_of_its_pictures_formula(name, monkeypatch):
    """By differences of fourth order of the case's own formula at 1e-6, whose rounding is 1e-10 of
    the picture; outlines that cross a corner of a pixel within the step add 1e-6 of it.  The blur's
    quadrature has a root's end in it: with four times the nodes 4e-4 are left of 4.6e-3."""
    case = CASES[name]
    stated = case.compute()
    if name == "lens_blur_by_focus":
        gauss = np.polynomial.legendre.leggauss
        monkeypatch.setattr(np.polynomial.legendre, "leggauss", lambda n: gauss(4 * n))
    value, h = value_of(case), 1e-6
    assert case.argument in inspect.signature(case.of.compute).parameters
    default = case.of.compute().pixels
    assert np.array_equal(case.of.compute(**{case.argument: value}).pixels, default, equal_nan=True)
    f = {k: case.of.compute(**{case.argument: value + k * h}).pixels for k in (-2, -1, 1, 2)}
    rate = (8.0 * (f[1] - f[-1]) - (f[2] - f[-2])) / (12.0 * h)
    both = np.isfinite(rate) & np.isfinite(stated.pixels)
    assert both.mean() > 0.25
    off = np.abs(rate - stated.pixels)[both].mean()
    assert off <= (1e-3 if name == "lens_blur_by_focus" else 1e-6) * np.abs(rate[both]).mean()


@pytest.mark.parametrize("name", OURS)
def test_ours_is_right_and_what_is_not_the_derivative_is_not(name):
    """Within the judge's noise, at most 0.25 % of the picture.  The truncation is at most 0.1 %,
    and its estimate has the picture's noise: 3.5 standard errors, of 28 cases.  Planted: nothing,
    the other sign, 2 % more, one channel twice.  The lens moves light to and fro, so that the whole
    picture does not tell its factor; of tiles, which are noisier, 10 % are seen."""
    case = CASES[name]
    found = our_derivative(case, load(SCENES / f"{case.of.name}.yaml"))
    expected = with_truncation(case.compute(), found.truncation)
    right = judge(expected, found.replicates)
    assert right.verdict == "right", right
    assert right.power < 0.25
    assert expected.bound - case.compute().bound < 0.001 + 3.5 * right.power / 100.0
    twice = found.replicates * [1.0, 2.0, 1.0]
    more = (1.1 if name == "lens_blur_by_focus" else 1.02) * found.replicates
    for wrong in (0.0 * found.replicates, -found.replicates, more, twice):
        assert judge(expected, wrong).verdict == "off"


def test_another_renderers_derivative_is_judged_by_the_same_rows():
    """Its own estimates, of which it says that no step adds to them."""

    class Exact:
        def __init__(self, factor):
            noise = 1e-3 * np.random.default_rng(1).normal(size=(8, 32, 32, 3))
            self.replicates = factor * case.compute().pixels * (1.0 + noise)
            self.truncation = np.zeros((32, 32, 3))

    case = CASES["sphere_lamp_by_radius"]
    scene = load(SCENES / "sphere_lamp.yaml")
    by = {"right": lambda *_: Exact(1.0), "2.7 times": lambda *_: Exact(2.7)}
    rows = derivative_rows(case, scene, by)
    assert [(row.renderer, row.status) for row in rows] == [
        ("right", "right"),
        ("2.7 times", "off"),
    ]
    assert all(len(row.pictures) == 3 for row in rows)


def test_the_command(tmp_path):
    """Mitsuba has no derivative by the place of a lamp, and in forward mode a spot's cutoff is
    mixed with its beam (findings/mitsuba-forward-mode-loses.sh): that does not fail the run."""
    names = ("spot_*", "point*", "diffuse_furnace*")
    done = invoke("truth", "--derivatives", *names, "-o", tmp_path, "--scenes", SCENES)
    assert done.exit_code == 0, done.output
    rows = json.loads((tmp_path / "results.json").read_text())["rows"]
    assert {row["renderer"] for row in rows} == {*DIFFERENTIATED}
    found = {(row["case"], row["renderer"]): row["status"] for row in rows}
    assert {status for (_, who), status in found.items() if who == "ours"} == {"right"}
    if backend().variant == LLVM:
        assert found["diffuse_furnace_by_reflectance", "mitsuba"] == "right"
        assert found["spot_falloff_by_cutoff", "mitsuba"] == "off"
        assert found["point_over_floor_by_height", "mitsuba"] == "not comparable"
    page = (tmp_path / "report.html").read_text()
    assert "`point_over_floor` by `lights[0].position[2]`" in page


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--derivatives", "--spp", "4"), "expected no --spp"),
        (("--derivatives", "--renderer", "cycles"), "of derivatives, got 'cycles'"),
        (("--derivatives", "slap"), "there is no case 'slap'"),
    ],
)
def test_wrong_usage(arguments, said):
    done = invoke("truth", *arguments)
    assert done.exit_code == 2
    assert said in done.output
