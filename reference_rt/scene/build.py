"""Scene -> SceneTables: the only place that makes a scene's arrays.

Every array is C-contiguous and writable, and has the same type in all scenes, so that scenes with
the same features have the same Numba types and share compiled kernels.  A feature that the scene
lacks is None, and its branches are removed when the kernels are compiled.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pydantic import PrivateAttr

from reference_rt.accel.geometry import Geometry
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.materials import Materials
from reference_rt.materials.bsdfs.diffuse import Diffuse
from reference_rt.materials.bsdfs.phong import Phong
from reference_rt.materials.bsdfs.tables import BLACK, CLEAR, TABLES, Leaves
from reference_rt.materials.emissive import Emissive
from reference_rt.materials.material import Material
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
from reference_rt.scene.build_lights import light_tables
from reference_rt.scene.model import SceneModel
from reference_rt.textures import TABLES as TEXTURE_TABLES
from reference_rt.textures import Palette, Textures, bitmap
from reference_rt.textures.parameter import join


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
        return SceneTables(
            geometry=geometry,
            materials=material_tables(scene, palette, _has_material(geometry, numbers[None])),
            lights=light_tables(scene, geometry, palette),
            textures=textures,
        )


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
    kinds, rows, maps, greatest = [], [], [], []
    for name, texture in scene.textures.items():
        code, module = next((c, m) for c, _, d, m in TEXTURE_TABLES if isinstance(texture, d))
        try:
            table: Any
            if isinstance(texture, bitmap.Bitmap):
                table = texture.tabulate(scene.folder, room[used:])
                used += len(table.memory.codes8)
            else:
                table = texture.tabulate(scene.folder)
        except ValueError as error:
            raise scene.error(str(error), "textures", name) from None
        parts.setdefault(code, []).append(table)
        kinds.append(code)
        rows.append(len(parts[code]) - 1)
        maps.append(texture.uv.coefficients())
        greatest.append(module.greatest(table))
    tables = {
        field: _joined(module, parts[code]) if code in parts else None
        for code, field, _, module in TEXTURE_TABLES
    }
    numbers = {name: k for k, name in enumerate(scene.textures)}
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
    kinds, rows, traits, shown = [], [], [], []
    oriented = False
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
        oriented = oriented or any(needs_tangents(path, materials) for path in found)
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
        oriented=np.ones(1, np.int64) if oriented else None,
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
