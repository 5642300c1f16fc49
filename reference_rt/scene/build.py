"""Scene -> SceneTables: the only place that makes a scene's arrays.

Every array is C-contiguous and writable, and has the same type in all scenes, so that scenes with
the same features have the same Numba types and share compiled kernels.  A feature that the scene
lacks is None, and its branches are removed when the kernels are compiled.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pydantic import PrivateAttr

from reference_rt.accel.geometry import Geometry
from reference_rt.core.arrays import FloatArray
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.lights import (
    AREA,
    ENVIRONMENT,
    Ambient,
    Areas,
    Constant,
    EnvironmentMap,
    Lights,
    LightSampler,
)
from reference_rt.lights import TABLES as LIGHT_TABLES
from reference_rt.lights.emitters import constant, environment_map
from reference_rt.lights.selection import bounds
from reference_rt.lights.selection.bounds import LightBounds
from reference_rt.lights.selection.choice import FEW, LightTree, build
from reference_rt.materials import Materials
from reference_rt.materials.bsdfs.diffuse import Diffuse
from reference_rt.materials.bsdfs.phong import Phong
from reference_rt.materials.bsdfs.tables import BLACK, CLEAR, TABLES, Leaves
from reference_rt.materials.material import Emissive, Material
from reference_rt.materials.nested.flattened import FlattenedBuilder
from reference_rt.materials.nested.paths import (
    MaterialPath,
    material_paths,
    needs_tangents,
    transmits,
)
from reference_rt.materials.nested.wrappers import Wrapper
from reference_rt.materials.textured import textured_table, uses_textures
from reference_rt.scene.build_geometry import assemble
from reference_rt.scene.model import SceneModel
from reference_rt.shapes import TABLES as SHAPE_TABLES
from reference_rt.shapes.meshes.triangle_table import shared
from reference_rt.textures import TABLES as TEXTURE_TABLES
from reference_rt.textures import Colours, Palette, Product, Textures, bitmap, product
from reference_rt.textures.parameter import join

_PLACED = (AREA, *(code for code, _, _, module in LIGHT_TABLES if hasattr(module, "bounds")))
"""The codes of lights that have a position: a light tree may hold them."""

_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])

SKY_SHARE = 0.125
"""The highest selection probability of a constant environment beside other lights with power.

BSDF sampling hits a constant environment as well as light sampling does, so that light samples are
better spent on lights that BSDF sampling rarely hits.  By its power, which is that on the whole
scene, it would get most of them.  Measured in 14 scenes with a lamp or a sun: the variance falls to
0.29 to 1.0 of its value, at the median to 0.64.  A quarter and a sixteenth do about as well; powers
of 1/2 fit the strata of the samples.
"""


def light_tables(scene: SceneModel, geometry: Geometry, palette: Palette) -> Lights:
    """All lights, selected in proportion to their power.  Writes the primitives' `light` columns.
    Raises SceneError."""
    radius = scene_radius(geometry)
    areas, powers = _area_lights(scene, geometry, palette)
    kinds, rows, weights = [AREA] * len(powers), [*range(len(powers))], [powers]
    tables: dict[str, Any] = {}
    for code, field, description, module in LIGHT_TABLES:
        found: list[Any] = [light for light in scene.lights if isinstance(light, description)]
        made = [light.tabulate(palette) for light in found]
        tables[field] = _joined(module, made) if found else None
        if found:
            kinds += [code] * len(found)
            rows += range(len(found))
            weights.append(module.power(tables[field], radius))
    environment = _environment(scene)
    if environment is not None:
        module = constant if isinstance(environment, constant.Environment) else environment_map
        kinds.append(ENVIRONMENT)
        rows.append(0)
        weights.append(module.power(environment, radius))
    # Overflow is clamped to the largest number; 0 times infinity counts as 0.
    power = np.nan_to_num(np.concatenate(weights), nan=0.0, posinf=np.finfo(np.float64).max)
    choice = _choice(np.array(kinds), np.array(rows), power)
    if choice is not None and isinstance(environment, constant.Environment):
        if scene.integrator.follows_scattered:
            choice = _mostly_others(choice)
    lights = Lights(
        **tables,
        areas=areas,
        environment=environment,
        ambient=_ambient(scene),
        choice=choice,
        tree=None,
    )
    return lights._replace(tree=_tree(lights, geometry, power))


def scene_radius(geometry: Geometry) -> float:
    """Approximate radius of all finite shapes, for the power of distant lights."""
    lower, upper = np.full(3, np.inf), np.full(3, -np.inf)
    for _, field, _, module in SHAPE_TABLES:
        table = getattr(geometry.shapes, field)
        if table is not None:
            low, high = module.bounds(table)
            finite = np.isfinite(low).all(axis=1) & np.isfinite(high).all(axis=1)
            lower = np.minimum(lower, low[finite].min(axis=0, initial=np.inf))
            upper = np.maximum(upper, high[finite].max(axis=0, initial=-np.inf))
    size = float(np.linalg.norm(upper - lower))
    return 0.5 * size if 0.0 < size < np.inf else 1.0


def _choice(kind: Any, row: Any, weight: FloatArray) -> LightSampler | None:
    """The light sampler by power; None if no light that can be sampled has power."""
    # Scaled by the largest, so that extreme values neither overflow nor vanish in the sum.
    largest = weight.max(initial=0.0)
    if largest == 0.0:
        return None
    weight = weight / largest
    return _choice_by(kind, row, weight / weight.sum())


def _choice_by(kind: Any, row: Any, probability: FloatArray) -> LightSampler:
    bounded = probability[np.isin(kind, _PLACED)].sum()
    cumulative = np.cumsum(probability) if len(probability) > 1 else None
    return LightSampler(kind, row, probability, cumulative, np.array([bounded]))


def _mostly_others(choice: LightSampler) -> LightSampler:
    """The light sampler with the constant environment, its last light, capped at SKY_SHARE if other
    lights have power."""
    others = choice.probability[:-1]
    power = others.sum()
    if choice.probability[-1] <= SKY_SHARE or power == 0.0:
        return choice
    probability = np.append((1.0 - SKY_SHARE) * (others / power), SKY_SHARE)
    return _choice_by(choice.kind, choice.row, probability)


def _tree(lights: Lights, geometry: Geometry, power: FloatArray) -> LightTree | None:
    """The light tree over lights with a position and power, if there are more than FEW."""
    if lights.choice is None:
        return None
    kind = lights.choice.kind
    placed = np.flatnonzero((power > 0.0) & np.isin(kind, _PLACED))
    if len(placed) <= FEW:
        return None
    parts = []
    if lights.areas is not None:
        areas = lights.areas
        intensity = power[: len(areas.area)] / np.pi
        parts.append(bounds.of_areas(geometry.shapes, areas.kind, areas.row, intensity))
    for _, field, _, module in LIGHT_TABLES:
        table = getattr(lights, field)
        if table is not None and hasattr(module, "bounds"):
            parts.append(module.bounds(table))
    columns = (np.concatenate(column)[placed] for column in zip(*parts, strict=True))
    return build(LightBounds(*columns), placed, len(kind))


def _environment(scene: SceneModel) -> Any:
    for i, light in enumerate(scene.lights):
        if isinstance(light, Constant):
            return light.tabulate()
        if isinstance(light, EnvironmentMap):
            try:
                return light.tabulate(scene.folder)
            except ValueError as error:
                raise scene.error(str(error), "lights", i) from None
    return None


def _ambient(scene: SceneModel) -> FloatArray | None:
    found = [light.radiance for light in scene.lights if isinstance(light, Ambient)]
    return np.sum(found, axis=0)[None] if found else None


def _area_lights(
    scene: SceneModel, geometry: Geometry, palette: Palette
) -> tuple[Areas | None, FloatArray]:
    """The emissive primitives, and the luminance of their power: pi times area times radiance (for
    a texture its maximum).  It is 0 for primitives that only BSDF-sampled rays hit: those of types
    that cannot be sampled, and parts of groups and of solids."""
    materials = [*scene.materials.values(), None]
    emissive = [k for k, m in enumerate(materials) if isinstance(m, Emissive)]
    if not emissive:
        return None, np.zeros(0)
    radiance, brightness = _radiances(scene, emissive, palette)
    kinds, rows, numbers, areas = [], [], [], []
    start = 0
    for code, field, _, module in SHAPE_TABLES:
        table = getattr(geometry.shapes, field)
        if table is None:
            continue
        mine = np.flatnonzero(np.isin(table.material, emissive))
        # In the order of the scene: that of the rows depends on the acceleration structure.
        mine = mine[np.lexsort((table.face[mine], table.owner[mine]))]
        area = np.full(len(mine), np.inf)
        if hasattr(module, "sample"):
            of_scene = table.owner[mine] < len(scene.shapes)
            area[of_scene] = module.areas(table)[mine[of_scene]]
        table.light[mine] = start + np.arange(len(mine))
        start += len(mine)
        kinds.append(np.full(len(mine), code))
        rows.append(mine)
        numbers.append(np.searchsorted(emissive, table.material[mine]))
        areas.append(area)
    if start == 0:
        return None, np.zeros(0)
    number, area = np.concatenate(numbers), np.concatenate(areas)
    columns = Colours(
        radiance.value[number], None if radiance.texture is None else radiance.texture[number]
    )
    table = Areas(np.concatenate(kinds), np.concatenate(rows), columns, area)
    power = np.pi * area * brightness[number]
    return table, np.where(np.isfinite(power), power, 0.0)


def _radiances(
    scene: SceneModel, emissive: list[int], palette: Palette
) -> tuple[Colours, FloatArray]:
    """The radiance of each emissive material, and its maximum luminance."""
    materials = list(scene.materials.values())
    columns, brightness = [], []
    for k in emissive:
        material = materials[k]
        assert isinstance(material, Emissive)
        columns.append(palette.colours(material.radiance, np.inf))
        if isinstance(material.radiance, str):
            brightness.append(palette.greatest[palette.numbers_of[material.radiance]])
        else:
            brightness.append(float(_LUMINANCE @ material.radiance))
    return join(columns), np.array(brightness)


class BuiltScene(SceneModel):
    """A description, together with the tables that are built from it."""

    _tables: SceneTables | None = PrivateAttr(default=None)

    @property
    def tables(self) -> SceneTables:
        """The kernels' tables, built on first use.  Raises SceneError for unusable files."""
        if self._tables is None:
            self._tables = build_tables(self)
        return self._tables


def build_tables(scene: SceneModel) -> SceneTables:
    """The tables of a scene.  Raises SceneError with file, line and key path."""
    numbers: dict[str | None, int] = {name: i for i, name in enumerate(scene.materials)}
    numbers[None] = len(numbers)
    textures, palette = _texture_tables(scene)
    with np.errstate(over="ignore", invalid="ignore"):  # checked afterwards: not finite
        geometry = assemble(scene, numbers)
        materials = material_tables(scene, palette, _has_material(geometry, numbers[None]))
        lights = light_tables(scene, geometry, palette)
        return SceneTables(_with_shared_ids(geometry), materials, lights, textures)


def _with_shared_ids(geometry: Geometry) -> Geometry:
    shapes = geometry.shapes
    if shapes.triangles is None:
        return geometry
    return geometry._replace(shapes=shapes._replace(triangles=shared(shapes.triangles)))


def _has_material(geometry: Geometry, number: int) -> bool:
    """Whether any primitive has this material."""
    tables = [table for table in geometry.shapes if table is not None]
    return any(bool((table.material == number).any()) for table in tables)


def _texture_tables(scene: SceneModel) -> tuple[Textures | None, Palette]:
    """The textures, and the palette by which material parameters refer to them."""
    if not scene.textures:
        return None, Palette({}, ())
    parts: dict[int, list[Any]] = {}
    try:
        room, used = bitmap.room_for(scene.textures.values(), scene.folder), 0
    except ValueError as error:
        raise scene.error(str(error), "textures") from None
    numbers = {name: k for k, name in enumerate(scene.textures)}
    kinds, rows, maps, greatest = [], [], [], []
    for name, texture in scene.textures.items():
        code, module = next((c, m) for c, _, d, m in TEXTURE_TABLES if isinstance(texture, d))
        try:
            table: Any
            if isinstance(texture, bitmap.Bitmap):
                table = texture.tabulate(scene.folder, room[used:])
                used += len(table.memory.codes8)
            elif isinstance(texture, Product):
                table = product.table_of(texture, numbers)
            else:
                table = texture.tabulate(scene.folder)
        except ValueError as error:
            raise scene.error(str(error), "textures", name) from None
        parts.setdefault(code, []).append(table)
        kinds.append(code)
        rows.append(len(parts[code]) - 1)
        maps.append(texture.uv.coefficients())
        greatest.append(module.greatest(table))
    for name, texture in scene.textures.items():
        if isinstance(texture, Product):
            greatest[numbers[name]] *= math.prod(greatest[numbers[of]] for of in texture.of)
    tables = {
        field: _joined(module, parts[code]) if code in parts else None
        for code, field, _, module in TEXTURE_TABLES
    }
    textures = Textures(np.array(kinds), np.array(rows), np.array(maps), **tables)
    return textures, Palette(numbers, greatest)


def _joined(module: Any, parts: Sequence[Any]) -> Any:
    return getattr(module, "join", join)(parts)


# ---- materials: BSDF tables, and flattened nested materials --------------------------------------

DEFAULT = "\0"
"""The name of the default material, of shapes without one; no scene can use this name."""


def material_tables(scene: SceneModel, palette: Palette, default: bool) -> Materials:
    """The materials of a scene in its order; then the default material, if it is used (`default`)
    or there is no other.

    An emissive material has the BSDF of its base.  Raises SceneError.
    """
    materials: dict[str, Material] = {**scene.materials}
    if default or not materials:
        materials[DEFAULT] = Diffuse()
    leaves, flat_leaves = _Leaves(materials, palette), FlattenedBuilder(palette)
    kinds, rows, traits, shown, oriented = [], [], [], [], []
    for name in materials:
        try:
            shown.append(palette.colours(_shown(name, materials), np.inf))
            scattering = _scattering(name, materials)
            if scattering is None or (name == DEFAULT and not default):
                found = []
            else:
                found = material_paths(scattering, materials)
            if scene.integrator.type == "path":
                _check_energy(found, materials, palette)
            numbers = [leaves.add(path.leaf) for path in found]
            flat_leaves.add(list(zip(found, numbers, strict=True)))
        except ValueError as error:
            raise scene.error(str(error), "materials", name) from None
        kind, row = numbers[0] if len(numbers) == 1 else (BLACK, -1)
        kinds.append(kind)
        rows.append(row)
        traits.append(_traits(found, materials))
        oriented.append(int(any(needs_tangents(path, materials) for path in found)))
    smooth, uses_u_lobe, behind = np.ascontiguousarray(np.array(traits, np.int64).T)
    asks = np.array([uses_textures(name, materials) for name in materials], np.int64)
    is_one_table = len(leaves.parts) == 1 and set(kinds) == leaves.parts.keys()
    return Materials(
        kind=None if is_one_table else np.array(kinds),
        row=None if is_one_table and rows == list(range(len(rows))) else np.array(rows),
        smooth=None if smooth.all() else smooth,
        uses_u_lobe=uses_u_lobe if uses_u_lobe.any() else None,
        behind=behind if behind.any() else None,
        shown=join(shown),
        oriented=np.array(oriented) if any(oriented) else None,
        asks=asks if asks.any() and not asks.all() else None,
        textured=textured_table(materials, palette),
        flat_leaves=flat_leaves.tables(),
        leaves=leaves.tables(),
    )


def _check_energy(
    found: list[MaterialPath], materials: Mapping[str, Material], palette: Palette
) -> None:
    """Raise ValueError for a Phong material that reflects more light than arrives, which path
    tracing cannot render."""
    for path in found:
        leaf = materials[path.leaf] if path.leaf is not None else None
        if isinstance(leaf, Phong) and leaf.energy_bound(palette) > 1.0:
            raise ValueError(
                f"creates energy: up to {leaf.energy_bound(palette):.4g} of the light comes back; "
                "expected at most 1 for path tracing, or the integrator 'whitted'"
            )


def _scattering(name: str, materials: Mapping[str, Material]) -> str | None:
    """The name of the material with the BSDF: an emissive one's base, or None without a base."""
    material = materials[name]
    return material.base if isinstance(material, Emissive) else name


def _shown(name: str, materials: Mapping[str, Material]) -> tuple[float, float, float] | str:
    """The colour of a material; of a nested one, that of its first base."""
    material = materials[name]
    while isinstance(material, Wrapper):
        material = materials[getattr(material, material.bases[0])]
    return material.colour


def _traits(
    found: list[MaterialPath], materials: Mapping[str, Material]
) -> tuple[bool, bool, bool]:
    """`Materials.smooth`, `uses_u_lobe` and `behind`."""
    leaves = [materials[path.leaf] for path in found if path.leaf is not None]
    return (
        any(leaf.smooth for leaf in leaves),
        len(found) > 1 or any(leaf.uses_u_lobe for leaf in leaves),
        any(transmits(path, materials) or path.turns for path in found),
    )


class _Leaves:
    """Collects the table rows of leaf BSDFs, each once."""

    def __init__(self, materials: Mapping[str, Material], palette: Palette) -> None:
        self.materials, self.palette = materials, palette
        self.parts: dict[int, list[Any]] = {}
        self.known: dict[str, tuple[int, int]] = {}

    def add(self, name: str | None) -> tuple[int, int]:
        """(kind, row) of a leaf, without a name of what is not there.  Raises ValueError."""
        if name is None:
            return CLEAR, -1
        if name not in self.known:
            material = self.materials[name]
            code = next(c for c, _, cls, _, _ in TABLES if isinstance(material, cls))
            rows = self.parts.setdefault(code, [])
            rows.append(material.tabulate(self.palette))
            self.known[name] = code, len(rows) - 1
        return self.known[name]

    def tables(self) -> Leaves:
        found = {code: join(rows) for code, rows in self.parts.items()}
        return Leaves(**{field: found.get(code) for code, field, _, _, _ in TABLES})
