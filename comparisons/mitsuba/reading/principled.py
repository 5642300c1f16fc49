"""The principled BSDFs of Mitsuba scenes, and Phong's of our own plugin: many numbers each."""

from typing import Any

from comparisons.mitsuba.reading.context import Reading
from comparisons.mitsuba.reading.node import Node
from comparisons.mitsuba.reading.textures import colour_or_texture, number_or_texture
from reference_rt.materials import Material, Phong, Principled, PrincipledThin

_NUMBERS = (
    "roughness", "metallic", "spec_tint", "anisotropic", "sheen", "sheen_tint", "clearcoat",
    "clearcoat_gloss", "spec_trans", "flatness",
)  # fmt: skip


def principled(reading: Reading, node: Node) -> Material:
    # How lobes are sampled does not change the picture.
    node.ignore(
        "main_specular_sampling_rate",
        "clearcoat_sampling_rate",
        "diffuse_reflectance_sampling_rate",
    )
    values: dict[str, Any] = {}
    if node.has("eta") and node.has("specular"):
        raise node.error("has both 'eta' and 'specular'; expected one of them")
    if node.has("eta"):
        values["eta"] = node.number("eta", 1.5)
    else:
        values["specular"] = node.number("specular", 0.5)
    for name in _NUMBERS:
        values[name] = number_or_texture(reading, node, name, 0.5 if name == "roughness" else 0.0)
    return Principled(base_colour=colour_or_texture(reading, node, "base_color", 0.5), **values)


_THIN_NUMBERS = (
    "roughness", "anisotropic", "spec_trans", "spec_tint", "sheen", "sheen_tint", "flatness",
    "diff_trans",
)  # fmt: skip


def principled_thin(reading: Reading, node: Node) -> Material:
    # How lobes are sampled does not change the picture.
    kinds = (f"{lobe}_{way}" for lobe in ("specular", "diffuse") for way in _WAYS)
    node.ignore(*(f"{kind}_sampling_rate" for kind in kinds))
    values: dict[str, Any] = {"eta": node.number("eta", 1.5)}
    for name in _THIN_NUMBERS:
        values[name] = number_or_texture(reading, node, name, 0.5 if name == "roughness" else 0.0)
    return PrincipledThin(base_colour=colour_or_texture(reading, node, "base_color", 0.5), **values)


_WAYS = ("reflectance", "transmittance")


def phong(reading: Reading, node: Node) -> Material:
    """Of our plugin, in files that we have written."""
    colours: dict[str, Any] = {
        key: colour_or_texture(reading, node, key, 0.0)
        for key in ("ambient", "diffuse", "specular", "mirror")
    }
    if node.has("exponent"):
        colours["exponent"] = node.number("exponent", 1.0)
    return Phong(**colours, half_vector=node.flag("half_vector"))
