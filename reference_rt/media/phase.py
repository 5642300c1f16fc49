"""Phase functions: by which angle a medium scatters light.

cosine is that of the angle by which light is turned: 1 for light that goes straight on.  All are
symmetric about the direction of travel, and reciprocal, so that they serve paths from the camera
and from the lamps alike.
"""

import math
from typing import Annotated, ClassVar, Literal, NamedTuple

from pydantic import Field

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.model import Description, Examples
from reference_rt.core.vec3 import Vec3, frame_from_normal, to_world
from reference_rt.jit.kernel import kernel
from reference_rt.sampling.warp import on_circle

_INV_4_PI = 0.25 / math.pi

HENYEY_GREENSTEIN, RAYLEIGH = range(2)
"""Codes of lobes."""


class Lobe(NamedTuple):
    """A part of a phase function: its share of the light, its code, and g for Henyey-Greenstein."""

    share: float
    code: int
    g: float


class Isotropic(Description):
    """All directions alike: 1 / (4 pi)."""

    type: Literal["isotropic"] = "isotropic"

    @property
    def lobes(self) -> tuple[Lobe, ...]:
        return (Lobe(1.0, HENYEY_GREENSTEIN, 0.0),)


class HenyeyGreenstein(Description):
    """Scattering that is stronger forwards or backwards (Henyey & Greenstein 1941):
    (1 - g²) / (4 pi (1 + g² - 2 g cosine)^(3/2))."""

    EXAMPLES: ClassVar[Examples] = ({"g": 0.5}, {"g": -0.3})
    type: Literal["hg"] = "hg"
    g: Annotated[float, Field(gt=-1, lt=1)] = 0.0
    """The mean cosine of the angle by which light is turned, between -1 and 1: above 0 it mostly
    goes on forwards, below 0 it mostly turns back; 0 is isotropic."""

    @property
    def lobes(self) -> tuple[Lobe, ...]:
        return (Lobe(1.0, HENYEY_GREENSTEIN, self.g),)


class Rayleigh(Description):
    """Scattering by what is much smaller than the wavelength, such as air (Rayleigh 1871):
    3 (1 + cosine²) / (16 pi)."""

    type: Literal["rayleigh"] = "rayleigh"

    @property
    def lobes(self) -> tuple[Lobe, ...]:
        return (Lobe(1.0, RAYLEIGH, 0.0),)


_Simple = Annotated[Isotropic | HenyeyGreenstein | Rayleigh, Field(discriminator="type")]


class BlendPhase(Description):
    """A mixture of two phase functions: (1 - weight) first + weight second."""

    EXAMPLES: ClassVar[Examples] = (
        {"first": {"type": "hg", "g": 0.8}, "second": {"type": "hg", "g": -0.2}, "weight": 0.3},
        {"first": {"type": "isotropic"}, "second": {"type": "rayleigh"}},
    )
    type: Literal["blend"] = "blend"
    first: _Simple
    """The phase function of weight 1 - `weight`."""
    second: _Simple
    """The phase function of weight `weight`."""
    weight: Annotated[float, Field(ge=0, le=1)] = 0.5
    """The share of `second`, from 0 to 1."""

    @property
    def lobes(self) -> tuple[Lobe, ...]:
        parts = (1.0 - self.weight, self.first), (self.weight, self.second)
        return tuple(
            lobe._replace(share=share * lobe.share) for share, part in parts for lobe in part.lobes
        )


AnyPhase = Annotated[
    Isotropic | HenyeyGreenstein | Rayleigh | BlendPhase, Field(discriminator="type")
]


class Lobes(NamedTuple):
    """The lobes of all media.  share, g (m,), code (m,): see `Lobe`;  first (n + 1,): the first
    lobe of each medium, and the number of all."""

    share: FloatArray
    g: FloatArray
    code: IntArray
    first: IntArray


@kernel
def phase(lobes: Lobes, k: int, cosine: float) -> float:
    """The phase function of medium k, 1/sr: also the density of `turned`."""
    total = 0.0
    for i in range(lobes.first[k], lobes.first[k + 1]):
        total += lobes.share[i] * _value(lobes.code[i], lobes.g[i], cosine)
    return total


@kernel
def _value(code: int, g: float, cosine: float) -> float:
    if code == RAYLEIGH:
        return 0.75 * _INV_4_PI * (1.0 + cosine * cosine)
    # 1 + g² - 2 g cosine, without cancellation where |g| is near 1 and light goes straight on.
    rest = 1.0 - cosine if g > 0.0 else 1.0 + cosine
    near = 1.0 - abs(g)
    span = near * near + 2.0 * abs(g) * rest
    return _INV_4_PI * (near * (1.0 + abs(g))) / (span * math.sqrt(span))


@kernel
def turned(lobes: Lobes, k: int, d: Vec3, u0: float, u1: float) -> Vec3:
    """The direction, unit, in which medium k scatters light that travels along d, unit, drawn with
    the density `phase`.  u0, u1: numbers from [0, 1)."""
    i, last = lobes.first[k], lobes.first[k + 1] - 1
    while i < last and u0 >= lobes.share[i]:
        u0 -= lobes.share[i]
        i += 1
    if lobes.share[i] > 0.0:
        u0 = min(u0 / lobes.share[i], BELOW_ONE)
    cosine, rest = _cosine(lobes.code[i], lobes.g[i], u0)
    sine = math.sqrt(max(0.0, rest))
    x, y = on_circle(u1)
    return to_world(frame_from_normal(d), Vec3(sine * x, sine * y, cosine))


BELOW_ONE = 1.0 - 2.0**-53
"""The largest number below 1."""


@kernel
def _cosine(code: int, g: float, u: float) -> tuple[float, float]:
    """The cosine whose distribution function is u, and 1 - cosine²."""
    if code == RAYLEIGH:
        # cosine³ + 3 cosine = 8 u - 4, by Cardano: one real root (Frisvad 2011).
        half = 4.0 * u - 2.0
        big = abs(half) + math.sqrt(half * half + 1.0)
        root = big ** (1.0 / 3.0)
        cosine = math.copysign(root - 1.0 / root, half)
        cosine = min(1.0, max(-1.0, cosine))
        return cosine, 1.0 - cosine * cosine
    # The textbook's form (PBR 4ed, 11.14), solved for the distances from both ends, 1 -+ |cosine|,
    # so that nothing cancels where |g| is near 1.
    a = abs(g)
    v, rest = (1.0 - u, u) if g > 0.0 else (u, 1.0 - u)
    near, far = 1.0 - a, 1.0 + a
    below = near + 2.0 * a * rest
    from_peak = 2.0 * v * (1.0 + a * rest) * (near / below) * (near / below)
    from_back = 2.0 * rest * (near + a * rest) * (far / below) * (far / below)
    cosine = 1.0 - from_peak
    return (cosine if g > 0.0 else -cosine), from_peak * from_back
