"""What all that refracts has in common: indices of refraction, and factors on what is mirrored and
what passes."""

from typing import Any

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
