"""Counterparts of shapes that Mitsuba lacks, of groups and of solids: rays, and planted faults."""

import numpy as np
import pytest
from counterparts import coarse_meshes

from comparisons.mitsuba.backend import scalar
from comparisons.results.case import RungResult
from comparisons.rungs import geometry
from comparisons.translator import load
from reference_rt.rendering.scene import Scene
from reference_rt.scene.build import build_tables

VIEW = """
camera: {type: perspective, eye: [2, 3, 7], target: [0, 0, 0], fov: 40}
film: {width: 40, height: 30}
integrator: {type: ray_cast}
"""
TURN = "transform: [{scale: [1, 0.7, 1.2]}, {rotate: {axis: [1, 2, 3], degrees: 40}}]"

SCENES = {
    "ellipsoid": ("{type: sphere, radius: 1.1, TURN}", "1.1", "1.1005"),
    "disk": ("{type: disk, TURN}", "scale: [1,", "scale: [1.0005,"),
    "plane": ("{type: plane, TURN}", "degrees: 40", "degrees: 40.02"),
    "polygon": (
        "{type: polygon, fill: even_odd, TURN, rings: [[[0, 1], [0.6, -0.8], [-1, 0.3], [1, 0.3],"
        " [-0.6, -0.8]]]}",
        "even_odd",
        "nonzero",
    ),
    "cylinder": ("{type: cylinder, TURN}", "type: cylinder", "type: cylinder, capped: false"),
    "open cylinder": ("{type: cylinder, capped: false, z_max: 1.5, TURN}", "1.5", "1.501"),
    "cone": ("{type: cone, height: 1.5, TURN}", "1.5", "1.502"),
    "paraboloid": (
        "{type: quadric, coefficients: [1, 1, 0, 0, 0, 0, 0, 0, -1, 0], lower: [-1, -1, 0],"
        " upper: [1, 1, 1], TURN}",
        "0, -1, 0]",
        "0, -1.002, 0]",
    ),
    "torus": ("{type: torus, TURN}", "type: torus", "type: torus, minor_radius: 0.251"),
    "solid": (
        "{type: difference, TURN, of: [{type: box}, {type: sphere, radius: 1.2},"
        " {type: cylinder, radius: 0.3, z_min: -2, z_max: 2}]}",
        "1.2}",
        "1.2005}",
    ),
    "operation": (
        "{type: intersection, of: [{type: box}, {type: sphere, radius: 1.2}]}",
        "intersection",
        "union",
    ),
}

ROUND = {
    "sphere": "{type: sphere, TURN}",
    "ellipsoid": "{type: sphere, TURN, material: lamp}",
    "disk": "{type: disk, TURN}",
    "cylinder": "{type: cylinder, TURN}",
    "open cylinder": "{type: cylinder, capped: false, TURN, material: lamp}",
    "cone": "{type: cone, TURN}",
    "solid": "{type: union, TURN, of: [{type: sphere}, {type: cylinder, radius: 0.3}]}",
}

GROUPS = """
groups:
  pair: [{type: sphere, radius: 0.5}, {type: box, transform: [{scale: 0.3}, {translate: [0, 1, 0]}]}]
  two: [{type: instance, group: pair}, {type: instance, group: pair, transform: [{translate: [2, 0, 0]}]}]
shapes:
  - {type: instance, group: two, transform: [{scale: [1, -1.4, 1]}]}
  - {type: instance, group: pair, transform: [{translate: [-2, 0, 0]}]}
"""  # noqa: E501


@pytest.mark.cases(2)
@pytest.mark.parametrize("shear", [3e-15, 3.3e-15, 5e-15, 7e-15, 1e-10])
@pytest.mark.parametrize("name", ROUND)
def test_maps_that_are_nearly_similarities(name: str, shear: float) -> None:
    """Both sides decide alike which maps keep a sphere round."""
    matrix = f"transform: [{{matrix: [[2, {shear!r}, 0, 1], [0, 2, 0, 0], [0, 0, 2, 0]]}}]"
    shape = ROUND[name].replace("TURN", matrix)
    lamp = "materials: {lamp: {type: emissive, radiance: 1}}"
    scene = Scene.parse(f"{VIEW}{lamp}\nshapes:\n  - {shape}\n")
    with scalar(), coarse_meshes(48, 24):
        found = geometry(scene, build_tables(scene), load(scene), 100)
    assert found.status == "agree", found.reason


def text_of(shape: str) -> str:
    return f"{VIEW}shapes:\n  - {shape.replace('TURN', TURN)}\n"


def climbed(ours: str, theirs: str) -> RungResult:
    scene = Scene.parse(ours)
    return geometry(scene, build_tables(scene), load(Scene.parse(theirs)), pixels=700)


@pytest.mark.cases(4)
@pytest.mark.parametrize("name", SCENES)
def test_a_counterpart_is_met_in_the_same_places(name: str) -> None:
    text = text_of(SCENES[name][0])
    rung = climbed(text, text)
    assert rung.status in ("agree", "reference-limited"), rung.reason
    assert (rung.numbers["decided_ours"], rung.numbers["undecided"]) == (0, 0), rung.reason
    assert rung.numbers["hits"] > 300
    for stand_ins in rung.numbers["stand_ins"].values():
        for stand_in in stand_ins:
            # Half the fineness, four times the distance: the surface is smooth, or straight.
            assert 3.0 < stand_in["ratio"] < 5.0
            assert stand_in["sag"] < 1e-4


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    "change",
    [("", ""), ("[-2, 0, 0]", "[-2.001, 0, 0]"), ("[2, 0, 0]", "[0, 0, 2]"), ("-1.4", "1.4")],
)
def test_groups_of_groups(change: tuple[str, str]) -> None:
    text = VIEW + GROUPS
    rung = climbed(text, text.replace(*change) if change[0] else text)
    assert rung.status == ("differ" if change[0] else "agree"), rung.reason
    assert np.isfinite(rung.numbers["max_t_error_over_bound"])
