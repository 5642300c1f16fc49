"""The error bound of a Whitted pixel: float32's own, summed over the tree of its rays.

Each ray of the tree ends at a node with a weight w and light L of its own: what it emits, ambient
light, and the direct light of all lamps.  To first order a pixel moves by the sum over its nodes of

- w L times the rounding of w: FACTORS products for each surface before it;
- w times the error of its direct light (`light_error`: slide, distance, normal, grazing cosines);
- w times how much the light of all that follows changes when its ray is moved by float32's error of
  one hit: measured with our tracer along moved rays.  So the error of a hit is magnified by all
  curved mirrors behind it, once for each node that makes one.

No term is absolute, and none is relative to anything but the pixel's own light.
"""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from comparisons.geometry.frame import ROUNDINGS, UNIT_ROUNDOFF
from comparisons.mitsuba.counterpart import Counterpart, trace
from comparisons.referee.sizes import ShapeSizes
from comparisons.rungs.rays.light_context import LightContext
from comparisons.rungs.rays.light_error import TURNS, along_mesh, of_direct_light
from comparisons.rungs.rays.rays import Rays
from comparisons.rungs.rays.slopes import moved, slopes, turned
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.integrators import Whitted
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.rendering import query
from reference_rt.rendering.scene import Scene

FACTORS = 8.0
"""Roundings of a ray's weight for each surface that bends it: Fresnel's two amplitudes, their
squares, the colour, the product with the weight."""

AT_ONCE = 1 << 16
"""Most nodes whose slopes are measured in one go."""


class Nodes(NamedTuple):
    """The m nodes of the trees of n rays.

    row (m,): the tree's ray;  depth (m,): surfaces that bent its ray;  weight (m, 3): its share in
    the pixel;  rays: those that end there, or meet nothing.
    """

    row: IntArray
    depth: IntArray
    weight: FloatArray
    rays: Rays

    def some(self, which: IntArray) -> "Nodes":
        """Some of the nodes."""
        return Nodes(self.row[which], self.depth[which], self.weight[which], self.rays.rows(which))

    def of(self, rows: IntArray) -> "Nodes":
        """The nodes of some rows, sorted, which are counted anew."""
        found = np.searchsorted(rows, self.row)
        at = np.append(rows, -1)[found] == self.row
        return self._replace(row=found).some(np.flatnonzero(at))


class TreeContext(NamedTuple):
    """A scene whose trees are compared."""

    scene: Scene
    tables: SceneTables
    counterpart: Counterpart
    sizes: ShapeSizes
    integrator: Whitted

    def along(self, depth: int, o: FloatArray, d: FloatArray) -> FloatArray:
        """Our light (n, 3) of rays that `depth` surfaces have bent."""
        left = self.integrator.setup().max_depth - depth
        setup = self.integrator.setup()._replace(max_depth=max(left, 0))
        return query.radiance_without_noise(self.tables, setup, o, d)


def roundings(context: TreeContext, nodes: Nodes, n: int) -> FloatArray:
    """(n,): the first two terms of the bound, of the trees of n rays that have these nodes."""
    rays, weight = nodes.rays, nodes.weight
    setup = context.integrator.setup()._replace(max_depth=0)
    light = query.radiance_without_noise(context.tables, setup, *rays)
    roundings = FACTORS * UNIT_ROUNDOFF * (nodes.depth + 1)
    error = roundings * np.abs(weight * light).max(axis=1)
    hits = query.intersect(context.tables, *rays), trace(context.counterpart, *rays)
    lit = LightContext(
        context.scene, context.tables, context.counterpart, rays, *hits, context.sizes
    )
    error += weight.max(axis=1) * of_direct_light(lit)
    return np.asarray(np.bincount(nodes.row, error, n), np.float64)


def magnified(context: TreeContext, nodes: Nodes, n: int) -> FloatArray:
    """(n,): the third term, which most pixels do not need."""
    total = np.zeros(n)
    for depth in np.unique(nodes.depth).tolist():
        at = np.flatnonzero(nodes.depth == depth)
        for begin in range(0, len(at), AT_ONCE):
            some = nodes.some(at[begin : begin + AT_ONCE])
            slope = some.weight.max(axis=1) * _slopes(context, some.rays, depth)
            total += np.bincount(some.row, slope, n)
    return total


def _slopes(context: TreeContext, rays: Rays, depth: int) -> FloatArray:
    """(m,): how much light changes within float32's error of one hit."""
    value = context.along(depth, *rays)
    hits = query.intersect(context.tables, *rays)
    theirs = trace(context.counterpart, *rays) if context.counterpart.stand_ins() else None
    p = np.where(hits.shape[:, None] >= 0, hits.p, rays.o)
    radius = context.sizes.frame.delta(rays.o, p, context.sizes.reach_of(hits.shape))
    # The corners of a face are rounded, each by u of its coordinates, which turns the normal of a
    # small one far from the origin by more than moved rays are turned.
    size = context.sizes.frame.largest(p)
    angle = 2.0 * UNIT_ROUNDOFF * size / context.sizes.bend_of(hits)
    angle[TURNS * angle < ROUNDINGS * UNIT_ROUNDOFF] = 0.0
    apart = np.zeros(len(rays.o))
    if theirs is not None:
        lit = LightContext(
            context.scene, context.tables, context.counterpart, rays, hits, theirs, context.sizes
        )
        apart = lit.off_by("sag") + lit.off_by("shift") + along_mesh(lit)
        angle += lit.off_by("turn")
        if context.tables.materials.oriented is not None:
            angle += lit.off_by("twist")
    others: list[Callable[[], FloatArray]] = [
        partial(context.along, depth, *other) for other in moved(rays, radius + apart)
    ]
    own = np.abs(value).max(axis=1)
    change = slopes(value, others, own)
    bent = np.flatnonzero(angle > 0.0)
    if len(bent):
        versions = turned(rays.rows(bent), hits.p[bent], TURNS * angle[bent])
        others = [partial(context.along, depth, *other) for other in versions]
        change[bent] += slopes(value[bent], others, own[bent])
    return change
