"""Scenes that are compared with their counterparts in Mitsuba, and how their tests set up."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from comparisons.geometry.frame import OURS
from comparisons.mitsuba.backend import scalar
from comparisons.shapes import canonical, torus
from comparisons.shapes.stand_ins import coarser
from comparisons.translator import load
from reference_rt import Scene


@contextmanager
def coarse_meshes(*cells: int) -> Iterator[None]:
    """Meshes in place of curved shapes with fewer cells, (along, around): quicker to make."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(torus, "TORUS_CELLS", cells)
        patch.setattr(canonical, "CURVED", cells)
        yield


@contextmanager
def quick() -> Iterator[None]:
    """Nothing is compiled, and meshes are coarse: their larger error is measured."""
    with scalar(), coarser(0.35):
        yield


def faulty_counterpart(text: str, right: str, wrong: str, folder: Path | None = None) -> Any:
    """The counterpart of a scene, with one thing in it replaced."""
    assert text.count(right) == 1
    return load(Scene.parse(text.replace(right, wrong), folder=folder))


EVERY_MATERIAL = """
camera: {type: perspective, eye: [0.3, 1.5, 9], target: [0, 0.5, 0], fov: 40}
film: {width: 24, height: 16}
integrator: {type: path, max_depth: 4}
textures:
  checks: {type: checker, first: [0.8, 0.7, 0.2], second: 0.3, uv: {scale: [6, 4], rotate: 20}}
  image: {type: bitmap, file: colours.png, uv: {scale: 3}}
  numbers: {type: bitmap, file: wide.png, encoding: raw, wrap: mirror, uv: {offset: [0.2, 0.1]}}
  heights: {type: bitmap, file: heights.png, encoding: raw}
  normals: {type: bitmap, file: normals.png, encoding: raw}
materials:
  grey: {type: diffuse, reflectance: 0.6}
  floor: {type: diffuse, reflectance: checks}
  silver: {type: mirror, reflectance: 0.9}
  gold: {type: conductor, eta: [0.14, 0.37, 1.44], k: [3.98, 2.39, 1.6]}
  glass: {type: dielectric, transmittance: [0.9, 1, 0.9]}
  pane: {type: thin_dielectric}
  brushed: {type: rough_conductor, eta: 0.2, k: 3, alpha: [0.1, 0.4]}
  cast: {type: rough_conductor, eta: 0.2, k: 3, distribution: beckmann, alpha: 0.3}
  frosted: {type: rough_dielectric, alpha: 0.3}
  coat: {type: plastic, reflectance: image, nonlinear: true}
  dull: {type: rough_plastic, reflectance: [0.1, 0.3, 0.7], alpha: 0.2}
  car:
    {type: principled, base_colour: image, roughness: numbers, metallic: 0.3, anisotropic: 0.4,
     sheen: 0.4, sheen_tint: 0.5, clearcoat: 0.5, spec_trans: 0.2, spec_tint: 0.3, flatness: 0.2}
  petal:
    {type: principled_thin, base_colour: image, roughness: numbers, anisotropic: 0.4,
     sheen: 0.4, sheen_tint: 0.5, spec_trans: 0.4, spec_tint: 0.3, flatness: 0.2}
  toy:
    {type: gltf_pbr, base_color: image, metallic: checks, roughness: numbers, ior: 1.8,
     specular: 0.9, specular_color: image}
  wax: {type: phong, diffuse: 0.1, specular: 0.3, exponent: 20, mirror: 0.1}
  leaf: {type: mask, base: grey, opacity: numbers}
  mix: {type: blend, first: brushed, second: floor, weight: numbers}
  sheet: {type: two_sided, base: dull, back: mix}
  dents: {type: bump, base: floor, height: heights, scale: 0.1}
  tiles: {type: normal_map, base: floor, normals: normals}
  lamp: {type: emissive, radiance: [3, 2, 1], base: grey}
shapes:
  - {type: sphere, radius: 0.5, center: [-3, 2.2, 0], material: lamp}
  - {type: disk, material: lamp,
     transform: [{scale: 0.5}, {rotate: {axis: [1, 0, 0], degrees: 100}}, {translate: [0, 4, 0]}]}
  - {type: triangle, v0: [2, 3, 1], v1: [3, 3, 1], v2: [2.5, 3.5, 0], material: lamp,
     transform: [{matrix: [[1, 0.2, 0, 0], [0, -1, 0.1, 6], [0.1, 0, 1, 0]]}]}
  - {type: rectangle, material: floor,
     transform: [{scale: [6, 5, 1]}, {rotate: {axis: [1, 0, 0], degrees: -90}},
       {translate: [0, -1, 0]}]}
  - {type: box, material: grey,
     transform: [{scale: 0.5}, {matrix: [[-1, 0.3, 0, 0], [0, 1, 0.2, 0], [0.1, 0, 1, 0]]},
       {rotate: {axis: [1, 2, 3], degrees: 50}}, {translate: [1.5, 0.1, 0.5]}]}
  - {type: sphere, radius: 0.8, center: [-1, 0, 0], material: grey}
lights:
  - {type: point, position: [3, 4, 4], intensity: [10, 11, 12]}
  - {type: spot, origin: [-2, 5, 3], target: [0, 0, 0], intensity: 30, cutoff_angle: 35}
  - {type: directional, direction: [1, -3, -1], irradiance: [0.5, 0.6, 0.7]}
  - {type: constant, radiance: [0.2, 0.3, 0.4]}
"""
"""Every type of material, and lights of four kinds; its images are those of `image_folder`."""

EVERY_SHAPE = """
groups:
  pair: [{type: sphere, radius: 0.8}, {type: sphere, radius: 0.3, center: [0.2, 0.9, 0.1]}]
shapes:
  - {type: sphere, radius: 0.8, center: [-2.4, -2.4, 0]}
  - {type: sphere, radius: 0.8, transform: [SHEARED, {translate: [0, -2.4, 0]}]}
  - {type: box, transform: [{scale: 0.7}, MIRRORED, {translate: [2.4, -2.4, 0]}]}
  - {type: rectangle, transform: [TURNED, {translate: [-2.4, 0, 0]}]}
  - {type: disk, transform: [SHEARED, {translate: [0, 0, 0]}]}
  - {type: plane, transform: [{translate: [0, 0, -3]}]}
  - {type: triangle, v0: [-1, -1, 0], v1: [1, -1, 0.3], v2: [0, 1, 0],
     transform: [MIRRORED, {translate: [2.4, 0, 0]}]}
  - {type: polygon, rings: [[[0, 1], [0.6, -0.8], [-1, 0.3], [1, 0.3], [-0.6, -0.8]]],
     transform: [MIRRORED, {translate: [-2.4, 2.4, 0]}]}
  - {type: mesh, file: tent.obj, transform: [MIRRORED, {translate: [0, 2.4, 0]}]}
  - {type: cylinder, radius: 0.5, capped: false, transform: [TURNED, {translate: [2.4, 2.4, 0]}]}
  - {type: cone, radius: 0.8, transform: [TURNED, {translate: [-2.4, 0, 2.4]}]}
  - {type: torus, major_radius: 0.7, minor_radius: 0.3, transform: [{translate: [0, 0, 2.4]}]}
  - {type: quadric, coefficients: [1, 1, -1, 0, 0, 0, 0, 0, 0, 0.1],
     lower: [-0.9, -0.8, -0.7], upper: [0.8, 0.9, 1], transform: [{translate: [2.4, 0, 2.4]}]}
  - {type: instance, group: pair, transform: [MIRRORED, {translate: [-2.4, 2.4, 2.4]}]}
  - {type: difference, of: [{type: box, transform: [{scale: 0.7}]}, {type: sphere, radius: 0.9}],
     transform: [{translate: [0, 2.4, 2.4]}]}
"""

MAPS = {
    "TURNED": "{rotate: {axis: [1, 2, 3], degrees: 50}}",
    "SHEARED": "{matrix: [[1, 0.3, 0, 0], [0, 1, 0.2, 0], [0.1, 0, 0.8, 0]]}",
    "MIRRORED": "{matrix: [[-1, 0.3, 0, 0], [0, 1, 0.2, 0], [0.1, 0, 0.9, 0]]}",
}

TENT = "v -1 -1 0\nv 1 -1 0\nv 0 1 0\nv 0 0 1\nf 1 2 4\nf 2 3 4\nf 3 1 4\nf 3 2 1\n"


def every_shape(folder: Path) -> Scene:
    """Every type of shape, turned, sheared or mirrored."""
    (folder / "tent.obj").write_text(TENT)
    text = EVERY_SHAPE
    for name, steps in MAPS.items():
        text = text.replace(name, steps)
    return Scene.parse(text, folder=folder)


def every_material(folder: Path) -> Scene:
    return Scene.parse(EVERY_MATERIAL, folder=folder)


def counterpart_of(scene: Scene) -> Any:
    """Standing where the scene does."""
    return load(scene, OURS)


COLOURED = """
camera: {type: perspective, eye: [0.4, 1.5, 3], target: [0, 0, 0], fov: 45}
film: {width: 24, height: 18}
integrator: {type: path, max_depth: 3}
textures:
  c: {type: vertex_colours, scale: 0.9}
  im: {type: bitmap, file: colours.png}
  h: {type: bitmap, file: heights.png, encoding: raw}
  n: {type: bitmap, file: normals.png, encoding: raw}
materials:
  grey: {type: diffuse, reflectance: 0.5}
  coat: COAT
  m: AROUND
shapes:
  - type: mesh
    vertices: [[-1, 0, -1], [1, 0, -1], [1, 0.1, 1], [-1, 0, 1]]
    faces: [[0, 2, 1], [0, 3, 2]]
    uv: [[0, 0], [1, 0], [1, 1], [0, 1]]
    colours: [[0.9, 0.1, 0], [0, 0.8, 0.2], [0.1, 0, 1], [0.7, 0.7, 0.1]]
    material: m
lights: LIGHTS
"""
COATS = {
    "base": "{type: plastic, reflectance: c}",
    "nonlinear base": "{type: plastic, reflectance: c, nonlinear: true, interior_ior: 1.9}",
    "coat": "{type: plastic, reflectance: im, specular: c}",
    "both": "{type: plastic, reflectance: c, specular: c}",
    "rough base": "{type: rough_plastic, reflectance: c, alpha: 0.2}",
    "rough coat": "{type: rough_plastic, specular: c, alpha: 0.3, distribution: beckmann}",
    "rough both": "{type: rough_plastic, reflectance: c, specular: c, alpha: 0.4, nonlinear: true}",
    "no coat": "{type: rough_plastic, reflectance: c, specular: c, interior_ior: 1}",
}
WRAPPERS = {
    "two-sided": "{type: two_sided, base: coat}",
    "mask": "{type: mask, base: coat, opacity: 0.6}",
    "blend": "{type: blend, first: coat, second: grey, weight: 0.3}",
    "bump": "{type: bump, base: coat, height: h, scale: 0.05}",
    "normal map": "{type: normal_map, base: coat, normals: n}",
}
LAMPS = "[{type: point, position: [1, 2, -1], intensity: 9}, {type: constant, radiance: 0.7}]"


def coated(coat: str, around: str = "two-sided", lights: str = LAMPS) -> str:
    """A square with one of COATS, which have colours of vertices, inside one of WRAPPERS."""
    text = COLOURED.replace("COAT", COATS[coat]).replace("AROUND", WRAPPERS[around])
    return text.replace("LIGHTS", lights)
