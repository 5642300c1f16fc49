"""Two-sided materials."""

from dataclasses import replace
from typing import Any

from comparisons.materials.material import Gltf, MaterialType, has_delta, nested
from comparisons.mitsuba.context import TranslationContext
from comparisons.mitsuba.files import UnwritableError
from comparisons.mitsuba.node import Node, Reading
from comparisons.renderers import NoCounterpartError
from comparisons.renderers.vocabulary import (
    BLACK,
    CyclesWriter,
    Data,
    GltfWriter,
    Look,
    PovLook,
    PovWriter,
)
from comparisons.textures.texture import Nested
from reference_rt.materials import TwoSided


def _to_mitsuba(material: TwoSided, context: TranslationContext) -> dict[str, Any]:
    front = Nested(material.base)
    if material.back is None:
        return {"type": "twosided", "0_front": front}
    back = Nested(material.back)
    if has_delta(material, context) and not context.native:
        return {"type": "mixture_sides", "front": front, "back": back}
    return {"type": "twosided", "0_front": front, "1_back": back}


def _from_mitsuba(reading: Reading, node: Node) -> TwoSided:
    if node.flag("allow_transmission"):
        raise node.error("'allow_transmission' is not supported; expected false")
    base, *back = nested(reading, node, 1, 2)
    transmits = [name for name in (base, *back) if reading.materials[name].transmits]
    if transmits:
        raise node.error(
            f"'{transmits[0]}' transmits light; expected materials that only reflect, as Mitsuba "
            "does"
        )
    return TwoSided(base=base, back=back[0] if back else None)


def _to_cycles(material: TwoSided, writing: CyclesWriter) -> Data:
    front = _bare(writing.shader(material.base))
    back = front if material.back is None else _bare(writing.shader(material.back))
    return {"type": "sides", "front": front, "back": back}


def _bare(shader: Data) -> Data:
    """What is seen from the front, on either side."""
    if shader["type"] == "sides" and shader["back"] == BLACK:
        return _bare(shader["front"])
    if shader["type"] in ("sum", "mix", "sides", "glass"):
        raise NoCounterpartError("two_sided of a material that is made of others, or of glass")
    return shader


def _look(material: TwoSided, name: str, writing: GltfWriter) -> Look:
    if material.back not in (None, material.base):
        raise UnwritableError("another material behind than in front")
    look = writing.look(material.base)
    look.both_sides = True
    return look


def _to_povray(material: TwoSided, writing: PovWriter) -> PovLook:
    look = writing.look(material.base)
    if material.back not in (None, material.base) or look.index is not None or any(look.ambient):
        raise NoCounterpartError("two_sided of two materials, of glass, or with ambient light")
    return replace(look, both_sides=True)


TWO_SIDED = MaterialType(
    description=TwoSided,
    table=None,
    to_mitsuba=_to_mitsuba,
    from_mitsuba={"twosided": _from_mitsuba},
    note=None,
    errors=None,
    to_cycles=_to_cycles,
    to_gltf=Gltf(_look),
    to_pbrt=None,  # both sides of pbrt's materials look alike: `pbrt.surfaces`
    to_povray=_to_povray,
)
