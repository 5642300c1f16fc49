"""The base of all materials, and the types that their kernels return.

Directions are in the shading frame (z is the shading normal) and point away from the surface: `wo`
towards the viewer, `wi` towards the light.  Zero always means "no contribution": black, or a
direction that this material never scatters to.
"""

import math
from typing import Any, ClassVar, NamedTuple

from reference_rt.core.model import Description
from reference_rt.core.vec3 import Vec3, is_black
from reference_rt.jit.kernel import kernel
from reference_rt.textures import Palette


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
