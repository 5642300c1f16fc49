"""Normal map: shading normals from an image (Cohen, Olano & Manocha 1998; the encoding in colours
is the usual one)."""

import math
from typing import Literal, NamedTuple

import numpy as np

from reference_rt.core.arrays import IntArray
from reference_rt.core.vec3 import Frame, Vec3, max_abs, normalize, to_world
from reference_rt.jit.kernel import kernel
from reference_rt.materials.frame import frame_along
from reference_rt.materials.nested.terminator import facing
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
    flip_invalid_normals: bool = False
    """Whether a tilted normal that faces away from the viewer is turned about the surface's own
    normal until it does not (Mitsuba's default)."""
    use_shadowing_function: bool = False
    """Whether light fades towards grazing angles where the normal is tilted, in place of a hard
    line (Estevez, Lecocq & Stein 2019; Mitsuba's default)."""

    @property
    def oriented(self) -> bool:
        return True

    def tabulate(self, palette: Palette) -> "NormalMaps":
        return NormalMaps(
            np.array([palette.number(self.normals, math.inf)]),
            np.array([int(self.flip_invalid_normals)]),
            np.array([int(self.use_shadowing_function)]),
        )


class NormalMaps(NamedTuple):
    """texture (n,): its number;  flips (n,), shadows (n,): 1 for `flip_invalid_normals`,
    `use_shadowing_function`, else 0."""

    texture: IntArray
    flips: IntArray
    shadows: IntArray


@kernel
def basis(maps: NormalMaps, i: int, at: At, tangents: Tangents, wo: Vec3) -> Frame:
    """The tilted frame, its s as close to that of the surface as possible; frame, tangents and wo
    are in coordinates of the shading frame.  A grey of 1/2 is no direction and leaves the normal as
    it is."""
    surface = frame_along(Vec3(0.0, 0.0, 1.0), tangents.dpdu)
    rgb = lookup(maps.texture[i], at)
    n = Vec3(2.0 * rgb.x - 1.0, 2.0 * rgb.y - 1.0, 2.0 * rgb.z - 1.0)
    size = max_abs(n)
    if size == 0.0:
        return surface
    tilted = normalize(to_world(surface, n / size))
    if maps.flips[i] != 0:
        tilted = facing(tilted, wo)
    return frame_along(tilted, surface.s)
