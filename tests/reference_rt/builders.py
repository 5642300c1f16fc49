"""Scenes, tables and meshes that tests are made of."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

import reference_rt as rt
from reference_rt import transform
from reference_rt.shapes import Shapes
from reference_rt.shapes.shape import FloatArray, IntArray

U = 2.0**-53
"""The unit roundoff: one operation is off by at most this, relatively."""

SCENES = Path(__file__).parents[2] / "scenes"


def unit_vectors(rng: np.random.Generator, n: int) -> FloatArray:
    v = rng.normal(size=(n, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


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
    from trimesh.creation import icosphere as make

    mesh = make(subdivisions=subdivisions)
    return np.array(mesh.vertices), np.array(mesh.faces)


EVERYTHING = """\
camera: {type: perspective, eye: [0, 1, 5], target: [0, 0.3, 0], fov: 50}
film: {width: 6, height: 4, filter: {type: gaussian}}
sampler: {type: sobol, spp: 2, seed: 3}
integrator: {type: path, rr_depth: 2}
materials:
  grey: {type: diffuse, reflectance: 0.6}
  glass: {type: dielectric}
  silver: {type: mirror, reflectance: 0.9}
  lamp: {type: emissive, radiance: [5, 4, 3], base: grey}
groups:
  pair: [{type: sphere, radius: 0.2}, {type: box, transform: [{scale: 0.1}]}]
shapes:
  - {type: mesh, file: ball.obj, material: glass}
  - {type: sphere, center: [-1.5, 0, 0], radius: 0.7, material: silver}
  - {type: sphere, center: [1.5, 2, 1], radius: 0.3, material: lamp}
  - type: rectangle
    transform: [{scale: 5}, {rotate: {axis: [1, 0, 0], degrees: -90}}, {translate: [0, -1, 0]}]
  - {type: box, material: lamp, transform: [{scale: 0.2}, {translate: [1, -0.5, 1.5]}]}
  - {type: triangle, v0: [-2, 2, -1], v1: [-1, 2, -1], v2: [-2, 3, -1], material: lamp}
  - {type: disk, material: silver, transform: [{translate: [-3, 1, -2]}]}
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
"""Every kind of shape, material and light; a hierarchy; beside it must lie `ball.obj`."""


def everything(folder: Path) -> Path:
    """A scene file with every feature there is."""
    vertices, faces = icosphere(0)
    write_obj(folder / "ball.obj", vertices, faces)
    (folder / "everything.yaml").write_text(EVERYTHING)
    return folder / "everything.yaml"
