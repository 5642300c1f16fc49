"""The base of all materials, and the types that their kernels take and return; the shading frame;
and `Emissive`, which emits light besides what it scatters.

Directions are in the shading frame (z is the shading normal) and point away from the surface: `wo`
towards the viewer, `wi` towards the light.  Zero always means "no contribution": black, or a
direction that this material never scatters to.  A shape with an emissive material becomes an area
light: see `reference_rt.lights.emitters.area`.
"""

import math
from typing import Any, ClassVar, Literal, NamedTuple

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.model import Description, Examples
from reference_rt.core.ray import BLOCK, UNIT_ROUNDOFF, SurfacePoint, put_vector, vector_of
from reference_rt.core.vec3 import (
    Frame,
    Vec3,
    cross,
    dot,
    frame_from_normal,
    is_black,
    max_abs,
    normalize,
    to_world,
)
from reference_rt.jit.kernel import kernel
from reference_rt.shapes.shape import Tangents
from reference_rt.textures import At, ColourParameter, OnTriangle, Palette


class Material(Description):
    """How a surface scatters light."""

    smooth: ClassVar[bool] = False
    """Whether it has a lobe of finite density, so that light sampling helps (as Mitsuba's
    `BSDFFlags::Smooth`)."""
    delta: ClassVar[bool] = False
    """Whether it has `branches`: delta lobes, whose directions no light sample can find."""

    uses_u_lobe: ClassVar[bool] = True
    """Whether `sample` uses its number `u_lobe`, which picks a lobe."""

    @property
    def colour(self) -> tuple[float, float, float] | str:
        """The colour that ray casting shows: linear sRGB, or the name of a texture."""
        raise NotImplementedError

    @property
    def transmits(self) -> bool:
        """Whether it refracts, or lets light pass, to the other side."""
        return False

    @property
    def oriented(self) -> bool:
        """Whether it is anisotropic: then x of the shading frame must be along dp/du."""
        return False

    def tabulate(self, palette: Palette) -> Any:
        """This material as one row of its table.  Raises ValueError (what is wrong, what was
        expected)."""
        raise NotImplementedError


class BsdfSample(NamedTuple):
    """A direction drawn by a material.

    wi: the direction;  weight: f(wo, wi) |cos wi| / pdf;  pdf: per solid angle, 0 means that
    sampling failed;  eta: index of refraction on wi's side over that on wo's, 1 for a reflection;
    is_delta: whether wi is of a delta lobe, which no light sample can find: then pdf is a
    probability.
    """

    wi: Vec3
    weight: Vec3
    pdf: float
    eta: float
    is_delta: bool


_BLACK = Vec3(0.0, 0.0, 0.0)

NO_SAMPLE = BsdfSample(_BLACK, _BLACK, 0.0, 1.0, False)
"""Nothing is scattered, or sampling failed."""


class Scattered(NamedTuple):
    """value: f(wo, wi) |cos wi|;  density: the density of `sample` at wi, per solid angle."""

    value: Vec3
    density: float


class Branches(NamedTuple):
    """The delta lobes of a perfectly smooth surface: the mirrored and the refracted direction.

    Each has the factor on the radiance that arrives from it; a black factor means that there is no
    such lobe.  share, passing: the fractions of power that are mirrored and refracted, which add to
    1;  eta: index of refraction on the refracted side over that on wo's.
    """

    reflected: Vec3
    reflectance: Vec3
    refracted: Vec3
    transmittance: Vec3
    share: float
    passing: float
    eta: float


NO_BRANCHES = Branches(_BLACK, _BLACK, _BLACK, _BLACK, 1.0, 0.0, 1.0)


@kernel
def reflection(wo: Vec3, reflectance: Vec3) -> Branches:
    """The mirrored direction alone."""
    zero = Vec3(0.0, 0.0, 0.0)
    return Branches(Vec3(-wo.x, -wo.y, wo.z), reflectance, zero, zero, 1.0, 0.0, 1.0)


@kernel
def straight_on(wo: Vec3) -> Branches:
    """No surface, as where a mask is clear: all light passes straight on."""
    zero, one = Vec3(0.0, 0.0, 0.0), Vec3(1.0, 1.0, 1.0)
    return Branches(zero, zero, -wo, one, 0.0, 1.0, 1.0)


@kernel
def sample_branch(branches: Branches, u: float) -> BsdfSample:
    """One of the two directions, with a probability equal to its fraction of the power."""
    if u < branches.share:
        if is_black(branches.reflectance):
            return NO_SAMPLE
        weight = branches.reflectance * (1.0 / branches.share)
        return BsdfSample(branches.reflected, weight, branches.share, 1.0, True)
    if branches.passing == 0.0:
        return NO_SAMPLE
    weight = branches.transmittance * (1.0 / branches.passing)
    return BsdfSample(branches.refracted, weight, branches.passing, branches.eta, True)


INV_PI = 1.0 / math.pi


class Shading(NamedTuple):
    """point: of the surface;  frame: the shading frame, n = `point.ns`;  wo: towards the viewer,
    local;  at: where textures are looked up;  tangents: dp/du and dp/dv, local, 0 for a
    material that is not `oriented`;  flat_leaves: the scratch buffer that `prepare` fills with the
    material's flattened leaves, empty if no material of the scene is nested."""

    point: SurfacePoint
    frame: Frame
    wo: Vec3
    at: At
    tangents: Tangents
    flat_leaves: FloatArray


SCATTER_FLOATS, SCATTER_INTEGERS = 30 * BLOCK, 2 * BLOCK


class ScatterBlock(NamedTuple):
    """What materials scatter of up to BLOCK paths, as SoA.

    numbers (SCATTER_FLOATS,): columns of `Asked`, but for the frame's n, and of the place for
    texture lookups;  of the answer value and density towards the light, and of the `BsdfSample`.
    codes (SCATTER_INTEGERS,): table of all materials, -1 where none scatters, then row.
    """

    numbers: FloatArray
    codes: IntArray


class Asked(NamedTuple):
    """What is asked of a material.  frame: the shading frame;  u_lobe, u0, u1: numbers for
    `sample`."""

    frame: Frame
    u_lobe: float
    u0: float
    u1: float


@kernel
def put_asked(block: ScatterBlock, j: int, kind: int, i: int, asked: Asked) -> None:
    """Path j is scattered by row i of a kind of materials."""
    block.codes[j], block.codes[BLOCK + j] = kind, i
    put_vector(block.numbers, 0, j, asked.frame.s)
    put_vector(block.numbers, 3, j, asked.frame.t)
    put_vector(block.numbers, 6, j, Vec3(asked.u_lobe, asked.u0, asked.u1))


@kernel
def asked_in(block: ScatterBlock, j: int, n: Vec3) -> Asked:
    """What is asked for path j.  n: the normal of the frame."""
    numbers, u = block.numbers, vector_of(block.numbers, 6, j)
    frame = Frame(vector_of(numbers, 0, j), vector_of(numbers, 3, j), n)
    return Asked(frame, u.x, u.y, u.z)


@kernel
def put_place(block: ScatterBlock, j: int, at: At) -> None:
    """The place for path j's texture lookups; of materials without textures none is stored."""
    on: Any = at.on
    block.numbers[9 * BLOCK + j], block.numbers[10 * BLOCK + j] = at.u, at.v
    put_vector(block.numbers, 11, j, at.colour)
    put_vector(block.numbers, 27, j, Vec3(float(on.row), on.u, on.v))


@kernel
def place_in(block: ScatterBlock, j: int, textures: Any) -> At:
    numbers = block.numbers
    u, v, on = numbers[9 * BLOCK + j], numbers[10 * BLOCK + j], vector_of(numbers, 27, j)
    return At(textures, u, v, vector_of(numbers, 11, j), OnTriangle(int(on.x), on.y, on.z))


@kernel
def direction_towards(light: FloatArray, j: int) -> Vec3:
    """The unit direction, in the world, of path j's light sample; 0 where nothing arrives.  light:
    columns of directions, in the first three, and of their pdfs, in the seventh."""
    if light[6 * BLOCK + j] == 0.0:
        return Vec3(0.0, 0.0, 0.0)
    return vector_of(light, 0, j)


@kernel
def put_scattered(
    block: ScatterBlock, j: int, frame: Frame, lit: Scattered, drawn: BsdfSample
) -> None:
    """Stores what path j's light sample contributes, and its sampled direction."""
    numbers = block.numbers
    put_vector(numbers, 14, j, lit.value)
    numbers[17 * BLOCK + j] = lit.density
    put_vector(numbers, 18, j, to_world(frame, drawn.wi))
    put_vector(numbers, 21, j, drawn.weight)
    numbers[24 * BLOCK + j], numbers[25 * BLOCK + j] = drawn.pdf, drawn.eta
    numbers[26 * BLOCK + j] = 1.0 if drawn.is_delta else 0.0


@kernel
def lit_in(block: ScatterBlock, j: int) -> Scattered:
    """What path j's light sample contributes."""
    return Scattered(vector_of(block.numbers, 14, j), block.numbers[17 * BLOCK + j])


@kernel
def drawn_in(block: ScatterBlock, j: int) -> BsdfSample:
    """The sampled direction of path j, in the world."""
    numbers = block.numbers
    return BsdfSample(
        vector_of(numbers, 18, j),
        vector_of(numbers, 21, j),
        numbers[24 * BLOCK + j],
        numbers[25 * BLOCK + j],
        numbers[26 * BLOCK + j] != 0.0,
    )


_NOISE = 64.0 * UNIT_ROUNDOFF
"""Orthogonalisation takes the part along the unit normal off a vector.  A remainder shorter than
this share of the vector is rounding noise, of some ten roundings."""

_LEAST, _MOST = 2.0**-400, 2.0**400
"""Components between whose squares neither overflow nor lose digits to underflow."""


@kernel
def frame_along(n: Vec3, direction: Vec3) -> Frame:
    """A right-handed basis around a unit normal, its `s` as far along `direction` (of any length)
    as it can be; any where that is parallel to n, or zero.

    What orthogonalisation leaves is orthogonal to within some roundings of the direction's length.
    Where that is not most of it, it is done again ("twice is enough": Parlett 1980, "The Symmetric
    Eigenvalue Problem", 6.9).
    """
    size = max_abs(direction)
    if not size > 0.0:
        return frame_from_normal(n)
    if not _LEAST < size < _MOST:
        direction = direction / size
    s = direction - n * dot(n, direction)
    length2, whole2 = dot(s, s), dot(direction, direction)
    if length2 < 0.25 * whole2:
        if length2 <= _NOISE * _NOISE * whole2:
            return frame_from_normal(n)
        s = normalize(s)
        s = s - n * dot(n, s)
        length2 = dot(s, s)
    s = s * (1.0 / math.sqrt(length2))
    return Frame(s, cross(n, s), n)


@kernel
def oriented_frame(ns: Vec3, tangents: Tangents) -> Frame:
    """The basis around a shading normal with `s` along dp/du, and t = n x s (as Mitsuba's)."""
    return frame_along(ns, tangents.dpdu)


class Emissive(Material):
    """Emits the same radiance in all directions of its front: its shape is an area light."""

    EXAMPLES: ClassVar[Examples] = (
        {"radiance": 1.0},
        {"radiance": (3.0, 2.0, 1.0), "base": "base"},
        {"radiance": "texture"},
    )
    type: Literal["emissive"] = "emissive"
    radiance: ColourParameter
    """Emitted radiance: W sr^-1 m^-2, linear sRGB, or a texture."""
    base: str | None = None
    """Name of the material that scatters light besides.  Default: the surface scatters none."""

    @property
    def colour(self) -> tuple[float, float, float] | str:
        return self.radiance

    def tabulate(self, palette: Palette) -> Any:
        raise TypeError("an emissive material has no row of its own: its base has")
