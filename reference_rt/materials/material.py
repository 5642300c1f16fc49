"""What all materials share: the codes of their tables and the contract of their kernels.

Directions are in the shading frame (z is the shading normal) and point away from the surface: `wo`
towards where the radiance goes, `wi` towards where it comes from.  A value of zero everywhere means
"no contribution": black, or a direction that this material never scatters to.
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
    """Whether it scatters to a continuum of directions, so that lights can be sampled."""
    delta: ClassVar[bool] = False
    """Whether it has `branches`: a few directions that no light sample could find."""

    chooses: ClassVar[bool] = True
    """Whether `sample` uses `u_lobe`."""

    @property
    def colour(self) -> tuple[float, float, float] | str:
        """What ray casting shows of it: linear sRGB, or the name of a texture."""
        raise NotImplementedError

    @property
    def transmits(self) -> bool:
        """Whether light passes to the other side."""
        return False

    @property
    def oriented(self) -> bool:
        """Whether it scatters differently along u and v: then x of the frame is along dp/du."""
        return False

    def tabulate(self, palette: Palette) -> Any:
        """This material as one row of its table.  Raises ValueError (what is wrong, what was
        expected)."""
        raise NotImplementedError


class BsdfSample(NamedTuple):
    """A direction drawn by a material.

    wi: the direction;  weight: f(wo, wi) |cos wi| / pdf;  pdf: per solid angle, 0 for "nothing";
    eta: index of refraction of wi's side over wo's, 1 unless it went through;  is_delta: whether
    the direction is one of a few, which no light sample could find (then pdf is a probability).
    """

    wi: Vec3
    weight: Vec3
    pdf: float
    eta: float
    is_delta: bool


@kernel
def no_sample() -> BsdfSample:
    zero = Vec3(0.0, 0.0, 0.0)
    return BsdfSample(zero, zero, 0.0, 1.0, False)


class Scattered(NamedTuple):
    """value: f(wo, wi) |cos wi|;  density: that with which `sample` picks wi."""

    value: Vec3
    density: float


class Branches(NamedTuple):
    """The mirrored and the refracted direction of a perfectly smooth surface.

    Each has the factor on the radiance that arrives from it; a black factor stands for "no such
    branch".  share, passing: the fractions of power that are mirrored and refracted, which add to
    1;  eta: index of refraction on the refracted side over that on wo's.
    """

    reflected: Vec3
    reflectance: Vec3
    refracted: Vec3
    transmittance: Vec3
    share: float
    passing: float
    eta: float


@kernel
def no_branches() -> Branches:
    zero = Vec3(0.0, 0.0, 0.0)
    return Branches(zero, zero, zero, zero, 1.0, 0.0, 1.0)


@kernel
def reflection(wo: Vec3, reflectance: Vec3) -> Branches:
    """The mirrored direction alone."""
    zero = Vec3(0.0, 0.0, 0.0)
    return Branches(Vec3(-wo.x, -wo.y, wo.z), reflectance, zero, zero, 1.0, 0.0, 1.0)


@kernel
def straight_on(wo: Vec3) -> Branches:
    """What is not there: everything passes."""
    zero, one = Vec3(0.0, 0.0, 0.0), Vec3(1.0, 1.0, 1.0)
    return Branches(zero, zero, -wo, one, 0.0, 1.0, 1.0)


@kernel
def sample_branch(branches: Branches, u: float) -> BsdfSample:
    """One of the two branches, with the probability of its share of the power."""
    if u < branches.share:
        if is_black(branches.reflectance):
            return no_sample()
        weight = branches.reflectance * (1.0 / branches.share)
        return BsdfSample(branches.reflected, weight, branches.share, 1.0, True)
    if branches.passing == 0.0:
        return no_sample()
    weight = branches.transmittance * (1.0 / branches.passing)
    return BsdfSample(branches.refracted, weight, branches.passing, branches.eta, True)


INV_PI = 1.0 / math.pi
