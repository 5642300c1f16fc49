"""Light that grazes flat shapes: the rung of Whitted ray tracing allows for float32's normals."""

import numpy as np
import pytest

from comparisons.mitsuba.backend import scalar
from comparisons.rungs import whitted
from comparisons.shapes.stand_ins import coarser
from comparisons.translator import load
from reference_rt import Scene
from reference_rt.core.transform import rotate
from reference_rt.rendering.render import render

GRAZED = """
camera: {type: perspective, eye: [0.3, 0.4, 5], target: [0, 0, 0], fov: 40}
film: {width: 16, height: 12}
integrator: {type: whitted}
shapes:
  - SHAPE
lights:
  - {type: directional, direction: DIRECTION, irradiance: 3}
"""
FLAT = {
    "plane": "{type: plane, TURN}",
    "rectangle": "{type: rectangle, TURN}",
    "disk": "{type: disk, TURN}",
    "box": "{type: box, TURN}",
    "cylinder": "{type: cylinder, TURN}",
    "cone": "{type: cone, TURN}",
    "triangle": "{type: triangle, v0: [-1, -1, 0], v1: [1, -1, 0], v2: [0, 1, 0], TURN}",
    "sliver": "{type: triangle, v0: [-1, -1, 0], v1: [1, 1, 0], v2: [1, 1.004, 0], TURN}",
    "polygon": "{type: polygon, rings: [[[0, 1], [0.6, -0.8], [-1, 0.3], [1, 0.3], [-0.6, -0.8]]],"
    " TURN}",
    "solid": "{type: difference, of: [{type: box}, {type: plane}], TURN}",
}


UNRESOLVED = ("sliver", "polygon", "cone")


@pytest.mark.cases(1)
@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("name", FLAT)
def test_light_that_grazes_flat_shapes(name: str, seed: int) -> None:
    """Float32 turns the normal of a triangle by its error over the triangle's height, and light at
    an angle of 1/100 changes by a hundred times that."""
    rng = np.random.default_rng(seed)
    axis, degrees = rng.normal(size=3).round(2), round(float(rng.uniform(20.0, 60.0)), 1)
    turn = rotate(tuple(axis), degrees)[:, :3]
    move = rng.uniform(-0.5, 0.5, 3).round(2)
    steps = f"transform: [{{rotate: {{axis: {axis.tolist()}, degrees: {degrees}}}}}, "
    steps += f"{{translate: {move.tolist()}}}]"
    shape = FLAT[name].replace("TURN", steps)
    a = rng.uniform(0.0, 6.0)
    scene, turned = (
        Scene.parse(GRAZED.replace("SHAPE", shape).replace("DIRECTION", str(d.tolist())))
        for d in (turn @ [np.cos(a), np.sin(a), z] for z in (-0.01, -0.01002))
    )
    with scalar(), coarser(0.35):
        found = whitted(scene, scene.tables, load(scene))
        wrong = whitted(scene, scene.tables, load(turned))
    assert found.status in ("agree", "reference-limited"), found.reason
    # Of planes the camera may see the dark side; slivers, and polygons that cross themselves, are
    # not resolved.
    lit = render(scene).colour.any()
    assert wrong.status == "differ" or not lit or name in UNRESOLVED
