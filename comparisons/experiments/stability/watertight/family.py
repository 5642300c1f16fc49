"""F3, watertight: rays in closed surfaces find their way out through no edge and no vertex.

Law: from inside a closed mesh every ray hits, and crosses an odd number of triangles, once more out
than in; from outside it crosses an even number, as often in as out.  From inside other closed
surfaces (boxes, capped cylinders and cones, spheres, tori, solids of set operations) every ray
hits, at their edges and seams too.

Range: meshes of radius 1 to 6 (an icosphere, a cube, pbrt's noisy globe, a knot) at offsets of 1 to
1e9, where vertices are rounded, but faces share them; 20 to 81,920 triangles at the origin; sizes
of 1e-70 (smaller meshes are refused: the squares of their areas are no floats) to 1e150, where
products of two coordinates end.  Counts: every vertex,
every edge's middle, random points of edges and random directions: quick some 8,000 rays a setting,
full 1,000,000, a tenth of them counted triangle by triangle.  Passes: no leak, no odd count.

Mitsuba gets vertices and rays rounded to float32, as long as float32's spacing there is below 0.1:
the mesh stays closed, the rays' origins inside.  It takes part with Embree's robust flag, without
it, and in an instance, where Mitsuba does not pass the flag on.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

import reference_rt as rt
from comparisons.experiments.methods.setting import unit_vectors
from comparisons.experiments.stability.harness.family import (
    EXAMPLES,
    OURS,
    Draw,
    Effort,
    Family,
    FloatArray,
    Outcome,
    Series,
    decades,
)
from comparisons.experiments.stability.harness.meshes import (
    AWAY,
    Closed,
    ball,
    cube,
    from_inside,
    knot,
    noisy,
    write,
)
from comparisons.experiments.stability.watertight import seams
from comparisons.experiments.stability.watertight.shots import shot
from comparisons.experiments.stability.watertight.tracers import (
    BoolArray,
    by_method,
    crossings,
    fits,
    mitsubas,
)
from reference_rt import textbook
from reference_rt.rendering import query

COUNTED = 10
"""One in so many rays is counted triangle by triangle, at most TESTS of these in all."""
TESTS = {"quick": 3_000_000, "full": 60_000_000}

BY_METHOD = 100
"""One in so many is put to the text-book's methods, at most MOST: each tests all triangles."""
MOST = 2_000


def outcome(o: FloatArray, d: FloatArray, right: BoolArray, wanted: str, got: Any) -> Outcome:
    """Of rays (n, 3);  got (n,): what came, for the examples."""
    wrong = np.flatnonzero(~right)
    return Outcome(
        cases=len(right),
        failures=len(wrong),
        examples=tuple(
            {
                "origin": [x.hex() for x in o[k].tolist()],
                "direction": [x.hex() for x in d[k].tolist()],
                "expected": wanted,
                "found": str(got[k]),
            }
            for k in wrong[:EXAMPLES].tolist()
        ),
    )


def _ours(draw: Draw, mesh: Closed, o: FloatArray, d: FloatArray, scale: float) -> Outcome:
    file = write(mesh.vertices, mesh.faces, draw.folder / "mesh.ply")
    tables = rt.build_tables(rt.Scene(shapes=(rt.Mesh(file=str(file)),), hierarchy="sah"))
    t = query.first_hits(tables, o, d).t
    total = outcome(o, d, np.isfinite(t), "a hit", t)
    few = slice(None, None, max(COUNTED, len(o) * len(mesh.faces) // TESTS[draw.effort]))
    number, balance = crossings(tables, o[few], d[few])
    right = (number % 2 == 1) & (balance == -1)
    total += outcome(o[few], d[few], right, "crossings, one more out than in", number)
    # From outside, at points inside and at edges seen from there.
    at = o[few] + d[few] * draw.rng.choice([0.0, 1.0], (len(o[few]), 1))
    away = 10.0 * scale * unit_vectors(draw.rng, len(at)) + mesh.insides.mean(axis=0)
    number, balance = crossings(tables, away, at - away)
    right = (number % 2 == 0) & (balance == 0)
    return total + outcome(away, at - away, right, "crossings, as many in as out", number)


def _measure(draw: Draw, mesh: Closed, n: int, scale: float, others: bool) -> dict[str, Outcome]:
    o, d = from_inside(draw.rng, mesh, n // 2, scale)
    found = {OURS: _ours(draw, mesh, o, d, scale)}
    if not others:
        return found
    if draw.mitsuba and fits(mesh.vertices):
        for name, trace in mitsubas(mesh).items():
            hit = trace(o, d)
            found[name] = outcome(o, d, hit, "a hit", hit)
    if mesh.name == "noisy globe":
        aimed = slice(n // 2, n // 2 + min(MOST, max(400, len(o) // BY_METHOD)))
        for name in textbook.names("triangle"):
            hit = by_method(name, mesh)(o[aimed], d[aimed])
            found[name] = outcome(o[aimed], d[aimed], hit, "a hit", hit)
    return found


def _merged(total: dict[str, Outcome], more: Mapping[str, Outcome]) -> None:
    for name, one in more.items():
        total[name] = total[name] + one if name in total else one


def measure_offset(draw: Draw, x: float) -> Mapping[str, Outcome]:
    total: dict[str, Outcome] = {}
    meshes = (ball(2), cube(3), noisy(draw.rng), knot())
    for mesh in meshes:
        moved = mesh.moved(x * AWAY)
        _merged(total, _measure(draw, moved, draw.cases // len(meshes), 1.0, others=True))
    return total


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
CASES: Mapping[Effort, int] = {"quick": 8_000, "full": 1_000_000}
FEWER: Mapping[Effort, int] = {"quick": 2_000, "full": 100_000}

FAMILY = Family(
    id="F3",
    name="watertight surfaces",
    law="from inside every ray hits, and crosses a mesh an odd number of times; from outside even",
    anchors="Embree's test accepts leaks of 2e-5; pbrt's is disabled; embree#188: double hits",
    series=(
        Series(
            name="offset",
            axis="offset from the origin, of meshes of radius 1 to 6",
            about="An icosphere, a cube, pbrt's noisy globe and a knot: rays at every vertex, every"
            " edge's middle, points of edges, and anywhere.  Mitsuba as long as float32 can.",
            values=OFFSETS,
            quick=(1.0, 148376.0, 1e9),
            cases=CASES,
            measure=measure_offset,
            explained="Mitsuba is asked as long as float32 tells the meshes' vertices apart, up to"
            " 1.5e5; there Embree's robust test still lets none of 11,800 rays through",
            shoot=shot,
        ),
        Series(
            name="triangles",
            axis="triangles of the mesh",
            about="An icosphere of radius 2, each vertex moved along its radius by up to 30 %.",
            values=tuple(20.0 * 4.0**k for k in range(7)),
            quick=(20.0, 20.0 * 4.0**4),
            cases=CASES,
            measure=measure_triangles,
            explained="the range ends at 81,920 triangles, ours does not; Embree's robust test"
            " leaks at vertices (of rays aimed at them 0.5 % with 5,120 triangles, 1.3 % with"
            " 20,480), not elsewhere",
        ),
        Series(
            name="seams",
            axis="offset from the origin, of shapes of radius 1 to 2",
            about="Boxes, spheres, capped cylinders and cones, tori and solids, turned: rays from"
            " inside at their edges and seams, and anywhere.  Mitsuba: boxes and cylinders.",
            values=OFFSETS,
            quick=(1.0, 148376.0, 1e9),
            cases=CASES,
            measure=seams.measure,
        ),
        Series(
            name="smallness",
            axis="1 / size",
            about="pbrt's noisy globe, ever smaller.",
            values=decades(0, 70, 10),
            quick=(1.0, 1e70),
            cases=FEWER,
            measure=measure_smallness,
        ),
        Series(
            name="size",
            axis="size",
            about="pbrt's noisy globe, ever larger.",
            values=decades(0, 160, 10),
            quick=(1.0, 1e150),
            cases=FEWER,
            measure=measure_size,
            holds_to=1e150,
            law="16 (6 size)^2 < 2^1024: products of two coordinates are finite",
        ),
    ),
)
