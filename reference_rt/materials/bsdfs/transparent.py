"""The description of smooth, thin and rough dielectrics, and the table of the first two."""

from typing import Any, NamedTuple

import numpy as np

from reference_rt.core.arrays import FloatArray
from reference_rt.core.model import Positive
from reference_rt.materials.material import Material
from reference_rt.materials.microfacet.fresnel import relative_index
from reference_rt.textures import Colours, Palette, ReflectanceParameter


class Transparent(Material):
    """A boundary of two transparent media."""

    type: str  # first, so that `to_json` writes it first
    interior_ior: Positive = 1.5
    """Index of refraction of the interior, behind the normal."""
    exterior_ior: Positive = 1.0
    """Index of refraction of the exterior, which the normal points to."""
    reflectance: ReflectanceParameter = (1.0, 1.0, 1.0)
    """A factor of the reflected light: linear sRGB from 0 to 1, or a texture.  The default, 1, is
    physical."""
    transmittance: ReflectanceParameter = (1.0, 1.0, 1.0)
    """A factor of the refracted light: linear sRGB from 0 to 1, or a texture.  The default, 1, is
    physical."""

    @property
    def colour(self) -> tuple[float, float, float] | str:
        return self.transmittance

    @property
    def transmits(self) -> bool:
        return True

    def tabulate(self, palette: Palette) -> Any:
        return Transparents(**self.columns(palette))

    def columns(self, palette: Palette) -> dict[str, Any]:
        """The columns that the tables share, one row: eta, reflectance, transmittance."""
        return {
            "eta": np.array([relative_index(self.interior_ior, self.exterior_ior)]),
            "reflectance": palette.colours(self.reflectance),
            "transmittance": palette.colours(self.transmittance),
        }


class Transparents(NamedTuple):
    """eta (n,): index of refraction of the interior (of a pane) over that of the exterior;
    reflectance, transmittance (n)."""

    eta: FloatArray
    reflectance: Colours
    transmittance: Colours
