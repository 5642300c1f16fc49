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
Embree's hierarchy.

`scenes` draws scenes and rays; `compared` compares hierarchies."""

from collections.abc import Mapping

import numpy as np

import reference_rt as rt
from comparisons.experiments.stability.harness.outcomes import OURS, FloatArray, Outcomes
from comparisons.experiments.stability.harness.series import (
    Draw,
    Effort,
    Family,
    Sweep,
    decades,
    series,
)
from comparisons.experiments.stability.hierarchy import scenes
from comparisons.experiments.stability.hierarchy.compared import compare, compare_all

FAMILY = Family(
    "F5",
    "hierarchies",
    "the same shape, face and bits of t as testing every primitive; any-hit agrees",
    "Embree's verify builds hierarchies of degenerate input, and does not compare hits",
)

SINGLY = 2_000
"""Primitives up to which each is tested by itself."""

TESTS: Mapping[Effort, float] = {"quick": 2e6, "full": 2e7}
"""Most single tests of a sweep point, some 15 ns each; eight at once ten times as many."""

CASES = 4_000, 1_000_000


def _rays(draw: Draw, primitives: int) -> int:
    """How many rays a sweep point can afford."""
    most = TESTS[draw.effort] * (1.0 if primitives <= SINGLY else 10.0) / primitives
    return int(min(draw.cases, max(most, 500.0)))


def _of(draw: Draw, corners: FloatArray, o: FloatArray, d: FloatArray) -> Outcomes:
    scene = rt.Scene(shapes=(scenes.soup(corners, draw.folder / "soup.ply"),))
    return {OURS: compare(scene, o, d, singly=len(corners) <= SINGLY)}


@series(Sweep("triangles", decades(0, 6), (1.0, 100.0, 1e4), *CASES))
def primitives(draw: Draw, x: float) -> Outcomes:
    """Triangles strewn in a cube, some on a lattice; rays also in the planes of boxes and from
    vertices."""
    corners = scenes.strewn(draw.rng, int(x))
    o, d = scenes.hard_rays(draw.rng, corners.reshape(-1, 3), _rays(draw, int(x)))
    return _of(draw, corners, o, d)


@series(Sweep("copies of each of three triangles", decades(0, 4), (1.0, 100.0), *CASES))
def copies(draw: Draw, x: float) -> Outcomes:
    """All in one place, two of the three in one plane."""
    three = np.array(
        [
            [[-1.0, -1.0, 0.0], [3.0, -1.0, 0.0], [-1.0, 3.0, 0.0]],
            [[-2.0, -1.0, 0.0], [1.0, -1.0, 0.0], [-1.0, 3.0, 0.0]],
            draw.rng.uniform(-1.0, 1.0, (3, 3)),
        ]
    )
    corners = np.repeat(three, int(x), axis=0)
    # In one place they are all tested whatever leads to them: by four hierarchies, not by one.
    o, d = scenes.hard_rays(draw.rng, three.reshape(-1, 3), _rays(draw, 4 * len(corners)))
    return _of(draw, corners, o, d)


@series(Sweep("length / height", decades(0, 15, 3), (1.0, 1e9, 1e15), *CASES))
def slivers(draw: Draw, x: float) -> Outcomes:
    """A bundle of slivers along one line and strips of one plane; rays in their planes, and up to
    1e-8 out of them."""
    corners = scenes.slivers(draw.rng, x, 400)
    o, d = scenes.grazing_rays(draw.rng, corners, _rays(draw, len(corners)))
    return _of(draw, corners, o, d)


def _assorted(draw: Draw, scale: float, at: FloatArray) -> Outcomes:
    count = 150
    shapes = scenes.assorted(draw.rng, count, scale, at)
    points = at + scale * draw.rng.uniform(-10.0, 10.0, (1000, 3))
    o, d = scenes.hard_rays(draw.rng, points, _rays(draw, count))
    return {OURS: compare(rt.Scene(shapes=shapes), o, d, singly=True)}


@series(
    Sweep("offset from the origin, of shapes of size 1", decades(0, 15, 3), (1.0, 1e12), *CASES)
)
def offset(draw: Draw, x: float) -> Outcomes:
    """Assorted shapes within 10 of a point far away."""
    return _assorted(draw, 1.0, x * np.array([1.0, -0.7, 0.3]))


@series(Sweep("size", decades(0, 300, 50), (1.0, 1e50, 1e300), *CASES))
def size(draw: Draw, x: float) -> Outcomes:
    """Assorted shapes, ever larger."""
    return _assorted(draw, x, np.zeros(3))


@series(Sweep("1 / size", decades(0, 70, 35), (1.0, 1e70), *CASES))
def smallness(draw: Draw, x: float) -> Outcomes:
    """Assorted shapes, ever smaller."""
    return _assorted(draw, 1.0 / x, np.zeros(3))


@series(Sweep("", (1.0,), (), *CASES))
def everything(draw: Draw, _x: float) -> Outcomes:
    """Shapes of every kind, groups and solids, a third of them on a lattice; half of the rays at
    lattice points, along axes and diagonals."""
    scene = scenes.everything(draw.rng, draw.folder)
    return {OURS: compare_all(scene, *scenes.lattice_rays(draw.rng, draw.cases))}
