"""Normal map: shading normals from an image (Cohen, Olano & Manocha 1998; the encoding in colours
is the usual one)."""

import math
from typing import Literal, NamedTuple

import numpy as np

from reference_rt.core.arrays import IntArray
from reference_rt.core.vec3 import Frame, Vec3, max_abs, normalize, to_world
from reference_rt.jit.kernel import kernel
from reference_rt.materials.frame import frame_along
from reference_rt.materials.nested.wrappers import Wrapper
from reference_rt.shapes.shape import Tangents
from reference_rt.textures import Palette, TextureName
from reference_rt.textures.lookup import At, lookup


class NormalMap(Wrapper):
    """A material whose normals are replaced by a texture's: the direction 2 rgb - 1 of any length.

    Red is along dp/du, blue along the surface's own shading normal.
    """

    type: Literal["normal_map"] = "normal_map"
    base: str
    """Name of the material whose normals are replaced."""
    normals: TextureName
    """Name of the texture of normals.  An image file of integers needs `encoding: raw`."""

    @property
    def oriented(self) -> bool:
        return True

    def tabulate(self, palette: Palette) -> "NormalMaps":
        return NormalMaps(np.array([palette.number(self.normals, math.inf)]))


class NormalMaps(NamedTuple):
    """texture (n,): its number."""

    texture: IntArray


@kernel
def basis(maps: NormalMaps, i: int, at: At, tangents: Tangents) -> Frame:
    """The tilted frame, its s as close to that of the surface as possible; frame and tangents are
    in coordinates of the shading frame.  A grey of 1/2 is no direction and leaves the normal as it
    is."""
    surface = frame_along(Vec3(0.0, 0.0, 1.0), tangents.dpdu)
    rgb = lookup(maps.texture[i], at)
    n = Vec3(2.0 * rgb.x - 1.0, 2.0 * rgb.y - 1.0, 2.0 * rgb.z - 1.0)
    size = max_abs(n)
    if size == 0.0:
        return surface
    return frame_along(normalize(to_world(surface, n / size)), surface.s)
