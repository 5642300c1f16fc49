"""The series of F5; the folder's docstring states the law."""

from collections.abc import Mapping

import numpy as np

import reference_rt as rt
from comparisons.experiments.stability.harness.core import OURS, Draw, Effort, FloatArray, Outcome
from comparisons.experiments.stability.harness.family import Family, Series, Sweep, decades
from comparisons.experiments.stability.hierarchy import scenes
from comparisons.experiments.stability.hierarchy.every import compare, compare_all

SINGLY = 2_000
"""Primitives up to which each is tested by itself."""

TESTS: Mapping[Effort, float] = {"quick": 2e6, "full": 2e7}
"""Most single tests of a sweep point, some 15 ns each; eight at once ten times as many."""


def rays(draw: Draw, primitives: int) -> int:
    """How many rays a sweep point can afford."""
    most = TESTS[draw.effort] * (1.0 if primitives <= SINGLY else 10.0) / primitives
    return int(min(draw.cases, max(most, 500.0)))


def _of(draw: Draw, corners: FloatArray, o: FloatArray, d: FloatArray) -> Mapping[str, Outcome]:
    scene = rt.Scene(shapes=(scenes.soup(corners, draw.folder / "soup.ply"),))
    return {OURS: compare(scene, o, d, singly=len(corners) <= SINGLY)}


def measure_primitives(draw: Draw, x: float) -> Mapping[str, Outcome]:
    corners = scenes.strewn(draw.rng, int(x))
    o, d = scenes.hard_rays(draw.rng, corners.reshape(-1, 3), rays(draw, int(x)))
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
    o, d = scenes.hard_rays(draw.rng, three.reshape(-1, 3), rays(draw, 4 * len(corners)))
    return _of(draw, corners, o, d)


def measure_slivers(draw: Draw, x: float) -> Mapping[str, Outcome]:
    corners = scenes.slivers(draw.rng, x, 400)
    o, d = scenes.grazing_rays(draw.rng, corners, rays(draw, len(corners)))
    return _of(draw, corners, o, d)


def _assorted(draw: Draw, scale: float, at: FloatArray) -> Mapping[str, Outcome]:
    count = 150
    shapes = scenes.assorted(draw.rng, count, scale, at)
    points = at + scale * draw.rng.uniform(-10.0, 10.0, (1000, 3))
    o, d = scenes.hard_rays(draw.rng, points, rays(draw, count))
    return {OURS: compare(rt.Scene(shapes=shapes), o, d, singly=True)}


def measure_offset(draw: Draw, x: float) -> Mapping[str, Outcome]:
    return _assorted(draw, 1.0, x * np.array([1.0, -0.7, 0.3]))


def measure_size(draw: Draw, x: float) -> Mapping[str, Outcome]:
    return _assorted(draw, x, np.zeros(3))


def measure_smallness(draw: Draw, x: float) -> Mapping[str, Outcome]:
    return _assorted(draw, 1.0 / x, np.zeros(3))


def measure_everything(draw: Draw, _x: float) -> Mapping[str, Outcome]:
    scene = scenes.everything(draw.rng, draw.folder)
    return {OURS: compare_all(scene, *scenes.lattice_rays(draw.rng, draw.cases))}


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
