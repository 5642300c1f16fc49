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


def import_everything():
    """Import every module of reference_rt: what a test enumerates then does not depend on which
    others have run."""
    for module in pkgutil.walk_packages(rt.__path__, "reference_rt."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
