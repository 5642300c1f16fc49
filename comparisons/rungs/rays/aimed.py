"""Rays aimed at edges, corners and silhouettes, where hits are hard to decide."""

import numpy as np

from comparisons.geometry import affine
from comparisons.geometry.frame import round32
from comparisons.referee.sizes import ShapeSizes
from comparisons.rungs.rays.rays import Rays, joined, random_rays
from reference_rt.core.arrays import FloatArray
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.rendering import query
from reference_rt.rendering.query import Intersections

EXPONENTS = (-7.0, -2.0)
"""Exponents of ten: how far a ray passes its target, as a fraction of the distance."""

HALVINGS = 26
"""Bisections of the angle between two rays, down to less than a step of float32."""

MOST_SPOTS = 4096
"""Most target points of a shape, and most copies of shapes that rays are aimed at."""


def aimed_rays(tables: SceneTables, sizes: ShapeSizes, n: int, seed: int) -> Rays:
    """At most n rays.  Half pass a boundary between two primitives, found by bisection between two
    rays of one origin; half pass corners and middles of edges, a third of these exactly."""
    rng = np.random.default_rng([seed, 1])
    spots = _spots(sizes, rng)
    at_spots = n // 2 if len(spots) else 0
    passing = _parting(tables, sizes, n - at_spots, rng)
    return joined(passing, _at_spots(sizes, spots, at_spots, rng))


def _parting(tables: SceneTables, sizes: ShapeSizes, n: int, rng: np.random.Generator) -> Rays:
    """Rays next to directions in which the primitive that is hit changes, found by bisection."""
    tries = random_rays(sizes, 8 * n, rng)
    # The same origin for four rays, each of which is paired with the next.
    o = np.repeat(tries.o[::4], 4, axis=0)
    d = tries.d
    hits = query.intersect(tables, o, d)
    following = np.arange(len(o)) // 4 * 4 + (np.arange(len(o)) + 1) % 4
    differ = _identity(hits) != _identity(hits)[following]
    turned_away = np.sum(d * d[following], axis=1) < -0.9
    pairs = np.flatnonzero(differ & ~turned_away)[:n]
    o, a, b = o[pairs], d[pairs], d[following[pairs]]
    at_a = _identity(hits)[pairs]
    for _ in range(HALVINGS):
        middle = a + b
        middle /= np.linalg.norm(middle, axis=1)[:, None]
        same = _identity(query.intersect(tables, o, middle)) == at_a
        a, b = np.where(same[:, None], middle, a), np.where(same[:, None], b, middle)
    return Rays(o, round32(_beside(a, rng)))


def _identity(hits: Intersections) -> FloatArray:
    """A number (n,) that differs wherever the shape, instance, part or primitive differs."""
    columns = np.column_stack([hits.shape, hits.instance, hits.part, hits.primitive])
    weights = np.array([1.0, np.pi, np.e, np.sqrt(2.0)])
    return np.asarray((columns * weights).sum(axis=1))


def _beside(d: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Unit directions, turned by 10^x radians in a random way, x uniform in EXPONENTS."""
    angle = 10.0 ** rng.uniform(*EXPONENTS, (len(d), 1))
    way = rng.normal(size=d.shape)
    way -= np.sum(way * d, axis=1)[:, None] * d
    turned = d + angle * way / np.linalg.norm(way, axis=1)[:, None]
    return np.asarray(turned / np.linalg.norm(turned, axis=1)[:, None])


def _at_spots(sizes: ShapeSizes, spots: FloatArray, n: int, rng: np.random.Generator) -> Rays:
    if n == 0:
        return Rays(np.zeros((0, 3)), np.zeros((0, 3)))
    o = random_rays(sizes, n, rng).o
    d = spots[rng.integers(0, len(spots), n)] - o
    length = np.linalg.norm(d, axis=1)
    o, d = o[length > 0.0], d[length > 0.0] / length[length > 0.0, None]
    exactly = rng.uniform(size=(len(d), 1)) < 1.0 / 3.0
    return Rays(o, round32(np.where(exactly, d, _beside(d, rng))))


def _spots(sizes: ShapeSizes, rng: np.random.Generator) -> FloatArray:
    """Corners and middles of edges (n, 3) of all shapes that have any."""
    spots_of_copies = [np.zeros((0, 3))]
    copies = sizes.copies
    if len(copies) > MOST_SPOTS:
        copies = [copies[k] for k in rng.choice(len(copies), MOST_SPOTS, replace=False)]
    local: dict[int, FloatArray] = {}
    share = max(1, 16 * MOST_SPOTS // max(1, len(copies)))
    for copy in copies:
        for leaf in sizes.leaves_of(copy):
            if id(leaf) not in local:
                spots = leaf.known.targets(leaf.table)
                if len(spots) > MOST_SPOTS:
                    spots = spots[rng.choice(len(spots), MOST_SPOTS, replace=False)]
                local[id(leaf)] = spots
            spots_of_copies.append(affine.apply_points(copy.outer, local[id(leaf)][:share]))
    return np.concatenate(spots_of_copies)
