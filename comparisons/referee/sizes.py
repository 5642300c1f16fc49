"""Lengths of the primitives of a scene, from which error bounds are made."""

from typing import Any

import numpy as np

from comparisons import shapes
from comparisons.geometry import affine
from comparisons.geometry.flatten import Copy, copies_of, place_of
from comparisons.geometry.frame import OURS, Frame
from comparisons.shapes.shape import Features
from reference_rt.core.arrays import Bounds, FloatArray, IdArray, IntArray
from reference_rt.rendering.query import Intersections
from reference_rt.rendering.scene import Scene
from reference_rt.shapes import TABLES
from reference_rt.shapes.shape import Shape


class LeafSizes:
    """Lengths of one primitive shape, in its group's coordinates: `feature_at` points (n, 3) of its
    faces (n,) is the smallest length over which its uv or its normal change, `bend_at` that of its
    normal alone, infinite on planes.

    shape: the description;  material: its name;  table: its rows;  field: the field of `Shapes`
    that they belong to;  known: that table's type;  bounds: lower and upper, (3,) each,
    infinite for a plane.
    """

    def __init__(self, shape: Shape, material: str | None, table: Any) -> None:
        self.shape, self.material, self.table = shape, material, table
        self.field, module = next((f, m) for _, f, t, m in TABLES if t is type(table))
        lower, upper = module.bounds(table)
        self.bounds: Bounds = lower.min(axis=0), upper.max(axis=0)
        self.is_finite = bool(np.isfinite(self.bounds).all())
        self.known = shapes.TABLES[self.field]
        self.feature_at = self.known.features(table)
        bends = self.known.bends
        self.bend_at = self.feature_at if bends is None else bends(table)

    def row_of(self, primitive: IntArray | IdArray) -> IntArray | IdArray:
        """The rows (n,) of the table for the faces `primitive`: faces of a mesh are numbered as in
        its file, and the table lacks those without area."""
        if self.field != "triangles":
            return primitive
        return np.searchsorted(self.table.face, primitive)


class ShapeSizes:
    """Lengths of a scene's shapes.

    reach (shapes,): the largest coordinate on each shape, counted from the origin of `frame`, 0 for
    infinite planes;  lower, upper (3,): the bounds of all finite shapes;  copies: `copies_of` the
    scene;  leaves: its distinct primitives;  frame: the coordinates of the scene's counterpart.
    """

    def __init__(self, scene: Scene, frame: Frame = OURS) -> None:
        self.frame = frame
        self.copies = copies_of(scene)
        self.reach = np.zeros(len(scene.shapes))
        self.lower, self.upper = np.full(3, np.inf), np.full(3, -np.inf)
        self.leaves: list[LeafSizes] = []
        # For each group, or shape that is no instance: the index of the leaf of each part.
        self._parts: dict[str, list[int]] = {}
        for copy in self.copies:
            self._add(scene, copy)
        maps = np.array([copy.outer for copy in self.copies]).reshape(-1, 3, 4)
        self._offset, self._inverse = maps[:, :, 3], np.linalg.inv(maps[:, :, :3])
        # A map shrinks lengths at most by its smallest singular value.
        values = np.linalg.svd(maps[:, :, :3], compute_uv=False)
        self._most, self._least = values[:, 0], values[:, -1]
        self._first_copy = np.searchsorted(
            [c.shape for c in self.copies], np.arange(len(self.reach))
        )
        most = max(map(len, self._parts.values()), default=1)
        groups = {name: k for k, name in enumerate(self._parts)}
        self._leaf_of = np.array([x + [-1] * (most - len(x)) for x in self._parts.values()])
        self._group_of = np.array([groups[_name(copy)] for copy in self.copies], np.int64)
        if not np.isfinite(self.lower).all():  # only infinite planes
            eye, target = np.array(scene.camera.eye), np.array(scene.camera.target)
            size = np.abs(eye - target).max()
            self.lower = np.minimum(eye, target) - size
            self.upper = np.maximum(eye, target) + size

    def _add(self, scene: Scene, copy: Copy) -> None:
        leaves = [leaf for member in copy.members for leaf in member.leaves]
        name = _name(copy)
        if name not in self._parts:
            numbers = self._parts[name] = [-1] * (max(leaf.part for leaf in leaves) + 1)
            for leaf in leaves:
                numbers[leaf.part] = len(self.leaves)
                place = place_of(scene, leaf, affine.IDENTITY)
                table = leaf.shape.tabulate(place)
                self.leaves.append(LeafSizes(leaf.shape, leaf.material, table))
        for sizes in self.leaves_of(copy):
            if sizes.is_finite:
                corners = corners_of(sizes.bounds, copy.outer)
                self.lower = np.minimum(self.lower, corners.min(axis=0))
                self.upper = np.maximum(self.upper, corners.max(axis=0))
                reach = float(self.frame.largest(corners).max())
                self.reach[copy.shape] = max(self.reach[copy.shape], reach)

    def leaves_of(self, copy: Copy) -> list[LeafSizes]:
        """The primitives of a copy."""
        return [self.leaves[number] for number in self._parts[_name(copy)] if number >= 0]

    def by_part(self, copy: Copy) -> dict[int, LeafSizes]:
        """The primitives of a copy, by part."""
        numbers = enumerate(self._parts[_name(copy)])
        return {part: self.leaves[number] for part, number in numbers if number >= 0}

    def reach_of(self, shape: IntArray | IdArray) -> FloatArray:
        """(n,): the reach of the shapes with these indices, 0 for -1."""
        return np.asarray(np.append(self.reach, 0.0)[shape])

    def copy_of(self, hits: Intersections) -> IntArray:
        """(n,): the index in `copies` that was hit; arbitrary for a miss."""
        shape = np.maximum(hits.shape, 0)
        return np.asarray(self._first_copy[shape] + np.maximum(hits.instance, 0))

    def leaf_of(self, hits: Intersections) -> IntArray:
        """(n,): the index in `leaves` that was hit, -1 for a miss."""
        known = hits.shape >= 0
        numbers = np.full(len(known), -1)
        group = self._group_of[self.copy_of(hits)[known]]
        numbers[known] = self._leaf_of[group, hits.part[known]]
        return numbers

    def local_points(self, hits: Intersections) -> FloatArray:
        """(n, 3): the hit points in the coordinates of their groups."""
        copy = self.copy_of(hits)
        moved = hits.p - self._offset[copy]
        return np.asarray(np.einsum("nij,nj->ni", self._inverse[copy], moved))

    def feature_of(self, hits: Intersections) -> FloatArray:
        """(n,): the feature size at each hit, in scene units; infinite for a miss."""
        return self._at(hits, [leaf.feature_at for leaf in self.leaves])

    def bend_of(self, hits: Intersections) -> FloatArray:
        """(n,): the smallest length over which the normal changes at each hit; infinite for a miss,
        and on planes."""
        return self._at(hits, [leaf.bend_at for leaf in self.leaves])

    def _at(self, hits: Intersections, lengths: list[Features]) -> FloatArray:
        """(n,): those of the leaves' `lengths` at each hit, in scene units."""
        found = np.full(len(hits.t), np.inf)
        copy, leaf, local = self.copy_of(hits), self.leaf_of(hits), self.local_points(hits)
        for number in np.unique(leaf[leaf >= 0]).tolist():
            rows = np.flatnonzero(leaf == number)
            found[rows] = self._least[copy[rows]] * lengths[number](
                local[rows], hits.primitive[rows]
            )
        return found

    def straightness_of(self, hits: Intersections) -> FloatArray:
        """(n,): the length of the sum of the weighted vertex normals at each hit of a mesh, 1 where
        they agree and 0 where they cancel; 1 elsewhere.  The unit normal turns by 1 / that length
        as much as the sum does."""
        found = np.ones(len(hits.t))
        leaf, local = self.leaf_of(hits), self.local_points(hits)
        for number in np.unique(leaf[leaf >= 0]).tolist():
            of = self.leaves[number]
            if getattr(of.table, "normals", None) is not None:
                rows = np.flatnonzero(leaf == number)
                found[rows] = _interpolated(of.table, of.row_of(hits.primitive[rows]), local[rows])
        return found


def _interpolated(table: Any, rows: IntArray, p: FloatArray) -> FloatArray:
    """(n,): the length of the interpolated vertex normals at points p (n, 3) of triangles."""
    a, b, c = np.moveaxis(table.vertices[rows].reshape(-1, 3, 3), 1, 0)
    n = np.cross(b - a, c - a)
    twice = np.sum(n * n, axis=1)
    weights = [
        np.sum(n * np.cross(v - u, p - u), axis=1) / twice for u, v in ((b, c), (c, a), (a, b))
    ]
    normals = np.moveaxis(table.normals[rows].reshape(-1, 3, 3), 1, 0)
    mixed = sum(w[:, None] * m for w, m in zip(weights, normals, strict=True))
    return np.asarray(np.linalg.norm(mixed, axis=1))


def _name(copy: Copy) -> str:
    """The key that copies with the same leaves share: the group, or a shape's index and a colon,
    which no group's name has."""
    return copy.group if copy.instance >= 0 else f"{copy.shape}:"


def corners_of(bounds: Bounds, m: affine.Affine) -> FloatArray:
    """(8, 3): the corners of a box, mapped by m."""
    ends = np.stack(bounds)
    pick = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    return affine.apply_points(m, ends[pick, [0, 1, 2]])
