"""Polygons: many vertices, far away, thin; points level with vertices, and shared edges.

Vertices are p = c + x U + y V with numbers of so few bits that all vertices of a ring lie exactly
in one plane: rounding then has no part in what is inside.
"""

import math
from functools import reduce

import numpy as np

from comparisons.experiments.methods.setting import Draw, Family, Trial, Truth, powers
from comparisons.experiments.methods.vectors import across, unit_rows
from comparisons.geometry.exact import first_of
from comparisons.geometry.exact.dyadic import Dyadic, cross, dot
from comparisons.geometry.exact.flat import polygons
from reference_rt.core.arrays import FloatArray
from reference_rt.textbook import PolygonParameters

SHAPES = 8
"""Of each setting, at random."""

GRID = 2.0**16
"""Of the coordinates x and y, per unit."""

PLANES = np.array(
    [
        [(1.0, 0.25, 0.5), (-0.5, 1.0, 0.75)],
        [(0.75, -1.0, 0.25), (0.5, 0.5, 1.0)],
        [(-0.25, 0.5, 1.0), (1.0, 0.75, 0.25)],
    ]
)
"""Pairs U, V; oblique, so that points of the plane are rounded."""

TEETH = 8
FAN = 6


def exact(polygon: PolygonParameters, o: FloatArray, d: FloatArray) -> Truth:
    """By the winding number in the plane, projected along the normal's largest component."""
    (ring,) = (np.asarray(r, np.float64) for r in polygon.rings)
    normal = _normal(ring)
    axis = int(np.argmax(np.abs(normal)))
    kept = [(axis + 1) % 3, (axis + 2) % 3]
    flat = ring[:, kept] - ring[0, kept]
    row = {
        "center": ring[:1],
        "normal": normal[None],
        "x_of": np.eye(3)[kept[:1]],
        "y_of": np.eye(3)[kept[1:]],
        "outline": np.hstack([flat, np.roll(flat, -1, axis=0)]),
        "first": np.array([0]),
        "size": np.array([len(ring)]),
        "mask": np.array([-1]),
    }
    hit = first_of(polygons(row, Dyadic.of(o), Dyadic.of(d)))
    return Truth(hit.fixed, hit.touching)


def _normal(ring: FloatArray) -> FloatArray:
    """The normal (3,) of a planar ring, as integers without a common factor.  Raises ValueError for
    a ring that is not planar."""
    legs = Dyadic.of(ring) - Dyadic.of(ring[:1])
    # The widest of the triangles at the first vertex; any that has an area would do.
    far = int(np.argmax(np.linalg.norm(ring - ring[0], axis=1)))
    candidates = cross(legs[far : far + 1], legs)
    widest = int(np.argmax(np.abs(candidates.n).max(axis=1)))
    n = [int(x) for x in candidates.n[widest]]
    factor = reduce(math.gcd, n)
    normal = np.array([x // factor for x in n], dtype=np.float64)
    if [int(x) * factor for x in normal] != n or dot(legs, Dyadic.of(normal[None])).sign().any():
        raise ValueError("expected a ring that lies exactly in a plane of few bits")
    return normal


POLYGON = Family("polygon", exact)


def _plane(draw: Draw) -> FloatArray:
    return np.asarray(PLANES[draw.rng.integers(len(PLANES))])


def _gear(draw: Draw, vertices: int) -> FloatArray:
    """Teeth of random height around (0, 0), (n, 2) on the grid."""
    angles = 2.0 * np.pi * (np.arange(vertices) + 0.5) / vertices
    radii = np.where(np.arange(vertices) % 2 == 0, 1.0, draw.rng.uniform(0.4, 0.9, vertices))
    if vertices == 4:
        radii[:] = 1.0
    xy = radii[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return np.asarray(np.rint(xy * GRID) / GRID)


def _rays(draw: Draw, target: FloatArray, plane: FloatArray, distance: float) -> FloatArray:
    """Directions (n, 3) towards targets, within 60 degrees of the normal, of this length."""
    normal = unit_rows(np.cross(*plane))
    n = len(target)
    cosine = draw.rng.uniform(0.5, 1.0, (n, 1))
    side = across(draw.rng, np.broadcast_to(normal, (n, 3)))
    out = cosine * normal + np.sqrt(1.0 - cosine**2) * side
    return np.asarray(-out * distance * draw.rng.uniform(0.8, 1.2, (n, 1)))


def _gears(
    draw: Draw, vertices: int, center: FloatArray, thinness: float = 1.0, distance: float = 3.0
) -> list[Trial]:
    """Rays at points in and around gears, y shrunk by `thinness`, a power of two."""
    trials = []
    for _ in range(SHAPES):
        plane, n = _plane(draw), draw.rays // SHAPES
        plane = plane / np.array([[1.0], [thinness]])
        ring = center + _gear(draw, vertices) @ plane
        target = center + draw.rng.uniform(-1.0, 1.0, (n, 2)) @ plane
        d = _rays(draw, target, plane, distance)
        trials.append(Trial((PolygonParameters([ring]),), target - d, d, 2.0))
    return trials


@POLYGON.sweep("vertices", "vertices", powers(2, 4, 6, 8, 10, base=2.0), extreme=256.0)
def many_vertices(draw: Draw, vertices: float) -> list[Trial]:
    """Gears from three units away, up to 60° from the normal, at points in and around them."""
    return _gears(draw, int(vertices), np.zeros(3))


@POLYGON.sweep("distance", "distance / size", powers(1, 2, 4, 6, 8), extreme=1e4)
def from_afar(draw: Draw, distance: float) -> list[Trial]:
    """A gear of 8 vertices from afar."""
    return _gears(draw, TEETH, np.zeros(3), distance=distance)


@POLYGON.sweep(
    "offset",
    "distance of both from the origin of coordinates",
    powers(0, 7, 13, 20, 27, base=2.0),
    extreme=2.0**13,
)
def moved_away(draw: Draw, offset: float) -> list[Trial]:
    """The same gear: polygon and rays together, translated away from the origin of coordinates."""
    return _gears(draw, TEETH, offset * np.array([1.0, -1.0, 0.5]))


@POLYGON.sweep("aspect", "length / height", powers(0, 7, 13, 20, 27, base=2.0), extreme=2.0**13)
def thin(draw: Draw, thinness: float) -> list[Trial]:
    """The same gear, ever thinner."""
    return _gears(draw, TEETH, np.zeros(3), thinness)


@POLYGON.sweep("level")
def level_with_vertices(draw: Draw, _: float) -> list[Trial]:
    """Lattice polygons seen along their normal; the points have the same y as vertices."""
    # The hit point is exact; vertices lie on the line from it to +x, one after another.
    trials = []
    for _ in range(SHAPES):
        ring = np.rint(_gear(draw, 32) * 16.0)
        # Neighbours that the lattice joins are one vertex.
        ring = ring[np.any(ring != np.roll(ring, 1, axis=0), axis=1)]
        ring = np.hstack([ring, np.zeros((len(ring), 1))])
        o = draw.rng.integers(-17, 18, (draw.rays // SHAPES, 3)).astype(np.float64)
        o[:, 2] = 5.0
        d = np.tile((0.0, 0.0, -1.0), (len(o), 1))
        trials.append(Trial((PolygonParameters([ring]),), o, d, 32.0))
    return trials


@POLYGON.sweep("edges", "distance", powers(0, 2, 4, 6))
def at_edges(draw: Draw, distance: float) -> list[Trial]:
    """6 triangles around a point in one oblique plane; rays at the edges that two of them share.
    Each must hit one: a miss is a leak."""
    trials = []
    for _ in range(SHAPES):
        plane, n = _plane(draw), draw.rays // SHAPES
        rim, apex = _gear(draw, FAN), np.rint(draw.rng.uniform(-0.1, 0.1, 2) * GRID) / GRID
        corners, middle = rim @ plane, apex @ plane
        parts = tuple(
            PolygonParameters([np.stack([middle, corners[k], corners[(k + 1) % FAN]])])
            for k in range(FAN)
        )
        along = draw.rng.uniform(0.05, 0.95, (n, 1))
        target = middle + along * (corners[draw.rng.integers(0, FAN, n)] - middle)
        d = _rays(draw, target, plane, distance)
        trials.append(Trial(parts, target - d, d, 2.0))
    return trials


@POLYGON.sweep("upright edges")
def at_upright_edges(draw: Draw, _: float) -> list[Trial]:
    """The same in the plane z = 0 and along its normal: all neighbours compute the same point."""
    trials = []
    flat = np.eye(2, 3)
    for _shape in range(SHAPES):
        rim, apex = _gear(draw, FAN) @ flat, draw.rng.uniform(-0.1, 0.1, 2) @ flat
        parts = tuple(
            PolygonParameters([np.stack([apex, rim[k], rim[(k + 1) % FAN]])]) for k in range(FAN)
        )
        along = draw.rng.uniform(0.05, 0.95, (draw.rays // SHAPES, 1))
        o = apex + along * (rim[draw.rng.integers(0, FAN, len(along))] - apex) + (0.0, 0.0, 1.0)
        trials.append(Trial(parts, o, np.tile((0.0, 0.0, -1.0), (len(o), 1)), 2.0))
    return trials
