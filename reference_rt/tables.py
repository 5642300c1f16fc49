"""Scene -> SceneTables: the only place that makes a scene's arrays.

Every array is float64 or int64, C-contiguous and writable, so that one feature set is one set of
Numba types and compiles once.  What a scene lacks is None: the kernels' branches for it vanish at
compile time.
"""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from reference_rt import bvh
from reference_rt.geometry import Geometry, Packets
from reference_rt.lights import AREA, CONSTANT, POINT, Areas, Choice, Constant, Lights, Point
from reference_rt.lights.constant import Environment
from reference_rt.lights.point import Points
from reference_rt.materials import BLACK, Diffuse, Emissive, Materials
from reference_rt.materials import TABLES as MATERIAL_TABLES
from reference_rt.materials.material import Material
from reference_rt.shapes import TABLES as SHAPE_TABLES
from reference_rt.shapes import TRIANGLE, Shapes
from reference_rt.shapes.shape import FloatArray, IntArray
from reference_rt.shapes.triangle import Triangles, geometric_normals

if TYPE_CHECKING:
    from reference_rt.scene import Scene

BVH_FROM = 40
"""Primitives from which a hierarchy pays: random rays among random shapes were as fast either way
at 45 spheres, 80 boxes and 90 rectangles tested side by side, and at 4 triangles, which are tested
one by one and so count for TRIANGLE_WORK each (a core with AVX-512)."""
TRIANGLE_WORK = 10


class SceneTables(NamedTuple):
    """A scene as its kernels see it."""

    geometry: Geometry
    materials: Materials
    lights: Lights


def build_tables(scene: "Scene") -> SceneTables:
    """The tables of a scene.  Raises SceneError, with the place in the scene file."""
    names = [*scene.materials, None]
    numbers = {name: i for i, name in enumerate(names)}
    with np.errstate(over="ignore", invalid="ignore"):  # found as what is not finite
        tables = _shape_tables(scene, numbers)
        hierarchy = _build_bvh(tables)
        return SceneTables(
            geometry=Geometry(Shapes(**tables), _packets(tables, hierarchy), hierarchy),
            materials=_material_tables(scene, names),
            lights=_light_tables(scene, tables),
        )


def colours(scene: "Scene") -> FloatArray:
    """Each material's own colour (materials, 3): what ray casting shows."""
    return np.array([m.colour for m in scene.materials.values()] + [Diffuse().colour])


# ---- shapes -------------------------------------------------------------------------------------


def _shape_tables(scene: "Scene", materials: dict[str | None, int]) -> dict[str, Any]:
    """One table per kind of primitive, None where there is none."""
    parts: dict[type, list[Any]] = {}
    for i, shape in enumerate(scene.shapes):
        try:
            part = shape.tabulate(i, materials[shape.material], scene.folder)
        except ValueError as error:
            raise scene.error(str(error), "shapes", i) from None
        if not all(np.all(np.isfinite(a)) for a in part if a is not None):
            raise scene.error("its coordinates overflow; expected finite numbers", "shapes", i)
        parts.setdefault(type(part), []).append(part)
    return {
        field: _concatenate(parts[table]) if table in parts else None
        for _, field, table, _ in SHAPE_TABLES
    }


def _concatenate(parts: Sequence[Any]) -> Any:
    """One table from several: the rows one after another."""
    if isinstance(parts[0], Triangles) and any(p.normals is not None for p in parts):
        parts = [_with_normals(p) for p in parts]
    columns = [
        None if column[0] is None else np.ascontiguousarray(np.concatenate(column))
        for column in zip(*parts, strict=True)
    ]
    return type(parts[0])(*columns)


def _with_normals(triangles: Triangles) -> Triangles:
    """Vertex normals for triangles that have none: their own."""
    if triangles.normals is not None:
        return triangles
    n = geometric_normals(triangles.vertices)
    with np.errstate(invalid="ignore"):
        n = np.nan_to_num(n / np.linalg.norm(n, axis=1, keepdims=True))
    return triangles._replace(normals=np.tile(n, 3))


def _present(tables: dict[str, Any]) -> Iterator[tuple[int, str, Any, Any]]:
    """(code, field, table, module) of the tables that the scene has."""
    for code, field, _, module in SHAPE_TABLES:
        if tables[field] is not None:
            yield code, field, tables[field], module


def _build_bvh(tables: dict[str, Any]) -> bvh.Bvh | None:
    """The hierarchy over all primitives, whose rows it puts into leaf order; None for a few."""
    codes = [np.full(len(table.owner), code) for code, _, table, _ in _present(tables)]
    kind = np.concatenate(codes) if codes else np.zeros(0, np.int64)
    if np.where(kind == TRIANGLE, TRIANGLE_WORK, 1).sum() < BVH_FROM:
        return None
    bounds = [module.bounds(table) for _, _, table, module in _present(tables)]
    lower, upper = (np.concatenate(side) for side in zip(*bounds, strict=True))
    boxes, first, size, order = bvh.build(lower, upper)
    row = np.concatenate([np.arange(len(c)) for c in codes])[order]
    kind = kind[order]
    for code, field, table, _ in list(_present(tables)):
        mine = kind == code
        tables[field] = type(table)(
            *(None if a is None else np.ascontiguousarray(a[row[mine]]) for a in table)
        )
        row[mine] = np.arange(len(table.owner))
    return bvh.Bvh(boxes, first, size, kind, row)


def _packets(tables: dict[str, Any], hierarchy: bvh.Bvh | None) -> Packets:
    """The tables side by side, where nothing else leads to their rows."""
    if hierarchy is not None:
        return Packets(None, None, None)
    modules = {field: module for _, field, _, module in _present(tables)}
    return Packets(
        *(
            modules[field].pack_all(tables[field]) if field in modules else None
            for field in Packets._fields
        )
    )


# ---- materials ----------------------------------------------------------------------------------


def _material_tables(scene: "Scene", names: Sequence[str | None]) -> Materials:
    """A row of kind and row for each name; an emissive material scatters as its base does."""
    parts: dict[int, list[Any]] = {}
    kinds, rows = [], []
    for name in names:
        material: Material | None = None
        if name is not None:
            material = scene.materials[name]
        elif any(shape.material is None for shape in scene.shapes):
            material = Diffuse()
        while isinstance(material, Emissive):
            material = None if material.base is None else scene.materials[material.base]
        code = BLACK
        for table_code, _, description, _ in MATERIAL_TABLES:
            if isinstance(material, description):
                code = table_code
                parts.setdefault(code, []).append(material.tabulate())
        kinds.append(code)
        rows.append(len(parts.get(code, [])) - 1)
    tables = {
        field: _concatenate(parts[code]) if code in parts else None
        for code, field, _, _ in MATERIAL_TABLES
    }
    return Materials(np.array(kinds), np.array(rows), **tables)


# ---- lights -------------------------------------------------------------------------------------


def _light_tables(scene: "Scene", tables: dict[str, Any]) -> Lights:
    """All lights, each as likely to be picked as any other; a shape's primitives by their area."""
    areas, area_weights = _area_lights(scene, tables)
    points = [light.tabulate() for light in scene.lights if isinstance(light, Point)]
    environments = [light.tabulate() for light in scene.lights if isinstance(light, Constant)]
    weights = np.concatenate([area_weights, np.ones(len(points) + len(environments))])
    if len(weights) == 0:
        return Lights(None, None, None, None)
    kinds = [AREA] * len(area_weights) + [POINT] * len(points) + [CONSTANT] * len(environments)
    rows = [*range(len(area_weights)), *range(len(points)), *range(len(environments))]
    probability = weights / weights.sum()
    point_table: Points | None = _concatenate(points) if points else None
    environment: Environment | None = environments[0] if environments else None
    choice = Choice(np.array(kinds), np.array(rows), probability, np.cumsum(probability))
    return Lights(point_table, areas, environment, choice)


def _area_lights(scene: "Scene", tables: dict[str, Any]) -> tuple[Areas | None, FloatArray]:
    """The emissive primitives and their weights, which sum to 1 for each shape; writes the
    primitives' `light` columns."""
    radiance = {}
    for i, shape in enumerate(scene.shapes):
        material = None if shape.material is None else scene.materials[shape.material]
        if isinstance(material, Emissive):
            radiance[i] = material.radiance
    kinds: list[IntArray] = []
    rows: list[IntArray] = []
    owners: list[IntArray] = []
    all_areas: list[FloatArray] = []
    start = 0
    for code, _, table, module in _present(tables):
        mine = np.flatnonzero(np.isin(table.owner, list(radiance)))
        area = module.areas(table)[mine]
        mine, area = mine[area > 0.0], area[area > 0.0]
        table.light[mine] = start + np.arange(len(mine))
        start += len(mine)
        kinds.append(np.full(len(mine), code))
        rows.append(mine)
        owners.append(table.owner[mine])
        all_areas.append(area)
    if start == 0:
        return None, np.zeros(0)
    owner, area = np.concatenate(owners), np.concatenate(all_areas)
    total = np.bincount(owner, weights=area)
    colours = np.array([radiance[i] for i in owner])
    return Areas(np.concatenate(kinds), np.concatenate(rows), colours, area), area / total[owner]
