"""Scenes and rays that hierarchies find hard."""

from pathlib import Path
from typing import Any

import numpy as np

import reference_rt as rt
from comparisons.experiments.stability.harness.meshes import cube, write
from comparisons.experiments.stability.harness.outcomes import FloatArray
from comparisons.experiments.stability.harness.steps import any_turn, at, orthogonal, scaled
from comparisons.geometry.affine import unit_vectors
from reference_rt.core import transform


def soup(corners: FloatArray, file: Path) -> rt.Mesh:
    """Triangles (n, 3, 3), each by itself."""
    n = len(corners)
    write(corners.reshape(-1, 3), np.arange(3 * n).reshape(n, 3), file)
    return rt.Mesh(file=str(file))


def strewn(rng: np.random.Generator, n: int) -> FloatArray:
    """Triangles (n, 3, 3) in the cube [-1, 1]^3, as large as leaves some space between them; a
    third of the vertices on a lattice, so that boxes are flat and planes coincide."""
    size = 2.0 / np.cbrt(n)
    corners: FloatArray = rng.uniform(-1.0, 1.0, (n, 1, 3)) + size * rng.uniform(
        -0.5, 0.5, (n, 3, 3)
    )
    regular = rng.uniform(size=n) < 0.3
    corners[regular] = np.round(corners[regular] * 4.0 / size) * size / 4.0
    # Rounding makes points and lines of some, which meshes leave out: one at least must stay.
    corners[0] = rng.uniform(-1.0, 1.0, (3, 3))
    return corners


def hard_rays(
    rng: np.random.Generator, points: FloatArray, n: int
) -> tuple[FloatArray, FloatArray]:
    """n rays among points (m, 3): a quarter anywhere; a quarter through a point, from another; a
    quarter along axes and diagonals with +0 and -0, starting level with a point, so that they run
    in the planes of boxes; a quarter from a point itself, along an axis or anywhere."""
    low, high = points.min(axis=0), points.max(axis=0)
    middle, half = (
        0.5 * low + 0.5 * high,
        np.maximum(0.5 * high - 0.5 * low, 1e-3 * np.abs(high).max()),
    )
    o = middle + 1.5 * half * rng.uniform(-1.0, 1.0, (n, 3))
    d = unit_vectors(rng, n)
    what = rng.integers(0, 4, n)
    at, other = points[rng.integers(0, len(points), (2, n))]
    straight = rng.choice([-1.0, -0.0, 0.0, 0.0, 1.0], (n, 3))
    straight[~straight.any(axis=1)] = (1.0, 0.0, -0.0)
    through, level, on = what == 1, what == 2, what == 3
    apart = (at != other).any(axis=1)
    o[through] = other[through]
    d[through & apart] = (at - other)[through & apart]
    o[level] = (at - 2.0 * half.max() * straight)[level]
    d[level] = straight[level]
    o[on] = at[on]
    some = on & (rng.uniform(size=n) < 0.5)
    d[some] = straight[some]
    return o, d


MOST_FLAT = 1e70
"""Larger rectangles, disks and boxes are refused: the squares of their areas are no floats."""


def assorted(rng: np.random.Generator, n: int, scale: float, middle: FloatArray) -> tuple[Any, ...]:
    """n spheres, triangles, boxes, rectangles and disks, as long as these are accepted, within 10
    of a point, all times scale."""
    shapes: list[Any] = []
    for k in range(n):
        x, y, z = (middle + scale * rng.uniform(-10.0, 10.0, 3)).tolist()
        size = scale * float(rng.uniform(0.3, 1.5))
        turn = any_turn(rng)
        # Some stay along the axes, where boxes are flat.
        steps: tuple[transform.Step, ...] = (
            scaled(size),
            *(() if k % 3 == 0 else (turn,)),
            at(x, y, z),
        )
        corners = np.array([x, y, z]) + size * rng.uniform(-1.0, 1.0, (3, 3))
        a, b, c = (tuple(v) for v in corners.tolist())
        shapes.append(
            (
                lambda x=x, y=y, z=z, size=size: rt.Sphere(center=(x, y, z), radius=size),
                lambda a=a, b=b, c=c: rt.Triangle(v0=a, v1=b, v2=c),
                lambda steps=steps: rt.Box(transform=steps),
                lambda steps=steps: rt.Rectangle(transform=steps),
                lambda steps=steps: rt.Disk(transform=steps),
            )[k % (5 if scale <= MOST_FLAT else 2)]()
        )
    return tuple(shapes)


def slivers(rng: np.random.Generator, aspect: float, n: int) -> FloatArray:
    """Triangles (n, 3, 3): half of a bundle along one line, half of a plane cut into strips."""
    line = unit_vectors(rng, 1)[0]
    ends = np.sort(rng.uniform(-1.0, 1.0, (n // 2, 3)), axis=1)
    bundle = ends[..., None] * line + unit_vectors(rng, 3 * (n // 2)).reshape(-1, 3, 3) / aspect
    turn = orthogonal(rng)
    strips = n - n // 2
    y = np.sort(rng.uniform(-1.0, 1.0, strips)) / np.sqrt(aspect)
    flat = np.zeros((strips, 3, 3))
    flat[..., 0] = np.sort(rng.uniform(-1.0, 1.0, (strips, 3)), axis=1)
    flat[..., 1] = y[:, None] + rng.uniform(-1.0, 1.0, (strips, 3)) / aspect
    return np.concatenate([bundle, flat @ turn.T])


def grazing_rays(
    rng: np.random.Generator, corners: FloatArray, n: int
) -> tuple[FloatArray, FloatArray]:
    """In the triangles' planes, but for rounding and up to 1e-8 of tilt: from point to point of a
    triangle, started before it."""
    which = corners[rng.integers(0, len(corners), n)]
    a, b = (np.einsum("nk,nkj->nj", rng.dirichlet((1.0, 1.0, 1.0), n), which) for _ in range(2))
    d = b - a
    tilt = 10.0 ** rng.uniform(-18.0, -8.0, (n, 1)) * (rng.uniform(size=(n, 1)) < 0.7)
    d = d + tilt * unit_vectors(rng, n)
    d[~d.any(axis=1)] = (0.0, 0.0, 1.0)
    return a - d * rng.uniform(0.0, 3.0, (n, 1)), d


def everything(rng: np.random.Generator, folder: Path) -> rt.Scene:
    """Shapes of every kind, groups and solids: two in three turned and stretched, the others on a
    lattice, where faces and edges coincide; some the same twice."""
    block = cube(3)
    file = str(write(block.vertices, block.faces, folder / "cube.ply"))
    star = tuple((np.sin(4 * np.pi * k / 5), np.cos(4 * np.pi * k / 5), 0.0) for k in range(5))
    made = (
        lambda t: rt.Sphere(transform=t),
        lambda t: rt.Rectangle(transform=t),
        lambda t: rt.Box(transform=t),
        lambda t: rt.Triangle(v0=(0, 0, 0), v1=(1, 0, 0), v2=(0, 1, 0), transform=t),
        lambda t: rt.Mesh(file=file, transform=t),
        lambda t: rt.Disk(transform=t),
        lambda t: rt.Polygon(rings=(star,), transform=t),
        lambda t: rt.Cylinder(capped=False, transform=t),
        lambda t: rt.Cone(transform=t),
        lambda t: rt.Torus(transform=t),
        lambda t: rt.Difference(of=(rt.Box(), rt.Sphere(radius=1.2)), transform=t),
        lambda t: rt.Instance(group="pair", transform=t),
        lambda t: rt.Plane(transform=t),
    )
    shapes: list[Any] = []
    for k in range(200):
        make = made[k % (len(made) if k < 2 * len(made) else len(made) - 1)]
        a, b, c = (0.25 * rng.uniform(0.5, 2.0, 3)).tolist()
        x, y, z = rng.uniform(-3.0, 3.0, 3).tolist()
        turn = any_turn(rng)
        steps: tuple[transform.Step, ...] = (scaled(a, b, c), turn, at(x, y, z))
        if k % 3 == 0:
            steps = (scaled(0.5), at(round(x), round(y), round(z)))
        shapes += [make(steps)] * (2 if k % 20 == 0 else 1)
    groups: dict[str, Any] = {"pair": (rt.Box(), rt.Sphere(center=(0.0, 0.0, 1.5), radius=0.5))}
    return rt.Scene(shapes=tuple(shapes), groups=groups)


def lattice_rays(rng: np.random.Generator, n: int) -> tuple[FloatArray, FloatArray]:
    """Half of them at lattice points, along axes and diagonals of it."""
    o, d = rng.uniform(-5.0, 5.0, (n, 3)), rng.normal(size=(n, 3))
    half = slice(0, n, 2)
    o[half], d[half] = np.round(2.0 * o[half]) / 2.0, np.round(d[half])
    d[~d.any(axis=1)] = (1.0, 0.0, -0.0)
    return o, d
