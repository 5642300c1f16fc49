"""Scenes in which Cycles votes, and planted faults: who stands alone is who has the fault.

These need Blender (docs/install.md), which the fast run does not.
"""

import os
from pathlib import Path

import pytest

import reference_rt as rt
from comparisons.compare.budget import Budget
from comparisons.compare.compare import Subject, compare_scene
from comparisons.cycles import backend
from comparisons.truth.case import cases
from comparisons.truth.renderers import load, row_of
from reference_rt.core.transform import Scale, Translate

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not os.environ.get(backend.PYTHON), reason="no Cycles"),
]

SCENES = Path(__file__).parents[3] / "scenes"

VOTERS = (
    *("camera_thin_lens", "caustic_glass", "colour_bleeding", "cornell_box"),
    *("far_origin", "filter_catmull_rom", "filter_gaussian", "filter_lanczos"),
    *("coloured_fog", "milk_glass"),
    *("filter_mitchell", "filter_tent", "index_matched", "light_directional", "light_shapes"),
    *("material_blend", "material_conductor", "material_two_sided", "mesh_knot", "near_delta"),
    *("soft_shadows", "tilted_lamps", "tiny"),
    *("truth/blend_furnace", "truth/box_lamp", "truth/closed_room"),
    *("truth/disk_lamp", "truth/mirror_image"),
    *("truth/penumbra_of_disk", "truth/setting_sphere", "truth/slab"),
    *("truth/sphere_in_sphere", "truth/three_points", "truth/triangle_lamp", "truth/wall_to_floor"),
)


def _case(*scenes, spp=32):
    """The rung `witness` of a comparison.  scenes: ours, Mitsuba's, Cycles'."""
    budget = Budget(size=(64, 48), spp=spp, replicates=16, witness="cycles", limit=0.05)
    case = compare_scene(
        Subject(*scenes), budget, lambda line: None, rungs=("statistics", "images")
    )
    (rung,) = (rung for rung in case.rungs if rung.name == "witness")
    return case, rung


@pytest.mark.parametrize(
    "name",
    [
        *("smoke_ball", "smoke_box", "ink_in_glass", "milk_in_glass", "point_in_fog"),
        *("sun_on_air", "sun_through_dust", "point_by_ball", "ball_of_fog", "ball_of_milk"),
    ],
)
def test_cycles_media_are_right(name):
    """By formula: absorption, boundaries of glass, phase functions, any number of scatterings."""
    scene = load(SCENES / "truth" / f"{name}.yaml", 64)
    (row,) = row_of(cases()[name], scene, ["cycles"])
    assert row.status == "right", row.reason


def _scene(name):
    return rt.Scene.load(SCENES / f"{name}.yaml")


@pytest.mark.parametrize("name", VOTERS)
def test_cycles_confirms(name):
    """Nobody stands alone, and neither of us differs from Cycles."""
    scene = _scene(name)
    _, rung = _case(scene, scene, scene)
    assert "alone" not in rung.numbers, rung.reason
    assert {pair["status"] for pair in rung.numbers["pairs"]} <= {"agree", "inconclusive"}


FAULTS = {
    "walls": ("cornell_box", "materials.white.reflectance", (0.8, 0.65, 0.6)),
    "a colour": ("cornell_box", "materials.red.reflectance", (0.3, 0.2, 0.2)),
    "a lamp's radiance": ("cornell_box", "materials.lamp.radiance", (17.0, 13.0, 6.0)),
    "path length": ("cornell_box", "integrator.max_depth", 3),
    "field of view": ("cornell_box", "camera.fov", 41.5),
    "eye": ("mesh_knot", "camera.eye", (0.1, -3.5, 2.2)),
    "a mesh 5 % larger": ("mesh_knot", "shapes.0.transform", (Scale(scale=(1.05,) * 3),)),
    "a mesh that moved": ("mesh_knot", "shapes.0.transform", (Translate(translate=(0.1, 0, 0)),)),
    "another mesh": ("mesh_knot", "shapes.0.file", "meshes/petal.ply"),
    "sky": ("mesh_knot", "lights.0.radiance", (0.15, 0.2, 0.3)),
    "index of refraction": ("caustic_glass", "materials.glass.interior_ior", 1.3),
    "a metal's eta": ("material_conductor", "materials.sample.eta", (0.2, 0.5, 0.6)),
    "a checker's scale": ("light_directional", "textures.tiles.uv.scale", (3.0, 3.0)),
    "a sun": ("light_directional", "lights.0.irradiance", (2.8, 2.6, 2.2)),
    "a sun's direction": ("light_directional", "lights.0.direction", (-1.0, -2.0, -1.2)),
    "aperture": ("camera_thin_lens", "camera.aperture_radius", 0.3),
    "focus": ("camera_thin_lens", "camera.focus_distance", 3.0),
    "a lamp that moved": ("soft_shadows", "shapes.4.center", (-3.0, 2.9, -1.0)),
    "a second lamp": ("near_delta", "materials.cool.radiance", (9.0, 9.0, 9.0)),
    "a ring": ("caustic_glass", "materials.gold.eta", (1.5, 1.5, 1.5)),
    "a blend's weight": ("material_blend", "materials.worn.weight", 0.5),
    "a sphere's radius": ("caustic_glass", "shapes.0.radius", 0.66),
    "a medium's density": ("coloured_fog", "media.even.scale", 1.5),
    "a phase function": ("coloured_fog", "media.forth.phase.g", -0.8),
}  # fmt: skip


def _changed(thing, path, value):
    """A description with another value at a path."""
    if not path:
        return value
    head, *rest = path
    if isinstance(thing, tuple):
        return tuple(_changed(x, rest, value) if k == int(head) else x for k, x in enumerate(thing))
    if isinstance(thing, dict):
        return {**thing, head: _changed(thing[head], rest, value)}
    return thing.model_copy(update={head: _changed(getattr(thing, head), rest, value)})


def _pair(fault):
    """The right scene, and the one with the fault."""
    name, path, value = FAULTS[fault]
    scene, (top, *rest) = _scene(name), path.split(".")
    return scene, scene.changed(**{top: _changed(getattr(scene, top), rest, value)})


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_of_ours_is_ours(fault):
    right, wrong = _pair(fault)
    case, rung = _case(wrong, right, right)
    assert (rung.numbers.get("alone"), case.verdict) == ("ours", "differ"), rung.reason
    assert "ours stands alone" in case.reason


@pytest.mark.parametrize("fault", [*FAULTS][::2])
def test_a_fault_of_mitsubas_side_is_mitsubas(fault):
    right, wrong = _pair(fault)
    case, rung = _case(right, wrong, right)
    assert (rung.numbers.get("alone"), case.verdict) == ("Mitsuba's", "differ"), rung.reason


@pytest.mark.parametrize("fault", [*FAULTS][1::2])
def test_a_fault_that_both_share_leaves_cycles_alone(fault):
    """And the verdict is `differ`, where without a witness it is `agree`."""
    right, wrong = _pair(fault)
    case, rung = _case(wrong, wrong, right)
    assert (rung.numbers.get("alone"), case.verdict) == ("Cycles'", "differ"), rung.reason
