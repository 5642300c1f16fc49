"""Small flat mirrors far from the origin, under a sky of noise: float32 rounds their corners, which
turns the sky that they show."""

from pathlib import Path

import numpy as np
import pytest

from comparisons.mitsuba.backend import scalar
from comparisons.rungs.whitted import whitted
from comparisons.translator import load
from reference_rt.rendering.scene import Scene

SCENE = """
camera: {{type: perspective, eye: [9, -13, 16.5], target: [9, -13, 14], fov: 14}}
film: {{width: 12, height: 8}}
integrator: {{type: whitted}}
materials: {{mirror: {{type: mirror}}}}
shapes:
  - {shape}
    material: mirror
    transform: [{{scale: 0.3}}, {{rotate: {{axis: [0.65, -0.162, 0.544], degrees: {angle}}}}},
     {{translate: [9, -13, 14]}}]
  - {{type: rectangle, transform: [{{translate: [-30, 0, -30]}}]}}
lights:
  - {{type: environment_map, file: sky.npy,
     transform: [{{rotate: {{axis: [0, 1, 0], degrees: {turn}}}}}]}}
"""
SHAPES = {
    "box": "type: box",
    "polygon": "type: polygon\n    rings: [[[-1, -1, 0], [1, -1, 0], [1.2, 1, 0], [-1, 1.3, 0]]]",
    "triangle": "type: triangle\n    v0: [-1, -1, 0]\n    v1: [1, -1, 0.2]\n    v2: [0, 1.5, 0.1]",
    "mesh": "type: mesh\n    vertices: [[-1, -1, 0], [1, -1, 0.2], [0, 1.5, 0.1], [2, 2, 0]]\n    "
    "faces: [[0, 1, 2], [1, 3, 2]]",
    "rectangle": "type: rectangle",
    "disk": "type: disk",
    "sphere": "type: sphere",
}


@pytest.mark.parametrize("angle", [10, 90])
@pytest.mark.parametrize("shape", SHAPES)
def test_the_sky_in_a_small_mirror(
    shape: str, angle: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Turned by 0.004 degrees it differs."""
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(1)
    np.save("sky.npy", rng.uniform(0.1, 1.0, (128, 256, 3)).astype(np.float32))
    right, turned = (
        Scene.parse(SCENE.format(shape=SHAPES[shape], angle=angle, turn=turn))
        for turn in (0.0, 0.004)
    )
    with scalar():
        found = whitted(right, right.tables, load(right))
        assert found.status == "agree", found.reason
        assert found.numbers["lit"] > 10
        assert whitted(right, right.tables, load(turned)).status == "differ"
