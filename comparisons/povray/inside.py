"""Bounds of shapes, by which two of them are certainly apart."""

from typing import NamedTuple

import numpy as np

from comparisons.geometry import affine
from comparisons.geometry.flatten import Copy, Member, Tree
from comparisons.referee.sizes import ShapeSizes, corners_of
from reference_rt.core.arrays import FloatArray
from reference_rt.shapes import Sphere

TOUCHING = 2.0**-30
"""Of the coordinates: far above their rounding."""


class Region(NamedTuple):
    """What a shape is in: a box lower to upper (3,), and a ball.  touches: whether a plane may
    touch it in a single point, as it touches a sphere."""

    lower: FloatArray
    upper: FloatArray
    center: FloatArray
    radius: float
    touches: bool = False

    def meets(self, other: "Region") -> bool:
        """Whether the two may have more than one point in common."""
        slack = TOUCHING * float(np.abs([self.lower, self.upper]).max())
        slack = -slack if self.touches else slack
        with np.errstate(invalid="ignore"):  # of planes, which are infinite
            apart = (self.lower - slack >= other.upper) | (self.upper + slack <= other.lower)
            distances = (
                np.linalg.norm(self.center - other.center) - self.radius - other.radius,
                _distance(self.center, other) - self.radius,
                _distance(other.center, self) - other.radius,
            )
        return not (apart.any() or any(d >= slack for d in distances))


def _distance(p: FloatArray, region: Region) -> float:
    """From a point to the box of a region."""
    return float(np.linalg.norm(p - np.clip(p, region.lower, region.upper)))


def region_at(p: FloatArray) -> Region:
    """That of a point."""
    return Region(p, p, p, 0.0)


def region_of(member: Member, copy: Copy, sizes: ShapeSizes) -> Region:
    """That of a member of a scene's copy."""
    leaves = sizes.by_part(copy)

    def box(tree: Tree | int) -> FloatArray:
        if isinstance(tree, int):
            leaf = leaves[member.leaves[tree].part]
            if not leaf.is_finite:
                return np.array([[-np.inf] * 3, [np.inf] * 3])
            corners = corners_of(leaf.bounds, copy.outer)
            return np.stack([corners.min(axis=0), corners.max(axis=0)])
        boxes = np.stack([box(part) for part in tree.of])
        if tree.operation == "union":
            return np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])
        if tree.operation == "difference":
            return np.asarray(boxes[0])
        return np.stack([boxes[:, 0].max(axis=0), boxes[:, 1].min(axis=0)])

    lower, upper = box(0 if member.tree is None else member.tree)
    shape = member.leaves[0].shape
    if member.tree is None and isinstance(shape, Sphere):
        m = affine.compose(affine.of_steps(shape.transform), copy.outer)
        center = affine.apply_points(m, np.array([shape.center]))[0]
        radius = shape.radius * float(np.linalg.svd(m[:, :3], compute_uv=False)[0])
        return Region(lower, upper, center, radius, True)
    if not np.isfinite([lower, upper]).all():
        return Region(lower, upper, np.zeros(3), np.inf)
    return Region(lower, upper, 0.5 * (lower + upper), 0.5 * float(np.linalg.norm(upper - lower)))
