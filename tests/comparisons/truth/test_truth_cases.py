"""The cases: formulas that hold their stated bounds, and pictures that do not pass for them."""

import ast
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from matplotlib.mathtext import MathTextParser

from comparisons.truth import film, optics
from comparisons.truth.areas import __path__ as areas
from comparisons.truth.case import AREAS, cases, chosen
from comparisons.truth.judge import judge
from comparisons.truth.outputs import plain_formula
from comparisons.truth.renderers import load

SCENES = Path(__file__).parents[3] / "scenes" / "truth"
CASES = cases()


@cache
def formula(name):
    """What the case's formula says: several tests ask for it."""
    return CASES[name].compute()


def test_every_case_has_its_scene_and_every_area_its_cases():
    assert {path.stem for path in SCENES.glob("*.yaml")} == set(CASES)
    assert len(CASES) >= 60
    assert {case.area for case in CASES.values()} == set(AREAS)
    for case in CASES.values():
        assert min(len(case.formula), len(case.tests), len(case.derivation)) > 2, case.name
        assert (SCENES / f"{case.name}.yaml").read_text().startswith("# "), case.name


def test_formulas_can_be_typeset_and_read_without():
    """Matplotlib's parser, which knows a part of LaTeX, takes what stands between dollars; no page
    without it shows a command."""
    parser = MathTextParser("path")
    for case in CASES.values():
        assert case.formula.count("$") % 2 == 0, case.name
        for part in case.formula.split("$")[1::2]:
            parser.parse(f"${part}$")
        assert not set("$\\{}") & set(plain_formula(case.formula)), case.name
    plain = plain_formula(CASES["setting_sphere"].formula)
    assert "(cos theta arccos(-q cot theta) - q sqrt(1 - h^2 cos^2 theta)) / h^2" in plain


def test_formulas_share_nothing_with_renderers():
    own = (
        "comparisons.truth.case",
        "comparisons.truth.film",
        "comparisons.truth.optics",
        "comparisons.truth.scattering",
    )
    allowed = (*own, "comparisons.truth.areas", "numpy", "scipy", "collections", "typing",
               "itertools", "dataclasses",
               "functools", "fnmatch", "importlib")  # fmt: skip
    files = [*Path(areas[0]).glob("*.py"), *(Path(areas[0]).parent / f"{n.rpartition('.')[2]}.py"
             for n in own)]  # fmt: skip
    for path in files:
        for node in ast.walk(ast.parse(path.read_text())):
            names = [alias.name for alias in getattr(node, "names", ())]
            if isinstance(node, ast.ImportFrom):
                names = [str(node.module)]
            elif not isinstance(node, ast.Import):
                continue
            assert all(name.startswith(allowed) for name in names), (path, names)


def test_names_areas_and_patterns():
    assert [case.name for case in chosen(["slab", "slab"])] == ["slab"]
    assert {case.area for case in chosen(["signal"])} == {"signal"}
    assert [case.name for case in chosen(["glass_f*"])] == ["glass_furnace", "glass_from_inside"]
    with pytest.raises(ValueError, match="there is no case 'slap'"):
        chosen(["slap"])


@pytest.mark.parametrize("name", CASES)
def test_the_formula_has_the_size_of_the_scene(name):
    found = load(SCENES / f"{name}.yaml").film
    assert formula(name).pixels.shape == (found.height, found.width, 3)


@pytest.mark.parametrize("name", CASES)
def test_quadratures_hold_their_bounds(name, monkeypatch):
    """With more nodes, no pixel's mean changes by more than the stated bound of the picture's
    mean, where both state it."""
    first = formula(name)
    gauss = np.polynomial.legendre.leggauss
    monkeypatch.setattr(np.polynomial.legendre, "leggauss", lambda n: gauss(n + 5))
    monkeypatch.setattr(optics, "RADII", optics.RADII * 3 // 2)
    monkeypatch.setattr(optics, "TURNS", optics.TURNS * 3 // 2)
    monkeypatch.setattr(film, "DENSE", film.DENSE // 2)
    second = CASES[name].compute()
    both = first.stated & second.stated
    assert both.mean() > 0.25
    off = np.abs(first.pixels - second.pixels)[both].mean()
    assert off <= first.bound * np.abs(first.pixels[both]).mean()


@pytest.mark.parametrize("name", CASES)
def test_what_is_not_the_picture_does_not_pass(name):
    """Black, of one value, and half as bright, as a single picture and as replicates; the formula's
    own picture does, in every precision that files have."""
    expected = formula(name)
    truth = np.where(expected.stated[..., None], expected.pixels, 0.7)
    mean = np.full_like(truth, np.nanmean(expected.pixels))
    for count in (1, 4):
        for wrong in (np.zeros_like(truth), mean, truth / 2.0):
            found = judge(expected, [wrong] * count).verdict
            # The residuals of a single picture are also its noise.
            assert found == "off" or (count == 1 and found == "noisy")
        for kind in (float, np.float32, np.float16):
            assert judge(expected, [truth.astype(kind)] * count).verdict == "right", kind
    assert judge(expected, [np.full_like(truth, np.nan)]).verdict == "invalid"
    assert judge(expected, [truth[1:]]).verdict == "invalid"


def test_coverage_is_the_area():
    """Of random triangles, partly beyond the film, against their clipped corners' area by a fine
    grid: its error is that of a grid of 64 x 64 in a pixel, along some 2 edges."""
    rng = np.random.default_rng(5)
    steps = (np.arange(4 * 64) + 0.5) / 64
    x, y = np.meshgrid(steps, steps)
    for _ in range(20):
        p = rng.uniform(-1.0, 5.0, (3, 2))
        sides = [
            (q[0] - o[0]) * (y - o[1]) - (q[1] - o[1]) * (x - o[0])
            for o, q in zip(p, np.roll(p, -1, axis=0), strict=True)
        ]
        inside = np.all(np.sign(sides) == np.sign(sides[0]), axis=0)
        fine = inside.reshape(4, 64, 4, 64).mean(axis=(1, 3))
        assert np.abs(film.coverage(p, 4, 4) - fine).max() < 2.0 / 64
        assert film.coverage(p + 10.0, 40, 40).sum() == pytest.approx(
            abs(np.linalg.det(p[1:] - p[0])) / 2.0, rel=1e-12
        )
