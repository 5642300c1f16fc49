"""All crossings of rays and a solid, not the first alone: what its laws are tested by."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from reference_rt.bvh import Bvh
from reference_rt.csg.anchor import ray_near
from reference_rt.csg.evaluate import (
    CROSSINGS,
    GRAZING,
    Front,
    Walk,
    begin_all,
    head_on,
    is_inside,
    pass_together,
    which_shows,
    width,
)
from reference_rt.csg.tables import Solids
from reference_rt.geometry import Geometry
from reference_rt.kernel import entry_kernel, kernel, local_floats, local_integers
from reference_rt.query import checked_rays
from reference_rt.ray import Hit, Ray
from reference_rt.shapes import Shapes
from reference_rt.shapes.shape import FloatArray, IntArray
from reference_rt.tables import SceneTables
from reference_rt.vec3 import row


@dataclass(frozen=True)
class SolidCrossings:
    """Where n rays go in and out of a solid, in order, over all t > 0.

    t (n, k): inf where there are fewer than k;  width (n, k): how far rounding may have moved t:
    crossings closer together than the sum of theirs are passed at once, and what is between them,
    material or gap, is not told;  part (n, k): number of the operand that shows;  count (n,).
    """

    t: FloatArray
    width: FloatArray
    part: IntArray
    count: IntArray


@kernel
def _all_along(
    solids: Solids,
    shapes: Shapes,
    bvh: Bvh,
    s: int,
    ray: Ray,
    t: FloatArray,
    widths: FloatArray,
    part: IntArray,
) -> int:
    """How many points of the surface of solid s lie at t > 0; the first of them, as many as there
    is room for, into t, in order, with `resolution` and the number of the operand that shows."""
    ray, begin = ray_near(solids, s, ray)
    first, count = solids.first[s], solids.operands[s]
    walk = Walk(
        local_floats(CROSSINGS * count),
        local_floats(CROSSINGS * count),
        local_floats(count),
        local_integers(count),
        local_integers(count),
        local_integers(count),
        local_integers(count),
        local_integers(count),
        local_integers(count),
    )
    front = Front(
        local_floats(count), local_floats(count), local_floats(count), local_integers(count)
    )
    values = local_integers(solids.depth[s])
    best, hit = begin_all(solids, shapes, bvh, s, ray, walk)
    inside = is_inside(solids, s, walk.state, values)
    found = 0
    while best >= 0:
        best, hit = pass_together(solids, shapes, bvh, s, ray, walk, front, best, hit)
        was_inside = inside
        inside = is_inside(solids, s, walk.state, values)
        if inside != was_inside:
            k = which_shows(solids, s, count, walk, values, was_inside)
            if found < len(t):
                kind = solids.kind[first + k]
                hit_k = Hit(front.t[k], kind, front.row[k], front.u[k], front.v[k], -1)
                t[found], part[found] = begin + hit_k.t, k
                widths[found] = resolution(shapes, hit_k, ray)
            found += 1
    return found


@kernel
def resolution(shapes: Shapes, hit: Hit, ray: Ray) -> float:
    """Crossings whose distance, in t, is more than the sum of theirs are told apart."""
    return min(width(shapes, hit, ray), 0.5 * GRAZING * head_on(ray, hit.t))


@entry_kernel
def _crossings(
    geometry: Geometry,
    solid: int,
    o: FloatArray,
    d: FloatArray,
    t: FloatArray,
    widths: FloatArray,
    part: IntArray,
    count: IntArray,
) -> None:
    solids: Any = geometry.solids
    bvh: Any = geometry.bvh
    for i in range(len(o)):
        ray = Ray(row(o, i), row(d, i), math.inf)
        count[i] = _all_along(solids, geometry.shapes, bvh, solid, ray, t[i], widths[i], part[i])


def crossings(
    scene: SceneTables,
    solid: int,
    origins: npt.ArrayLike,
    directions: npt.ArrayLike,
    most: int = 64,
) -> SolidCrossings:
    """All crossings of each ray with the solid of that number, in the scene's order; `most` of
    them, though `count` counts all."""
    solids = scene.geometry.solids
    if solids is None or not 0 <= solid < len(solids.first):
        known = 0 if solids is None else len(solids.first)
        raise ValueError(f"there is no solid {solid}; expected one of the scene's {known}")
    o, d = checked_rays(origins, directions)
    t, widths = np.full((2, len(o), most), math.inf)
    part = np.full((len(o), most), -1)
    count = np.zeros(len(o), np.int64)
    with np.errstate(all="ignore"):
        _crossings(scene.geometry, solid, o, d, t, widths, part, count)
    return SolidCrossings(t, widths, part, count)
