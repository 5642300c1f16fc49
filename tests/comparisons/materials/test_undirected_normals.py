"""Texels of a normal map that are no direction: a grey of 1/2."""

from pathlib import Path

import numpy as np
import pytest

from comparisons.rungs.direct import direct
from comparisons.translator import load
from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.scene import Scene

SCENE = """
camera: {type: perspective, eye: [0, 0.5, 4], target: [0, 0, 0], fov: 30}
film: {width: 16, height: 12}
textures: {n: {type: bitmap, file: n.npy, encoding: raw, filter: FILTER}}
materials:
  grey: {type: diffuse}
  mapped: {type: normal_map, base: grey, normals: n, scale: 0.7}
shapes: [{type: rectangle, material: mapped}]
lights: [{type: constant, radiance: 1}, {type: point, position: [1, 2, 3], intensity: 9}]
"""


def _texels(all_of_them: bool) -> FloatArray:
    texels = np.full((4, 6, 3), 0.5)
    if not all_of_them:
        texels[::2] = np.random.default_rng(3).uniform(0.4, 1.0, (2, 6, 3))
    return texels


@pytest.mark.parametrize(
    ("choice", "all_of_them"), [("bilinear", True), ("nearest", True), ("nearest", False)]
)
def test_texels_without_a_direction_keep_the_surfaces_normal(
    choice: str, all_of_them: bool, tmp_path: Path
) -> None:
    np.save(tmp_path / "n.npy", _texels(all_of_them))
    scene = Scene.parse(SCENE.replace("FILTER", choice), folder=tmp_path)
    found = direct(scene, scene.tables, load(scene), 100)
    assert found.status == "agree", found.reason
    assert found.numbers["lit_right"] > 100
