"""Counterparts of shapes whose maps are nearly similarities, and of groups of groups: by rays."""

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


def climbed(ours: str, theirs: str) -> RungResult:
    scene = Scene.parse(ours)
    return geometry(scene, build_tables(scene), load(Scene.parse(theirs)), pixels=700)


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
