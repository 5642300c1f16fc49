"""`SceneTables`: the arrays of a scene, which `reference_rt.scene.build` makes for the kernels."""

from typing import Any, NamedTuple

from reference_rt import shapes as any_shape
from reference_rt.accel.geometry import Geometry
from reference_rt.accel.geometry import surface as surface_in_geometry
from reference_rt.core.ray import Hit, Ray, SurfacePoint
from reference_rt.jit.kernel import by_class, kernel
from reference_rt.lights import Lights, LinkedLights
from reference_rt.materials import Materials
from reference_rt.shapes import Shapes
from reference_rt.textures import Textures


class SceneTables(NamedTuple):
    """All arrays that kernels read.  A feature that the scene lacks is None, and its branches are
    removed when the kernels are compiled."""

    geometry: Geometry
    materials: Materials
    lights: Lights
    textures: Textures | None


class LinkedScene(NamedTuple):
    """A scene behind links: all scenes have this one type.  geometry, shapes, textures: `Link`s,
    which kernels take in place of tables;  is_placed: whether there are instances
    or solids, whose surfaces take more than the shape's own table;  materials: all their arrays are
    present, `flat_leaves` and `leaves` are links."""

    geometry: Any
    shapes: Any
    is_placed: int
    materials: Materials
    lights: LinkedLights
    textures: Any


@kernel
def _own_shapes(scene: SceneTables) -> Shapes:
    return scene.geometry.shapes


@kernel
def _linked_shapes(scene: LinkedScene) -> Any:
    return scene.shapes


shapes_of = by_class("shapes_of", {SceneTables: _own_shapes, LinkedScene: _linked_shapes})
"""shapes_of(scene): the tables of shapes, or the link to them."""


@kernel
def _surface_in_tables(scene: SceneTables, ray: Ray, hit: Hit) -> SurfacePoint:
    return surface_in_geometry(scene.geometry, ray, hit)


@kernel
def _surface_through_link(scene: LinkedScene, ray: Ray, hit: Hit) -> SurfacePoint:
    if scene.is_placed != 0:
        return surface_in_geometry(scene.geometry, ray, hit)
    return any_shape.surface(scene.shapes, ray, hit)


surface = by_class("surface", {SceneTables: _surface_in_tables, LinkedScene: _surface_through_link})
"""surface(scene, ray, hit): the surface point, in world space, of a hit."""
