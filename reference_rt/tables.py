"""Scene -> SceneTables: the only place that makes a scene's arrays.

Every array is float64 or int64, C-contiguous and writable, so that one feature set is one set of
Numba types and compiles once.  What a scene lacks is None: the kernels' branches for it vanish at
compile time.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from reference_rt.assembly import assemble
from reference_rt.geometry import Geometry
from reference_rt.lights import AREA, CONSTANT, POINT, Areas, Choice, Constant, Lights, Point
from reference_rt.lights.constant import Environment
from reference_rt.lights.point import Points
from reference_rt.materials import BLACK, Diffuse, Emissive, Materials
from reference_rt.materials import TABLES as MATERIAL_TABLES
from reference_rt.materials.material import Material
from reference_rt.shapes import TABLES as SHAPE_TABLES
from reference_rt.shapes import Shapes
from reference_rt.shapes.shape import FloatArray, IntArray

if TYPE_CHECKING:
    from reference_rt.scene import Scene


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
        geometry = assemble(scene, numbers)
        return SceneTables(
            geometry=geometry,
            materials=_material_tables(scene, names),
            lights=_light_tables(scene, geometry.shapes),
        )


def colours(scene: "Scene") -> FloatArray:
    """Each material's own colour (materials, 3): what ray casting shows."""
    return np.array([m.colour for m in scene.materials.values()] + [Diffuse().colour])


def _concatenate(parts: Sequence[Any]) -> Any:
    """One table from several: the rows one after another."""
    columns = [np.ascontiguousarray(np.concatenate(column)) for column in zip(*parts, strict=True)]
    return type(parts[0])(*columns)


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


def _light_tables(scene: "Scene", shapes: Shapes) -> Lights:
    """All lights, each as likely to be picked as any other; a shape's primitives by their area."""
    areas, area_weights = _area_lights(scene, shapes)
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


def _area_lights(scene: "Scene", shapes: Shapes) -> tuple[Areas | None, FloatArray]:
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
    for code, field, _, module in SHAPE_TABLES:
        table = getattr(shapes, field)
        if table is None:
            continue
        mine = np.flatnonzero(np.isin(table.owner, list(radiance)))
        if len(mine) > 0 and not hasattr(module, "sample"):
            raise scene.error(
                "a shape of this type cannot be a light; expected one that can be sampled by area",
                "shapes",
                int(table.owner[mine[0]]),
            )
        if len(mine) == 0:
            continue
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
