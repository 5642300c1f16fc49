"""Light that total reflection keeps in glass leaves too soon in Mitsuba: its rays start too far off
surfaces."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from comparisons.compare import compare, ray_starts
from comparisons.compare.budget import Budget
from comparisons.compare.compare import Subject, compare_scene
from comparisons.compare.judge import Evidence, judge, of_replicates
from comparisons.mitsuba.backend import mitsuba, scalar
from comparisons.mitsuba.plugins.base import is_wide
from comparisons.mitsuba.scene import picture
from comparisons.results.case import RungResult
from comparisons.translator import load
from reference_rt.lights import Constant
from reference_rt.rendering.scene import Scene

GALLERY = """
camera: {type: perspective, eye: [0, 0, 0.75], target: [0.908, 0, 1.17], fov: 6}
film: {width: 16, height: 12, filter: {type: box}}
sampler: {type: independent, spp: 64}
integrator: {type: path, max_depth: 90, rr_depth: 1000}
materials: {glass: {type: dielectric}}
shapes: [{type: sphere, material: glass}]
lights: [{type: constant, radiance: 1}]
"""
"""From inside of a glass sphere.  Rays whose lines pass the centre at more than 1 / 1.5 stay in it
for ever: half of the picture is black, for ever."""


@pytest.fixture
def wide(monkeypatch: pytest.MonkeyPatch) -> None:
    if not is_wide(mitsuba()):
        pytest.skip("needs one of Mitsuba's variants that trace many rays at a time")
    monkeypatch.setattr(ray_starts, "RAYS", 1 << 14)


def judged(
    scene: Scene, reference: Scene | None = None, seconds: float = 120.0, limit: float = 0.04
) -> Any:
    budget = Budget(
        spp=512, replicates=8, seconds=seconds, pixels=192, light_pixels=192, limit=limit
    )
    found: list[str] = []
    subject = Subject(scene, reference=reference)
    case = compare_scene(subject, budget, found.append)
    return case, {rung.name: rung for rung in case.rungs}, found


def test_scalar_variants_say_that_they_do_not_measure_it() -> None:
    scene = Scene.parse(GALLERY)
    sides = np.zeros((8, 12, 16, 3)), np.ones((8, 12, 16, 3))
    differs = RungResult("statistics", "differ", "darker")
    with scalar():
        counterpart = load(scene)
        assert ray_starts.may_matter(scene, counterpart)
        found, without = ray_starts.explained(
            scene, counterpart, 0.01, 60.0, lambda text: None, differs, sides
        )
    assert (found.status, without) == ("differ", None)
    assert "darker; Mitsuba's ray epsilon may explain it" in found.reason


@pytest.mark.slow
def test_light_that_leaves_glass_too_soon_is_mitsubas(wide: None) -> None:
    case, rungs, said = judged(Scene.parse(GALLERY))
    assert rungs["geometry"].status == rungs["whitted"].status == "agree"
    assert case.verdict == "reference-limited", case.reason
    assert "ray epsilon" in rungs["statistics"].reason
    assert rungs["images"].status == "reference-limited"
    assert any("measuring whether" in line for line in said)


@pytest.mark.slow
def test_what_noise_hides_is_inconclusive(wide: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """A first pass alone, whose noise is too large for the limit."""
    monkeypatch.setattr(ray_starts, "RAYS", 1 << 10)
    case, rungs, _ = judged(Scene.parse(GALLERY), seconds=0.1, limit=0.002)
    assert case.verdict == rungs["statistics"].status == "inconclusive", case.reason
    assert rungs["images"].status == "reference-limited"
    assert rungs["statistics"].numbers["ray_epsilon"] < -0.5


@pytest.mark.slow
def test_a_fault_of_ours_is_not_explained_by_it(
    wide: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same scene, and a sky in ours that is 20 % too bright: only the pictures show it, since
    the rungs before are made to pass."""
    right = Scene.parse(GALLERY)
    wrong = right.changed(lights=[Constant(radiance=(1.2, 1.2, 1.2))])

    def passed(*arguments: Any) -> list[Any]:
        return [replace(r, status="agree") for r in rungs_before(*arguments)]

    rungs_before = compare._deterministic_rungs
    monkeypatch.setattr(compare, "_deterministic_rungs", passed)
    monkeypatch.setattr(compare, "path_lengths", lambda *_: None)  # a minute, for the cause
    case, rungs, _ = judged(wrong, reference=right)
    assert case.verdict == "differ"
    assert "does not explain it" in rungs["statistics"].reason


@pytest.mark.slow
def test_a_small_effect_does_not_hide_a_fault_in_its_noise(
    wide: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Statistics that find no difference, whatever the pictures are: the effect is a tenth of the
    difference."""
    scene = Scene.parse(GALLERY)
    counterpart = load(scene)
    effect = ray_starts.Effect(scene, counterpart, pairs=8)
    effect.render()
    theirs = np.stack([picture(counterpart.mi_scene, 64, k) for k in range(8)])
    differ, agree = (RungResult("statistics", status, "") for status in ("differ", "agree"))
    monkeypatch.setattr(ray_starts.statistics, "compare", lambda *_, **__: agree)
    for times, status in (
        (1.0, "reference-limited"),
        (10.0, "inconclusive"),
        (-1.0, "inconclusive"),
    ):
        ours = theirs + times * effect.mean
        found, without = ray_starts.explained(
            *(scene, counterpart, 0.005, 60.0, print, differ), (ours, theirs)
        )
        assert found.status == status
        assert without is not None
        np.testing.assert_array_equal(without[0], ours)
        assert np.abs((without[1] - theirs).mean(axis=0)).max() > 0.0


def test_starts_matter_at_long_paths_in_glass_alone(wide: None) -> None:
    scene = Scene.parse(GALLERY)
    for text, matters in (
        ("max_depth: 90", True),
        ("max_depth: null", True),
        (f"max_depth: {ray_starts.FOLLOWED}", False),
    ):
        other = Scene.parse(GALLERY.replace("max_depth: 90", text))
        assert ray_starts.may_matter(other, load(other)) == matters
    plain = Scene.parse(GALLERY.replace("type: dielectric", "type: diffuse"))
    assert not ray_starts.may_matter(plain, load(plain))
    assert ray_starts.may_matter(scene, load(scene))


@pytest.mark.slow
def test_rays_that_start_close_see_the_same_where_starts_do_not_matter(wide: None) -> None:
    """Sky, lamp, point light, cylinder and rough glass: pictures by the same random numbers."""
    scene = Scene.parse("""
camera: {type: perspective, eye: [0, -6, 3], target: [0, 0, 0.5], up: [0, 0, 1], fov: 40}
film: {width: 24, height: 20, filter: {type: box}}
sampler: {type: independent, spp: 64}
integrator: {type: path, max_depth: 12}
materials:
  glass: {type: dielectric}
  frosted: {type: rough_dielectric, alpha: 0.2}
  lamp: {type: emissive, radiance: 3}
shapes:
  - {type: rectangle, transform: [{scale: 4}]}
  - {type: sphere, material: glass, center: [-1.2, 0, 1], radius: 0.8}
  - {type: cylinder, material: frosted, transform: [{scale: 0.5}, {translate: [1.2, 0, 0.7]}]}
  - {type: disk, material: lamp, transform: [{rotate: {axis: [1, 0, 0], degrees: 180}},
     {translate: [0, 0, 4]}]}
lights:
  - {type: constant, radiance: 0.3}
  - {type: point, position: [2, -3, 4], intensity: 5}
""")
    counterpart = load(scene)
    effect = ray_starts.Effect(scene, counterpart, pairs=8)
    for _ in range(4):
        effect.render()
    usual = picture(counterpart.mi_scene, 256, 0)
    assert np.abs(effect.mean).max() < 0.002 * usual.mean()
    assert (np.abs(effect.mean) < 5.0 * effect.error).all()


@pytest.mark.parametrize("status", ["agree", "differ"])
def test_they_are_not_measured_where_another_rung_differs(status):
    """It renders for minutes, and the verdict is known."""
    rng, asked = np.random.default_rng(1), []
    a, b = (rng.normal(mean, 0.01, (16, 24, 24, 3)) for mean in (1.0, 1.2))

    def explained(rung, replicates):
        asked.append(replicates)
        return rung, None

    geometry = RungResult("geometry", status, "rays", {})
    rendered = of_replicates(a, b, {})
    case = judge(Evidence("x", (geometry,), rendered, {}, ray_starts=explained), 0.005)
    assert (case.verdict, len(asked)) == ("differ", int(status == "agree"))
