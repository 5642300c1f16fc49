"""The materials of a scene -> Materials: BSDF tables, and flattened nested materials."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from reference_rt.materials import Materials
from reference_rt.materials.bsdfs.diffuse import Diffuse
from reference_rt.materials.bsdfs.tables import BLACK, CLEAR, TABLES, Leaves
from reference_rt.materials.material import Material
from reference_rt.materials.nested.flattened import FlattenedBuilder
from reference_rt.materials.nested.paths import (
    check_energy,
    colour_of,
    material_paths,
    scattering_of,
    traits,
)
from reference_rt.materials.textured import textured_table, textures_of
from reference_rt.scene.build_media import Boundary
from reference_rt.scene.model import SceneModel
from reference_rt.textures import Palette
from reference_rt.textures.parameter import join
from reference_rt.util.errors import MOST_TOLD, together

DEFAULT = "\0"
"""The name of the default material, of shapes without one; no scene can use this name."""


def material_tables(
    scene: SceneModel, palette: Palette, default: bool, boundaries: Iterable[Boundary]
) -> Materials:
    """The materials of a scene in its order; then the default material, if it is used (`default`)
    or there is no other; then those of `boundaries` once more that bound media.

    An emissive material has the BSDF of its base.  Raises SceneError.
    """
    materials: dict[str, Material] = {**scene.materials}
    if default or not materials:
        materials[DEFAULT] = Diffuse()
    for boundary in [*boundaries][len(scene.materials) + 1 :]:
        materials[f"{DEFAULT}{len(materials)}"] = materials[boundary.material or DEFAULT]
    leaves, flat_leaves = _Leaves(materials, palette), FlattenedBuilder(palette)
    kinds, rows, found_traits, shown, wrong = [], [], [], [], []
    for name in materials:
        try:
            shown.append(palette.colours(colour_of(name, materials), np.inf))
            scattering = scattering_of(name, materials)
            if scattering is None or (name == DEFAULT and not default):
                paths = []
            else:
                paths = material_paths(scattering, materials)
            if scene.integrator.type == "path":
                check_energy(paths, materials, palette)
            numbers = [leaves.add(path.leaf) for path in paths]
            flat_leaves.add(list(zip(paths, numbers, strict=True)))
        except ValueError as error:
            wrong.append(scene.error(str(error), "materials", name))
            if len(wrong) == MOST_TOLD:
                break
            continue
        kind, row = numbers[0] if len(numbers) == 1 else (BLACK, -1)
        kinds.append(kind)
        rows.append(row)
        found_traits.append(traits(paths, materials))
    if wrong:
        raise together(wrong)
    smooth, uses_u_lobe, behind, oriented = np.ascontiguousarray(np.array(found_traits, np.int64).T)
    asks = np.array([bool(textures_of(name, materials)) for name in materials], np.int64)
    return Materials(
        kind=np.array(kinds),
        row=np.array(rows),
        smooth=smooth,
        uses_u_lobe=uses_u_lobe,
        behind=behind,
        shown=join(shown),
        oriented=oriented,
        asks=asks,
        textured=textured_table(materials, palette),
        flat_leaves=flat_leaves.tables(),
        leaves=leaves.tables(),
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
