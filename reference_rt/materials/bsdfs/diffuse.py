"""Diffuse: Lambert's law, f = reflectance / pi, on the front side."""

from typing import ClassVar, Literal, NamedTuple

from reference_rt.core.model import Examples
from reference_rt.core.vec3 import Vec3
from reference_rt.jit.kernel import kernel
from reference_rt.materials.material import INV_PI, NO_SAMPLE, BsdfSample, Material, Scattered
from reference_rt.sampling.warp import cosine_hemisphere
from reference_rt.textures import At, Colours, Palette, ReflectanceParameter, colour_at


class Diffuse(Material):
    """An ideally matte surface: radiance is the same in all directions; black from behind."""

    EXAMPLES: ClassVar[Examples] = (
        {},
        {"reflectance": (0.7, 0.4, 0.1)},
        {"reflectance": "texture"},
    )
    smooth: ClassVar[bool] = True
    uses_u_lobe: ClassVar[bool] = False
    type: Literal["diffuse"] = "diffuse"
    reflectance: ReflectanceParameter = (0.5, 0.5, 0.5)
    """Fraction of the light that is scattered: linear sRGB from 0 to 1, or a texture."""

    @property
    def colour(self) -> tuple[float, float, float] | str:
        return self.reflectance

    def tabulate(self, palette: Palette) -> "Diffuses":
        return Diffuses(palette.colours(self.reflectance))


class Diffuses(NamedTuple):
    """reflectance (n), linear sRGB."""

    reflectance: Colours


@kernel
def eval_pdf(diffuses: Diffuses, i: int, at: At, wo: Vec3, wi: Vec3) -> Scattered:
    """f(wo, wi) cos wi, and the density of `sample`: cos wi / pi."""
    if wo.z <= 0.0 or wi.z <= 0.0:
        return Scattered(Vec3(0.0, 0.0, 0.0), 0.0)
    density = wi.z * INV_PI
    return Scattered(colour_at(diffuses.reflectance, i, at) * density, density)


@kernel
def sample(
    diffuses: Diffuses, i: int, at: At, wo: Vec3, u_lobe: float, u0: float, u1: float
) -> BsdfSample:
    """A direction with density cos / pi: the weight is the reflectance."""
    if wo.z <= 0.0:
        return NO_SAMPLE
    wi = cosine_hemisphere(u0, u1)
    return BsdfSample(wi, colour_at(diffuses.reflectance, i, at), wi.z * INV_PI, 1.0, False)
