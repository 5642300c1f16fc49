"""What a reader should know of materials whose twins are not Mitsuba's own alone."""

from functools import singledispatch
from typing import Any

from comparisons.mitsuba.accuracy import accuracy
from comparisons.mitsuba.plastic_error import base_error
from comparisons.mitsuba.translate.textures import Surroundings
from comparisons.mitsuba.translate.wrappers import has_delta
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
from reference_rt.materials.microfacet.ggx_and_smith import MIN_ALPHA
from reference_rt.rendering.scene import Scene


def notes_of(scene: Scene) -> list[str]:
    """One for each kind of material that is used so."""
    around = Surroundings.of(scene)
    found = [note_of(material, around) for material in scene.materials.values()]
    for name in scene.materials:
        off = accuracy(scene, name)
        if off > 0.0:
            found.append(
                f"'{name}': {off:.2g} of its light is allowed for, see comparisons.mitsuba.accuracy"
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
        "Mitsuba's masking of Beckmann microfacets, an approximation up to 0.31 % off for each of "
        "the two directions, is replaced by the exact one"
    )


@note_of.register(Plastic)
def _(material: Plastic, around: Surroundings) -> str:
    eta = material.interior_ior / material.exterior_ior
    return (
        f"Mitsuba's fit of what a coat mirrors from within, which makes its base {_off(eta)} at a "
        f"relative index of {eta:.4g}, is replaced by the integral"
    )


@note_of.register(RoughPlastic)
def _(material: RoughPlastic, around: Surroundings) -> str:
    eta = material.interior_ior / material.exterior_ior
    alpha = max(material.alpha, MIN_ALPHA)
    return (
        "Mitsuba's tables of what a rough coat lets pass and mirrors from within, which make its "
        f"base {_off(eta, material.distribution, alpha)} at alpha {alpha:g} "
        f"({material.distribution}) and a relative index of {eta:.4g}, are replaced by finer ones"
    )


def _off(eta: float, distribution: str = "", alpha: float = 0.0) -> str:
    """How far the base of Mitsuba's own plastic is from the exact law, in words."""
    low, high = (100.0 * off for off in base_error(eta, distribution, alpha))
    if low < 0.0 < high:
        return f"{-low:.2f} % darker to {high:.2f} % brighter"
    ends = sorted({f"{abs(low):.2f}", f"{abs(high):.2f}"}, key=float)
    return f"{' to '.join(ends)} % {'darker' if low < 0.0 else 'brighter'}"


@note_of.register(Phong)
def _(material: Phong, around: Surroundings) -> str:
    return "Mitsuba has no Phong: a material written for it stands in"


@note_of.register(Blend)
def _(material: Blend, around: Surroundings) -> str:
    if not has_delta(material, around):
        return ""
    return (
        "Mitsuba's blend is wrong where one of the two mirrors perfectly: a mirror with a share w "
        "has (w + (1 - w) f) / (w + (1 - w) p) of its light, with f what the other one scatters "
        "into the mirrored direction and p its density there; one written for it stands in"
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
