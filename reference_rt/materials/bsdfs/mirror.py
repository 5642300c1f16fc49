"""Mirror: R = 2 (wo·n) n - wo, times a colour, on the front side."""

from typing import ClassVar, Literal, NamedTuple

from reference_rt.core.model import Examples
from reference_rt.core.vec3 import Vec3
from reference_rt.jit.kernel import kernel
from reference_rt.materials.material import NO_BRANCHES, Branches, Material, reflection
from reference_rt.textures import At, Colours, Palette, ReflectanceParameter, colour_at


class Mirror(Material):
    """A perfect mirror with a colour; black from behind."""

    EXAMPLES: ClassVar[Examples] = (
        {},
        {"reflectance": (0.9, 0.7, 0.5)},
        {"reflectance": "texture"},
    )
    delta: ClassVar[bool] = True
    type: Literal["mirror"] = "mirror"
    reflectance: ReflectanceParameter = (1.0, 1.0, 1.0)
    """Fraction of the light that is reflected, k_r: linear sRGB from 0 to 1, or a texture."""

    @property
    def colour(self) -> tuple[float, float, float] | str:
        return self.reflectance

    def tabulate(self, palette: Palette) -> "Mirrors":
        return Mirrors(palette.colours(self.reflectance))


class Mirrors(NamedTuple):
    """reflectance (n), linear sRGB."""

    reflectance: Colours


@kernel
def branches(mirrors: Mirrors, i: int, at: At, wo: Vec3) -> Branches:
    """The one mirrored direction."""
    if wo.z <= 0.0:
        return NO_BRANCHES
    return reflection(wo, colour_at(mirrors.reflectance, i, at))
