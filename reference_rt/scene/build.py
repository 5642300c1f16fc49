"""Scene -> SceneTables: the only place that makes a scene's arrays.

Every array is C-contiguous and writable, and has the same type in all scenes, so that tables of a
type have the same Numba type and share compiled kernels.  A table that the scene lacks is None.
"""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, Self

import numpy as np
from pydantic import PrivateAttr

from reference_rt.accel.geometry import Geometry
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.materials import Emissive
from reference_rt.scene.build_geometry import assemble
from reference_rt.scene.build_lights import environment_of, light_tables, lights_of
from reference_rt.scene.build_materials import material_tables
from reference_rt.scene.build_media import Boundary, boundaries
from reference_rt.scene.build_textures import texture_tables, with_uv_sets
from reference_rt.scene.model import SceneModel
from reference_rt.shapes.meshes.triangle_table import Triangles, shared, spread
from reference_rt.util.errors import SceneError, together


class BuiltScene(SceneModel):
    """A description, together with the tables that are built from it."""

    _built: list[SceneTables] = PrivateAttr(default_factory=list)

    @property
    def tables(self) -> SceneTables:
        """The kernels' tables, built on first use: a file that changes later is read by a scene
        that is loaded again.  Raises SceneError for unusable files."""
        if not self._built:
            self._built.append(build_tables(self))
        return self._built[0]

    def changed(self, **parts: Any) -> Self:
        """A copy of the scene with other parts (film=..., sampler=...), checked again.  It shares
        the tables if these do not depend on the parts."""
        scene = super().changed(**parts)
        if parts.keys() <= _NOT_IN_TABLES:
            scene._built = self._built
        return scene

    def without_tables(self) -> Self:
        """A copy whose tables are not built."""
        scene = self.changed()
        scene._built = []
        return scene


_NOT_IN_TABLES = {"camera", "film", "sampler"}
"""The parts of a scene on which its tables do not depend."""


def build_tables(scene: SceneModel) -> SceneTables:
    """The tables of a scene.  Raises SceneError with file, line and key path."""
    numbers = boundaries(scene)
    with np.errstate(over="ignore", invalid="ignore"):  # checked afterwards: not finite
        try:
            textures, palette = texture_tables(scene)
            geometry = assemble(scene, numbers)
            environment, described = environment_of(scene), lights_of(scene)
        except SceneError:
            raise together(_wrong_in_files(scene, numbers)) from None
        if any(isinstance(material, Emissive) for material in scene.materials.values()):
            geometry = _with_triangles(geometry, spread)  # which may be numbered as lights
        default = numbers[Boundary(None)]
        has_default = len(numbers) > default + 1 or _has_material(geometry, default)
        materials = material_tables(scene, palette, has_default, numbers)
        lights = light_tables(scene, geometry, palette, numbers, environment, described)
        textures = with_uv_sets(scene, textures, geometry.shapes.triangles)
        geometry = _with_triangles(geometry, _as_in_scenes)
        return SceneTables(geometry, materials, lights, textures)


def _wrong_in_files(scene: SceneModel, numbers: dict[Boundary, int]) -> Iterator[SceneError]:
    """The errors of textures, shapes and lights, so that all files that are missing are told."""
    for read in (texture_tables, partial(assemble, materials=numbers), environment_of, lights_of):
        try:
            read(scene)
        except SceneError as error:
            yield error


def _with_triangles(geometry: Geometry, change: Callable[[Triangles], Triangles]) -> Geometry:
    shapes = geometry.shapes
    if shapes.triangles is None:
        return geometry
    return geometry._replace(shapes=shapes._replace(triangles=change(shapes.triangles)))


def _as_in_scenes(triangles: Triangles) -> Triangles:
    return shared(triangles)._replace(more_uvs=None)


def _has_material(geometry: Geometry, number: int) -> bool:
    """Whether any primitive has this material."""
    tables = [table for table in geometry.shapes if table is not None]
    return any(bool((table.material == number).any()) for table in tables)
