"""The limits of float64: details of a scene that are about as small as the error of hit points.

The error bound is that of `reference_rt.core.ray.surface_error`: a point p on a surface has an
error of at most 16 sqrt(3) u (|anchor| + |p| + size).  A smaller shape, a narrower gap, or an index
of refraction as close to 1 as its rounding, is not resolved.  Products of coordinates must be
finite.
"""

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from reference_rt.core import transform
from reference_rt.core.arrays import FloatArray
from reference_rt.core.ray import UNIT_ROUNDOFF, surface_error
from reference_rt.core.transform import Affine
from reference_rt.core.vec3 import Vec3
from reference_rt.rendering.scene import Scene
from reference_rt.shapes import TABLES, Mesh
from reference_rt.shapes.csg import Solid, operands_of
from reference_rt.shapes.instances import Instance
from reference_rt.shapes.shape import Shape, TabulationContext

MOST = 2000
"""Most shapes that are examined, instances and operands of solids included.  Of a mesh in a group
only the first copy is, because a table is made for each."""

LISTED = 10
"""Most violations that are listed, the worst first."""


class Limit(NamedTuple):
    """A detail of size `size`, to be resolved where float64's error is at most `bound`."""

    law: str
    what: str
    size: float
    bound: float

    @property
    def margin(self) -> float:
        """size / bound: 1 or less is beyond float64."""
        return self.size / self.bound if self.bound > 0.0 else math.inf

    @property
    def is_beyond(self) -> bool:
        return self.margin <= 1.0


class Leaf(NamedTuple):
    """A primitive shape in world space.  name: for display;  field, table: its rows;  lower, upper
    (n, 3): their bounds;  error (n,): error bound of the points that rays from the camera hit."""

    name: str
    field: str
    table: Any
    lower: FloatArray
    upper: FloatArray
    error: FloatArray


def limits_of(scene: Scene) -> list[Limit]:
    """The closest detail to each kind of limit, and the violations (at most LISTED); the smallest
    margin first."""
    leaves: list[Leaf] = []
    for name, shape, outer in _placed(scene):
        if len(leaves) == MOST:
            break
        leaves.append(_leaf(name, shape, outer, scene))
    found = [*_thin(leaves), *_contacts(leaves), *_indices(scene), *_large(leaves)]
    found.sort(key=lambda limit: limit.margin)
    beyond = [limit for limit in found if limit.is_beyond][:LISTED]
    nearest = {limit.law: limit for limit in reversed(found)}
    kept = [*beyond, *(limit for limit in nearest.values() if limit not in beyond)]
    return sorted(kept, key=lambda limit: limit.margin)


def _placed(scene: Scene) -> Iterator[tuple[str, Shape, Affine]]:
    """(name, primitive, outer transform, applied after its own) of all shapes."""

    seen: set[int] = set()

    def of(name: str, shape: Shape, outer: Affine) -> Iterator[tuple[str, Shape, Affine]]:
        if isinstance(shape, Instance):
            for one in shape.maps(scene.folder)[:MOST]:
                inner = transform.compose(one, outer)
                for k, member in enumerate(scene.groups[shape.group]):
                    if isinstance(member, Mesh):
                        if id(member) in seen:
                            continue
                        seen.add(id(member))
                    yield from of(f"{name}, {shape.group}[{k}]", member, inner)
        elif isinstance(shape, Solid):
            for k, (leaf, inner, _, _) in enumerate(operands_of(shape, outer, None)):
                yield f"{name}, operand {k}", leaf, inner
        else:
            yield name, shape, outer

    for i, shape in enumerate(scene.shapes):
        yield from of(f"shapes[{i}]", shape, transform.identity())


def _leaf(name: str, shape: Shape, outer: Affine, scene: Scene) -> Leaf:
    table = shape.tabulate(TabulationContext(folder=scene.folder, outer=outer))
    field, module = next((f, m) for _, f, t, m in TABLES if t is type(table))
    lower, upper = module.bounds(table)
    far = np.maximum(np.abs(lower), np.abs(upper)).max(axis=1)
    extent = (upper - lower).max(axis=1)
    # A ray begins at the camera, whose coordinates are rounded like those of the hit.
    eye = max(map(abs, scene.camera.eye))
    far = np.where(np.isfinite(far), far, eye)
    error = LAW * (far + np.maximum(far, eye) + np.where(np.isfinite(extent), extent, 0.0))
    return Leaf(f"{name} ({type(shape).__name__.lower()})", field, table, lower, upper, error)


LAW = surface_error(Vec3(1.0, 0.0, 0.0), Vec3(0.0, 0.0, 0.0), 0.0)
"""16 sqrt(3) u."""


# ---- sizes --------------------------------------------------------------------------------------


def _thin(leaves: list[Leaf]) -> Iterator[Limit]:
    """The thickness of each shape, against the error of the points on it."""
    for leaf in leaves:
        size = _thickness(leaf)
        k = int(np.argmin(size / leaf.error))
        if math.isfinite(size[k]):
            name = f"{leaf.name}, face {k}" if len(size) > 1 else leaf.name
            yield Limit("size", name, float(size[k]), float(leaf.error[k]))


def _thickness(leaf: Leaf) -> FloatArray:
    """(n,): the smallest extent of each row; inf if it has none."""
    table = leaf.table
    if leaf.field == "spheres":
        return np.asarray(2.0 * table.radius)
    if leaf.field == "triangles":
        v = table.vertices.reshape(-1, 3, 3)
        longest = np.linalg.norm(v - np.roll(v, 1, axis=1), axis=2).max(axis=1)
        area = np.linalg.norm(np.cross(v[:, 1] - v[:, 0], v[:, 2] - v[:, 0]), axis=1)
        # A triangle without area is never hit: nothing is lost with it.
        height = np.divide(area, longest, out=np.full_like(area, np.inf), where=area > 0.0)
        return np.asarray(height)
    if leaf.field in ("rectangles", "disks"):
        steepest = np.maximum(*(np.linalg.norm(x, axis=1) for x in (table.x_of, table.y_of)))
        return np.asarray(2.0 / steepest)
    if leaf.field in ("boxes", "quadrics", "tori"):
        rows = np.linalg.norm(table.to_local.reshape(-1, 3, 3), axis=2).max(axis=1)
        if leaf.field == "tori":
            return np.asarray(2.0 * table.minor / rows)
        if leaf.field == "boxes":
            return np.asarray(2.0 / rows)
    side = leaf.upper - leaf.lower
    side = np.where(side > 4.0 * UNIT_ROUNDOFF * np.abs(leaf.upper), side, np.inf)
    return np.asarray(side.min(axis=1))


LARGEST = 2.0**510 / 6.0
"""The largest coordinate, 5.6e152: edge functions of rays at a triangle six times as far away are
sums of 16 products of two coordinates, which must be finite."""


def _large(leaves: list[Leaf]) -> Iterator[Limit]:
    """The largest coordinate of each finite shape."""
    for leaf in leaves:
        reach = float(np.maximum(np.abs(leaf.lower), np.abs(leaf.upper)).max())
        if math.isfinite(reach):
            yield Limit(RANGE, leaf.name, LARGEST, reach)


RANGE = "range"


# ---- gaps ---------------------------------------------------------------------------------------


def _contacts(leaves: list[Leaf]) -> Iterator[Limit]:
    """Gaps between spheres, and between parallel planes of boxes, rectangles and disks.  Two
    surfaces are resolved if they are farther apart than the sum of their errors.  Coincident
    surfaces are no gap."""
    spheres = [leaf for leaf in leaves if leaf.field == "spheres"]
    if len(spheres) > 1:
        center = np.concatenate([leaf.table.center for leaf in spheres])
        radius = np.concatenate([leaf.table.radius for leaf in spheres])
        error = np.concatenate([leaf.error for leaf in spheres])
        for i in range(len(spheres) - 1):
            apart = np.linalg.norm(center[i + 1 :] - center[i], axis=1)
            rest = radius[i + 1 :]
            gap = np.minimum(
                np.abs(apart - (radius[i] + rest)), np.abs(apart - np.abs(radius[i] - rest))
            )
            bound = error[i] + error[i + 1 :]
            # A distance below the rounding of these operations means coincident.
            rounding = 8.0 * UNIT_ROUNDOFF * (apart + radius[i] + rest)
            yield from _gaps(spheres, i, gap, bound, rounding)
    faces = [face for leaf in leaves for face in _faces(leaf)][:MOST_FACES]
    for i, (leaf, c, n) in enumerate(faces):
        near = [
            (other, abs(float((at - c) @ n)))
            for other, at, along in faces[i + 1 :]
            if other is not leaf and abs(float(along @ n)) > 1.0 - PARALLEL and _near(leaf, other)
        ]
        for other, gap in near:
            bound = float(leaf.error[0] + other.error[0])
            if gap > 16.0 * UNIT_ROUNDOFF * float(np.abs([c, other.upper[0]]).max()):
                yield Limit("gap", f"{leaf.name} and {other.name}", gap, bound)


PARALLEL = 2.0**-40
"""Largest 1 - cosine of planes that count as parallel: turned by less than a millionth."""

MOST_FACES = 400
"""Most planes that are compared with each other."""


def _gaps(
    leaves: list[Leaf], i: int, gap: FloatArray, bound: FloatArray, rounding: FloatArray
) -> Iterator[Limit]:
    ratio = np.where(gap > rounding, gap / bound, np.inf)
    k = int(np.argmin(ratio))
    if math.isfinite(ratio[k]):
        what = f"{leaves[i].name} and {leaves[i + 1 + k].name}"
        yield Limit("gap", what, float(gap[k]), float(bound[k]))


def _faces(leaf: Leaf) -> Iterator[tuple[Leaf, FloatArray, FloatArray]]:
    """(leaf, a point, the unit normal) of each plane that bounds a flat shape."""
    if leaf.field in ("rectangles", "disks"):
        yield leaf, leaf.table.center[0], leaf.table.normal[0]
    elif leaf.field == "boxes":
        edges, rows = leaf.table.edges[0].reshape(3, 3), leaf.table.to_local[0].reshape(3, 3)
        for edge, row in zip(edges, rows, strict=True):
            n = row / np.linalg.norm(row)
            yield leaf, leaf.table.center[0] - edge, n
            yield leaf, leaf.table.center[0] + edge, n


def _near(a: Leaf, b: Leaf) -> bool:
    """Whether the boxes of two shapes are closer than their errors."""
    slack = a.error[0] + b.error[0]
    low, high = np.maximum(a.lower[0], b.lower[0]), np.minimum(a.upper[0], b.upper[0])
    return bool((low <= high + slack).all())


# ---- indices ------------------------------------------------------------------------------------


def _indices(scene: Scene) -> Iterator[Limit]:
    """Refraction depends on eta - 1.  Both indices and their quotient are rounded: an error of
    3 u."""
    for name, material in scene.materials.items():
        inside = getattr(material, "interior_ior", None)
        outside = getattr(material, "exterior_ior", None)
        if inside is not None and outside is not None and inside != outside:
            away = abs(inside - outside) / outside
            yield Limit("index", f"materials.{name}: eta - 1", away, 3.0 * UNIT_ROUNDOFF)


def in_words(limit: Limit) -> str:
    """A limit in words."""
    if limit.law == RANGE:
        return f"{limit.what}: reaches {limit.bound:.3g}, float64's products {limit.size:.3g}"
    if limit.is_beyond:
        return f"{limit.what}: {limit.size:.3g}, float64's error is {limit.bound:.3g}"
    return f"{limit.what}: {limit.size:.3g} is {limit.margin:.2g} times float64's error"
