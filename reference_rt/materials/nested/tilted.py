"""Tilted shading normals: bump maps, normal maps, and what they may do where geometry contradicts.

A bump map gives the normals of a surface displaced by a height, without moving a point (Blinn 1978,
"Simulation of Wrinkled Surfaces"): the displaced point p + h n has the derivatives
dp/du + dh/du n and dp/dv + dh/dv n, except for terms in h times the curvature, which are left out;
their cross product is its normal.  A normal map gives normals from an image (Cohen, Olano & Manocha
1998; the encoding in colours is the usual one).

A tilted normal may face away from the viewer, and at grazing angles light that the surface itself
receives ends at a hard line.  Both have options, off by default; Mitsuba has both on.
"""

import math
from typing import ClassVar, Literal, NamedTuple

import numpy as np

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.model import Examples
from reference_rt.core.vec3 import Frame, Vec3, cross, dot, max_abs, normalize, to_world
from reference_rt.jit.kernel import kernel
from reference_rt.materials.material import frame_along
from reference_rt.materials.nested.wrappers import Wrapper
from reference_rt.shapes.shape import Tangents
from reference_rt.textures import Palette, TextureName
from reference_rt.textures.lookup import At, lookup, lookup_gradient

_LARGEST = 1.0
"""The largest alpha² of the microfacets."""


@kernel
def facing(n: Vec3, wo: Vec3) -> Vec3:
    """The tilted normal n; where it faces away from wo as the surface does not, turned by half a
    turn about the surface's own normal, (0, 0, 1)."""
    if wo.z * dot(wo, n) <= 0.0:
        return Vec3(-n.x, -n.y, n.z)
    return n


@kernel
def shadowing_alpha2(n: Vec3) -> float:
    """alpha² of the GGX microfacets whose masking takes the place of the hard line: an eighth of
    tan² of the tilt, at most 1 (Estevez, Lecocq & Stein 2019, "A Microfacet-Based Shadowing
    Function to Solve the Bump Terminator Problem", Ray Tracing Gems, chapter 12)."""
    across, along = n.x * n.x + n.y * n.y, n.z * n.z
    if 0.125 * across >= _LARGEST * along:
        return _LARGEST
    return 0.125 * across / along


@kernel
def shadowing(alpha2: float, wi: Vec3) -> float:
    """Smith's masking of light from `wi`, in the frame before the tilt: 2 / (1 + sqrt(1 + alpha²
    tan²)), multiplied out so that it is finite at grazing angles."""
    z = abs(wi.z)
    across = wi.x * wi.x + wi.y * wi.y
    root = math.sqrt(z * z + alpha2 * across)
    if not root > 0.0:
        return 1.0 if alpha2 == 0.0 else 0.0
    return 2.0 * z / (z + root)


class Bump(Wrapper):
    """A material whose normals are tilted as if the surface were raised by a texture's luminance.

    The texture is a bitmap with the filter `bilinear`: others have no slope.
    """

    EXAMPLES: ClassVar[Examples] = (
        {"base": "base", "height": "texture", "scale": 0.1},
        {
            "base": "other",
            "height": "texture",
            "scale": 0.3,
            "flip_invalid_normals": True,
            "use_shadowing_function": True,
        },
    )
    type: Literal["bump"] = "bump"
    base: str
    """Name of the material whose normals are tilted."""
    height: TextureName
    """Name of the texture whose luminance is the height.  An image file of integers usually needs
    `encoding: raw`."""
    scale: float = 1.0
    """The height of a luminance of 1, in scene units; negative ones press in.  The transform of an
    instance does not change it."""
    flip_invalid_normals: bool = False
    """Whether a tilted normal that faces away from the viewer is turned about the surface's own
    normal until it does not (Mitsuba's default)."""
    use_shadowing_function: bool = False
    """Whether light fades towards grazing angles where the normal is tilted, in place of a hard
    line (Estevez, Lecocq & Stein 2019; Mitsuba's default)."""

    @property
    def oriented(self) -> bool:
        return True

    def tabulate(self, palette: Palette) -> "Bumps":
        texture = palette.number(self.height, math.inf)
        return Bumps(
            np.array([texture]),
            np.array([self.scale], dtype=np.float64),
            np.array([int(self.flip_invalid_normals)]),
            np.array([int(self.use_shadowing_function)]),
        )


class Bumps(NamedTuple):
    """texture (n,): the number of the height's; scale (n,); flips (n,), shadows (n,): 1 for
    `flip_invalid_normals`, `use_shadowing_function`, else 0."""

    texture: IntArray
    scale: FloatArray
    flips: IntArray
    shadows: IntArray


@kernel
def bump_basis(bumps: Bumps, i: int, at: At, tangents: Tangents, wo: Vec3) -> Frame:
    """The tilted frame, its s along dp/du; frame, tangents and wo are in coordinates of the shading
    frame."""
    dhdu, dhdv = lookup_gradient(bumps.texture[i], at)
    scale = bumps.scale[i]
    n = tilted(scale * dhdu, scale * dhdv, tangents)
    if bumps.flips[i] != 0:
        n = facing(n, wo)
    return frame_along(n, tangents.dpdu)


@kernel
def tilted(dhdu: float, dhdv: float, tangents: Tangents) -> Vec3:
    """The unit normal of the displaced surface; that of the surface itself is (0, 0, 1).

    As in Mitsuba, the tangents are first made orthogonal to the shading normal, and the result is
    flipped to the side of the geometric normal, which here is the normal of both tangents that is
    less than 90 degrees from the shading normal.
    """
    size_u, size_v = max_abs(tangents.dpdu), max_abs(tangents.dpdv)
    if not (size_u > 0.0 and size_v > 0.0):
        return Vec3(0.0, 0.0, 1.0)
    u, v = tangents.dpdu / size_u, tangents.dpdv / size_v
    n = cross(Vec3(u.x, u.y, dhdu / size_u), Vec3(v.x, v.y, dhdv / size_v))
    size = max_abs(n)
    if not (size > 0.0 and size < math.inf):
        return Vec3(0.0, 0.0, 1.0)
    n = normalize(n / size)
    geometric = cross(u, v)
    return -n if dot(n, geometric) * geometric.z < 0.0 else n


class NormalMap(Wrapper):
    """A material whose normals are replaced by a texture's: the direction 2 rgb - 1 of any length.

    Red is along dp/du, blue along the surface's own shading normal.
    """

    EXAMPLES: ClassVar[Examples] = (
        {"base": "base", "normals": "texture", "scale": 0.5},
        {
            "base": "base",
            "normals": "texture",
            "follow_v": True,
            "flip_invalid_normals": True,
            "use_shadowing_function": True,
        },
    )
    type: Literal["normal_map"] = "normal_map"
    base: str
    """Name of the material whose normals are replaced."""
    normals: TextureName
    """Name of the texture of normals.  An image file of integers needs `encoding: raw`."""
    scale: float = 1.0
    """A factor of the normals' components along the surface."""
    follow_v: bool = False
    """Whether green is on the side of dp/dv, also where (u, v) is mirrored on the surface, as in
    glTF.  Default: to the left of dp/du, seen from the front (Mitsuba's)."""
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
            np.array([self.scale], dtype=np.float64),
            np.array([int(self.follow_v)]),
            np.array([int(self.flip_invalid_normals)]),
            np.array([int(self.use_shadowing_function)]),
        )


class NormalMaps(NamedTuple):
    """texture (n,): its number;  scale (n,);  follows (n,), flips (n,), shadows (n,): 1 for
    `follow_v`, `flip_invalid_normals`, `use_shadowing_function`, else 0."""

    texture: IntArray
    scale: FloatArray
    follows: IntArray
    flips: IntArray
    shadows: IntArray


@kernel
def map_basis(maps: NormalMaps, i: int, at: At, tangents: Tangents, wo: Vec3) -> Frame:
    """The tilted frame, its s as close to that of the surface as possible; frame, tangents and wo
    are in coordinates of the shading frame.  A grey of 1/2 is no direction and leaves the normal as
    it is."""
    surface = frame_along(Vec3(0.0, 0.0, 1.0), tangents.dpdu)
    rgb = lookup(maps.texture[i], at)
    scale = maps.scale[i]
    n = Vec3((2.0 * rgb.x - 1.0) * scale, (2.0 * rgb.y - 1.0) * scale, 2.0 * rgb.z - 1.0)
    if maps.follows[i] != 0 and cross(tangents.dpdu, tangents.dpdv).z < 0.0:
        n = Vec3(n.x, -n.y, n.z)
    size = max_abs(n)
    if size == 0.0:
        return surface
    tilted = normalize(to_world(surface, n / size))
    if maps.flips[i] != 0:
        tilted = facing(tilted, wo)
    return frame_along(tilted, surface.s)
