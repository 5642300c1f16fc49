"""Scenes, tables and meshes that tests are made of."""

import importlib
import os
import pkgutil
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.lib.npyio import NpzFile
from PIL import Image

import reference_rt as rt
from reference_rt.core import transform
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.shapes import Shapes

U = 2.0**-53
"""The unit roundoff: one operation is off by at most this, relatively."""

HELPERS = Path(__file__).parent
SCENES = Path(__file__).parents[2] / "scenes"


_PLAIN = """
import importlib
import sys
from pathlib import Path
folder, module, function, *arguments = sys.argv[1:]
sys.path.insert(0, folder)
getattr(importlib.import_module(module), function)(*map(Path, arguments))
"""


def in_plain_python(test_file: str, function: str, *arguments: Path) -> None:
    """Call a function of a test's file with paths, where kernels run as plain Python."""
    file = Path(test_file)
    subprocess.run(
        [sys.executable, "-c", _PLAIN, str(file.parent), file.stem, function, *map(str, arguments)],
        env=os.environ | {"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": str(HELPERS)},
        check=True,
    )


def same_in_plain_python(write: Callable[[Path, Path], None], folder: Path) -> NpzFile:
    """The arrays that `write(folder, file)` of a test's module stores, after it is checked that
    plain Python gives the same bits as compiled kernels."""
    files = folder / "compiled.npz", folder / "plain.npz"
    write(folder, files[0])
    in_plain_python(write.__code__.co_filename, write.__name__, folder, files[1])
    compiled, plain = (np.load(file) for file in files)
    assert set(compiled.files) == set(plain.files)
    for name in compiled.files:
        assert compiled[name].tobytes() == plain[name].tobytes(), name
    return compiled


def unit_vectors(rng: np.random.Generator, n: int) -> FloatArray:
    v = rng.normal(size=(n, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def random_turn(rng: np.random.Generator) -> FloatArray:
    """A rotation (3, 3), mirrored as often as not."""
    return np.linalg.qr(rng.normal(size=(3, 3)))[0]


def placed(rng: np.random.Generator, scale: float, offset: float) -> tuple:
    """Steps of a transform: unequal scales near `scale`, any rotation, a translation."""
    return (
        transform.Scale(scale=tuple(scale * rng.uniform(0.5, 2.0, 3))),
        transform.Rotate(
            rotate=transform.Turn(
                axis=tuple(unit_vectors(rng, 1)[0]), degrees=float(rng.uniform(0, 360))
            )
        ),
        transform.Translate(translate=tuple(offset * rng.uniform(-1.0, 1.0, 3))),
    )


def random_shape(kind: str, rng: np.random.Generator, scale: float, offset: float) -> object:
    """A sphere, rectangle, box or triangle of about this size, about this far from the origin."""
    if kind == "sphere":
        center = tuple(offset * rng.uniform(-1.0, 1.0, 3))
        return rt.Sphere(center=center, radius=scale * rng.uniform(0.5, 2.0))
    if kind == "triangle":
        c = offset * rng.uniform(-1.0, 1.0, 3)
        v = [tuple(c + scale * w) for w in rng.uniform(-1.0, 1.0, (3, 3))]
        return rt.Triangle(v0=v[0], v1=v[1], v2=v[2])
    shape = {"rectangle": rt.Rectangle, "box": rt.Box}[kind]
    return shape(transform=placed(rng, scale, offset))


def shapes_in_order(shapes: Sequence[object]) -> tuple[Shapes, IntArray]:
    """The tables of shapes of one kind, and the row of each."""
    tables = rt.build_tables(rt.Scene(shapes=tuple(shapes))).geometry.shapes
    (table,) = (t for t in tables if t is not None)
    return tables, np.argsort(table.owner)


def write_obj(path: Path, vertices: FloatArray, faces: IntArray) -> Path:
    """An .obj file with every bit of the vertices."""
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in np.asarray(vertices, float).tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (np.asarray(faces) + 1).tolist()]
    path.write_text("\n".join(lines) + "\n")
    return path


def cube(n: int) -> tuple[FloatArray, IntArray]:
    """The cube [-1, 1]³, each face n x n squares of two triangles, vertices shared."""
    ticks = np.linspace(-1.0, 1.0, n + 1)
    vertices: dict[tuple[float, ...], int] = {}
    faces = []

    def vertex(axis: int, sign: float, i: int, j: int) -> int:
        p = [0.0, 0.0, 0.0]
        p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3] = sign, ticks[i], ticks[j]
        return vertices.setdefault(tuple(map(float, p)), len(vertices))

    for axis in range(3):
        for sign in (-1.0, 1.0):
            for i in range(n):
                for j in range(n):
                    a, b = vertex(axis, sign, i, j), vertex(axis, sign, i + 1, j)
                    c, d = vertex(axis, sign, i + 1, j + 1), vertex(axis, sign, i, j + 1)
                    pair = [[a, b, c], [a, c, d]]
                    faces += pair if sign > 0 else [f[::-1] for f in pair]
    return np.array(list(vertices)), np.array(faces)


def icosphere(subdivisions: int) -> tuple[FloatArray, IntArray]:
    """A closed ball of 20 * 4^subdivisions triangles about the origin, radius 1, facing out."""
    t = (1.0 + 5.0**0.5) / 2.0
    pairs = ((-1.0, t), (1.0, t), (-1.0, -t), (1.0, -t))
    corners = [np.roll((x, y, 0.0), axis) for axis in range(3) for x, y in pairs]
    v = np.array(corners) / np.linalg.norm((1.0, t))
    f = np.array(ICOSAHEDRON).reshape(-1, 3)
    for _ in range(subdivisions):
        edges = np.sort(f[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        found, inverse = np.unique(edges[:, ::-1], axis=0, return_inverse=True)
        (a, b, c), (ab, bc, ca) = f.T, inverse.reshape(-1, 3).T + len(v)
        f = np.stack([a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca], axis=1).reshape(-1, 3)
        v = np.concatenate([v, v[found[:, ::-1]].mean(axis=1)])
        scale = np.sqrt((v**2).sum(axis=1, keepdims=True))
        v += v / scale * (1.0 - scale)
    return v, f


ICOSAHEDRON = (
    *(0, 11, 5, 0, 5, 1, 0, 1, 7, 0, 7, 10, 0, 10, 11, 1, 5, 9, 5, 11, 4, 11, 10, 2, 10, 7, 6),
    *(7, 1, 8, 3, 9, 4, 3, 4, 2, 3, 2, 6, 3, 6, 8, 3, 8, 9, 4, 9, 5, 2, 4, 11, 6, 2, 10),
    *(8, 6, 7, 9, 8, 1),
)
"""Vertices of its faces."""


PETAL = """\
ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
property uchar red
property uchar green
property uchar blue
element face 1
property list uchar int vertex_indices
end_header
-1 -1 0 255 0 0
1 -1 0 0 255 0
0 1 0 0 0 255
3 0 1 2
"""
"""A triangle with colours, as a .ply file."""

EVERY_SHAPE = """\
camera: {type: perspective, eye: [0, 1, 5], target: [0, 0.3, 0], fov: 50}
film: {width: 6, height: 4, filter: {type: gaussian}}
sampler: {type: sobol, spp: 2, seed: 3}
integrator: {type: path, rr_depth: 2}
materials:
  grey: {type: diffuse, reflectance: 0.6}
  glass: {type: dielectric}
  lamp: {type: emissive, radiance: [5, 4, 3], base: grey}
groups:
  pair: [{type: sphere, radius: 0.2}, {type: box, transform: [{scale: 0.1}]}]
shapes:
  - {type: mesh, file: ball.obj, material: glass}
  - {type: sphere, center: [-1.5, 0, 0], radius: 0.7}
  - {type: sphere, center: [1.5, 2, 1], radius: 0.3, material: lamp}
  - type: rectangle
    transform: [{scale: 5}, {rotate: {axis: [1, 0, 0], degrees: -90}}, {translate: [0, -1, 0]}]
  - {type: box, material: lamp, transform: [{scale: 0.2}, {translate: [1, -0.5, 1.5]}]}
  - {type: triangle, v0: [-2, 2, -1], v1: [-1, 2, -1], v2: [-2, 3, -1], material: lamp}
  - {type: disk, material: glass, transform: [{translate: [-3, 1, -2]}]}
  - {type: plane, transform: [{translate: [0, 0, -9]}]}
  - {type: polygon, rings: [[[0, 0], [1, 0], [0, 1]]], transform: [{translate: [2, 1, -1]}]}
  - {type: cylinder, radius: 0.2, transform: [{translate: [-1, -0.5, 1]}]}
  - {type: torus, major_radius: 0.3, minor_radius: 0.1, transform: [{translate: [0, 0, 2]}]}
  - {type: instance, group: pair, transform: [{translate: [0, 0, -2]}]}
  - type: difference
    material: grey
    of: [{type: box, transform: [{scale: 0.3}]}, {type: sphere, radius: 0.4}]
    transform: [{translate: [0, 1.5, 0]}]
lights:
  - {type: point, position: [0, 4, 2], intensity: 9}
  - {type: constant, radiance: [0.2, 0.3, 0.4]}
"""
"""Every kind of shape; a hierarchy; beside it must lie `ball.obj`."""

EVERY_LAW = """\
camera: {type: perspective, eye: [0, 1.5, 6], target: [0, 0.2, 0], fov: 60}
film: {width: 12, height: 8, filter: {type: mitchell}, layers: [albedo, normal, position]}
sampler: {type: sobol, spp: 2, seed: 3}
integrator: {type: path, rr_depth: 2}
textures:
  checks: {type: checker, first: [0.8, 0.7, 0.2], second: 0.3, uv: {scale: [6, 4], rotate: 20}}
  oblique: {type: checker, first: 0.7, second: 0.3, uv: {matrix: [[4, 1, 0], [0.5, 3, 0.1]]}}
  image: {type: bitmap, file: image.png, uv: {scale: 3}}
  numbers: {type: bitmap, file: image.png, encoding: raw, wrap: mirror, uv: {offset: [0.2, 0.1]}}
  own: {type: vertex_colours}
materials:
  floor: {type: diffuse, reflectance: checks}
  paint: {type: diffuse, reflectance: own}
  silver: {type: mirror, reflectance: 0.9}
  gold: {type: conductor, eta: [0.14, 0.37, 1.44], k: [3.98, 2.39, 1.6]}
  glass: {type: dielectric, transmittance: [0.9, 1, 0.9]}
  pane: {type: thin_dielectric}
  brushed: {type: rough_conductor, eta: 0.2, k: 3, alpha: [0.1, numbers]}
  cast: {type: rough_conductor, eta: 0.2, k: 3, distribution: beckmann, alpha: numbers}
  frosted: {type: rough_dielectric, alpha: 0.3}
  coat: {type: plastic, reflectance: image, nonlinear: true}
  dull: {type: rough_plastic, reflectance: [0.1, 0.3, 0.7], alpha: 0.2}
  car:
    {type: principled, base_colour: image, roughness: numbers, metallic: 0.3, anisotropic: 0.4,
     sheen: 0.4, sheen_tint: 0.5, clearcoat: 0.5, spec_trans: 0.2, spec_tint: 0.3, flatness: 0.2}
  leaf:
    {type: principled_thin, base_colour: image, roughness: 0.4, spec_trans: numbers, eta: 1.3,
     sheen: 0.3, diff_trans: 0.7, anisotropic: 0.3}
  toy: {type: gltf_pbr, base_color: image, metallic: 0.5, roughness: numbers, ior: 1.8}
  wax: {type: phong, ambient: 0.1, diffuse: 0.1, specular: 0.6, exponent: 20, mirror: 0.1}
  chalk: {type: phong, diffuse: 0.1, specular: [0.1, 0.2, 0.3], exponent: 30, half_vector: true}
shapes:
  - type: rectangle
    material: floor
    transform: [{scale: 6}, {rotate: {axis: [1, 0, 0], degrees: -90}}, {translate: [0, -1, 0]}]
  - {type: mesh, file: petal.ply, material: paint, transform: [{translate: [0, 2, -2]}]}
  - {type: sphere, center: [-3, 1.2, 0], radius: 0.5, material: silver}
  - {type: sphere, center: [-1.8, 1.2, 0], radius: 0.5, material: gold}
  - {type: sphere, center: [-0.6, 1.2, 0], radius: 0.5, material: glass}
  - {type: sphere, center: [0.6, 1.2, 0], radius: 0.5, material: pane}
  - {type: sphere, center: [1.8, 1.2, 0], radius: 0.5, material: brushed}
  - {type: sphere, center: [3, 1.2, 0], radius: 0.5, material: cast}
  - {type: sphere, center: [-3, 0, 0], radius: 0.5, material: frosted}
  - {type: sphere, center: [-1.8, 0, 0], radius: 0.5, material: coat}
  - {type: sphere, center: [-0.6, 0, 0], radius: 0.5, material: dull}
  - {type: sphere, center: [0.6, 0, 0], radius: 0.5, material: car}
  - {type: sphere, center: [1.8, 0, 0], radius: 0.5, material: wax}
  - {type: sphere, center: [4.2, 0, 0], radius: 0.5, material: leaf}
  - {type: sphere, center: [3, 0, 0], radius: 0.5, material: chalk}
  - {type: sphere, center: [4.2, 1.2, 0], radius: 0.5, material: toy}
lights:
  - {type: point, position: [0, 4, 2], intensity: 9}
  - {type: constant, radiance: [0.2, 0.3, 0.4]}
  - {type: ambient, radiance: [0.1, 0.2, 0.3]}
"""
"""Every material that is not made of others, and every texture; beside it must lie `image.png` and
`petal.ply`."""

EVERY_LIGHT = """\
camera: {type: perspective, eye: [0, 1.5, 6], target: [0, 0.2, 0], fov: 60}
film: {width: 12, height: 8, layers: [depth, id, variance]}
sampler: {type: independent, spp: 2, seed: 3}
integrator: {type: path, rr_depth: 2}
textures:
  image: {type: bitmap, file: image.png}
  numbers: {type: bitmap, file: image.png, encoding: raw}
materials:
  grey: {type: diffuse, reflectance: 0.6}
  silver: {type: mirror, reflectance: 0.9}
  leaf: {type: mask, base: grey, opacity: numbers}
  mix: {type: blend, first: silver, second: grey, weight: 0.7}
  sheet: {type: two_sided, base: grey, back: mix}
  dents: {type: bump, base: sheet, height: numbers, scale: 0.1}
  tiles: {type: normal_map, base: mix, normals: numbers, use_shadowing_function: true}
  glow: {type: emissive, radiance: image, base: dents}
  lamp: {type: emissive, radiance: [3, 2, 1]}
shapes:
  - type: rectangle
    material: dents
    transform: [{scale: 6}, {rotate: {axis: [1, 0, 0], degrees: -90}}, {translate: [0, -1.5, 0]}]
  - {type: sphere, center: [-0.5, -0.5, 1], radius: 0.9, material: tiles}
  - {type: rectangle, material: leaf, transform: [{translate: [1, 0.5, 2]}]}
  - {type: rectangle, material: sheet, transform: [{scale: -1}, {translate: [-1, 1, 0]}]}
  - {type: rectangle, material: glow, transform: [{translate: [-3, 0, -1]}]}
  - {type: sphere, center: [2, 0, 0], radius: 0.6, material: lamp}
  - {type: triangle, v0: [1, 2, -1], v1: [2, 2, -1], v2: [1, 3, -1], material: glow}
lights:
  - {type: point, position: [0, 4, 2], intensity: 9}
  - {type: point, position: [3, 4, 2], intensity: [1, 2, 3]}
  - {type: point, position: [-3, 4, 2], intensity: [3, 2, 1]}
  - {type: point, position: [-3, 4, -2], intensity: 2}
  - {type: point, position: [3, 4, -2], intensity: 2}
  - {type: spot, origin: [0, 4, 0], target: [0, 0, 0], intensity: 9, cutoff_angle: 50}
  - {type: spot, origin: [5, 4, 3], target: [0, 0, 0], intensity: 9}
  - {type: spot, origin: [-5, 4, 3], target: [0, 0, 0], intensity: 9, texture: image}
  - {type: projector, origin: [0, 4, 5], target: [0, 0, 0], irradiance: image, fov: 70, aspect: 2}
  - {type: directional, direction: [1, -2, -1], irradiance: [0.3, 0.4, 0.5]}
  - type: environment_map
    file: image.png
    scale: 0.5
    transform: [{rotate: {axis: [1, 2, 3], degrees: 40}}]
  - {type: ambient, radiance: [0.1, 0.2, 0.3]}
"""
"""Every kind of light, so many that a tree picks them, and every material that is made of others;
beside it must lie `image.png`."""


def every_shape(folder: Path) -> Path:
    """The scene file EVERY_SHAPE, with what it names."""
    vertices, faces = icosphere(0)
    write_obj(folder / "ball.obj", vertices, faces)
    return _written(folder / "every_shape.yaml", EVERY_SHAPE)


def every_law(folder: Path) -> Path:
    """The scene file EVERY_LAW, with what it names."""
    (folder / "petal.ply").write_text(PETAL)
    return _written(folder / "every_law.yaml", EVERY_LAW)


def every_light(folder: Path) -> Path:
    """The scene file EVERY_LIGHT, with what it names."""
    return _written(folder / "every_light.yaml", EVERY_LIGHT)


def _written(path: Path, text: str) -> Path:
    pixels = np.random.default_rng(17).integers(30, 220, (3, 4, 3), dtype=np.uint8)
    Image.fromarray(pixels).save(path.parent / "image.png")
    path.write_text(text)
    return path


def import_everything():
    """Import every module of reference_rt: what a test enumerates then does not depend on which
    others have run."""
    for module in pkgutil.walk_packages(rt.__path__, "reference_rt."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
