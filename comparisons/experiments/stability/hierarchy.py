"""F5: every hierarchy finds what testing every primitive finds.

Law.  The same shape, the same face, the same bits of t and of the coordinates there, whichever of
the four hierarchies (sah, median, spatial, none) is traversed; and the any-hit query says that
something is there before infinity and just beyond t, and nothing before t.

Range.  1 to 1e6 triangles, a third of them on a lattice; 1 to 1e4 copies in one place; slivers of
aspect 1 to 1e15, with rays in their planes; assorted shapes at offsets of 1 to 1e15 and of sizes of
1e-70 to 1e300 (spheres and triangles alone from 1e80 on, where the others are refused; from 1e160
on nothing is hit); and a scene with everything, which the quick run leaves out, as its kernels take
half a minute to compile.  Rays: anywhere, through vertices, along axes and diagonals with both
zeros in the planes of boxes, from vertices.

Counts.  Quick 4,000 rays, full 1,000,000, fewer where rays times primitives exceed 2e7, eight at
once 2e8.  Each ray is a case for each hierarchy.

Passes.  No difference.

Above 2,000 primitives "none" stands for all of them: it tests every triangle, eight at once, and is
itself compared with single tests below that.  Mitsuba does not take part: it cannot trace without
Embree's hierarchy."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

import reference_rt as rt
from comparisons.experiments.relations import HIERARCHIES
from comparisons.experiments.stability.harness.core import (
    OURS,
    Draw,
    Effort,
    Family,
    FloatArray,
    Outcome,
    Series,
    Sweep,
    decades,
    outcome,
)
from comparisons.experiments.stability.harness.meshes import cube, write
from comparisons.experiments.stability.harness.steps import any_turn, at, scaled
from comparisons.geometry.affine import unit_vectors
from comparisons.geometry.exact.dyadic import BoolArray
from reference_rt import shapes as any_shape
from reference_rt.core import transform
from reference_rt.core.arrays import IntArray
from reference_rt.core.ray import Hit, is_representable
from reference_rt.core.ray import at as point_at
from reference_rt.core.ray import scaled as scaled_ray
from reference_rt.core.vec3 import row
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.jit.kernel import entry_kernel, kernel
from reference_rt.rendering import query
from reference_rt.rendering.query import Closest
from reference_rt.shapes import Shapes
from reference_rt.shapes.meshes.watertight import shear_of

# ---- scenes and rays that hierarchies find hard --------------------------------------------------


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
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
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


# ---- tests every primitive for every ray; hierarchies must agree with that bit for bit -----------


@kernel
def _comes_first(shapes: Shapes, a: Hit, b: Hit) -> bool:
    """Which of two hits at one t counts: by kind, then by shape, then by face."""
    if a.kind != b.kind:
        return a.kind < b.kind
    of_a, of_b = any_shape.owner(shapes, a.kind, a.row), any_shape.owner(shapes, b.kind, b.row)
    if of_a != of_b:
        return bool(of_a < of_b)
    return bool(any_shape.face(shapes, a) < any_shape.face(shapes, b))


@entry_kernel
def _every(
    shapes: Shapes,
    references: IntArray,
    o: FloatArray,
    d: FloatArray,
    t: FloatArray,
    kinds: IntArray,
    rows: IntArray,
    uv: FloatArray,
) -> None:
    for i in range(len(o)):
        # As all queries do: squares of extreme directions would leave float64's range.
        ray, unit, valid = scaled_ray(row(o, i), row(d, i), np.inf)
        t[i], kinds[i], rows[i], uv[i, 0], uv[i, 1] = np.inf, -1, -1, 0.0, 0.0
        if not valid:
            continue
        shear = shear_of(ray)
        closest = Hit(np.inf, -1, -1, 0.0, 0.0, -1)
        for k in range(len(references)):
            kind: Any = np.int64(references[k, 0])
            number: Any = np.int64(references[k, 1])
            found = any_shape.intersect(shapes, kind, number, ray, shear)
            if found.t < np.inf and found.t <= closest.t:
                hit = Hit(found.t, kind, number, found.u, found.v, -1)
                if found.t < closest.t or _comes_first(shapes, hit, closest):
                    closest = hit
        if closest.kind >= 0 and is_representable(closest.t * unit, point_at(ray, closest.t)):
            t[i], kinds[i], rows[i] = closest.t * unit, closest.kind, closest.row
            uv[i, 0], uv[i, 1] = closest.u, closest.v


def every(tables: SceneTables, o: FloatArray, d: FloatArray) -> Closest:
    """The closest hits, by no hierarchy: of scenes without solids and groups."""
    geometry = tables.geometry
    assert geometry.bvh is not None
    n = len(o)
    found = Closest(np.empty(n), np.empty(n, np.int64), np.empty(n, np.int64), np.empty((n, 2)))
    with np.errstate(all="ignore"):
        _every(
            geometry.shapes,
            geometry.bvh.references.astype(np.int64),
            np.ascontiguousarray(o),
            np.ascontiguousarray(d),
            found.t,
            found.kind,
            found.row,
            found.uv,
        )
    return found


def named(tables: SceneTables, found: Closest) -> FloatArray:
    """(n, 6): t, kind, owner, face, u, v, which are the same whatever order tables have."""
    owner, face = np.full((2, len(found.t)), -1)
    for code, field, _, _ in any_shape.TABLES:
        mine = found.kind == code
        if mine.any():
            table = getattr(tables.geometry.shapes, field)
            owner[mine] = table.owner[np.minimum(found.row[mine], len(table.owner) - 1)]
            face[mine] = table.face[found.row[mine]]
    return np.column_stack([found.t, found.kind, owner, face, found.uv])


def differ(a: FloatArray, b: FloatArray) -> BoolArray:
    """Which rows are not the same bits."""
    return np.asarray((a.view(np.int64) != b.view(np.int64)).any(axis=1))


def any_hit_differs(tables: SceneTables, o: FloatArray, d: FloatArray, t: FloatArray) -> BoolArray:
    """Whether `occluded` does not agree with hits at t: on the whole ray, up to t, and just
    beyond."""
    hit = np.isfinite(t)
    wrong = query.occluded(tables, o, d) != hit
    wrong |= query.occluded(tables, o, d, t) != (t > np.inf)
    wrong |= query.occluded(tables, o, d, np.nextafter(t, np.inf)) != hit
    return np.asarray(wrong)


def compare(scene: rt.Scene, o: FloatArray, d: FloatArray, singly: bool) -> Outcome:
    """All four hierarchies of a scene;  singly: against every primitive by itself, else against
    "none", one leaf with everything, which tests eight triangles at once."""

    def found(tables: SceneTables) -> FloatArray:
        return named(tables, query.closest_primitives(tables, o, d))

    def truth(tables: SceneTables) -> FloatArray:
        return named(tables, every(tables, o, d))

    return _compared(scene, o, d, found, truth if singly else None)


def compare_all(scene: rt.Scene, o: FloatArray, d: FloatArray) -> Outcome:
    """The same of any scene, against "none": everything that is known of a hit."""

    def found(tables: SceneTables) -> FloatArray:
        hits = vars(query.intersect(tables, o, d))
        return np.column_stack([np.asarray(a, np.float64) for a in hits.values()])

    return _compared(scene, o, d, found, None)


Find = Callable[[SceneTables], FloatArray]
"""The hits of rays in a scene as rows (n, k), t first."""


def _compared(
    scene: rt.Scene, o: FloatArray, d: FloatArray, find: Find, truth: Find | None
) -> Outcome:
    """Each ray is a case for each hierarchy.  truth: by default what "none" finds."""
    total = Outcome(0, 0)
    expected = None
    for method in HIERARCHIES:
        tables = rt.build_tables(scene.changed(hierarchy=method))
        got = find(tables)
        if expected is None:
            expected = truth(tables) if truth else got
        wrong = differ(got, expected) | any_hit_differs(tables, o, d, expected[:, 0])
        shown = {"hierarchy": method, "origin": o, "direction": d}
        total += outcome(wrong, shown | {"expected": expected, "found": got})
    return total


# ---- the series ----------------------------------------------------------------------------------


SINGLY = 2_000
"""Primitives up to which each is tested by itself."""

TESTS: Mapping[Effort, float] = {"quick": 2e6, "full": 2e7}
"""Most single tests of a sweep point, some 15 ns each; eight at once ten times as many."""


def rays(draw: Draw, primitives: int) -> int:
    """How many rays a sweep point can afford."""
    most = TESTS[draw.effort] * (1.0 if primitives <= SINGLY else 10.0) / primitives
    return int(min(draw.cases, max(most, 500.0)))


def _of(draw: Draw, corners: FloatArray, o: FloatArray, d: FloatArray) -> Mapping[str, Outcome]:
    scene = rt.Scene(shapes=(soup(corners, draw.folder / "soup.ply"),))
    return {OURS: compare(scene, o, d, singly=len(corners) <= SINGLY)}


def measure_primitives(draw: Draw, x: float) -> Mapping[str, Outcome]:
    corners = strewn(draw.rng, int(x))
    o, d = hard_rays(draw.rng, corners.reshape(-1, 3), rays(draw, int(x)))
    return _of(draw, corners, o, d)


def measure_copies(draw: Draw, x: float) -> Mapping[str, Outcome]:
    """Three triangles, two of which are in one plane and overlap."""
    three = np.array(
        [
            [[-1.0, -1.0, 0.0], [3.0, -1.0, 0.0], [-1.0, 3.0, 0.0]],
            [[-2.0, -1.0, 0.0], [1.0, -1.0, 0.0], [-1.0, 3.0, 0.0]],
            draw.rng.uniform(-1.0, 1.0, (3, 3)),
        ]
    )
    corners = np.repeat(three, int(x), axis=0)
    # In one place they are all tested whatever leads to them: by four hierarchies, not by one.
    o, d = hard_rays(draw.rng, three.reshape(-1, 3), rays(draw, 4 * len(corners)))
    return _of(draw, corners, o, d)


def measure_slivers(draw: Draw, x: float) -> Mapping[str, Outcome]:
    corners = slivers(draw.rng, x, 400)
    o, d = grazing_rays(draw.rng, corners, rays(draw, len(corners)))
    return _of(draw, corners, o, d)


def _assorted(draw: Draw, scale: float, at: FloatArray) -> Mapping[str, Outcome]:
    count = 150
    shapes = assorted(draw.rng, count, scale, at)
    points = at + scale * draw.rng.uniform(-10.0, 10.0, (1000, 3))
    o, d = hard_rays(draw.rng, points, rays(draw, count))
    return {OURS: compare(rt.Scene(shapes=shapes), o, d, singly=True)}


def measure_offset(draw: Draw, x: float) -> Mapping[str, Outcome]:
    return _assorted(draw, 1.0, x * np.array([1.0, -0.7, 0.3]))


def measure_size(draw: Draw, x: float) -> Mapping[str, Outcome]:
    return _assorted(draw, x, np.zeros(3))


def measure_smallness(draw: Draw, x: float) -> Mapping[str, Outcome]:
    return _assorted(draw, 1.0 / x, np.zeros(3))


def measure_everything(draw: Draw, _x: float) -> Mapping[str, Outcome]:
    scene = everything(draw.rng, draw.folder)
    return {OURS: compare_all(scene, *lattice_rays(draw.rng, draw.cases))}


CASES = 4_000, 1_000_000

FAMILY = Family(
    id="F5",
    name="hierarchies",
    law="the same shape, face and bits of t as testing every primitive; any-hit agrees",
    anchors="Embree's verify builds hierarchies of degenerate input, and does not compare hits",
    series=(
        Series(
            "primitives",
            Sweep("triangles", decades(0, 6), (1.0, 100.0, 1e4), *CASES),
            "Triangles strewn in a cube, some on a lattice; rays also in the planes of boxes"
            " and from vertices.",
            measure_primitives,
        ),
        Series(
            "copies",
            Sweep("copies of each of three triangles", decades(0, 4), (1.0, 100.0), *CASES),
            "All in one place, two of the three in one plane.",
            measure_copies,
        ),
        Series(
            "slivers",
            Sweep("length / height", decades(0, 15, 3), (1.0, 1e9, 1e15), *CASES),
            "A bundle of slivers along one line and strips of one plane; rays in their"
            " planes, and up to 1e-8 out of them.",
            measure_slivers,
        ),
        Series(
            "offset",
            Sweep(
                "offset from the origin, of shapes of size 1",
                decades(0, 15, 3),
                (1.0, 1e12),
                *CASES,
            ),
            "Assorted shapes within 10 of a point far away.",
            measure_offset,
        ),
        Series(
            "size",
            Sweep("size", decades(0, 300, 50), (1.0, 1e50, 1e300), *CASES),
            "Assorted shapes, ever larger.",
            measure_size,
        ),
        Series(
            "smallness",
            Sweep("1 / size", decades(0, 70, 35), (1.0, 1e70), *CASES),
            "Assorted shapes, ever smaller.",
            measure_smallness,
        ),
        Series(
            "everything",
            Sweep("", (1.0,), (), *CASES),
            "Shapes of every kind, groups and solids, a third of them on a lattice; half of"
            " the rays at lattice points, along axes and diagonals.",
            measure_everything,
        ),
    ),
)
