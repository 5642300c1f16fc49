"""What a material is asked about: a point of a surface, seen from somewhere."""

from typing import NamedTuple

from reference_rt.core.arrays import FloatArray
from reference_rt.core.ray import SurfacePoint
from reference_rt.core.vec3 import Frame, Vec3
from reference_rt.shapes.shape import Tangents
from reference_rt.textures import At


class Shading(NamedTuple):
    """point: of the surface;  frame: the shading frame, n = `point.ns`;  wo: towards the viewer,
    local;  at: where textures are asked;  tangents: dp/du and dp/dv, local, which mean something
    only where a material of the scene is `oriented`;  layers: what `materials.layers` keeps of the
    material here, empty where no material is made of others."""

    point: SurfacePoint
    frame: Frame
    wo: Vec3
    at: At
    tangents: Tangents
    layers: FloatArray
