"""Where a solid has its operands' coordinates begin: next to them, so that distance costs nothing.

Tabulated in the world, each operand of a solid far from the origin (D) would be rounded by itself,
by u D: faces that coincide would be parted by that, and what is as thin could not be told from it.
Here all maps are put together exactly and seen from one anchor: operands round as if the solid
stood at the origin, and the ray's origin is counted from the anchor once for all of them.
"""

from collections.abc import Iterator
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np

from reference_rt.core.arrays import FloatArray
from reference_rt.core.ray import UNIT_ROUNDOFF, Ray, SurfacePoint
from reference_rt.core.transform import Affine, Transform, identity
from reference_rt.core.vec3 import dot, length, max_abs, row
from reference_rt.jit.kernel import kernel
from reference_rt.shapes.csg.description import operands_of
from reference_rt.shapes.csg.tables import Solids
from reference_rt.shapes.rounding import along_from
from reference_rt.shapes.shape import Shape, Solid

_exact = np.vectorize(Fraction, otypes=[object])

FAR = 16.0
"""Sizes from the world's origin up to which operands stay in its coordinates, where they round by
16 times what they must at most, as shapes do that are no operands."""


class Anchored(NamedTuple):
    """anchor (3,), 0 for the world's origin;  operands: (shape, the map that its own transform is
    followed by), seen from there."""

    anchor: FloatArray
    operands: list[tuple[Shape, Affine]]


def anchored(solid: Shape) -> Anchored:
    """The operands of a solid, from left to right.

    The anchor is an operand's own origin or, of a sphere, centre: the first by its coordinates, so
    that the order of operands does not matter.  Raises ValueError where coordinates overflow.
    """
    standing = list(_standing(solid, ()))
    try:
        maps = [_map_of(shape, steps) for shape, steps in standing]
        anchor = min(maps, key=lambda m: tuple(m[:, 3]))[:, 3].astype(np.float64)
        for m in maps:
            m[:, 3] -= _exact(anchor)
        floats = [m.astype(np.float64) for m in maps]
    except (OverflowError, ValueError):
        raise ValueError("its coordinates overflow; expected finite numbers") from None
    if np.abs(anchor).max() <= FAR * np.abs(floats).max():
        operands = operands_of(solid, identity(), None)
        return Anchored(np.zeros(3), [(shape, outer) for shape, outer, _, _ in operands])
    seen: list[tuple[Shape, Affine]] = []
    for (shape, _), m in zip(standing, floats, strict=True):
        update: dict[str, Any] = {"transform": ()}
        if hasattr(shape, "center"):
            update["center"] = (0.0, 0.0, 0.0)  # in the map
        seen.append((shape.model_copy(update=update), m))
    return Anchored(anchor, seen)


def _standing(shape: Shape, outer: Transform) -> Iterator[tuple[Shape, Transform]]:
    """(operand, the steps from its own coordinates to the world's)."""
    steps = (*shape.transform, *outer)
    if not isinstance(shape, Solid):
        yield shape, steps
        return
    for operand in shape.of:
        yield from _standing(operand, steps)


def _map_of(shape: Shape, steps: Transform) -> Any:
    """The map (3, 4), exactly; a shape's centre, where it has one, is taken for its origin."""
    linear, offset = _exact(np.eye(3)), _exact(getattr(shape, "center", (0.0, 0.0, 0.0)))
    for step in steps:
        m = _exact(step.matrix_of())
        linear, offset = m[:, :3] @ linear, m[:, :3] @ offset + m[:, 3]
    return np.column_stack([linear, offset])


@kernel
def ray_near(solids: Solids | None, s: int, ray: Ray) -> tuple[Ray, float]:
    """(the ray from the anchor of solid s, begin): its t is begin + t of that ray; as it is for
    s = -1.

    A ray from far outside of all operands begins next to them, found without rounding
    (`along_from`): its crossings then round as the solid is large, not as it is far.  Where even
    the t of that place rounds by more than the solid is large it begins where it did.
    """
    if solids is None:
        return ray, 0.0
    if s < 0:
        return ray, 0.0
    anchor, reach = row(solids.anchor, s), solids.reach[s]
    seen = Ray(ray.o - anchor, ray.d, ray.t_max)
    if not max_abs(seen.o) > 8.0 * reach:
        return seen, 0.0
    speed = length(ray.d)
    begin = (-dot(seen.o, ray.d) / speed - 4.0 * reach) / speed
    if not begin > 0.0:
        return seen, 0.0
    o = along_from(ray.o, ray.d, anchor, begin)
    if not dot(o, ray.d) < -2.0 * reach * speed:
        return seen, 0.0
    return Ray(o, ray.d, ray.t_max), begin


@kernel
def out_of_solid(solids: Solids | None, s: int, point: SurfacePoint) -> SurfacePoint:
    """A point that counts from the anchor of solid s, in the world; as it is for s = -1.

    Three roundings more, of numbers no larger than the anchor and the point: of the point, of the
    next ray's origin off it, and of that seen from the anchor.
    """
    if solids is None:
        return point
    if s < 0:
        return point
    anchor = row(solids.anchor, s)
    if max_abs(anchor) == 0.0:
        return point
    p = anchor + point.p
    rounding = (4.0 * 1.7320508075688774 * UNIT_ROUNDOFF) * (max_abs(anchor) + max_abs(p))
    return SurfacePoint(p, point.n, point.ns, point.error + rounding, point.material, point.light)
