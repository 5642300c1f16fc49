"""Principled materials; their errors are those of thin ones, too."""

from typing import Any

import numpy as np

from comparisons.geometry.frame import UNIT_ROUNDOFF
from comparisons.materials.glass import fresnel_error
from comparisons.materials.material import MOST, Errors, Gltf, MaterialType
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.context import TranslationContext, UntranslatableError
from comparisons.mitsuba.node import Node, Reading
from comparisons.mitsuba.plugin_table import PluginTable, Row, inserted
from comparisons.renderers.vocabulary import GltfWriter, Look, of_index
from comparisons.textures.kinds import COLOUR_OR_TEXTURE, NUMBER_OR_TEXTURE
from reference_rt.materials import Principled

BASE = Row("base_colour", "base_color", COLOUR_OR_TEXTURE, 0.5)


def numbers(*names: str) -> tuple[Row, ...]:
    """Rows of numbers that both have under one name."""
    default = {"roughness": 0.5}
    return tuple(Row(name, name, NUMBER_OR_TEXTURE, default.get(name, 0.0)) for name in names)


TABLE = PluginTable(
    "principled",
    (
        BASE,
        *numbers("roughness", "metallic", "spec_tint", "anisotropic", "sheen", "sheen_tint"),
        *numbers("clearcoat", "clearcoat_gloss", "spec_trans", "flatness"),
    ),
    # How lobes are sampled does not change the picture.
    tuple(
        f"{lobe}_sampling_rate" for lobe in ("main_specular", "clearcoat", "diffuse_reflectance")
    ),
)


def _to_mitsuba(material: Principled, context: TranslationContext) -> dict[str, Any]:
    if material.eta is not None:
        index = {"eta": material.eta}
    else:
        index = {"specular": 0.5 if material.specular is None else material.specular}
    plugin = inserted(TABLE.write(material, context), BASE.name, index)
    if context.files is None and material.sheen and mitsuba().variant().startswith("scalar"):
        plugin["spec_trans"] = _with_sheen(material)
    return plugin


def _with_sheen(material: Principled) -> float:
    """Transmission with which Mitsuba's scalar variants do not leave out the sheen, as they do
    where it is exactly 1: the next float32 below.  All lobes then differ by at most a rounding."""
    if isinstance(material.spec_trans, str):
        lacking = "Principled with sheen and a texture of spec_trans, by scalar variants,"
        raise UntranslatableError(lacking, "material")
    return min(material.spec_trans, 1.0 - UNIT_ROUNDOFF)


def _from_mitsuba(reading: Reading, node: Node) -> Principled:
    if node.has("eta") and node.has("specular"):
        raise node.error("has both 'eta' and 'specular'; expected one of them")
    index: dict[str, Any]
    if node.has("eta"):
        index = {"eta": node.number("eta", 1.5)}
    else:
        index = {"specular": node.number("specular", 0.5)}
    return Principled(**TABLE.read(reading, node), **index)


def clearcoat_error(material: Principled) -> float:
    """The relative error of Mitsuba's clear coat: 1 + (alpha² - 1) cos² is off by some 4 u in
    float32, and its least value is alpha²."""
    gloss = 1.0 if isinstance(material.clearcoat_gloss, str) else material.clearcoat_gloss
    alpha = 0.1 + (0.001 - 0.1) * gloss
    return 4.0 * UNIT_ROUNDOFF / alpha**2


def rest_error(material: Any) -> float:
    """The relative error of 1 - x in float32, the share of a lobe next to one with the share x."""
    shares = (getattr(material, name, 0.0) for name in ("spec_trans", "metallic"))
    given = [x for x in shares if not isinstance(x, str) and x < 1.0]
    return max((UNIT_ROUNDOFF * x / (1.0 - x) for x in given), default=0.0)


OURS, THEIRS = (0.2126, 0.7152, 0.0722), (0.212671, 0.715160, 0.072169)
"""Luminance of linear sRGB: rounded as in Rec. 709, and Mitsuba's `mi.luminance`."""


def tint_error(material: Any) -> float:
    """The relative difference of a base colour's luminance in the two renderers: tinted highlights
    and sheen are the base colour over its luminance."""
    if not any(getattr(material, name) for name in ("spec_tint", "sheen_tint")):
        return 0.0
    colours = np.eye(3) if isinstance(material.base_colour, str) else [material.base_colour]
    ours, theirs = (np.array(colours) @ weights for weights in (OURS, THEIRS))
    lit = ours > 0.0
    return float(np.abs(theirs[lit] / ours[lit] - 1.0).max(initial=0.0))


def errors_of_shares(material: Any) -> float:
    """The relative error of a principled material but for its clear coat."""
    index = material.relative_ior if isinstance(material, Principled) else material.eta
    return tint_error(material) + min(MOST, rest_error(material)) + fresnel_error(index)


def _relative(material: Principled) -> float:
    coat = 0.0 if material.clearcoat == 0.0 else min(MOST, clearcoat_error(material))
    return coat + errors_of_shares(material)


def _look(material: Principled, name: str, writing: GltfWriter) -> Look:
    more = of_index(material.relative_ior)
    base, metallic, rough = material.base_colour, material.metallic, material.roughness
    return Look(base, (1, 1, 1), metallic, rough, extensions=more)


PRINCIPLED = MaterialType(
    description=Principled,
    table=TABLE,
    to_mitsuba=_to_mitsuba,
    from_mitsuba={"principled": _from_mitsuba},
    note=None,
    errors=Errors(_relative, lambda material: 0.0),
    to_cycles=None,
    to_gltf=Gltf(_look, nearly="base colour, metallic, roughness and index alone"),
    to_pbrt=None,
)
