"""Acceleration structures over a scene's shapes and instances; tables sorted into leaf order."""

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import numpy as np

from reference_rt.accel import bvh
from reference_rt.accel.bvh import Bvh
from reference_rt.accel.leaf import INSTANCE, SOLID
from reference_rt.core.arrays import Bounds, FloatArray, IntArray
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


class TableRows(NamedTuple):
    """Primitives or solids of one kind: their rows (n,)."""

    kind: int
    rows: IntArray


class ExpandedInstance(NamedTuple):
    """An expanded instance: its index in the scene, hierarchies (k,) and transforms (k, 3, 4)."""

    owner: int
    trees: IntArray
    maps: FloatArray


class HierarchyBuilder:
    """Builds the hierarchies of a scene and joins them into the arrays of one `Bvh`.

    method: of `bvh.build`, or "auto";  tables: by field of `Shapes`;  bounds: boxes of each kind.
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
        self._kinds: list[IntArray] = []
        self._rows: list[IntArray] = []
        self._unbounded = -1
        self._instances: Instances | None = None
        self._new_rows: dict[int, IntArray] = {}
        self._scene: int | None = None

    def add(self, references: Sequence[TableRows], whole: bool = False, last: bool = False) -> int:
        """Build a hierarchy over these, and return its number.  whole: reference each only once;
        last: forget the bounds, no other one is built."""
        kinds, rows = _joined(references)
        lower, upper = self._bounds_of(kinds, rows)
        method: bvh.Method = "sah" if self.method == "auto" else self.method
        if whole and method == "spatial":
            method = "sah"
        nodes, order = bvh.build(lower, upper, method, self._corners(kinds, rows))
        if last:
            self.bounds.clear()
        del lower, upper
        return self._append(nodes, kinds[order], rows[order])

    def finish(
        self, top: Sequence[TableRows], copies: Sequence[ExpandedInstance], roots: Sequence[int]
    ) -> None:
        """Build the scene's top-level hierarchy over shapes and instances, and sort the tables into
        leaf order.  roots: the numbers of the hierarchies that `copies` refer to."""
        if copies:
            self._instances = self._place(copies, roots)
            count = len(self._instances.owner)
            top = [*top, TableRows(INSTANCE, np.arange(count))]
        kinds, rows = _joined(top)
        if len(kinds) > 0 and not (self.method == "auto" and self._is_few(kinds)):
            lower, upper = self._bounds_of(kinds, rows)
            finite = np.isfinite(lower).all(axis=1) & np.isfinite(upper).all(axis=1)
            del lower, upper  # `add` computes them again: two copies would double the memory
            if finite.any():
                bounded = [TableRows(k, rows[finite & (kinds == k)]) for k in _distinct(kinds)]
                self._scene = self.add([some for some in bounded if len(some.rows)], last=True)
            if not finite.all():
                everywhere = np.repeat([-np.inf, np.inf], 3)[None]
                leaf = bvh.Nodes(everywhere, np.zeros(1, np.int64), np.array([(~finite).sum()]))
                self._unbounded = self._append(leaf, kinds[~finite], rows[~finite])
                if self._scene is None:
                    self._scene, self._unbounded = self._unbounded, -1
        self._order_rows()

    def hierarchy(self) -> Bvh | None:
        """All hierarchies, the scene's first; None if brute force is faster for few shapes."""
        if self._scene is None:
            return None
        order = [self._scene, *(k for k in range(len(self._wide)) if k != self._scene)]
        triangles = self.tables["triangles"]
        joined = bvh.joined(
            [self._wide[k] for k in order],
            [self._kinds[k] for k in order],
            [self._rows[k] for k in order],
            None if triangles is None else triangles.vertices,
        )
        return joined._replace(unbounded=-1 if self._unbounded < 0 else self.start(self._unbounded))

    def start(self, tree: int) -> int:
        """The index of a hierarchy's root among all nodes."""
        if tree == self._scene:
            return 0
        before = sum(len(self._wide[k].codes) for k in range(tree) if k != self._scene)
        return before + (0 if self._scene is None else len(self._wide[self._scene].codes))

    def instances(self) -> Instances | None:
        if self._instances is None:
            return None
        starts = np.array([self.start(k) for k in range(len(self._wide))])
        return self._instances._replace(root=starts[self._instances.root])

    def new_row(self, kind: int, row: int) -> int:
        """The new index of a row of a table after sorting."""
        return int(self._new_rows[kind][row])

    # ---- how ------------------------------------------------------------------------------------

    def _append(self, nodes: bvh.Nodes, kinds: IntArray, rows: IntArray) -> int:
        self._wide.append(bvh.widened(nodes, kinds == TRIANGLE))
        self._boxes.append(nodes.boxes[0].copy())
        self._kinds.append(kinds)
        self._rows.append(rows)
        return len(self._wide) - 1

    def _is_few(self, kinds: IntArray) -> bool:
        if self._wide or np.any(kinds >= SOLID):
            return False
        quick = np.isin(kinds, SIDE_BY_SIDE) & (kinds != QUADRIC)
        work = np.where(quick, 1, ONE_BY_ONE)
        return bool(work.sum() < BVH_FROM)

    def _bounds_of(self, kinds: IntArray, rows: IntArray) -> Bounds:
        present = _distinct(kinds)
        if len(present) == 1:
            low, high = self.bounds[present[0]]
            if len(rows) == len(low) and np.array_equal(rows, np.arange(len(low))):
                return low, high  # not copied: a large mesh
            return low[rows], high[rows]
        lower, upper = np.empty((2, len(kinds), 3))
        for kind in present:
            mine = kinds == kind
            lower[mine], upper[mine] = (side[rows[mine]] for side in self.bounds[kind])
        return lower, upper

    def _corners(self, kinds: IntArray, rows: IntArray) -> FloatArray | None:
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
        kinds = np.concatenate([np.zeros(0, np.int64), *self._kinds])
        rows = np.concatenate([np.zeros(0, np.int64), *self._rows])
        for code, field, table_type, module in TABLES:
            if self.tables[field] is None:
                continue
            # Column by column, so that no two tables of a large mesh are in memory.
            columns = self.tables[field]._asdict()
            self.tables[field] = None
            order = _first_named(rows[kinds == code], len(columns["owner"]))
            new_row = np.empty_like(order)
            new_row[order] = np.arange(len(order))
            self._new_rows[code] = new_row
            ragged = getattr(module, "RAGGED", ())
            for name in columns:
                if columns[name] is not None and name not in ragged:
                    columns[name] = np.ascontiguousarray(columns[name][order])
            self.tables[field] = table_type(**columns)
            for tree_kinds, tree_rows in zip(self._kinds, self._rows, strict=True):
                mine = tree_kinds == code
                tree_rows[mine] = new_row[tree_rows[mine]]


def _distinct(kinds: IntArray) -> list[int]:
    """The distinct codes in kinds (n,), small numbers; np.unique takes 0.2 s for a million."""
    return np.flatnonzero(np.bincount(kinds)).tolist()


def _first_named(rows: IntArray, count: int) -> IntArray:
    """A permutation of range(count): first those in rows (m,), in the order of their first
    occurrence, then the rest."""
    if len(rows) == count and np.bincount(rows, minlength=count).max(initial=0) <= 1:
        return rows  # all of them once, as in a mesh: sorting a million takes 60 ms
    first = np.full(count, len(rows))
    # Backwards, so that the first of several occurrences wins.
    first[rows[::-1]] = np.arange(len(rows))[::-1]
    return np.argsort(first, kind="stable")


def _joined(references: Sequence[TableRows]) -> tuple[IntArray, IntArray]:
    """Kinds and rows (n,)."""
    none = np.zeros(0, np.int64)
    kinds = [np.full(len(r.rows), r.kind) for r in references]
    return np.concatenate([none, *kinds]), np.concatenate([none, *(r.rows for r in references)])
