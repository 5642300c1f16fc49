"""`SceneTables`: the arrays of a scene, which `reference_rt.scene.build` makes."""

from typing import NamedTuple

from reference_rt.accel.geometry import Geometry
from reference_rt.lights import Lights
from reference_rt.materials import Materials
from reference_rt.textures import Textures


class SceneTables(NamedTuple):
    """A scene as its kernels see it."""

    geometry: Geometry
    materials: Materials
    lights: Lights
    textures: Textures | None
