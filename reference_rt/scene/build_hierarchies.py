"""Acceleration structures over a scene's shapes and instances; tables sorted into leaf order."""

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from reference_rt.accel import bvh
from reference_rt.accel.bvh import Bvh
from reference_rt.accel.leaf import INSTANCE, SOLID
from reference_rt.core.arrays import Bounds, FloatArray, IdArray, IntArray
from reference_rt.shapes import QUADRIC, TABLES, TRIANGLE
from reference_rt.shapes.brute_force import SIDE_BY_SIDE
from reference_rt.shapes.instances import Instances
from reference_rt.shapes.placement import bounds as placed_bounds

BVH_FROM = 40
"""Number of primitives from which a hierarchy pays.  Random rays among random shapes took the same
time with and without one at 45 spheres, 80 boxes and 90 rectangles, which brute force tests with
vector instructions, as it does disks, and at 4 triangles, which it tests one by one and which
therefore count as ONE_BY_ONE each (a core with AVX-512).  So do quadrics: 8 cylinders take the same
time in blocks of rays, but in front of single rays of Whitted's method 6 take 2.6 times as long."""
ONE_BY_ONE = 10


Kinds = npt.NDArray[np.int8]
"""Kinds of primitives: codes of tables, SOLID, INSTANCE or OPERAND."""

_TOGETHER = 1 << 15
"""Primitives whose boxes are computed together: more only take more memory."""


class TableRows(NamedTuple):
    """Primitives, solids or operands of one kind: their rows (n,)."""

    kind: int
    rows: IdArray


class ExpandedInstance(NamedTuple):
    """An expanded instance: its index in the scene, hierarchies (k,) and transforms (k, 3, 4)."""

    owner: int
    trees: IntArray
    maps: FloatArray


class HierarchyBuilder:
    """Builds the hierarchies of a scene and joins them into the arrays of one `Bvh`.

    method: of `bvh.build`, or "auto";  tables: by field of `Shapes`;  bounds: boxes of the kinds
    without a table.
    """

    def __init__(
        self,
        method: bvh.Method | Literal["auto"],
        tables: dict[str, Any],
        bounds: dict[int, Bounds],
    ) -> None:
        self.method, self.tables, self.bounds = method, tables, bounds
        self._wide: list[bvh.Wide] = []
        self._boxes: list[FloatArray] = []
        self._sizes: list[int] = []
        self._kinds: list[Kinds] = []
        self._rows: list[IdArray] = []
        self._unbounded = -1
        self._instances: Instances | None = None
        self._new_rows: dict[int, IdArray] = {}
        self._scene: int | None = None

    def add(self, references: Sequence[TableRows], whole: bool = False) -> int:
        """Build a hierarchy over these, which are finite, and return its number.  whole: reference
        each only once."""
        kinds, rows = _joined(references)
        nodes, order = self._built(kinds, rows, self._boxes_of(kinds, rows)[0], whole)
        return self._append(nodes, kinds[order], rows[order])

    def finish(
        self, top: Sequence[TableRows], copies: Sequence[ExpandedInstance], roots: Sequence[int]
    ) -> None:
        """Build the scene's top-level hierarchy over shapes and instances, and sort the tables into
        leaf order.  roots: the numbers of the hierarchies that `copies` refer to."""
        if copies:
            self._instances = self._place(copies, roots)
            count = len(self._instances.owner)
            top = [*top, TableRows(INSTANCE, np.arange(count, dtype=np.int32))]
        kinds, rows = _joined(sorted(top, key=lambda some: some.kind))
        if len(kinds) > 0 and not (self.method == "auto" and self._is_few(kinds)):
            self._add_top(kinds, rows)
        self._order_rows()

    def hierarchy(self) -> Bvh | None:
        """All hierarchies, the scene's first; None if brute force is faster for few shapes."""
        if self._scene is None:
            return None
        order = [self._scene, *(k for k in range(len(self._sizes)) if k != self._scene)]
        joined = bvh.joined(
            [self._wide[k] for k in order],
            [self._kinds[k] for k in order],
            [self._rows[k] for k in order],
        )
        for used in (self._wide, self._kinds, self._rows):
            used.clear()
        triangles = self.tables["triangles"]
        if triangles is not None:
            joined = bvh.with_corners(joined, triangles.points, triangles.corners)
        return joined._replace(unbounded=-1 if self._unbounded < 0 else self.start(self._unbounded))

    def start(self, tree: int) -> int:
        """The index of a hierarchy's root among all nodes."""
        if tree == self._scene:
            return 0
        before = sum(self._sizes[k] for k in range(tree) if k != self._scene)
        return before + (0 if self._scene is None else self._sizes[self._scene])

    def instances(self) -> Instances | None:
        if self._instances is None:
            return None
        starts = np.array([self.start(k) for k in range(len(self._sizes))])
        return self._instances._replace(root=starts[self._instances.root])

    def new_row(self, kind: int, row: int) -> int:
        """The new index of a row of a table after sorting."""
        return int(self._new_rows[kind][row])

    # ---- how ------------------------------------------------------------------------------------

    def _add_top(self, kinds: Kinds, rows: IdArray) -> None:
        """The scene's own hierarchy, and one leaf of what is infinite."""
        boxes, finite = self._boxes_of(kinds, rows)
        infinite = kinds[~finite], rows[~finite]
        if finite.any():
            if len(infinite[0]):
                kinds, rows = kinds[finite], rows[finite]
            nodes, order = self._built(kinds, rows, boxes)
            del boxes  # it takes more than all that follows
            self._scene = self._append(nodes, kinds[order], rows[order])
        if len(infinite[0]):
            everywhere = np.repeat([-np.inf, np.inf], 3)[None]
            size = np.array([len(infinite[0])], np.int32)
            leaf = bvh.Nodes(everywhere, np.zeros(1, np.int32), size)
            self._unbounded = self._append(leaf, *infinite)
            if self._scene is None:
                self._scene, self._unbounded = self._unbounded, -1

    def _built(
        self, kinds: Kinds, rows: IdArray, boxes: FloatArray, whole: bool = False
    ) -> tuple[bvh.Nodes, IdArray]:
        method: bvh.Method = "sah" if self.method == "auto" else self.method
        if whole and method == "spatial":
            method = "sah"
        return bvh.build_over(boxes, method, self._corners(kinds, rows))

    def _append(self, nodes: bvh.Nodes, kinds: Kinds, rows: IdArray) -> int:
        self._wide.append(bvh.widened(nodes, kinds == TRIANGLE))
        self._sizes.append(len(self._wide[-1].codes))
        self._boxes.append(nodes.boxes[0].copy())
        self._kinds.append(kinds)
        self._rows.append(rows)
        return len(self._wide) - 1

    def _is_few(self, kinds: Kinds) -> bool:
        if self._wide or len(kinds) >= BVH_FROM or np.any(kinds >= SOLID):
            return False
        quick = np.isin(kinds, SIDE_BY_SIDE) & (kinds != QUADRIC)
        work = np.where(quick, 1, ONE_BY_ONE)
        return bool(work.sum() < BVH_FROM)

    def _boxes_of(self, kinds: Kinds, rows: IdArray) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
        """The boxes of those that are finite, one after another, see `bvh.build_over`; and which
        are finite, (n,)."""
        boxes, finite, count = bvh.room_for(len(kinds)), np.empty(len(kinds), np.bool_), 0
        for begin in range(0, len(kinds), _TOGETHER):
            here = slice(begin, begin + _TOGETHER)
            box = np.empty((len(kinds[here]), 6))
            for kind in np.unique(kinds[here]).tolist():
                mine = kinds[here] == kind
                box[mine, :3], box[mine, 3:] = self._bounds_of(kind, rows[here][mine])
            finite[here] = np.isfinite(box).all(axis=1)
            box = box[finite[here]]
            boxes[count : count + len(box), :6] = box
            count += len(box)
        return boxes[: count + 1], finite

    def _bounds_of(self, kind: int, rows: IdArray) -> Bounds:
        if kind in self.bounds:
            low, high = self.bounds[kind]
            return low[rows], high[rows]
        _, field, table_type, module = TABLES[kind]
        columns = self.tables[field]._asdict()
        which: slice | IdArray = rows
        if np.array_equal(rows, np.arange(rows[0], rows[0] + len(rows))):
            which = slice(int(rows[0]), int(rows[0]) + len(rows))  # not copied
        for name in _by_row(columns, module):
            columns[name] = columns[name][which]
        bounds: Bounds = module.bounds(table_type(**columns))
        return bounds

    def _corners(self, kinds: Kinds, rows: IdArray) -> FloatArray | None:
        """The vertices (n, 9) of triangles for clipping by spatial splits; NaN for other kinds."""
        if self.method != "spatial":
            return None
        corners = np.full((len(kinds), 9), np.nan)
        mine = kinds == TRIANGLE
        if mine.any():
            corners[mine] = self.tables["triangles"].vertices[rows[mine]]
        return corners

    def _place(self, copies: Sequence[ExpandedInstance], roots: Sequence[int]) -> Instances:
        """The table of instances, with the hierarchy's number as `root`.  Computes their bounds."""
        maps = np.concatenate([c.maps for c in copies])
        trees = np.array(roots)[np.concatenate([c.trees for c in copies])]
        counts = [len(c.trees) for c in copies]
        edges = maps[:, :, :3].transpose(0, 2, 1).reshape(-1, 9)
        inverse = np.linalg.inv(maps[:, :, :3]).reshape(-1, 9)
        table = Instances(
            center=np.ascontiguousarray(maps[:, :, 3]),
            to_local=np.ascontiguousarray(inverse),
            edges=np.ascontiguousarray(edges),
            root=trees,
            owner=np.repeat([c.owner for c in copies], counts),
            copy=np.concatenate([np.arange(n) for n in counts]),
        )
        boxes = np.array(self._boxes)[trees]
        self.bounds[INSTANCE] = placed_bounds(table.center, edges, boxes[:, :3], boxes[:, 3:])
        return table

    def _order_rows(self) -> None:
        """Sort the tables into the order of the leaves, so that neighbours are adjacent in
        memory."""
        kinds = np.concatenate([np.zeros(0, np.int8), *self._kinds])
        rows = np.concatenate([np.zeros(0, np.int32), *self._rows])
        for code, field, table_type, module in TABLES:
            if self.tables[field] is None:
                continue
            # Column by column, so that no two tables of a large mesh are in memory.
            columns = self.tables[field]._asdict()
            self.tables[field] = None
            order = _first_named(rows[kinds == code], len(columns["face"]))
            new_row = np.empty_like(order)
            new_row[order] = np.arange(len(order), dtype=np.int32)
            self._new_rows[code] = new_row
            for name in _by_row(columns, module):
                columns[name] = np.ascontiguousarray(columns[name][order])
            self.tables[field] = table_type(**columns)
            for tree_kinds, tree_rows in zip(self._kinds, self._rows, strict=True):
                mine = tree_kinds == code
                tree_rows[mine] = new_row[tree_rows[mine]]


def _by_row(columns: dict[str, Any], module: Any) -> list[str]:
    """The names of a table's columns with a row for each shape: neither absent, nor ragged, nor
    `triangle_table.shared`."""
    left_out, count = getattr(module, "RAGGED", ()), len(columns["face"])
    return [
        name
        for name, column in columns.items()
        if column is not None and name not in left_out and len(column) == count
    ]


def _first_named(rows: IdArray, count: int) -> IdArray:
    """A permutation of range(count): first those in rows (m,), in the order of their first
    occurrence, then the rest."""
    named = np.zeros(count, np.bool_)
    named[rows] = True
    if len(rows) == count and named.all():
        return rows  # all of them once, as in a mesh: sorting a million takes 60 ms
    first = np.full(count, len(rows))
    # Backwards, so that the first of several occurrences wins.
    first[rows[::-1]] = np.arange(len(rows))[::-1]
    return np.argsort(first, kind="stable").astype(np.int32)


def _joined(references: Sequence[TableRows]) -> tuple[Kinds, IdArray]:
    """Kinds and rows (n,); rows of a single kind are not copied."""
    if len(references) == 1:
        kind, rows = references[0]
        return np.full(len(rows), kind, np.int8), rows
    kinds = [np.full(len(r.rows), r.kind, np.int8) for r in references]
    return (
        np.concatenate([np.zeros(0, np.int8), *kinds]),
        np.concatenate([np.zeros(0, np.int32), *(r.rows for r in references)]),
    )
