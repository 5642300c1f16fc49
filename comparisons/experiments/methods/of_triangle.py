"""Triangles: thin, at grazing angles, far away; shared edges and vertices."""

import numpy as np

from comparisons.experiments.methods.setting import Draw, Family, Trial, Truth, powers
from comparisons.experiments.methods.vectors import across, unit_rows, unit_vectors
from comparisons.geometry.exact import first_hit
from reference_rt.core.arrays import FloatArray
from reference_rt.textbook import TriangleParameters

SHAPES = 16
"""Of each setting, at random."""

FAN = 6
"""Triangles around a vertex."""


def exact(triangle: TriangleParameters, o: FloatArray, d: FloatArray) -> Truth:
    hit = first_hit("triangles", {"vertices": np.concatenate(triangle)[None]}, o, d)
    return Truth(hit.fixed, hit.touching)


TRIANGLE = Family("triangle", exact)


def _size(corners: FloatArray) -> float:
    return float(np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1).max())


def _targets(draw: Draw, v: FloatArray, n: int) -> FloatArray:
    """Points of the triangle's plane, three in four of them inside and off the edges."""
    inside = draw.rng.dirichlet((1.0, 1.0, 1.0), n) * 0.94 + 0.02
    # Beyond the edge across from one vertex, by a tenth to all of the triangle's height.
    beyond = draw.rng.uniform(-1.0, -0.1, n)
    share = draw.rng.uniform(-0.3, 1.3, n)
    outside = np.stack([beyond, (1.0 - beyond) * share, (1.0 - beyond) * (1.0 - share)], axis=1)
    which = draw.rng.uniform(size=(n, 1)) < 0.75
    return np.asarray(np.where(which, inside, outside) @ v)


def _any(rng: np.random.Generator) -> FloatArray:
    """A random triangle (3, 3) that is not thin: near an equilateral one, rotated."""
    x = across(rng, unit_vectors(rng, 1))[0]
    y = across(rng, x[None])[0]
    angles = 2.0 * np.pi / 3.0 * np.arange(3) + rng.uniform(-0.3, 0.3, 3)
    turned = np.cos(angles)[:, None] * x + np.sin(angles)[:, None] * y
    return np.asarray(rng.uniform(-1.0, 1.0, 3) + turned)


def _aimed(draw: Draw, v: FloatArray, distance: float, cosine: float | None = None) -> Trial:
    """Rays from `distance` sizes away, at angles up to 70 degrees from the normal, or all at the
    angle of this cosine."""
    n = draw.rays // SHAPES
    targets, size = _targets(draw, v, n), _size(v)
    normal = unit_rows(np.cross(v[1] - v[0], v[2] - v[0]))
    cosines = draw.rng.uniform(0.35, 1.0, (n, 1)) if cosine is None else np.full((n, 1), cosine)
    cosines *= draw.rng.choice([-1.0, 1.0], (n, 1))
    side = across(draw.rng, np.broadcast_to(normal, (n, 3)))
    out = cosines * normal + np.sqrt(1.0 - cosines**2) * side
    d = -out * draw.rng.uniform(0.8, 1.2, (n, 1)) * distance * size
    return Trial((TriangleParameters(*v),), targets - d, d, size)


@TRIANGLE.sweep("aspect", "length / height", powers(*range(9)), extreme=1e4)
def thin(draw: Draw, aspect: float) -> list[Trial]:
    """Ever thinner triangles from three lengths away, up to 70° from the normal; three rays in four
    at points inside, the others beyond an edge."""
    trials = []
    for _ in range(SHAPES):
        v = _any(draw.rng)
        # The third corner moves towards the edge opposite to it.
        foot = v[0] + draw.rng.uniform(0.2, 0.8) * (v[1] - v[0])
        v[2] = foot + (v[2] - foot) / aspect
        trials.append(_aimed(draw, v, 3.0))
    return trials


@TRIANGLE.sweep("grazing", "1 / cosine", powers(*range(9)), extreme=1e4)
def grazed(draw: Draw, inverse_cosine: float) -> list[Trial]:
    """Triangles that are not thin, all rays at the same angle to the normal."""
    return [_aimed(draw, _any(draw.rng), 3.0, 1.0 / inverse_cosine) for _ in range(SHAPES)]


@TRIANGLE.sweep("distance", "distance / length", powers(*range(9)), extreme=1e4)
def from_afar(draw: Draw, distance: float) -> list[Trial]:
    """Triangles that are not thin, from afar."""
    return [_aimed(draw, _any(draw.rng), distance) for _ in range(SHAPES)]


@TRIANGLE.sweep(
    "offset",
    "distance of both from the origin of coordinates",
    powers(*range(9)),
    extreme=1e4,
)
def moved_away(draw: Draw, offset: float) -> list[Trial]:
    """Triangle and rays together, translated away from the origin of coordinates."""
    return [
        _aimed(draw, _any(draw.rng) + offset * unit_vectors(draw.rng, 1)[0], 3.0)
        for _ in range(SHAPES)
    ]


def _fan(draw: Draw, rim: int, distance: float, at_vertex: bool) -> Trial:
    """A fan of `rim` triangles around a raised apex, seen from outside.

    Rays go to the apex, or to points of the edges from there, so that they must hit the fan.
    """
    rng, n = draw.rng, draw.rays // SHAPES
    axis = unit_vectors(rng, 1)
    x = across(rng, axis)[0]
    y = np.cross(axis[0], x)
    angles = 2.0 * np.pi * (np.arange(rim) + rng.uniform(-0.2, 0.2, rim)) / rim
    center = rng.uniform(-1.0, 1.0, 3)
    base = center + np.cos(angles)[:, None] * x + np.sin(angles)[:, None] * y
    apex = center + 0.3 * axis[0]
    parts = tuple(TriangleParameters(apex, base[k], base[(k + 1) % rim]) for k in range(rim))
    along = np.zeros((n, 1)) if at_vertex else rng.uniform(0.05, 0.95, (n, 1))
    target = apex + along * (base[rng.integers(0, rim, n)] - apex)
    # Within 45 degrees of the axis all of the fan is seen from its outer side.
    slant = rng.uniform(0.0, 1.0, (n, 1)) * across(rng, np.broadcast_to(axis, (n, 3)))
    d = -(axis + slant) * distance * rng.uniform(0.8, 1.2, (n, 1))
    return Trial(parts, target - d, d, 2.0)


@TRIANGLE.sweep("edges", "distance", powers(0, 2, 4, 6))
def at_edges(draw: Draw, distance: float) -> list[Trial]:
    """Fans of 6 triangles around an apex; rays at the edges that two of them share.  Each must hit
    the fan: a miss is a leak."""
    return [_fan(draw, FAN, distance, at_vertex=False) for _ in range(SHAPES)]


@TRIANGLE.sweep("vertices", "distance", powers(0, 2, 4, 6))
def at_vertices(draw: Draw, distance: float) -> list[Trial]:
    """The same fans; rays at the apex, which 6 triangles share."""
    return [_fan(draw, FAN, distance, at_vertex=True) for _ in range(SHAPES)]
