"""Hidden lamps: Mitsuba misplaces what lies behind them, and our integrator takes its place."""

from pathlib import Path

import numpy as np
import pytest

import comparisons.compare.compare
from comparisons.compare.budget import Budget
from comparisons.compare.compare import Subject, compare_scene
from comparisons.mitsuba.backend import mitsuba, scalar
from comparisons.mitsuba.counterpart import Counterpart
from comparisons.mitsuba.notes import notes_of
from comparisons.mitsuba.plugins.base import is_wide
from comparisons.mitsuba.reading.reference import changes_to, own_scene
from comparisons.mitsuba.scene import picture
from comparisons.mitsuba.translate import UntranslatableError, load, to_mitsuba
from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene

SCENE = """
camera: {{type: perspective, eye: [0, 0.5, 5], target: [0, 0, 0], fov: 35}}
film: {{width: 12, height: 8}}
sampler: {{type: independent, spp: 256}}
integrator: {{type: {integrator}, hide_emitters: {hides}}}
materials:
  clay: {{type: diffuse, reflectance: [0.7, 0.5, 0.3]}}
  lamp: {{type: emissive, radiance: [9, 7, 5], base: clay}}
shapes:
  - {seen}
  - {lamp}
  - {{type: rectangle, transform: [{{scale: 3}}, {{translate: [0, 0, -2]}}]}}
lights:
  - {{type: constant, radiance: 0.2}}
"""

BALL = "{type: sphere, center: [0.1, 0, -0.5], radius: 0.8, material: clay}"

CRATE = "{type: box, transform: [{rotate: {axis: [1, 2, 3], degrees: 35}}], material: clay}"

TURN = "{rotate: {axis: [3, 1, 2], degrees: 50}}, {translate: [0.2, 0.4, 1.6]}"

LAMPS = {
    "sphere": "{type: sphere, radius: 0.4, center: [0.2, 0.4, 1.6], material: lamp}",
    "rectangle": f"{{type: rectangle, transform: [{{scale: 0.5}}, {TURN}], material: lamp}}",
    "disk": f"{{type: disk, transform: [{{scale: 0.5}}, {TURN}], material: lamp}}",
    "box": f"{{type: box, transform: [{{scale: [0.3, 0.2, 0.4]}}, {TURN}], material: lamp}}",
    "ellipsoid": f"{{type: sphere, transform: [{{scale: [0.5, 0.2, 0.3]}}, {TURN}], "
    "material: lamp}",
    "cylinder": f"{{type: cylinder, transform: [{{scale: 0.3}}, {TURN}], material: lamp}}",
    "torus": f"{{type: torus, transform: [{{scale: 0.4}}, {TURN}], material: lamp}}",
    "solid": "{type: difference, material: lamp, of: [{type: sphere}, {type: sphere, "
    f"center: [0.5, 0, 0]}}], transform: [{{scale: 0.4}}, {TURN}]}}",
    "two": "{type: union, material: lamp, of: [{type: sphere, radius: 0.3, center: [0, 0.4, 1.6]},"
    " {type: sphere, radius: 0.2, center: [0.1, 0.4, 2.4]}]}",
}


def scene(lamp: str, seen: str = BALL, integrator: str = "path", hides: str = "true") -> Scene:
    return Scene.parse(
        SCENE.format(lamp=LAMPS[lamp], seen=seen, integrator=integrator, hides=hides)
    )


def by_ours(one: Scene) -> FloatArray:
    """Eight grey pictures (8, height, width)."""
    samplers = [one.resolved_sampler.model_copy(update={"seed": seed}) for seed in range(8)]
    found = [render(one.changed(sampler=sampler)).colour for sampler in samplers]
    return np.asarray(np.mean(found, axis=3))


def by_mitsuba(mi_scene: object) -> FloatArray:
    """The same."""
    found = [picture(mi_scene, 256, seed) for seed in range(8)]
    return np.asarray(np.mean(found, axis=3))


def agrees(ours: FloatArray, theirs: FloatArray) -> bool:
    """Whether the means of 4 x 4 pixels are within 6 standard errors, estimated from 16 pictures:
    a right one of the six exceeds that once in 10,000 times (Student's t of 14 degrees)."""
    sides = [side.reshape(8, 2, 4, 3, 4).mean(axis=(2, 4)) for side in (ours, theirs)]
    error = np.hypot(*(side.std(axis=0, ddof=1) / np.sqrt(8) for side in sides))
    off = np.abs(sides[0].mean(axis=0) - sides[1].mean(axis=0))
    return bool((off <= 6.0 * error).all())


@pytest.mark.parametrize("integrator", ["path", "direct"])
@pytest.mark.parametrize("lamp", LAMPS)
def test_our_integrator_in_mitsuba_sees_what_ours_sees(lamp: str, integrator: str) -> None:
    assert is_wide(mitsuba())
    seen = CRATE if lamp == "box" else BALL
    hidden = scene(lamp, seen, integrator)
    counterpart = load(hidden)
    assert counterpart.has_our_integrator
    assert any("misplaces what lies behind hidden lamps" in note for note in notes_of(hidden))
    theirs = by_mitsuba(counterpart.mi_scene)
    assert agrees(by_ours(hidden), theirs)
    assert not agrees(by_ours(scene(lamp, seen, integrator, "false")), theirs)


@pytest.mark.parametrize("integrator", ["path", "direct"])
def test_mitsubas_own_misplaces_a_sphere_and_no_mesh(integrator: str) -> None:
    """The proof that it is its error."""
    mi = mitsuba()
    for seen, right in ((BALL, False), (CRATE, True)):
        hidden = scene("sphere", seen, integrator)
        own = mi.load_dict(to_mitsuba(hidden))
        assert agrees(by_ours(hidden), by_mitsuba(own)) == right


def test_lamps_that_are_not_hidden_keep_mitsubas_own() -> None:
    shown = scene("sphere", hides="false")
    assert not load(shown).has_our_integrator
    assert not any("hidden lamps" in note for note in notes_of(shown))


OWN = """<scene version="3.0.0"><integrator type="{integrator}">
  <boolean name="hide_emitters" value="true"/></integrator>
  <sensor type="perspective"><float name="fov" value="35"/>
    <transform name="to_world">
      <lookat origin="0, 0.5, 5" target="0, 0, 0" up="0, 1, 0"/></transform>
    <film type="hdrfilm"><integer name="width" value="12"/><integer name="height" value="8"/>
      <rfilter type="box"/></film>
    <sampler type="independent"><integer name="sample_count" value="256"/></sampler></sensor>
  <shape type="sphere"><float name="radius" value="0.8"/></shape>
  <shape type="sphere"><float name="radius" value="0.4"/>
    <point name="center" x="0.2" y="0.4" z="1.6"/><emitter type="area"/></shape>
  <emitter type="constant"><rgb name="radiance" value="0.2"/></emitter>
</scene>"""


@pytest.mark.parametrize("integrator", ["path", "direct", "volpath"])
def test_the_users_own_file_gets_our_integrator_and_the_report_says_so(
    tmp_path: Path, integrator: str
) -> None:
    path = tmp_path / "hidden.xml"
    path.write_text(OWN.format(integrator=integrator), encoding="utf-8")
    hidden = Scene.load(path)
    assert any("misplaces what lies behind hidden lamps" in text for text in changes_to(hidden))
    assert agrees(by_ours(hidden), by_mitsuba(own_scene(hidden)))


def test_without_an_llvm_such_pictures_are_not_comparable(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a translation and without: our integrator would trace ray by ray for hours."""
    path = tmp_path / "hidden.xml"
    path.write_text(OWN.format(integrator="path"), encoding="utf-8")
    budget = Budget(spp=4, replicates=2, pixels=16, light_pixels=16)

    def refused(_: Scene) -> Counterpart:
        raise UntranslatableError("of a test", "scene")

    for load_ in (load, refused):
        monkeypatch.setattr(comparisons.compare.compare, "load", load_)
        with scalar():
            case = compare_scene(Subject(Scene.load(path)), budget, lambda _: None)
        found = {rung.name: rung for rung in case.rungs}
        assert found["statistics"].status == "not-comparable"
        assert "scalar variant" in found["statistics"].reason
