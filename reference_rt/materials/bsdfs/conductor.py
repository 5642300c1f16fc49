"""Conductor: a smooth metal, by Fresnel's equations with a complex index of refraction.

`Metal` is the description that smooth and rough conductors share.
"""

from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import AfterValidator

from reference_rt.core.arrays import FloatArray
from reference_rt.core.model import Colour, Examples
from reference_rt.core.vec3 import Vec3, row
from reference_rt.jit.kernel import kernel
from reference_rt.materials.material import NO_BRANCHES, Branches, Material, reflection
from reference_rt.materials.microfacet.fresnel import conductor_colour
from reference_rt.textures import At, Colours, Palette, ReflectanceParameter, colour_at


def _above_zero(eta: tuple[float, float, float]) -> tuple[float, float, float]:
    if min(eta) <= 0.0:
        raise ValueError(f"expected indices of refraction above 0, got {min(eta):g}")
    return eta


Index = Annotated[Colour, AfterValidator(_above_zero)]
"""Real parts of indices of refraction at the three primaries, above 0."""


class Metal(Material):
    """The boundary of a metal; its back is black."""

    EXAMPLES: ClassVar[Examples] = (
        {"eta": 0.2, "k": 3.0},
        {"eta": (0.14, 0.37, 1.44), "k": (3.98, 2.39, 1.6), "reflectance": (0.9, 0.8, 0.7)},
        {"eta": 1.5, "k": 0.0, "reflectance": "texture"},
    )
    type: str  # first, so that `to_json` writes it first
    eta: Index
    """Real part of the index of refraction for red, green and blue, relative to the medium outside;
    above 0."""
    k: Colour
    """Extinction coefficient for red, green and blue: the imaginary part of the index; at least 0.
    """
    reflectance: ReflectanceParameter = (1.0, 1.0, 1.0)
    """A factor of the reflected light: linear sRGB from 0 to 1, or a texture.  The default, 1, is
    physical."""

    @property
    def colour(self) -> tuple[float, float, float] | str:
        """The reflectance at normal incidence; the texture, where it has one."""
        if isinstance(self.reflectance, str):
            return self.reflectance
        r, g, b = conductor_colour(1.0, Vec3(*self.eta), Vec3(*self.k)) * Vec3(*self.reflectance)
        return r, g, b

    def columns(self, palette: Palette) -> dict[str, Any]:
        """The columns that the tables share, one row: eta, k, reflectance."""
        return {
            "eta": np.array([self.eta]),
            "k": np.array([self.k]),
            "reflectance": palette.colours(self.reflectance),
        }


class Conductor(Metal):
    """A smooth metal; black from behind."""

    delta: ClassVar[bool] = True
    type: Literal["conductor"] = "conductor"

    def tabulate(self, palette: Palette) -> "Conductors":
        return Conductors(**self.columns(palette))


class Conductors(NamedTuple):
    """eta (n, 3) and k (n, 3): the index of refraction eta + i k;  reflectance (n)."""

    eta: FloatArray
    k: FloatArray
    reflectance: Colours


@kernel
def branches(conductors: Conductors, i: int, at: At, wo: Vec3) -> Branches:
    """The one mirrored direction."""
    if wo.z <= 0.0:
        return NO_BRANCHES
    f = conductor_colour(wo.z, row(conductors.eta, i), row(conductors.k, i))
    return reflection(wo, f * colour_at(conductors.reflectance, i, at))
