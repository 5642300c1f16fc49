"""Scene -> SceneTables: the only place that makes a scene's arrays.

Every array is C-contiguous and writable, and has the same type in all scenes, so that scenes with
the same features have the same Numba types and share compiled kernels.  A feature that the scene
lacks is None, and its branches are removed when the kernels are compiled.
"""

import numpy as np
from pydantic import PrivateAttr

from reference_rt.accel.geometry import Geometry
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.scene.build_geometry import assemble
from reference_rt.scene.build_lights import light_tables
from reference_rt.scene.build_materials import material_tables
from reference_rt.scene.build_textures import texture_tables, with_uv_sets
from reference_rt.scene.model import SceneModel
from reference_rt.shapes.meshes.triangle_table import shared


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
    textures, palette = texture_tables(scene)
    with np.errstate(over="ignore", invalid="ignore"):  # checked afterwards: not finite
        geometry = assemble(scene, numbers)
        materials = material_tables(scene, palette, _has_material(geometry, numbers[None]))
        lights = light_tables(scene, geometry, palette)
        textures = with_uv_sets(scene, textures, geometry.shapes.triangles)
        return SceneTables(_as_in_scenes(geometry), materials, lights, textures)


def _as_in_scenes(geometry: Geometry) -> Geometry:
    shapes = geometry.shapes
    if shapes.triangles is None:
        return geometry
    triangles = shared(shapes.triangles)._replace(more_uvs=None)
    return geometry._replace(shapes=shapes._replace(triangles=triangles))


def _has_material(geometry: Geometry, number: int) -> bool:
    """Whether any primitive has this material."""
    tables = [table for table in geometry.shapes if table is not None]
    return any(bool((table.material == number).any()) for table in tables)
