"""The arguments of a material's kernels: a point of a surface, seen from a direction."""

from typing import NamedTuple

from reference_rt.core.arrays import FloatArray
from reference_rt.core.ray import SurfacePoint
from reference_rt.core.vec3 import Frame, Vec3
from reference_rt.shapes.shape import Tangents
from reference_rt.textures import At


class Shading(NamedTuple):
    """point: of the surface;  frame: the shading frame, n = `point.ns`;  wo: towards the viewer,
    local;  at: where textures are looked up;  tangents: dp/du and dp/dv, local, only valid if a
    material of the scene is `oriented`;  layers: the scratch buffer that `prepare` fills with the
    material's flattened leaves, empty if no material of the scene is nested."""

    point: SurfacePoint
    frame: Frame
    wo: Vec3
    at: At
    tangents: Tangents
    flat_leaves: FloatArray
