"""Radiance along neighbouring rays: which differences of a ray's two values are those of edges and
gradients that Mitsuba does not resolve.
"""

from collections.abc import Callable

import numpy as np
import scipy

from comparisons.geometry.frame import ROUNDINGS, UNIT_ROUNDOFF
from comparisons.mitsuba.plugins.whitted import reach_of_planes
from comparisons.rungs.rays.arbiter import NEIGHBOURS, RADII, BoolArray, directions
from comparisons.rungs.rays.light_context import DISTANT
from comparisons.rungs.rays.light_error import MIDDLE
from comparisons.rungs.rays.rays import Rays
from comparisons.rungs.rays.tree_error import TreeContext
from reference_rt.core.arrays import FloatArray
from reference_rt.lights import ENVIRONMENT
from reference_rt.rendering import query
from reference_rt.scene.build import build_tables
from reference_rt.shapes import Cylinder

AT_ONCE = (200, 32)
"""Most pixels that are arbitrated at a time by our tracer and by Mitsuba: each takes 193 ray trees
for each radius, 30 ms in scalar variants of Mitsuba.  Where these are not all explained, the rest
count as differing."""

FINER = (400, (1.0, 0.5, 0.2))
"""Moves and radii of a last search for the few that are left: a gradient that bends has values
between those of two moves that are no mixture of them, by the square of their distance."""

MOST_FINE = 8
"""Most pixels of that search."""

BENT = 4.0
"""A normal that is off by an angle turns a mirrored ray by twice that; two surfaces that stand in
for others, one seen in the other, by twice as much."""

Radiance = Callable[..., FloatArray]
"""(origins, unit directions) -> radiance, all (n, 3).  Ours also takes the tables of a scene."""


def _radii(context: TreeContext, rays: Rays) -> list[FloatArray]:
    """By how much rays are moved, (m,) each: by float32's error of their hits and of all later ones
    of their trees, once and at each surface; and by what they skip where they start, at the height
    `plugins.whitted.clearance`: on cylinders Mitsuba's ray epsilon, elsewhere float32's error of
    the scene's size.  It moves the shadows of a lamp by as much over the lamp's cosine."""
    sizes, depth = context.sizes, max(context.integrator.max_depth, 1)
    frame, lit = sizes.frame, context.counterpart.lit
    finite = np.full(len(rays.o), lit.reach() / frame.scale)
    hits = query.intersect(context.tables, rays.o, rays.d)
    reach = np.full(len(hits.t), sizes.reach.max(initial=0.0))  # later hits are anywhere
    rounding = frame.delta(rays.o, hits.p, reach)
    epsilon = frame.epsilon(hits.p)
    if lit.planes:
        size = frame.largest(hits.p) * frame.scale
        finite = np.maximum(finite, reach_of_planes(size) / frame.scale)
    height = np.minimum(epsilon, ROUNDINGS * UNIT_ROUNDOFF * finite)
    shadows = np.minimum(height / _least_cosine(context, rays, hits), depth * epsilon)
    radii = [rounding, depth * rounding, rounding + shadows]
    if any(isinstance(leaf.shape, Cylinder) for leaf in sizes.leaves):
        radii += [epsilon, depth * epsilon]
    return radii


def _least_cosine(context: TreeContext, rays: Rays, hits: query.Intersections) -> FloatArray:
    """(m,): the least cosine of any lamp at the first hits, 1 for none."""
    least, choice = np.ones(len(hits.t)), context.tables.lights.choice
    if choice is None:
        return least
    for light in np.flatnonzero((choice.kind != ENVIRONMENT) & (choice.probability > 0.0)).tolist():
        ours = query.direct_light(context.tables, rays.o, rays.d, light, MIDDLE)
        some = np.flatnonzero(ours.pdf > 0.0)
        distant = choice.kind[light] in DISTANT
        w = ours.target[some] - (0.0 if distant else hits.p[some])
        cosine = np.abs(np.sum(w * hits.n[some], axis=1)) / np.linalg.norm(w, axis=1)
        least[some] = np.minimum(least[some], np.maximum(cosine, np.finfo(float).tiny))
    return least


def explained_by_neighbours(
    context: TreeContext,
    rays: Rays,
    sides: tuple[tuple[FloatArray, Radiance], tuple[FloatArray, Radiance]],
    bound: FloatArray,
) -> BoolArray:
    """Which of the outliers (m,) have neighbouring rays along which one renderer has the other's
    value, or values on all sides of it.

    `sides` are ours and Mitsuba's: the value along each ray, and the function that computes it.
    Where Mitsuba's own value changes that much within its rounding, it is not resolved.  Rays are
    moved as `_radii` says, and next to meshes that stand in for shapes by their errors.
    """
    settled, (ours, theirs) = np.zeros(len(bound), bool), sides
    step = -(-len(bound) // AT_ONCE[0])
    for first in range(step):
        rows = np.arange(first, len(bound), step)
        some = (ours[0][rows], ours[1]), (theirs[0][rows], theirs[1])
        settled[rows] = _explained(context, rays.rows(rows), some, bound[rows])
        if not settled[rows].all():
            break
    return settled


def _explained(
    context: TreeContext,
    rays: Rays,
    sides: tuple[tuple[FloatArray, Radiance], tuple[FloatArray, Radiance]],
    bound: FloatArray,
) -> BoolArray:
    settled = np.zeros(len(bound), bool)
    angle = ROUNDINGS * UNIT_ROUNDOFF
    radii = _radii(context, rays)

    def search(
        radius: FloatArray,
        angle: float,
        only: BoolArray | None = None,
        moves: tuple[int, tuple[float, ...]] = (NEIGHBOURS, RADII),
    ) -> None:
        for k in (0, 1):
            radiance, wanted = sides[k][1], sides[1 - k][0]
            rows = np.flatnonzero(~settled if only is None else only & ~settled)
            rows = rows[: AT_ONCE[k]]
            if len(rows) == 0:
                return
            values = values_around(rays.rows(rows), radius[rows], angle, radiance, moves)
            settled[rows] = [
                is_mixture(*row) for row in zip(wanted[rows], values, bound[rows], strict=True)
            ]

    for radius in radii:
        search(radius, angle)
    stand_ins = context.counterpart.stand_ins()
    if stand_ins and not settled.all():
        errors = [error for some in stand_ins.values() for error in some]
        sag, turn = (max(getattr(error, name) for error in errors) for name in ("sag", "turn"))
        if context.tables.materials.oriented is not None:
            turn += max(error.twist for error in errors)
        radius, angle = radii[0] + sag, angle + BENT * turn
        rows = np.flatnonzero(~settled)
        near = np.zeros(len(bound), bool)
        near[rows] = _near(
            context, set(stand_ins), rays.rows(rows), radius[rows], angle, sides[0][1]
        )
        search(radius, angle, near)
        if np.count_nonzero(near & ~settled) <= MOST_FINE:
            search(radius, angle, near, FINER)
    return settled


def _near(
    context: TreeContext,
    shapes: set[int],
    rays: Rays,
    radius: FloatArray,
    angle: float,
    radiance: Radiance,
) -> BoolArray:
    """(m,): whether the radiance along any neighbouring ray depends on these shapes: whether it
    changes when they are taken away."""
    scene = context.scene
    rest = [shape for k, shape in enumerate(scene.shapes) if k not in shapes]
    tables = build_tables(scene.changed(shapes=rest))

    def without(o: FloatArray, d: FloatArray) -> FloatArray:
        return radiance(o, d, tables)

    there, gone = (values_around(rays, radius, angle, value) for value in (radiance, without))
    same = (there == gone) | (np.isnan(there) & np.isnan(gone))
    return np.asarray(~same.all(axis=(1, 2)))


def values_around(
    rays: Rays,
    radius: FloatArray,
    turn: float,
    value: Radiance,
    moves: tuple[int, tuple[float, ...]] = (NEIGHBOURS, RADII),
) -> FloatArray:
    """The values `value(origins, directions)` next to m rays: (m, k, 3).

    Origins move by up to `radius` (m,); unit directions stay, or turn by `turn` radians, on the
    opposite side of the sphere.  moves: how many, and by which parts of the radius.  All moves of
    all rays are evaluated in one call.
    """
    count, radii = moves
    spread, still = directions(count), np.zeros((1, 3))
    ways = np.roll(spread, count // 2, axis=0)
    move = np.concatenate([still, *(factor * spread for factor in radii for _ in (0, 1))])
    way = np.concatenate([still, *(size * ways for _ in radii for size in (0.0, turn))])
    origins = rays.o[:, None] + move * radius[:, None, None]
    turned = rays.d[:, None] + way
    turned /= np.linalg.norm(turned, axis=2, keepdims=True)
    return value(origins.reshape(-1, 3), turned.reshape(-1, 3)).reshape(len(rays.o), -1, 3)


def is_mixture(wanted: FloatArray, values: FloatArray, slack: float) -> bool:
    """Whether some weighted mean of `values` (k, 3) is `wanted` (3,), up to `slack` in each
    channel.

    Between the values of neighbouring rays lie those of a gradient and of edges that cross, but not
    every colour whose channels each lie between theirs: a fault in one channel of a mirror in which
    a picture is seen is no mixture of the picture's colours (a linear programme, 3 ms).
    """
    values = values[np.isfinite(values).all(axis=1)]
    off = (np.unique(values, axis=0) - wanted) / max(slack, np.finfo(float).tiny)
    if not (
        (off.min(axis=0, initial=np.inf) <= 1.0) & (off.max(axis=0, initial=-np.inf) >= -1.0)
    ).all():
        return False
    if (np.abs(off).max(axis=1) <= 1.0).any():
        return True
    sides = np.concatenate([off.T, -off.T])
    solution = scipy.optimize.linprog(
        np.zeros(len(off)), sides, np.ones(6), np.ones((1, len(off))), np.ones(1), method="highs"
    )
    return bool(solution.status == 0)
