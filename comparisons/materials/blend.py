"""Blends of two materials, of which Mitsuba's is wrong for perfect mirrors."""

from dataclasses import replace
from typing import Any

from comparisons.materials.material import MaterialType, has_delta, nested
from comparisons.mitsuba.context import TranslationContext
from comparisons.mitsuba.node import Node, Reading
from comparisons.mitsuba.plugin_table import PluginTable, Row
from comparisons.renderers import NoCounterpartError
from comparisons.renderers.vocabulary import (
    CyclesWriter,
    Data,
    Params,
    PbrtWriter,
    PovLook,
    PovWriter,
)
from comparisons.textures.kinds import NUMBER_OR_TEXTURE
from comparisons.textures.texture import Nested
from reference_rt.materials import Blend

TABLE = PluginTable("blendbsdf", (Row("weight", "weight", NUMBER_OR_TEXTURE, None),))


def _to_mitsuba(material: Blend, context: TranslationContext) -> dict[str, Any]:
    values = TABLE.write(material, context)
    first, second = Nested(material.first), Nested(material.second)
    if has_delta(material, context) and not context.native:
        return {**values, "type": "mixture_blend", "first": first, "second": second}
    return {**values, "0_first": first, "1_second": second}


def _from_mitsuba(reading: Reading, node: Node) -> Blend:
    values = TABLE.read(reading, node)
    first, second = nested(reading, node, 2, 2)
    return Blend(first=first, second=second, **values)


def _note(material: Blend, context: TranslationContext) -> str:
    if not has_delta(material, context):
        return ""
    return (
        "Mitsuba's blend is wrong if one of the two is a perfect mirror: with the weight w it "
        "reflects (w + (1 - w) f) / (w + (1 - w) p) of its light, where f is the other's BSDF "
        "times cosine in the mirrored direction, and p its pdf there; our plugin is used instead"
    )


def _to_cycles(material: Blend, writing: CyclesWriter) -> Data:
    first, second = writing.shader(material.first), writing.shader(material.second)
    weight = writing.number(material.weight)
    return {"type": "mix", "weight": weight, "first": first, "second": second}


def _to_pbrt(material: Blend, writing: PbrtWriter, both_sides: bool) -> Params:
    """pbrt's random choice at each point, by the weight: the mean is the same."""
    pair = (material.first, material.second)
    names = tuple(writing.material(name, both_sides) for name in pair)
    amount = writing.parameter("float", "amount", material.weight)
    return {"string type": "mix", "string materials": names, **amount}


def _to_povray(material: Blend, writing: PovWriter) -> PovLook:
    """Of a mirror and another material, which is one of POV-Ray's."""
    if isinstance(material.weight, str):
        raise NoCounterpartError("a blend whose weight is a texture")
    shares = (1.0 - material.weight, material.weight)
    names = (material.first, material.second)
    looks = [writing.look(name).weighted(w) for name, w in zip(names, shares, strict=True)]
    looks.sort(key=lambda look: look.is_mirror)
    dull, mirror = looks
    if not mirror.is_mirror or dull.index is not None or dull.both_sides != mirror.both_sides:
        raise NoCounterpartError("a blend of other materials than a mirror and an opaque one")
    summed = tuple(a + b for a, b in zip(dull.mirror, mirror.mirror, strict=True))
    return replace(dull, mirror=summed)


BLEND = MaterialType(
    description=Blend,
    table=TABLE,
    to_mitsuba=_to_mitsuba,
    from_mitsuba={"blendbsdf": _from_mitsuba},
    note=_note,
    errors=None,
    to_cycles=_to_cycles,
    to_gltf=None,
    to_pbrt=_to_pbrt,
    to_povray=_to_povray,
)
