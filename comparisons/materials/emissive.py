"""Lamps' materials: the BSDF alone, as the emission is the shape's emitter in other renderers."""

from typing import Any

from comparisons.materials.material import Gltf, MaterialType
from comparisons.mitsuba.context import TranslationContext, rgb
from comparisons.renderers import NoCounterpartError
from comparisons.renderers.vocabulary import (
    CyclesWriter,
    Data,
    GltfWriter,
    Look,
    front,
    matte,
    plain_rgb,
)
from comparisons.textures.texture import Nested
from reference_rt.materials import Emissive


def _to_mitsuba(material: Emissive, context: TranslationContext) -> dict[str, Any] | Nested:
    """See `translate.parts_of` for the emitter."""
    if material.base is None:
        return {"type": "diffuse", "reflectance": rgb((0.0, 0.0, 0.0))}
    return Nested(material.base)


def _to_cycles(material: Emissive, writing: CyclesWriter) -> Data:
    if isinstance(material.radiance, str):
        raise NoCounterpartError("a textured lamp")
    emission = front({"type": "emission", "radiance": plain_rgb(material.radiance)})
    if material.base is None:
        return emission
    return {"type": "sum", "of": [emission, writing.shader(material.base)]}


def _look(material: Emissive, name: str, writing: GltfWriter) -> Look:
    writing.note("few renderers of glTF light others with surfaces that shine")
    look = matte((0.0, 0.0, 0.0)) if material.base is None else writing.look(material.base)
    look.radiance = material.radiance
    return look


EMISSIVE = MaterialType(
    description=Emissive,
    table=None,
    to_mitsuba=_to_mitsuba,
    from_mitsuba={},  # `lights.area` has a shape's emitter
    note=None,
    errors=None,
    to_cycles=_to_cycles,
    to_gltf=Gltf(_look),
    to_pbrt=None,  # pbrt has a shape's light, too: `pbrt.surfaces`
)
