"""What materials of microfacets have in common: the distribution of normals and its width."""

from typing import Any

import numpy as np

from comparisons.mitsuba.context import TranslationContext
from comparisons.mitsuba.files import UnwritableError
from comparisons.mitsuba.node import Node, Reading
from comparisons.mitsuba.plugin_table import PluginTable, Row, inserted, one_of
from comparisons.renderers.vocabulary import ALONG, Params, PbrtWriter
from comparisons.textures.reading import number_or_texture
from comparisons.textures.translate import number

DISTRIBUTION = Row("distribution", "distribution", one_of("beckmann", "ggx"), "beckmann")

ALPHA = 0.1
"""Mitsuba's default."""

SAMPLING = ("sample_visible",)
"""How it is sampled does not change the picture; but see `reference.sample_visible`."""


def write_rough(table: PluginTable, material: Any, context: TranslationContext) -> dict[str, Any]:
    """The dictionary of a rough material of one or two widths, whose `table` has DISTRIBUTION;
    with our plugin around it where Mitsuba's masking is approximate."""
    alpha = material.alpha
    along_u, along_v = (alpha, alpha) if isinstance(alpha, str) else alpha
    alphas = {"alpha_u": number(along_u, context), "alpha_v": number(along_v, context)}
    bsdf = inserted(table.write(material, context), DISTRIBUTION.name, alphas)
    if material.distribution == "ggx" or context.native:
        return bsdf
    return {"type": "exact_beckmann", "nested": bsdf, **alphas}


def read_alpha(reading: Reading, node: Node) -> Any:
    """One width, or those along u and along v."""
    if node.has("alpha_u") or node.has("alpha_v"):
        if not (node.has("alpha_u") and node.has("alpha_v")) or node.has("alpha"):
            raise node.error("expected 'alpha', or 'alpha_u' and 'alpha_v'")
        return tuple(
            number_or_texture(reading, node, name, ALPHA) for name in ("alpha_u", "alpha_v")
        )
    return number_or_texture(reading, node, "alpha", ALPHA)


def note_of_beckmann(material: Any, context: TranslationContext) -> str:
    if material.distribution == "ggx":
        return ""
    return (
        "Mitsuba's masking function of Beckmann microfacets, an approximation up to 0.31 % off for "
        "each of the two directions, is replaced by the exact one"
    )


def gltf_alpha(alpha: Any) -> Any:
    """The roughness of both directions: a texture, or the geometric mean."""
    along, across = alpha if isinstance(alpha, tuple) else (alpha, alpha)
    if along == across:
        return along
    if isinstance(along, str) or isinstance(across, str):
        raise UnwritableError("two roughnesses of which one is a texture")
    return float(np.sqrt(along * across))


def pbrt_alpha(material: Any, writing: PbrtWriter) -> Params:
    if material.distribution != "ggx":
        raise UnwritableError(f"microfacets '{material.distribution}'")
    writing.note("pbrt's masking of microfacets is height-correlated: brighter at grazing angles")
    if material.oriented:
        params = dict(zip(ALONG, material.alpha, strict=True))
    else:
        alpha = material.alpha if isinstance(material.alpha, str) else material.alpha[0]
        params = writing.parameter("float", "roughness", alpha)
    return {**params, "bool remaproughness": False}
