"""`SceneTables`: the arrays of a scene, which `reference_rt.scene.build` makes for the kernels."""

from typing import NamedTuple

from reference_rt.accel.geometry import Geometry
from reference_rt.lights import Lights
from reference_rt.materials import Materials
from reference_rt.textures import Textures


class SceneTables(NamedTuple):
    """All arrays that kernels read.  A feature that the scene lacks is None, and its branches are
    removed when the kernels are compiled."""

    geometry: Geometry
    materials: Materials
    lights: Lights
    textures: Textures | None
