"""The contract of a type of materials: what the comparison knows of it, in one file a type."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from comparisons.mitsuba.context import TranslationContext
from comparisons.mitsuba.node import Node, Reading
from comparisons.mitsuba.plugin_table import PluginTable
from comparisons.renderers.vocabulary import (
    CyclesWriter,
    Data,
    GltfWriter,
    Look,
    Params,
    PbrtWriter,
    PovLook,
    PovWriter,
)
from comparisons.textures.texture import Nested
from reference_rt.materials import Mask, Material, Wrapper


class Gltf(NamedTuple):
    """look: of a material with a name, in glTF's terms;  nearly: what it only nearly is there,
    empty if it is exact."""

    look: Callable[[Any, str, GltfWriter], Look]
    nearly: str = ""


class Errors(NamedTuple):
    """What a comparison must allow for of a material, in our tables or in Mitsuba.  relative: to
    the light that it scatters;  absolute: of light that passes a coat, as a fraction of the
    brightest such light."""

    relative: Callable[[Any], float]
    absolute: Callable[[Any], float]


MOST = 5e-3
"""Largest relative error that is allowed for: what is more off is wrong, not coarse."""


@dataclass(frozen=True, kw_only=True)
class MaterialType:
    """What the comparison knows of a type of materials; None where a renderer has none.

    table: of Mitsuba's plugin;  to_mitsuba: a dictionary, in which a `Nested` stands for another
    material (it may be one);  from_mitsuba: a material of an element, by Mitsuba's plugin;  note:
    on a material whose counterpart is not simply Mitsuba's own, empty without one;  errors: None
    for exact materials;  to_cycles: where Cycles computes the same to 0.1 %;  to_pbrt: with whether
    both sides look alike;  to_povray: where POV-Ray computes the same to 1e-5.  They raise
    UntranslatableError, SceneError, NoCounterpartError and UnwritableError.
    """

    description: type[Material]
    table: PluginTable | None
    to_mitsuba: Callable[[Any, TranslationContext], dict[str, Any] | Nested]
    from_mitsuba: Mapping[str, Callable[[Reading, Node], Material]]
    note: Callable[[Any, TranslationContext], str] | None
    errors: Errors | None
    to_cycles: Callable[[Any, CyclesWriter], Data] | None
    to_gltf: Gltf | None
    to_pbrt: Callable[[Any, PbrtWriter, bool], Params] | None
    to_povray: Callable[[Any, PovWriter], PovLook] | None = None


def has_delta(material: Material, context: TranslationContext) -> bool:
    """Whether a material has a delta lobe: perfect reflection, refraction or transparency."""
    if isinstance(material, Mask):
        return True
    if isinstance(material, Wrapper):
        names = (getattr(material, field) for field in material.bases)
        return any(has_delta(context.materials[name], context) for name in names if name)
    return material.delta


def nested(reading: Reading, node: Node, least: int, most: int) -> list[str]:
    """The names of an element's nested BSDFs, which are read.  Raises SceneError."""
    bsdfs = node.children("BSDF")
    if not least <= len(bsdfs) <= most:
        expected = str(least) if least == most else f"{least} or {most}"
        raise node.error(f"has {len(bsdfs)} nested BSDFs; expected {expected}")
    return [reading.bsdf(child) for child in bsdfs]
