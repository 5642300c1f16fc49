"""Meshes whose triangles are wound against the normals of their vertices, as many files have."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from comparisons.mitsuba.backend import scalar
from comparisons.rungs import direct
from comparisons.translator import load
from reference_rt.rendering.scene import Scene

SCENE = """
camera: {{type: perspective, eye: [1, 2, 4], target: [0, 0, 0], fov: 45}}
film: {{width: 20, height: 16}}
textures:
  map: {{type: bitmap, file: map.png, encoding: raw}}
materials:
  base: {{type: rough_conductor, eta: 0.2, k: 3, alpha: 0.3}}
  m: {material}
shapes:
  - type: mesh
    material: m
    vertices: [[1, 0, -0.6], [-0.5, 0.9, -0.6], [-0.5, -0.9, -0.6], [1, 0, 0.6], [-0.5, 0.9, 0.6],
      [-0.5, -0.9, 0.6]]
    normals: [[1, 0.1, -0.3], [-0.4, 0.9, -0.5], [-0.5, -0.9, -0.7], [1, -0.1, 0.5],
      [-0.6, 0.9, 0.5], [-0.5, -0.9, 0.5]]
    faces: {faces}
    {uv}
    transform: [{{scale: [0.95, {y}, 0.7]}}, {{rotate: {{axis: [1, -0.4, 2], degrees: 40}}}}]
lights:
  - {{type: point, position: [2, 3, 4], intensity: 20}}
  - {{type: constant, radiance: [0.4, 0.3, 0.2]}}
"""
OUTWARD = [[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4], [2, 0, 3], [2, 3, 5], [0, 2, 1], [3, 4, 5]]
FACES = {
    "outward": OUTWARD,
    "inward": [[a, c, b] for a, b, c in OUTWARD],
    "both": [[a, b, c] if k % 2 else [a, c, b] for k, (a, b, c) in enumerate(OUTWARD)],
}
MATERIALS = {
    "diffuse": "{type: diffuse}",
    "bump": "{type: bump, height: map, base: base, scale: 0.3}",
    "bump, Mitsuba's defaults": "{type: bump, height: map, base: base, scale: 0.3,"
    " flip_invalid_normals: true, use_shadowing_function: true}",
    "normal map": "{type: normal_map, normals: map, base: base}",
    "normal map, Mitsuba's defaults": "{type: normal_map, normals: map, base: base,"
    " flip_invalid_normals: true, use_shadowing_function: true}",
    "glass": "{type: rough_dielectric, alpha: 0.3}",
    "plastic": "{type: rough_plastic, alpha: 0.3}",
    "principled": "{type: principled, anisotropic: 0.7, roughness: 0.4, spec_trans: 0.3}",
    "thin": "{type: principled_thin, diff_trans: 0.8, spec_trans: 0.3}",
}
UV = "uv: [[0.98, 1.7], [1.5, 1.2], [1.25, 1.4], [0, 0.6], [0.1, 0.9], [1.95, 0.5]]"


@pytest.mark.cases(2)
@pytest.mark.parametrize("y", [0.8, -0.8])
@pytest.mark.parametrize("uv", ["", UV], ids=["without uv", "with uv"])
@pytest.mark.parametrize("faces", FACES)
@pytest.mark.parametrize("material", MATERIALS)
def test_light_on_them(material: str, faces: str, uv: str, y: float, tmp_path: Path) -> None:
    """Also mirrored."""
    image = np.random.default_rng(5).integers(90, 255, (6, 9, 3), dtype=np.uint8)
    Image.fromarray(image).save(tmp_path / "map.png")
    text = SCENE.format(material=MATERIALS[material], faces=FACES[faces], uv=uv, y=y)
    scene = Scene.parse(text, folder=tmp_path)
    with scalar():
        found = direct(scene, scene.tables, load(scene), 150)
    assert found.status == "agree", found.reason
