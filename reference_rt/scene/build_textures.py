"""The textures of a scene -> Textures, and the palette by which parameters refer to them."""

import math
from typing import Any

import numpy as np

from reference_rt.scene.model import SceneModel
from reference_rt.shapes.meshes.triangle_table import Triangles
from reference_rt.textures import TABLES as TEXTURE_TABLES
from reference_rt.textures import Palette, Product, Textures, bitmap, product
from reference_rt.textures.parameter import joined
from reference_rt.textures.tables import UvSets
from reference_rt.util.errors import MOST_TOLD, together


def texture_tables(scene: SceneModel) -> tuple[Textures | None, Palette]:
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
    wrong = []
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
            wrong.append(scene.error(str(error), "textures", name))
            if len(wrong) == MOST_TOLD:
                break
            continue
        parts.setdefault(code, []).append(table)
        kinds.append(code)
        rows.append(len(parts[code]) - 1)
        maps.append(texture.uv.coefficients())
        greatest.append(module.greatest(table))
    if wrong:
        raise together(wrong)
    for name, texture in scene.textures.items():
        if isinstance(texture, Product):
            greatest[numbers[name]] *= math.prod(greatest[numbers[of]] for of in texture.of)
    tables = {
        field: joined(module, parts[code]) if code in parts else None
        for code, field, _, module in TEXTURE_TABLES
    }
    sets = UvSets(np.zeros(len(kinds), np.int64), np.zeros((0, 6)))
    textures = Textures(np.array(kinds), np.array(rows), np.array(maps), **tables, sets=sets)
    return textures, Palette(numbers, greatest)


def with_uv_sets(
    scene: SceneModel, textures: Textures | None, triangles: Triangles | None
) -> Textures | None:
    """The textures with the sets of texture coordinates that they use beside the meshes' own."""
    if textures is None or triangles is None or triangles.more_uvs is None:
        return textures
    numbers = np.array([texture.uv_set for texture in scene.textures.values()])
    return textures._replace(sets=UvSets(numbers, triangles.more_uvs))
