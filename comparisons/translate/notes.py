"""What a reader should know of materials whose twins are not Mitsuba's own alone."""

from functools import singledispatch
from typing import Any

from comparisons.accuracy import accuracy
from comparisons.translate.textures import Surroundings
from comparisons.translate.wrappers import has_delta
from reference_rt.materials import (
    Blend,
    Bump,
    Mask,
    NormalMap,
    Phong,
    Plastic,
    RoughConductor,
    RoughDielectric,
    RoughPlastic,
)
from reference_rt.scene import Scene


def notes_of(scene: Scene) -> list[str]:
    """One for each kind of material that is used so."""
    around = Surroundings.of(scene)
    found = [note_of(material, around) for material in scene.materials.values()]
    for name in scene.materials:
        off = accuracy(scene, name)
        if off > 0.0:
            found.append(
                f"'{name}': {off:.2g} of its light is allowed for, see comparisons.accuracy"
            )
    return list(dict.fromkeys(note for note in found if note))


@singledispatch
def note_of(material: Any, around: Surroundings) -> str:
    """What to say of a material; nothing where Mitsuba's own stands for it as it is."""
    return ""


@note_of.register(RoughConductor)
@note_of.register(RoughDielectric)
def _(material: RoughConductor | RoughDielectric, around: Surroundings) -> str:
    if material.distribution == "ggx":
        return ""
    return (
        "Mitsuba's masking of Beckmann microfacets, an approximation up to 0.31 % off, is replaced "
        "by the exact one"
    )


@note_of.register(Plastic)
def _(material: Plastic, around: Surroundings) -> str:
    return (
        "Mitsuba's fit of what a coat mirrors from within, which makes its base 0.1 % brighter at "
        "an index of 1.5 and 2.7 % at 2.4, is replaced by the integral"
    )


@note_of.register(RoughPlastic)
def _(material: RoughPlastic, around: Surroundings) -> str:
    return (
        "Mitsuba's tables of what a rough coat lets pass and mirrors from within, the latter about "
        "1 % low, are replaced by finer ones"
    )


@note_of.register(Phong)
def _(material: Phong, around: Surroundings) -> str:
    return "Mitsuba has no Phong: a material written for it stands in"


@note_of.register(Blend)
def _(material: Blend, around: Surroundings) -> str:
    if not has_delta(material, around):
        return ""
    return (
        "Mitsuba's blend is wrong where one of the two mirrors perfectly (it keeps 0.5 / (1 + cos "
        "/ pi) of half a mirror's light over a diffuse half): one written for it stands in"
    )


@note_of.register(Mask)
def _(material: Mask, around: Surroundings) -> str:
    return "shadow rays take masks for opaque, on both sides"


@note_of.register(Bump)
@note_of.register(NormalMap)
def _(material: Bump | NormalMap, around: Surroundings) -> str:
    return (
        "Mitsuba's bump and normal maps are told not to turn normals that face away, nor to darken "
        "by a shadowing term"
    )
