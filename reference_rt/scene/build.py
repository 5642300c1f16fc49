"""Scene -> SceneTables: the only place that makes a scene's arrays.

Every array is C-contiguous and writable, and has the same type in all scenes, so that scenes with
the same features have the same Numba types and share compiled kernels.  A feature that the scene
lacks is None, and its branches are removed when the kernels are compiled.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from pydantic import PrivateAttr

from reference_rt.accel.geometry import Geometry
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.scene.build_geometry import assemble
from reference_rt.scene.build_lights import light_tables
from reference_rt.scene.build_materials import material_tables
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
