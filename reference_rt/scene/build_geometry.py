"""Shapes, groups and solids of a scene -> Geometry: tables and acceleration structures."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from reference_rt.accel.geometry import Geometry
from reference_rt.accel.leaf import OPERAND, SOLID
from reference_rt.core.arrays import Bounds, FloatArray, IntArray
from reference_rt.core.transform import identity
from reference_rt.materials.textured import textures_of
from reference_rt.scene.build_hierarchies import ExpandedInstance, HierarchyBuilder, TableRows
from reference_rt.scene.build_media import Boundary
from reference_rt.scene.model import SceneModel
from reference_rt.shapes import TABLES, TRIANGLE, Shape, Shapes, csg
from reference_rt.shapes.csg import NOT, OR, Parts, Solid, Solids
from reference_rt.shapes.instances import Instance, composed
from reference_rt.shapes.meshes.topology import describe_boundary
from reference_rt.shapes.meshes.triangle_table import Triangles, more_sets, shared
from reference_rt.shapes.shape import TabulationContext, outward
from reference_rt.textures.tables import largest_uv_set
from reference_rt.util.errors import MOST_TOLD, SceneError, together
from reference_rt.util.memory import give_back

_CODES = {table: code for code, _, table, _ in TABLES}

OPERANDS_FROM = 8
"""The number of operands with finite boxes from which a solid has a hierarchy over them.  Unions of
4, 6, 8 and 16 balls take a ray 1.0, 1.0, 0.9 and 0.8 of the time with one (measured)."""

MOST_OPERANDS = 10_000
"""Operands of a solid: a ray's walk takes 190 bytes for each of the 8 MiB of a thread's stack."""

MOST_INSTANCES = 10_000_000
"""Instances that a group may expand to: each takes some 500 bytes while the scene is built."""


def assemble(scene: SceneModel, materials: dict[Boundary, int]) -> Geometry:
    """The geometry of a scene, its triangles `shared`.  materials: the row of each material.

    Raises SceneError with file, line and key path.
    """
    work = _Assembly(scene, materials)
    top: list[TableRows] = []
    copies: list[ExpandedInstance] = []
    wrong: list[SceneError] = []
    for i, shape in enumerate(scene.shapes):
        try:
            if isinstance(shape, Instance):
                copies.append(ExpandedInstance(i, *work.copies(shape)))
            else:
                top.append(work.member(shape, i, None))
        except ValueError as error:
            wrong.append(scene.error(str(error), "shapes", i))
        except SceneError as error:
            if error not in wrong:  # of a group that another instance draws, too
                wrong.append(error)
        if len(wrong) == MOST_TOLD:
            break
    if wrong:
        raise together(wrong)
    tables: dict[str, Any] = {}
    bounds: dict[int, Bounds] = {}
    for code, field, _, _ in TABLES:
        tables[field] = None
        if work.tables[code]:  # popped, so that a large mesh is never held twice
            work.check_finite(work.tables[code])
            tables[field] = _concatenate(work.tables.pop(code))
    if tables["triangles"] is not None:
        tables["triangles"] = shared(tables["triangles"])
    if work.solids:
        bounds[SOLID] = _concatenated_bounds([solid.bounds for solid in work.solids])
        bounds[OPERAND] = _concatenated_bounds([solid.boxes for solid in work.solids])
    give_back()  # what readers leave
    trees = HierarchyBuilder(scene.hierarchy, tables, bounds)
    roots = [trees.add(references, whole=whole) for references, whole in work.trees]
    trees.finish(top, copies, roots)
    solids, parts = work.solid_tables(trees, roots), work.part_table()
    del work, top
    give_back()
    hierarchy = trees.hierarchy()
    give_back()
    return Geometry(
        Shapes(**tables),
        hierarchy,
        solids,
        trees.instances(),
        parts,
    )


class _Program:
    """A solid: first operand, number of operands and their boxes (m, 3), (m, 3), gates, local
    origin of its coordinates (anchor), reach from there, and box (1, 3), (1, 3) in the world.

    finite (m,): which operands have finite boxes;  tree: the number of the hierarchy over these, -1
    for none.
    """

    def __init__(
        self, first: int, steps: list[int], boxes: Sequence[Bounds], anchor: FloatArray
    ) -> None:
        self.first, self.count, self.anchor = first, len(boxes), anchor
        self.gates = csg.gates_of(steps)
        lower, upper = _solid_bounds(steps, boxes)
        self.bounds = outward(lower + anchor, upper + anchor)
        self.boxes = np.array([low for low, _ in boxes]), np.array([high for _, high in boxes])
        self.finite = np.isfinite(self.boxes).all(axis=(0, 2))
        self.tree = -1
        # The distance of a corner, doubled to cover its rounding.
        self.reach = 2.0 * math.sqrt(3.0) * float(np.abs(boxes).max())

    def asked(self) -> IntArray:
        """The operands that are in no hierarchy (k,)."""
        return self.first + np.flatnonzero(~self.finite if self.tree >= 0 else self.finite >= 0)


class _Assembly:
    """Collects the primitives of a scene's shapes, groups and solids."""

    def __init__(self, scene: SceneModel, materials: dict[Boundary, int]) -> None:
        self.scene, self.materials = scene, materials
        self.tables: dict[int, list[Any]] = {code: [] for code, _, _, _ in TABLES}
        self.rows = dict.fromkeys(self.tables, 0)
        # The primitives of each hierarchy except the scene's own, and whether spatial splits are
        # forbidden in it.
        self.trees: list[tuple[list[TableRows], bool]] = []
        # Key paths of owners that are not top-level shapes of the scene.
        self.paths: dict[int, tuple[str | int, ...]] = {}
        # (shape, part, solid, turned) by owner number: the scene's shapes first.
        self.parts = [(i, 0, -1, 0) for i in range(len(scene.shapes))]
        self.solids: list[_Program] = []
        # (kind, row, number of the tree) of each operand.
        self.operands: list[tuple[int, int, int]] = []
        self.expansions: dict[str, tuple[IntArray, FloatArray]] = {}
        self.wrong_groups: dict[str, SceneError] = {}
        self.uv_sets = _uv_sets(scene, materials)

    def add(self, shape: Shape, place: TabulationContext) -> TableRows:
        """Add a primitive shape's rows to their table."""
        table = shape.tabulate(place)
        code = _CODES[type(table)]
        if place.material in self.uv_sets:
            self.check_uv_sets(table, place.material)
        first = self.rows[code]
        self.rows[code] += len(table.face)
        self.tables[code].append(table)
        return TableRows(code, np.arange(first, self.rows[code], dtype=np.int32))

    def check_finite(self, parts: Sequence[Any]) -> None:
        """Raise SceneError for a shape, whose table is one of these, with numbers that have
        overflowed."""
        for part in parts:
            if not all(np.isfinite(column).all() for column in part if column is not None):
                raise self.scene.error(
                    "its coordinates overflow; expected finite numbers",
                    *self.path_of(int(part.owner[0])),
                )

    def check_uv_sets(self, table: Any, material: int) -> None:
        """Raise ValueError for a shape without the texture coordinates of its material."""
        sets = more_sets(table) if isinstance(table, Triangles) else 0
        for texture, number in self.uv_sets[material].items():
            if number > sets:
                raise ValueError(
                    f"the texture '{texture}' of its material has uv_set {number}; expected a mesh "
                    f"whose 'more_uv' has {number} sets of texture coordinates or more, got {sets}"
                )

    def member(self, shape: Shape, owner: int, material: str | None) -> TableRows:
        """Add a shape of the scene or of a group that is not an instance."""
        name = shape.material if shape.material is not None else material
        of = Boundary(name, shape.interior, shape.exterior)
        if isinstance(shape, Solid):
            return TableRows(SOLID, np.array([self.solid(shape, owner, of)], np.int32))
        return self.add(shape, self.place(owner, of))

    def part(
        self, shape: int, number: int, of: Boundary, solid: int = -1, turned: bool = False
    ) -> TabulationContext:
        """The tabulation context of a part of a shape, with a new owner number."""
        self.parts.append((shape, number, solid, int(turned)))
        return self.place(len(self.parts) - 1, of)

    def place(self, owner: int, of: Boundary) -> TabulationContext:
        return TabulationContext(owner, self.materials[of], self.scene.folder, warn=self.warn)

    def path_of(self, owner: int) -> tuple[str | int, ...]:
        """The key path of an owner in the scene file."""
        return self.paths.get(owner, ("shapes", owner))

    def warn(self, owner: int, message: str) -> None:
        self.scene.warn(message, *self.path_of(owner))

    # ---- solids ---------------------------------------------------------------------------------

    def solid(self, shape: Solid, owner: int, of: Boundary) -> int:
        """Add a solid, and return its number.  Its operands become primitives that are in no
        hierarchy of shapes."""
        first, boxes = len(self.operands), []
        wrong: list[SceneError] = []
        operands = csg.operands_of(shape, identity(), of.material)
        steps = csg.postfix(shape)
        if max(steps) >= MOST_OPERANDS:
            raise ValueError(f"over {MOST_OPERANDS:,} operands; expected fewer in one solid")
        anchor, seen = csg.anchored(shape)
        for k, (_, _, name, turned) in enumerate(operands):
            operand, outer = seen[k]
            try:
                whole, number = self.parts[owner][:2]
                whose = of._replace(material=name)
                place = self.part(whole, number + k, whose, len(self.solids), turned)
                self.paths[place.owner] = self.path_of(owner)
                boxes.append(self.operand(operand, place._replace(outer=outer)))
            except ValueError as error:
                what = f"operand {k}, a {_type_of(operand)}: {error}"
                wrong.append(self.scene.error(what, *self.path_of(owner)))
                if len(wrong) == MOST_TOLD:
                    break
        if wrong:
            raise together(wrong)
        program = _Program(first, steps, boxes, anchor)
        bounded = first + np.flatnonzero(program.finite).astype(np.int32)
        if len(bounded) >= OPERANDS_FROM:
            self.trees.append(([TableRows(OPERAND, bounded)], True))
            program.tree = len(self.trees) - 1
        self.solids.append(program)
        return len(self.solids) - 1

    def operand(self, shape: Shape, place: TabulationContext) -> Bounds:
        """Add an operand, and return its box (3,), (3,)."""
        reference = self.add(shape, place)
        code = reference.kind
        table, module = self.tables[code][-1], TABLES[code][3]
        if code == TRIANGLE:
            problem = describe_boundary(table.vertices)
            if problem:
                raise ValueError(problem)
            # Crossings are counted, so that each triangle must be referenced once.
            self.trees.append(([reference], True))
            self.operands.append((code, -1, len(self.trees) - 1))
        elif hasattr(module, "spans") and getattr(module, "is_solid", lambda _: True)(table):
            self.operands.append((code, int(reference.rows[0]), -1))
        else:
            raise ValueError("it encloses no space; expected a solid")
        lower, upper = module.bounds(table)
        return lower.min(axis=0), upper.max(axis=0)

    def box_of(self, reference: TableRows) -> Bounds:
        """The boxes of the shape that was added last."""
        if reference.kind == SOLID:
            return self.solids[-1].bounds
        bounds: Bounds = TABLES[reference.kind][3].bounds(self.tables[reference.kind][-1])
        return bounds

    def solid_tables(self, trees: HierarchyBuilder, roots: Sequence[int]) -> Solids | None:
        if not self.solids:
            return None
        asked = [s.asked() for s in self.solids]
        asked_count = np.array([len(some) for some in asked])
        gates = np.array([len(s.gates.gate_up) for s in self.solids])
        rows = [trees.new_row(kind, row) if row >= 0 else -1 for kind, row, _ in self.operands]
        return Solids(
            first=np.array([s.first for s in self.solids]),
            operands=np.array([s.count for s in self.solids]),
            tree=np.array([trees.start(roots[s.tree]) if s.tree >= 0 else -1 for s in self.solids]),
            asked_first=np.cumsum(asked_count) - asked_count,
            asked_count=asked_count,
            asked=np.concatenate(asked),
            kind=np.array([kind for kind, _, _ in self.operands]),
            row=np.array(rows),
            root=np.array([trees.start(roots[k]) if k >= 0 else -1 for _, _, k in self.operands]),
            gate_first=np.cumsum(gates) - gates,
            gates=gates,
            up=np.array([to for s in self.solids for to in s.gates.up]),
            gate_up=np.array([to for s in self.solids for to in s.gates.gate_up]),
            gate_start=np.array([on for s in self.solids for on in s.gates.start]),
            anchor=np.array([s.anchor for s in self.solids]),
            reach=np.array([s.reach for s in self.solids]),
        )

    def part_table(self) -> Parts | None:
        if len(self.parts) == len(self.scene.shapes):
            return None
        return Parts(*(np.array(column) for column in zip(*self.parts, strict=True)))

    # ---- groups ---------------------------------------------------------------------------------

    def copies(self, instance: Instance, path: Sequence[str] = ()) -> tuple[IntArray, FloatArray]:
        """Hierarchies (k,) and transforms (k, 3, 4) of an instance, nested ones included."""
        trees, maps = self.expand(instance.group, path)
        outer = instance.maps(self.scene.folder)
        _check_count(len(trees) * len(outer))
        return np.tile(trees, len(outer)), composed(maps, outer)

    def expand(self, name: str, path: Sequence[str] = ()) -> tuple[IntArray, FloatArray]:
        """Hierarchies (k,) and transforms (k, 3, 4) of a group's instance, nested ones included."""
        if name in path:
            raise ValueError(
                f"the group contains itself: {' -> '.join([*path, name])}; expected no circle"
            )
        if name in self.wrong_groups:
            raise self.wrong_groups[name]
        if name not in self.expansions:
            try:
                self.expansions[name] = self._expansion(name, (*path, name))
            except SceneError as error:
                self.wrong_groups[name] = error
                raise
        return self.expansions[name]

    def _expansion(self, name: str, path: Sequence[str]) -> tuple[IntArray, FloatArray]:
        references: list[TableRows] = []
        trees, maps = [], []
        more = 0  # operands of solids so far, beyond one for each solid
        wrong: list[SceneError] = []
        for k, shape in enumerate(self.scene.groups[name]):
            try:
                if isinstance(shape, Instance):
                    inner_trees, inner = self.copies(shape, path)
                    trees.append(inner_trees)
                    maps.append(inner)
                    _check_count(sum(map(len, trees)))
                else:
                    of = Boundary(shape.material, shape.interior, shape.exterior)
                    owner = self.part(-1, k + more, of).owner
                    self.paths[owner] = ("groups", name, k)
                    reference = self.member(shape, owner, None)
                    if not np.isfinite(self.box_of(reference)).all():
                        raise ValueError("it is infinite; expected a shape of a finite size")
                    references.append(reference)
                    if isinstance(shape, Solid):
                        more += self.solids[-1].count - 1
            except ValueError as error:
                wrong.append(self.scene.error(str(error), "groups", name, k))
            except SceneError as error:
                wrong.append(error)
            if len(wrong) == MOST_TOLD:
                break
        if wrong:
            raise together(wrong)
        if references:
            self.trees.append((references, False))
            trees.insert(0, np.array([len(self.trees) - 1]))
            maps.insert(0, identity()[None])
        return np.concatenate(trees), np.concatenate(maps)


def _uv_sets(scene: SceneModel, materials: dict[Boundary, int]) -> dict[int, dict[str, int]]:
    """By the row of a material: its textures by sets of texture coordinates that meshes may lack,
    and the largest number of these."""
    numbers = {name: largest_uv_set(name, scene.textures) for name in scene.textures}
    if not any(numbers.values()):
        return {}
    of_materials = {
        row: {of: numbers[of] for of in textures_of(boundary.material, scene.materials)}
        for boundary, row in materials.items()
        if boundary.material is not None
    }
    return {row: found for row, found in of_materials.items() if any(found.values())}


def _type_of(shape: Shape) -> str:
    return str(getattr(shape, "type", "shape"))


def _check_count(copies: int) -> None:
    if copies > MOST_INSTANCES:
        raise ValueError(f"over {MOST_INSTANCES:,} copies; expected fewer")


def _concatenated_bounds(parts: Sequence[Bounds]) -> Bounds:
    lower, upper = (np.concatenate(side) for side in zip(*parts, strict=True))
    return lower, upper


def _concatenate(parts: Sequence[Any]) -> Any:
    """Concatenate tables."""
    table = type(parts[0])
    align = getattr(TABLES[_CODES[table]][3], "align", None)
    if align is not None:
        parts = align(parts)
    columns = [
        None if column[0] is None else np.ascontiguousarray(_joined(column))
        for column in zip(*parts, strict=True)
    ]
    return table(*columns)


def _joined(arrays: Sequence[Any]) -> Any:
    """Concatenate arrays; a single one is not copied."""
    return arrays[0] if len(arrays) == 1 else np.concatenate(arrays)


def _solid_bounds(steps: Sequence[int], boxes: Sequence[Bounds]) -> Bounds:
    """A bounding box (1, 3), (1, 3) of a solid, possibly infinite.

    A complement is unbounded; an intersection lies in both boxes, a union in the box around both.
    """
    stack: list[Bounds] = []
    for step in steps:
        if step >= 0:
            stack.append(boxes[step])
        elif step == NOT:
            stack[-1] = (np.full(3, -np.inf), np.full(3, np.inf))
        else:
            b, a = stack.pop(), stack.pop()
            low, high = (np.minimum, np.maximum) if step == OR else (np.maximum, np.minimum)
            stack.append((low(a[0], b[0]), high(a[1], b[1])))
    lower, upper = stack.pop()
    # If the boxes are disjoint, the solid is empty, and any box will do.
    return np.minimum(lower, upper)[None], np.maximum(lower, upper)[None]
