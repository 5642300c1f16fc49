"""Mitsuba's scenes with our plugins are freed after use: Dr.Jit compiles code for all shapes and
materials that exist, so that every scene that stays makes all later ones slower."""

import gc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from galleries import gallery_of_lights, gallery_of_materials

import reference_rt as rt
from comparisons.mitsuba.backend import SCALAR, mitsuba, scalar, set_variant
from comparisons.mitsuba.counterpart import Counterpart
from comparisons.mitsuba.scene import picture
from comparisons.rungs import direct, geometry, whitted
from comparisons.translator import load
from comparisons.translator.reference import own_scene
from comparisons.translator.writing import write_xml
from reference_rt.rendering.scene import Scene

VIEW = """
camera: {type: perspective, eye: [0.5, 2.2, 5], target: [0, 0, 0], fov: 40}
film: {width: 4, height: 3}
sampler: {type: independent, spp: 1}
integrator: INTEGRATOR
materials:
  grey: {type: diffuse, reflectance: 0.6}
  glass: {type: dielectric}
  lamp: {type: emissive, radiance: [8, 7, 6]}
  leaf: {type: mask, base: grey, opacity: 0.5}
shapes:
  - {type: rectangle, material: grey, transform: [{scale: 3}, {translate: [0, 0, -1]}]}
  - SHAPE
lights:
  - {type: point, position: [2, 2, 3], intensity: 6}
"""
SOLID = "{type: difference, material: glass, of: [{type: sphere}, {type: sphere, radius: 0.5}]}"
ELLIPSOID = "{type: sphere, material: lamp, transform: [{scale: [0.5, 0.8, 0.3]}]}"
LEAF = "{type: rectangle, material: leaf}"
BALL = "{type: sphere, material: glass}"


def view(shape: str, integrator: str = "{type: path, max_depth: 3}") -> Callable[[Path], Scene]:
    return lambda folder: Scene.parse(
        VIEW.replace("SHAPE", shape).replace("INTEGRATOR", integrator)
    )


SCENES: dict[str, Callable[[Path], Scene]] = {
    "every material": gallery_of_materials,
    "every light": gallery_of_lights,
    "a solid": view(SOLID),
    "direct light on a solid": view(SOLID, "{type: direct}"),
    "Whitted's light on a solid": view(SOLID, "{type: whitted}"),
    "a mask": view(LEAF),
    "a lamp of triangles": view(ELLIPSOID),
    "Whitted's light": view(BALL, "{type: whitted}"),
}


def objects(mi: Any) -> int:
    """The objects of Mitsuba that Python knows: a scene has none that do not belong to plugins."""
    gc.collect()
    return sum(issubclass(type(one), mi.Object) for one in gc.get_objects())


def use(scene: Scene, counterpart: Counterpart) -> None:
    for rung in (geometry, direct, whitted):
        rung(scene, scene.tables, counterpart, 20)
    if not counterpart.no_pictures_reason and not isinstance(scene.integrator, rt.Whitted):
        picture(counterpart.mi_scene, 1, 0)


def test_integrators_in_python_are_those_of_the_variant_and_made_once() -> None:
    """A scalar variant between two wide ones, which has none of its own, costs nothing; another
    wide one has its own."""
    mi = mitsuba()
    chosen, made = mi.variant(), []
    if chosen == SCALAR:
        pytest.skip("no wide variant works here")
    other = next(name for name in mi.variants() if name[:7] == chosen[:7] and name != chosen)
    for name in (SCALAR, chosen, SCALAR, chosen, other, SCALAR, other, chosen):
        set_variant(mi, name)
        if name != SCALAR:
            made.append(mi.ad.integrators.prb.PRBIntegrator)
            assert issubclass(made[-1], mi.CppADIntegrator)
            assert type(mi.load_dict({"type": "prb"})) is made[-1]
    assert made[0] is made[1]
    assert made[1] is not made[2] is made[3] is not made[4]


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_counterparts(name: str, tmp_path: Path) -> None:
    scene = SCENES[name](tmp_path)
    mitsuba()
    with scalar() as mi:
        before = objects(mi)
        use(scene, load(scene))
        assert objects(mi) == before


@pytest.mark.slow
def test_files_of_users(tmp_path: Path) -> None:
    """As the reference of a comparison, which has our integrator for masks."""
    write_xml(SCENES["a mask"](tmp_path), tmp_path / "scene.xml")
    scene = Scene.load(tmp_path / "scene.xml")
    mi = mitsuba()
    before = objects(mi)
    picture(own_scene(scene), 1, 0)
    assert objects(mi) == before
