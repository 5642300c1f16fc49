"""Boxes: far away, flat; rays along the axes, in the planes of faces, and at edges."""

import numpy as np

from comparisons.experiments.methods.setting import Draw, Family, Trial, Truth, powers
from comparisons.experiments.methods.vectors import unit_vectors
from comparisons.geometry.exact.crossings import where
from comparisons.geometry.exact.curved import Slabs
from comparisons.geometry.exact.dyadic import NEVER, Dyadic
from reference_rt.core.arrays import FloatArray
from reference_rt.textbook import BoxParameters

LOWER, UPPER = np.array([-1.1, -0.7, 0.3]), np.array([0.9, 1.3, 1.7])
SIZE = 2.0
PARALLEL = (0.0, -0.0)


def exact(box: BoxParameters, o: FloatArray, d: FloatArray) -> Truth:
    lower, upper = (Dyadic.of(np.atleast_2d(x)) for x in (box.lower, box.upper))
    slabs = Slabs(Dyadic.of(o), Dyadic.of(d), lower, upper, np.ones(3))
    t = np.where(slabs.t_in > 0, slabs.t_in, slabs.t_out)
    return Truth(where(~slabs.misses & (t > 0) & (t < NEVER), t), slabs.touching)


BOX = Family("box", exact)


def _trial(o: FloatArray, d: FloatArray, upper: FloatArray = UPPER) -> list[Trial]:
    return [Trial((BoxParameters(LOWER, upper),), o, d, SIZE)]


def _targets(draw: Draw, upper: FloatArray = UPPER) -> FloatArray:
    """Points (rays, 3) in and around the box."""
    margin = 0.2 * (upper - LOWER)
    return draw.rng.uniform(LOWER - margin, upper + margin, (draw.rays, 3))


@BOX.sweep("distance", "distance / size", powers(*range(1, 10)), extreme=1e5)
def from_afar(draw: Draw, distance: float) -> list[Trial]:
    """Origins all around the box; rays at points in and around it."""
    o = 0.5 * (LOWER + UPPER) + distance * SIZE * unit_vectors(draw.rng, draw.rays)
    return _trial(o, _targets(draw) - o)


@BOX.sweep("flatness", "size / height", powers(0, 2, 4, 6, 8, 10, 12, 14), extreme=1e6)
def flat(draw: Draw, inverse_height: float) -> list[Trial]:
    """From three sizes away, at points in and around ever flatter boxes."""
    upper = np.array([*UPPER[:2], LOWER[2] + (UPPER[2] - LOWER[2]) / inverse_height])
    o = 0.5 * (LOWER + UPPER) + 3.0 * SIZE * unit_vectors(draw.rng, draw.rays)
    return _trial(o, _targets(draw, upper) - o, upper)


@BOX.sweep("along axes")
def along_axes(draw: Draw, _: float) -> list[Trial]:
    """Directions with one or two components that are +0 or -0."""
    o = 0.5 * (LOWER + UPPER) + 3.0 * SIZE * unit_vectors(draw.rng, draw.rays)
    target = _targets(draw)
    zero = np.argsort(draw.rng.uniform(size=o.shape), axis=1) < draw.rng.integers(1, 3, (len(o), 1))
    o = np.where(zero, target, o)
    return _trial(o, np.where(zero, draw.rng.choice(PARALLEL, o.shape), target - o))


@BOX.sweep("from planes")
def from_planes(draw: Draw, _: float) -> list[Trial]:
    """Origins in the planes of the faces; half of the rays run along that plane."""
    n = draw.rays
    o = draw.rng.uniform(LOWER - 1.0, UPPER + 1.0, (n, 3))
    axis, rows = draw.rng.integers(0, 3, n), np.arange(n)
    o[rows, axis] = np.where(draw.rng.uniform(size=n) < 0.5, LOWER[axis], UPPER[axis])
    d = _targets(draw) - o
    still = draw.rng.uniform(size=n) < 0.5
    d[rows[still], axis[still]] = draw.rng.choice(PARALLEL, int(still.sum()))
    return _trial(o, d)


@BOX.sweep("ridges", "distance / size", powers(0, 2, 4, 6))
def at_ridges(draw: Draw, distance: float) -> list[Trial]:
    """Rays at edges, both faces of which are visible: a method that misses the face reports the far
    side of the box."""
    # Aimed at points of the three edges that meet in the upper corner.
    n = draw.rays
    o = UPPER + distance * draw.rng.uniform(1.0, 3.0, (n, 3))
    target = np.tile(UPPER, (n, 1))
    axis = draw.rng.integers(0, 3, n)
    # Off the corners, where the far side is near.
    share = draw.rng.uniform(0.1, 0.9, n)
    target[np.arange(n), axis] = LOWER[axis] + share * (UPPER - LOWER)[axis]
    return _trial(o, target - o)
