"""Emissive: a surface that emits light, besides what it scatters.

A shape with this material becomes an area light: see `reference_rt.lights.emitters.area`.
"""

from typing import Any, Literal

from reference_rt.materials.material import Material
from reference_rt.textures import ColourParameter, Palette


class Emissive(Material):
    """Emits the same radiance in all directions of its front: its shape is an area light."""

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
