"""What all that refracts has in common: indices of refraction, and factors on what is mirrored and
what passes."""

from typing import Any

from comparisons.geometry.frame import UNIT_ROUNDOFF
from comparisons.materials.material import Errors
from comparisons.materials.microfacets import gltf_alpha
from comparisons.mitsuba.files import UnwritableError
from comparisons.mitsuba.plugin_table import INDEX, Row
from comparisons.renderers.vocabulary import GltfWriter, Look, Params, of_index
from comparisons.textures.kinds import COLOUR_OR_TEXTURE


def indices(inside: str) -> tuple[Row, ...]:
    """Mitsuba's defaults are substances; inside: its default there."""
    return (
        Row("interior_ior", "int_ior", INDEX, inside),
        Row("exterior_ior", "ext_ior", INDEX, "air"),
    )


GLASS = (
    *indices("bk7"),
    Row("reflectance", "specular_reflectance", COLOUR_OR_TEXTURE, 1.0),
    Row("transmittance", "specular_transmittance", COLOUR_OR_TEXTURE, 1.0),
)


def relative_index(material: Any) -> float:
    return float(material.interior_ior / material.exterior_ior)


def fresnel_error(index: float) -> float:
    """The relative error of the light that a surface mirrors in float32, at most 1;  index: behind
    it over in front.

    Where the indices are nearly equal, the amplitude (n - 1) / (n + 1) is what is left of numbers
    near 1.  The index is rounded thrice and the amplitude once, and it is squared: measured are
    1.1 u over the amplitude for exact indices from 1.00001 to 1.5 (Mitsuba 3.9.1, `mi.fresnel`),
    and the index adds 3.  0 for equal indices, where both renderers mirror nothing.
    """
    amplitude = abs(index - 1.0) / (index + 1.0)
    return min(1.0, 4.0 * UNIT_ROUNDOFF / amplitude) if amplitude > 0.0 else 0.0


def _fresnel_error(material: Any) -> float:
    return fresnel_error(relative_index(material))


OF_FRESNEL = Errors(relative=_fresnel_error, absolute=lambda material: 0.0)


def look_of_glass(material: Any, name: str, writing: GltfWriter) -> Look:
    passing = {"KHR_materials_transmission": {"transmissionFactor": 1.0}}
    alpha = gltf_alpha(getattr(material, "alpha", 0.0))
    more = passing | of_index(relative_index(material))
    return Look(material.transmittance, (1, 1, 1), 0.0, alpha, True, extensions=more)


def pbrt_glass(plugin: str, material: Any) -> Params:
    for name in ("reflectance", "transmittance"):
        if getattr(material, name) != (1.0, 1.0, 1.0):
            raise UnwritableError(f"a {name} other than 1")
    return {"string type": plugin, "float eta": relative_index(material)}
