"""`SceneTables`: the arrays of a scene, which `reference_rt.scene.build` makes; `KernelScene`: the
same as kernels take them."""

from dataclasses import dataclass, field
from typing import Any, NamedTuple

from reference_rt import shapes as any_shape
from reference_rt.accel.geometry import Geometry
from reference_rt.accel.geometry import surface as surface_in_geometry
from reference_rt.core.ray import (
    Hit,
    HitBlock,
    PointBlock,
    Ray,
    RayBlock,
    SurfacePoint,
    hit_of,
    put_point,
    ray_of,
)
from reference_rt.jit.kernel import kernel
from reference_rt.lights import Lights, LightTables
from reference_rt.materials import Materials
from reference_rt.shapes import TABLES
from reference_rt.textures import Textures
from reference_rt.util.errors import Brief


@dataclass(frozen=True, eq=False)
class SceneTables(metaclass=Brief):
    """All arrays of a scene; None for what it lacks.  links: by purpose, what was made of them for
    kernels (`rendering/kept_links.py`)."""

    geometry: Geometry
    materials: Materials
    lights: Lights
    textures: Textures | None
    links: dict[Any, Any] = field(init=False, default_factory=dict, repr=False)

    @property
    def parts(self) -> tuple[Any, ...]:
        return self.geometry, self.materials, self.lights, self.textures

    def __reduce__(self) -> Any:
        return SceneTables, self.parts  # links hold addresses of this process


class KernelScene(NamedTuple):
    """A scene as kernels take it.  geometry, shapes, textures, and tables in materials and lights:
    links (`jit/links.py`), so that all scenes have this one type; in plain Python the tables
    themselves;  is_placed: whether there are instances or solids, whose surfaces take more than the
    shape's own table."""

    geometry: Any
    shapes: Any
    is_placed: int
    materials: Materials
    lights: LightTables
    textures: Any


@kernel
def surface(scene: KernelScene, ray: Ray, hit: Hit) -> SurfacePoint:
    """The surface point, in world space, of a hit."""
    if scene.is_placed != 0:
        return surface_in_geometry(scene.geometry, ray, hit)
    return any_shape.surface(scene.shapes, ray, hit)


_KINDS = len(TABLES)


@kernel
def surfaces(
    scene: KernelScene, rays: RayBlock, hits: HitBlock, n: int, points: PointBlock
) -> None:
    """`surface` of those of the first n rays that hit something."""
    if scene.is_placed == 0:
        for kind in range(_KINDS):
            any_shape.surfaces(scene.shapes, kind, rays, hits, n, points)
        return
    for j in range(n):
        if hits.codes[j] >= 0:
            put_point(points, j, surface(scene, ray_of(rays, j), hit_of(hits, j)))
