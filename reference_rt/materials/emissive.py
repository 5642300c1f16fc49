"""Emissive: a surface that emits light, besides what it scatters.

A shape with this material becomes an area light: see `reference_rt.lights.emitters.area`.
"""

from typing import Any, Literal

from reference_rt.materials.material import Material
from reference_rt.textures import ColourParameter, Palette


class Emissive(Material):
    """Emits the same radiance to all sides of its front, and scatters like its base."""

    type: Literal["emissive"] = "emissive"
    radiance: ColourParameter
    """W sr^-1 m^-2, linear sRGB."""
    base: str | None = None
    """A key of the scene's materials: how it scatters besides; none means not at all."""

    @property
    def colour(self) -> tuple[float, float, float] | str:
        return self.radiance

    def tabulate(self, palette: Palette) -> Any:
        raise TypeError("an emissive material has no row of its own: its base has")
