"""Layers of the rays through the pixels' centres: pixel by pixel, within float32's bound."""

import dataclasses
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from comparisons.mitsuba.counterpart import Counterpart, trace
from comparisons.mitsuba.hits import MitsubaHits, rows_of
from comparisons.referee.sizes import ShapeSizes
from comparisons.rungs.layers.seen import Seen
from comparisons.rungs.rays import arbiter
from comparisons.rungs.rays.camera import camera_rays, ends
from comparisons.rungs.rays.comparer import KINDS, Comparer
from comparisons.rungs.rays.rays import Rays
from comparisons.rungs.rays.slide import slide
from reference_rt.core.arrays import FloatArray
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.rendering import query
from reference_rt.rendering.query import Intersections
from reference_rt.rendering.scene import Scene

SLACK = 2.0
"""Error bound of a layer over that of a hit: its rays are those of the picture, which Mitsuba gets
rounded to float32; that moves a hit by at most as much again."""

MOVES = 12
"""Directions in which rays next to each ray lie, whose colours by Mitsuba span what float32 may
make of a texture."""

STEPS = 8
"""Rays in each direction.  Where a ray grazes a surface far away they may be texels apart: colours
between two of them are not known better than by the mean difference of neighbours.  Of a single
edge between two texels that is an eighth of the contrast."""

COLOUR = 1e-5
"""Tolerance of a colour that does not vary: float32 texels and their interpolation make some
2 * 2^-24 of the largest."""


class Centres(NamedTuple):
    """pixels, unresolved: how many were compared, and how many float32 does not resolve;  wrong: by
    layer, how many differ;  ratio: the largest error over its bound;  first: the first difference
    in words, or ""."""

    pixels: int
    unresolved: int
    wrong: dict[str, int]
    ratio: float
    first: str


def centres(
    scene: Scene,
    tables: SceneTables,
    counterpart: Counterpart,
    sizes: ShapeSizes,
    layers: Mapping[str, FloatArray],
) -> Centres:
    """Compare layers (height, width[, k]) with Mitsuba's hits of the same rays.

    A pixel where our own hit is not Mitsuba's within the bound lies at an edge: the geometry rung
    judges such rays, and here they are left out.
    """
    film = scene.film
    y, x = np.mgrid[0 : film.height, 0 : film.width]
    x, y = x.ravel() + 0.5, y.ravel() + 0.5
    rays = Rays(*camera_rays(scene, x, y))
    t_max = ends(scene, rays.d)
    ours = query.intersect(tables, *rays, t_max=t_max)
    theirs = trace(counterpart, *rays, t_max=t_max)
    comparer = Comparer(sizes)
    resolved = (comparer.ratios(rays, ours, theirs) <= SLACK).all(axis=1)
    resolved &= ~counterpart.beyond_planes(ours, theirs)
    flat = {name: layer.reshape(len(x), -1) for name, layer in layers.items()}
    errors = {
        name: _errors(comparer, rays, ours, theirs, name, values)
        for name, values in flat.items()
        if name != "colour"
    }
    if "colour" in flat:
        errors["colour"] = _of_colours(scene, counterpart, sizes, rays, theirs, flat["colour"])
    wrong, ratio, first = {}, 0.0, ""
    for name, error in errors.items():
        bad = np.flatnonzero(resolved & ~(error <= SLACK))
        good = error[resolved & (error <= SLACK)]
        wrong[name], ratio = len(bad), max(ratio, float(good.max(initial=0.0)) / SLACK)
        if len(bad) and not first:
            k = int(bad[0])
            first = (
                f"{name} of pixel ({int(x[k])}, {int(y[k])}): ours {flat[name][k]}, where Mitsuba "
                f"hits shape {theirs.shape[k]} at t = {theirs.t[k]:.9g}, n = {theirs.n[k]}"
            )
    return Centres(len(x), int(np.count_nonzero(~resolved)), wrong, ratio, first)


def _errors(
    comparer: Comparer,
    rays: Rays,
    ours: Intersections,
    theirs: MitsubaHits,
    name: str,
    values: FloatArray,
) -> FloatArray:
    """(n,): error over bound of a layer (n, k).  The bounds are those of `Comparer`, about our own
    hit; where nothing is hit, the layer must say so exactly."""
    hit, column = ours.shape >= 0, values[:, 0]
    if name == "id":
        return np.where(column == theirs.shape, 0.0, np.inf)
    if name == "uv":
        changed = dataclasses.replace(ours, uv=values)
        ratio = comparer.ratios(rays, changed, theirs)[:, KINDS.index("uv")]
    else:
        with np.errstate(divide="ignore", invalid="ignore"):
            e = slide(comparer.sizes, rays.o, rays.d, ours, theirs.sag)
            if name == "normal":
                n = np.where(theirs.stands_in[:, None], theirs.ns, theirs.n)
                bend = np.minimum(comparer.sizes.bend_of(ours), theirs.height)
                bound = e / bend + theirs.turn
                ratio = np.linalg.norm(values - n, axis=1) / bound
            else:
                ratio = np.abs(column - theirs.t) / e  # directions are unit vectors
    of_miss = np.inf if name in ("depth", "distance") else 0.0
    missed = np.where((values == of_miss).all(axis=1), 0.0, np.inf)
    return np.where(hit, np.nan_to_num(ratio, nan=np.inf), missed)


def _of_colours(
    scene: Scene,
    counterpart: Counterpart,
    sizes: ShapeSizes,
    rays: Rays,
    theirs: MitsubaHits,
    values: FloatArray,
) -> FloatArray:
    """(n,): SLACK times the distance from the range of colours that Mitsuba's hits of rays next to
    each have, over the tolerance.  A mesh that stands in for a shape shifts textures further than
    float32 does."""
    seen = Seen(scene, sizes)
    ratio = _outside(seen.colours(theirs, of_vertices=True), values)
    far = np.flatnonzero(ratio > 1.0)
    if len(far) == 0:
        return SLACK * ratio
    reach = np.full(len(far), sizes.reach.max(initial=0.0))
    some = rays.rows(far)
    delta = sizes.frame.delta(some.o, theirs.p[far], reach)
    radius = 2.0 * (delta + counterpart.off_by(theirs.shape[far], "sag", "slip"))
    middle = seen.colours(rows_of(theirs, far), of_vertices=True)
    around = np.empty((MOVES, STEPS + 1, *middle.shape))
    around[:, 0] = middle
    for k, move in enumerate(arbiter.directions(MOVES)):
        for step in range(1, STEPS + 1):
            o = some.o + (step / STEPS * radius)[:, None] * move
            around[k, step] = seen.colours(trace(counterpart, o, some.d), of_vertices=True)
    between = np.abs(np.diff(around, axis=1)).mean(axis=1).max(axis=0)
    ratio[far] = _outside(around, values[far], between)
    return SLACK * ratio


def _outside(
    colours: FloatArray, values: FloatArray, slack: FloatArray | float = 0.0
) -> FloatArray:
    """(n,): how far values (n, 3) are outside the range of colours (..., n, 3), and further than
    `slack`, over the tolerance."""
    each = colours.reshape(-1, *values.shape)
    low, high = each.min(axis=0) - slack, each.max(axis=0) + slack
    bound = COLOUR * np.maximum(np.abs(low), np.abs(high)).max(axis=1, keepdims=True)
    off = np.maximum(np.maximum(low - values, values - high), 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(off == 0.0, 0.0, off / bound).max(axis=1)
    return np.asarray(np.nan_to_num(ratio, nan=np.inf))
