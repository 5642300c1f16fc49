"""Infinite planes: their normals are the same everywhere, whatever the unit of their uv."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from comparisons.rungs.direct import direct
from comparisons.rungs.whitted import whitted
from comparisons.translator import load
from reference_rt.rendering.scene import Scene

SCENE = """
camera: {{type: pinhole, target: [0.2, -0.29, 0], eye: [-5, 1.13, -1], film_width: 0.85}}
film: {{width: 12, height: 12}}
materials: {{lamp: {{type: emissive, radiance: {radiance}}}}}
shapes:
  - {{type: plane, transform: [{{scale: {unit}}}, {{rotate: {{axis: [1, 0, 0], degrees: -90}}}},
      {{translate: [0, -3, 0]}}]}}
  - {{type: box, material: lamp,
      transform: [{{matrix: [[-0.06, 0, 0, 1], [0, 0, 1, 1], [0.03, -0.01, 0, 1]]}}]}}
"""


@pytest.mark.parametrize("unit", [1.0, 1e-3])
def test_grazing_light_on_a_plane_is_resolved(unit: float) -> None:
    """200 units away the lamp is a degree above the plane, and the camera, too."""
    scene, brighter = (
        Scene.parse(SCENE.format(unit=unit, radiance=[0, 0, blue])) for blue in (1.0, 1.001)
    )
    found = whitted(scene, scene.tables, load(scene))
    assert found.status == "agree", found.reason
    assert found.numbers["lit_right"] == found.numbers["lit"] > 20
    assert whitted(scene, scene.tables, load(brighter)).status == "differ"


TEXTURED = """
camera: {{type: perspective, eye: [-4, 2, 4], target: [0, 0, 0], fov: 30}}
film: {{width: 12, height: 8}}
textures: {{t: {{type: bitmap, file: t.png}}}}
materials: {{m: {{type: diffuse, reflectance: t}}}}
shapes: [{{type: plane, material: m, transform: [{{scale: [1, {unit}, 1]}}]}}]
lights: [{{type: constant, radiance: 1}}]
"""


@pytest.mark.parametrize("unit", [1.0, 1e-2, 1e-4])
def test_a_texture_that_repeats_often_on_a_plane(unit: float, tmp_path: Path) -> None:
    """Its uv change over the plane's unit, though its normal does not."""
    texels = np.random.default_rng(2).integers(0, 256, (4, 4, 3)).astype(np.uint8)
    Image.fromarray(texels).save(tmp_path / "t.png")
    scene = Scene.parse(TEXTURED.format(unit=unit), folder=tmp_path)
    found = direct(scene, scene.tables, load(scene), 96)
    assert found.status == "agree", found.reason
