"""What mirrors and metals, smooth and rough, have in common."""

from typing import Any

import numpy as np

from comparisons.materials.microfacets import gltf_alpha
from comparisons.mitsuba.colours import metal
from comparisons.mitsuba.context import rgb
from comparisons.mitsuba.files import UnwritableError
from comparisons.mitsuba.node import Node, Reading
from comparisons.mitsuba.plugin_table import Kind, PluginTable, Row
from comparisons.renderers.vocabulary import GltfWriter, Look, Params, PbrtWriter, plain_rgb
from comparisons.textures.kinds import COLOUR_OR_TEXTURE
from comparisons.textures.reading import colour_or_texture

NO_INDEX = 1e-12
"""The index of refraction of Mitsuba's metal without a name, whose 0 ours cannot have: it reflects
all but 4e-12 of the light, with k = 1."""


def _plain(reading: Reading, node: Node, name: str, default: float) -> Any:
    value = colour_or_texture(reading, node, name, default, "unbounded")
    if isinstance(value, str):
        raise node.error("'eta' or 'k' is a texture; expected colours")
    return value


_INDEX = Kind(lambda value, context: rgb(value), _plain)

REFLECTANCE = Row("reflectance", "specular_reflectance", COLOUR_OR_TEXTURE, 1.0)

METAL = (Row("eta", "eta", _INDEX, 0.0), Row("k", "k", _INDEX, 1.0), REFLECTANCE)
"""Mitsuba's defaults are those of a metal that is not named."""


def read_metal(table: PluginTable, reading: Reading, node: Node) -> dict[str, Any]:
    """The fields of `table`, which has METAL; eta and k of a metal by its name, too."""
    name = node.text("material", "none")
    if name == "none":
        return table.read(reading, node)
    if node.has("eta"):
        raise node.error("has both 'material' and 'eta'; expected one of them")
    eta, k = metal(node, name)
    return {**table.read(reading, node, but=("eta", "k")), "eta": eta, "k": k}


def without_zeros(values: dict[str, Any]) -> dict[str, Any]:
    """The fields of a metal with NO_INDEX for an index of 0."""
    return values | {"eta": tuple(max(x, NO_INDEX) for x in values["eta"])}


def look_of_metal(material: Any, name: str, writing: GltfWriter) -> Look:
    """Its tint is the reflectance of the metal head-on."""
    eta, k = np.array(material.eta), np.array(material.k)
    reflectance = ((eta - 1.0) ** 2 + k**2) / ((eta + 1.0) ** 2 + k**2)
    r, g, b = reflectance.tolist()
    alpha = gltf_alpha(getattr(material, "alpha", 0.0))
    return Look(material.reflectance, (r, g, b), 1.0, alpha, True)


def cycles_metal(material: Any) -> dict[str, Any]:
    return {"type": "metal", "eta": plain_rgb(material.eta), "k": plain_rgb(material.k)}


def pbrt_index(material: Any) -> Params:
    return {"rgb eta": material.eta, "rgb k": material.k}


def pbrt_metal(params: Params, material: Any, writing: PbrtWriter) -> Params:
    """A metal times its reflectance, as a mixture with black."""
    whole, share = {"string type": "conductor", **params}, material.reflectance
    if isinstance(share, str) or len(set(share)) > 1:
        raise UnwritableError("a metal or mirror times a colour or a texture")
    if share[0] == 1.0:
        return whole
    pair = (writing.black(), writing.define(whole, "", f"{material.type} whole"))
    return {"string type": "mix", "string materials": pair, "float amount": share[0]}
