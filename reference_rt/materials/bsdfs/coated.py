"""What smooth and rough plastic share: a diffuse base under a clear coat."""

from typing import ClassVar

from reference_rt.core.model import Positive
from reference_rt.core.vec3 import Vec3
from reference_rt.jit.kernel import kernel
from reference_rt.materials.material import Material
from reference_rt.textures import ReflectanceParameter


class Coated(Material):
    """A diffuse base under a clear coat; its back is black."""

    smooth: ClassVar[bool] = True
    type: str  # first, so that `to_json` writes it first
    reflectance: ReflectanceParameter = (0.5, 0.5, 0.5)
    """Diffuse reflectance of the base: linear sRGB from 0 to 1, or a texture."""
    specular: ReflectanceParameter = (1.0, 1.0, 1.0)
    """A factor of the light that the coat reflects: linear sRGB from 0 to 1, or a texture.  The
    default, 1, is physical."""
    interior_ior: Positive = 1.5
    """Index of refraction of the coat."""
    exterior_ior: Positive = 1.0
    """Index of refraction outside the coat."""
    nonlinear: bool = False
    """Whether `reflectance` colours the light at every bounce below the coat, so that colours
    saturate."""

    @property
    def colour(self) -> tuple[float, float, float] | str:
        return self.reflectance


@kernel
def base_albedo(rho: Vec3, internal: float, nonlinear: int) -> Vec3:
    """rho / (1 - c internal), c = rho if `nonlinear`, else 1: the albedo of the base, light that
    the coat throws back included;  internal: the coat's reflectance from within."""
    if nonlinear == 0:
        return rho * (1.0 / (1.0 - internal))
    return Vec3(
        rho.x / (1.0 - rho.x * internal),
        rho.y / (1.0 - rho.y * internal),
        rho.z / (1.0 - rho.z * internal),
    )
