"""F3: rays in closed surfaces find their way out through no edge and no vertex.

Law.  From inside a closed mesh every ray hits, and crosses an odd number of triangles, once more
out than in; from outside it crosses an even number, as often in as out.  From inside other closed
surfaces (boxes, capped cylinders and cones, spheres, tori, solids of set operations) every ray
hits, at their edges and seams too.

Range.  Meshes of radius 1 to 6 (an icosphere, a cube, pbrt's noisy globe, a knot) at offsets of 1
to 1e9, where vertices are rounded, but faces share them; 20 to 81,920 triangles at the origin;
sizes of 1e-70 (smaller meshes are refused: the squares of their areas are no floats) to 1e150,
where products of two coordinates end.

Counts.  Every vertex, every edge's middle, random points of edges and random directions: quick some
8,000 rays a point, full 1,000,000, a tenth of them counted triangle by triangle.

Passes.  No leak, no odd count.

Mitsuba gets vertices and rays rounded to float32, as long as float32's spacing there is below 0.1:
the mesh stays closed, the rays' origins inside.  It takes part with Embree's robust flag, without
it, and in an instance, where Mitsuba does not pass the flag on."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

import reference_rt as rt
from comparisons.experiments.stability.harness.core import (
    MITSUBA,
    OURS,
    Draw,
    Family,
    FloatArray,
    Outcome,
    Series,
    Shot,
    Sweep,
    decades,
    outcome,
    together,
)
from comparisons.experiments.stability.harness.meshes import (
    AWAY,
    Closed,
    ball,
    cube,
    from_inside,
    knot,
    mitsuba_mesh,
    noisy,
    write,
)
from comparisons.experiments.stability.harness.steps import any_turn, at, traced
from comparisons.geometry.affine import unit_vectors
from comparisons.geometry.exact.dyadic import BoolArray
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.scene import for_rays
from reference_rt import textbook
from reference_rt.core import transform
from reference_rt.core.arrays import IntArray
from reference_rt.core.ray import Ray
from reference_rt.core.vec3 import row
from reference_rt.jit.kernel import entry_kernel
from reference_rt.rendering import query
from reference_rt.shapes.meshes import triangle
from reference_rt.shapes.meshes.triangle import Triangles
from reference_rt.shapes.meshes.watertight import shear_of

# Rays in a closed mesh: ours counted by triangles, Mitsuba in three ways, textbook methods.


Tracer = Callable[[FloatArray, FloatArray], BoolArray]

NOT_ROBUST, INSTANCED = "mitsuba, not robust", "mitsuba, instanced"

COARSEST = 0.1
"""The spacing of float32 beyond which a mesh of radius 1 to 6 is deformed too much."""


@entry_kernel
def _count(
    triangles: Triangles, o: FloatArray, d: FloatArray, crossings: IntArray, balance: IntArray
) -> None:
    for i in range(len(o)):
        shear = shear_of(Ray(row(o, i), row(d, i), np.inf))
        for k in range(len(triangles.face)):
            if triangle.intersect(triangles, k, shear).t < np.inf:
                crossings[i] += 1
                balance[i] += triangle.enters(triangles, k, shear)


def crossings(tables: Any, o: FloatArray, d: FloatArray) -> tuple[IntArray, IntArray]:
    """How many triangles of a scene each ray crosses, each tested by itself, and how many more
    times it goes in than out."""
    number, balance = np.zeros((2, len(o)), np.int64)
    with np.errstate(all="ignore"):
        _count(tables.geometry.shapes.triangles, o, d, number, balance)
    return number, balance


def fits(coordinates: FloatArray) -> bool:
    """Whether float32 resolves coordinates of this size to COARSEST."""
    return bool(np.spacing(np.float32(np.abs(coordinates).max())) < COARSEST)


def mitsubas(mesh: Closed) -> dict[str, Tracer]:
    """Whether rays hit a mesh whose vertices are rounded to float32: with Embree's robust flag, as
    the translation has it, without, and in a group, which ignores it."""
    mi = mitsuba()

    def scene(is_robust: bool, **shapes: Any) -> Any:
        flags = {"type": "scene", "embree_use_robust_intersections": is_robust}
        return mi.load_dict({**flags, **shapes}, optimize=False)

    def made() -> Any:
        return mitsuba_mesh(mesh.vertices, mesh.faces)

    group = {"type": "shapegroup", "member": made()}
    copy = {"type": "instance", "group": {"type": "ref", "id": "group"}}
    return {
        MITSUBA: _tracer(mi, scene(True, mesh=made())),
        NOT_ROBUST: _tracer(mi, scene(False, mesh=made())),
        INSTANCED: _tracer(mi, scene(True, group=group, copy=copy)),
    }


def _tracer(mi: Any, scene: Any) -> Tracer:
    def hits(origin: Any, direction: Any) -> tuple[Any, ...]:
        return (scene.ray_intersect_preliminary(mi.Ray3f(mi.Point3f(origin), direction)).t,)

    def trace(o: FloatArray, d: FloatArray) -> BoolArray:
        (t,) = for_rays(hits, o, d)
        return np.asarray(np.isfinite(t))

    return trace


def by_method(name: str, mesh: Closed) -> Tracer:
    """One of the textbook's tests of a triangle, of all of a mesh's."""

    def trace(o: FloatArray, d: FloatArray) -> BoolArray:
        met = np.zeros(len(o), np.bool_)
        for corners in mesh.vertices[mesh.faces]:
            t = textbook.intersect(name, textbook.TriangleParameters(*corners), o, d)
            met |= np.isfinite(t)
        return met

    return trace


# ---- a closed mesh from inside, under a bright sky: leaks are white ------------------------------


SQUARES, PIXELS = 8, 193
"""A face has so many squares, and a picture so many pixels: every 24th row runs along edges."""

TURN = np.linalg.qr(np.array([[3.0, 1.0, 4.0], [1.0, 5.0, 9.0], [2.0, 6.0, 5.0]]))[0]
"""The room's: along the axes all numbers would be round, and nothing would leak."""


def room() -> Closed:
    """The cube that is seen: its edges, and the squares' diagonals, run through pixels' middles."""
    straight = cube(SQUARES)
    return Closed("room", straight.vertices @ TURN.T, straight.faces, straight.insides)


def view() -> tuple[FloatArray, FloatArray]:
    """Rays (n, 3) from a point inside, evenly over one face."""
    at = np.arange(PIXELS) / (0.5 * (PIXELS - 1)) - 1.0
    y, x = np.meshgrid(-at, at, indexing="ij")
    seen = np.stack([x.ravel(), y.ravel(), -np.ones(x.size)], axis=1)
    o = np.tile([0.137, -0.219, 0.083], (len(seen), 1))
    return o @ TURN.T, (seen - o) @ TURN.T


def shot(contestant: str, _x: float) -> Shot:
    """The walls grey by their squares, the sky white: no pixel may be."""
    mesh = room()
    o, d = view()
    if contestant == OURS:
        number, _ = crossings(_tables(mesh), o, d)
        hit = number > 0
    elif contestant.startswith("mitsuba"):
        hit = mitsubas(mesh)[contestant](o, d)
    else:
        hit = by_method(contestant, mesh)(o, d)
    seen = (o + d) @ TURN
    chequered = np.floor((seen[:, :2] + 1.0 + 1e-9) * 0.5 * SQUARES).sum(axis=1) % 2.0
    grey = np.where(hit, np.where(chequered == 0.0, 40, 64), 255)
    pixels = np.repeat(grey.reshape(PIXELS, PIXELS, 1), 3, axis=2).astype(np.uint8)
    return Shot(pixels, f"A closed cube from inside: {int((~hit).sum())} pixels see the sky.")


def _tables(mesh: Closed) -> rt.SceneTables:
    corners = mesh.vertices[mesh.faces].tolist()
    return rt.build_tables(
        rt.Scene(shapes=tuple(rt.Triangle(v0=a, v1=b, v2=c) for a, b, c in corners))
    )


# ---- closed surfaces that are no meshes: where their parts meet ----------------------------------


APART = 10.0
"""Between the middles of neighbours, none of which is larger than 2."""


@dataclass(frozen=True)
class Seamed:
    """make(steps): the shape under a transform;  insides (k, 3): rays start within 0.05 of these;
    seams(rng, n): points (n, 3) of edges;  translated: whether Mitsuba has it as it is."""

    make: Callable[[tuple[transform.Step, ...]], Any]
    insides: FloatArray
    seams: Callable[[np.random.Generator, int], FloatArray]
    translated: bool = False


def _circle(rng: np.random.Generator, n: int, radius: float, z: FloatArray) -> FloatArray:
    phi = rng.uniform(0.0, 2.0 * np.pi, n)
    return np.stack([radius * np.cos(phi), radius * np.sin(phi), rng.choice(z, n)], axis=1)


def _box_edges(rng: np.random.Generator, n: int) -> FloatArray:
    """Corners among them."""
    p = rng.choice([-1.0, 1.0], (n, 3))
    free = rng.integers(0, 4, n)
    some = free < 3
    p[np.flatnonzero(some), free[some]] = rng.uniform(-1.0, 1.0, int(some.sum()))
    return p


def _sphere_on_box(radius: float) -> Callable[[np.random.Generator, int], FloatArray]:
    """The circles in which a sphere cuts the faces of the box."""

    def seams(rng: np.random.Generator, n: int) -> FloatArray:
        p = _circle(rng, n, np.sqrt(radius**2 - 1.0), np.array([-1.0, 1.0]))
        turn = np.array([[0, 1, 2], [1, 2, 0], [2, 0, 1]])[rng.integers(0, 3, n)]
        return np.take_along_axis(p, turn, axis=1)

    return seams


_RING = np.array([[np.cos(a), np.sin(a), 0.0] for a in np.linspace(0.0, 6.0, 7)])
_CORNERS = 0.9 * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
_MIDDLE = np.zeros((1, 3))
_UP = np.array([[0.0, 0.0, 1.0]])

KINDS: dict[str, Seamed] = {
    "box": Seamed(lambda t: rt.Box(transform=t), _MIDDLE, _box_edges, translated=True),
    "sphere": Seamed(
        lambda t: rt.Sphere(transform=t), _MIDDLE, lambda rng, n: unit_vectors(rng, n)
    ),
    "cylinder": Seamed(
        lambda t: rt.Cylinder(transform=t),
        0.5 * _UP,
        lambda rng, n: _circle(rng, n, 1.0, np.array([0.0, 1.0])),
        translated=True,
    ),
    "cone": Seamed(
        lambda t: rt.Cone(transform=t),
        0.3 * _UP,
        lambda rng, n: np.where(
            rng.uniform(size=(n, 1)) < 0.1, [0.0, 0.0, 1.0], _circle(rng, n, 1.0, np.zeros(1))
        ),
    ),
    "torus": Seamed(
        lambda t: rt.Torus(major_radius=1.0, minor_radius=0.4, transform=t),
        _RING,
        lambda rng, n: _circle(rng, n, 1.0, np.array([-0.4, 0.4])),
    ),
    "union": Seamed(
        lambda t: rt.Union(of=(rt.Sphere(), rt.Sphere(center=(0.0, 0.0, 1.0))), transform=t),
        0.5 * _UP,
        lambda rng, n: _circle(rng, n, np.sqrt(0.75), np.array([0.5])),
    ),
    "intersection": Seamed(
        lambda t: rt.Intersection(of=(rt.Box(), rt.Sphere(radius=1.2)), transform=t),
        _MIDDLE,
        _sphere_on_box(1.2),
    ),
    "difference": Seamed(
        lambda t: rt.Difference(of=(rt.Box(), rt.Sphere(radius=1.2)), transform=t),
        _CORNERS,
        _sphere_on_box(1.2),
    ),
}


@dataclass(frozen=True)
class Case:
    """Shapes and rays (n, 3) that start in shape `whose` (n,)."""

    shapes: tuple[Any, ...]
    o: FloatArray
    d: FloatArray
    whose: IntArray


def drawn(rng: np.random.Generator, names: tuple[str, ...], offset: float, n: int) -> Case:
    """n rays of each of these kinds: half in random directions, half at the seams."""
    shapes, origins, directions = [], [], []
    for k, name in enumerate(names):
        kind = KINDS[name]
        middle = offset * AWAY + [APART * k, 0.0, 0.0]
        steps = (any_turn(rng), at(*middle.tolist()))
        shapes.append(kind.make(steps))
        m = transform.affine(steps[:1])[:, :3]
        stray = rng.uniform(-1.0, 1.0, (n, 3)) * 0.05 / np.sqrt(3.0)
        inside = kind.insides[rng.integers(0, len(kind.insides), n)] + stray
        o = inside @ m.T + middle
        half = n // 2
        aimed = kind.seams(rng, half) @ m.T + middle - o[:half]
        origins.append(o)
        directions.append(np.concatenate([aimed, unit_vectors(rng, n - half)]))
    whose = np.repeat(np.arange(len(names)), n)
    return Case(tuple(shapes), np.concatenate(origins), np.concatenate(directions), whose)


def judged(case: Case, hits: Any) -> Outcome:
    """Whether each ray meets the shape that it starts in."""
    shown = {
        "shape": lambda k: case.shapes[case.whose[k]].model_dump_json(exclude_defaults=True),
        "origin": case.o,
        "direction": case.d,
        "expected": "a hit of the shape",
        "found": lambda k: f"shape {hits.shape[k]} at t = {hits.t[k]}",
    }
    return outcome(hits.shape != case.whose, shown)


def measure(draw: Draw, x: float) -> Mapping[str, Outcome]:
    names = tuple(KINDS)
    case = drawn(draw.rng, names, x, draw.cases // len(names))
    tables = rt.build_tables(rt.Scene(shapes=case.shapes, hierarchy="sah"))
    found = {OURS: judged(case, query.intersect(tables, case.o, case.d))}
    if draw.mitsuba and fits(np.abs(case.o)):
        names = tuple(name for name in names if KINDS[name].translated)
        case = drawn(draw.rng, names, x, draw.cases // len(names))
        found[MITSUBA] = judged(case, traced(rt.Scene(shapes=case.shapes), case.o, case.d))
    return found


# ---- the series ----------------------------------------------------------------------------------


COUNTED = 10
"""One in so many rays is counted triangle by triangle, at most TESTS of these in all."""
TESTS = {"quick": 3_000_000, "full": 60_000_000}

BY_METHOD = 100
"""One in so many is put to the textbook's methods, at most MOST: each tests all triangles."""
MOST = 2_000


def _judged(o: FloatArray, d: FloatArray, right: BoolArray, wanted: str, got: Any) -> Outcome:
    """Of rays (n, 3);  got (n,): what came, for the examples."""
    shown = {"origin": o, "direction": d, "expected": wanted, "found": lambda k: str(got[k])}
    return outcome(~right, shown)


def _ours(draw: Draw, mesh: Closed, o: FloatArray, d: FloatArray, scale: float) -> Outcome:
    file = write(mesh.vertices, mesh.faces, draw.folder / "mesh.ply")
    tables = rt.build_tables(rt.Scene(shapes=(rt.Mesh(file=str(file)),), hierarchy="sah"))
    t = query.first_hits(tables, o, d).t
    total = _judged(o, d, np.isfinite(t), "a hit", t)
    few = slice(None, None, max(COUNTED, len(o) * len(mesh.faces) // TESTS[draw.effort]))
    number, balance = crossings(tables, o[few], d[few])
    right = (number % 2 == 1) & (balance == -1)
    total += _judged(o[few], d[few], right, "crossings, one more out than in", number)
    # From outside, at points inside and at edges seen from there.
    at = o[few] + d[few] * draw.rng.choice([0.0, 1.0], (len(o[few]), 1))
    away = 10.0 * scale * unit_vectors(draw.rng, len(at)) + mesh.insides.mean(axis=0)
    number, balance = crossings(tables, away, at - away)
    right = (number % 2 == 0) & (balance == 0)
    return total + _judged(away, at - away, right, "crossings, as many in as out", number)


def _measure(draw: Draw, mesh: Closed, n: int, scale: float, others: bool) -> dict[str, Outcome]:
    o, d = from_inside(draw.rng, mesh, n // 2, scale)
    found = {OURS: _ours(draw, mesh, o, d, scale)}
    if not others:
        return found
    if draw.mitsuba and fits(mesh.vertices):
        for name, trace in mitsubas(mesh).items():
            hit = trace(o, d)
            found[name] = _judged(o, d, hit, "a hit", hit)
    if mesh.name == "noisy globe":
        aimed = slice(n // 2, n // 2 + min(MOST, max(400, len(o) // BY_METHOD)))
        for name in textbook.names("triangle"):
            hit = by_method(name, mesh)(o[aimed], d[aimed])
            found[name] = _judged(o[aimed], d[aimed], hit, "a hit", hit)
    return found


def measure_offset(draw: Draw, x: float) -> Mapping[str, Outcome]:
    meshes = (ball(2), cube(3), noisy(draw.rng), knot())
    return together(
        _measure(draw, mesh.moved(x * AWAY), draw.cases // len(meshes), 1.0, others=True)
        for mesh in meshes
    )


def measure_triangles(draw: Draw, x: float) -> Mapping[str, Outcome]:
    """Vertices are moved along their radii, so that nothing is regular."""
    whole = ball(round(np.log(x / 20.0) / np.log(4.0)))
    noise = 1.0 + 0.3 * draw.rng.uniform(-1.0, 1.0, (len(whole.vertices), 1))
    mesh = Closed("ball", whole.vertices * noise, whole.faces, whole.insides)
    return _measure(draw, mesh, draw.cases, 1.0, others=True)


def measure_size(draw: Draw, x: float) -> Mapping[str, Outcome]:
    return _measure(draw, noisy(draw.rng).moved(np.zeros(3), x), draw.cases, x, others=False)


def measure_smallness(draw: Draw, x: float) -> Mapping[str, Outcome]:
    return measure_size(draw, 1.0 / x)


OFFSETS = (1.0, 1e3, 148376.0, 1e6, 1e9)
CASES = 8_000, 1_000_000
FEWER = 2_000, 100_000

FAMILY = Family(
    id="F3",
    name="watertight surfaces",
    law="from inside every ray hits, and crosses a mesh an odd number of times; from outside even",
    anchors="Embree's test accepts leaks of 2e-5; pbrt's is disabled; embree#188: double hits",
    series=(
        Series(
            "offset",
            Sweep(
                "offset from the origin, of meshes of radius 1 to 6",
                OFFSETS,
                (1.0, 148376.0, 1e9),
                *CASES,
            ),
            "An icosphere, a cube, pbrt's noisy globe and a knot: rays at every vertex, every"
            " edge's middle, points of edges, and anywhere.  Mitsuba as long as float32 can.",
            measure_offset,
            explained="Mitsuba is asked as long as float32 tells the meshes' vertices apart, up to"
            " 1.5e5; there Embree's robust test still lets none of 11,800 rays through",
            shoot=shot,
        ),
        Series(
            "triangles",
            Sweep(
                "triangles of the mesh",
                tuple(20.0 * 4.0**k for k in range(7)),
                (20.0, 20.0 * 4.0**4),
                *CASES,
            ),
            "An icosphere of radius 2, each vertex moved along its radius by up to 30 %.",
            measure_triangles,
            explained="the range ends at 81,920 triangles, ours does not; Embree's robust test"
            " leaks at vertices (of rays aimed at them 0.5 % with 5,120 triangles, 1.3 % with"
            " 20,480), not elsewhere",
        ),
        Series(
            "seams",
            Sweep(
                "offset from the origin, of shapes of radius 1 to 2",
                OFFSETS,
                (1.0, 148376.0, 1e9),
                *CASES,
            ),
            "Boxes, spheres, capped cylinders and cones, tori and solids, turned: rays from"
            " inside at their edges and seams, and anywhere.  Mitsuba: boxes and cylinders.",
            measure,
        ),
        Series(
            "smallness",
            Sweep("1 / size", decades(0, 70, 10), (1.0, 1e70), *FEWER),
            "pbrt's noisy globe, ever smaller.",
            measure_smallness,
        ),
        Series(
            "size",
            Sweep("size", decades(0, 160, 10), (1.0, 1e150), *FEWER),
            "pbrt's noisy globe, ever larger.",
            measure_size,
            holds_to=1e150,
            law="16 (6 size)^2 < 2^1024: products of two coordinates are finite",
        ),
    ),
)
