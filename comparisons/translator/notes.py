"""Notes for the reader on materials whose counterpart is not simply Mitsuba's own material."""

import itertools
import math
from functools import singledispatch
from typing import Any

import numpy as np

from comparisons.lights.translate import (
    counts_lights_often,
    drops_light,
    misplaces,
    squares_opacity,
)
from comparisons.materials.translate import has_delta
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.plugins.exact_coat import (
    CELLS,
    accepted,
    fresnel,
    rough_coat,
    smooth_reflectance,
)
from comparisons.textures.translate import TranslationContext
from comparisons.translator.accuracy import accuracy
from reference_rt.integrators import Direct
from reference_rt.materials import (
    Blend,
    Bump,
    GltfPbr,
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
from reference_rt.textures import VertexColours

# ---- the error of Mitsuba's own plastics, measured on its BSDF -----------------------------------


COSINES = (0.2, 0.5, 0.75, 1.0)
"""Cosines of the directions at which `base_error` compares Mitsuba with the exact integral."""


def base_error(eta: float, distribution: str = "", alpha: float = 0.0) -> tuple[float, float]:
    """The relative error of the light that the base of Mitsuba's own plastic scatters: the least
    and the greatest over pairs of directions with COSINES.

    eta: relative index of the coat;  distribution, alpha: of a rough coat, empty for a smooth one.
    For a base that is linear, or white; a darker nonlinear one has a smaller error.
    """
    import drjit as dr

    mi = mitsuba()
    rough = {"distribution": distribution, "alpha": alpha} if distribution else {}
    bsdf = mi.load_dict(
        {
            "type": "roughplastic" if rough else "plastic",
            "int_ior": accepted(eta) if rough else eta,
            "ext_ior": 1.0,
            "diffuse_reflectance": {"type": "rgb", "value": [1.0, 1.0, 1.0]},
            **rough,
        }
    )
    cosines = np.array(COSINES)
    if distribution:
        coat = rough_coat(distribution, alpha, eta)
        reflectance = coat.reflectance
        passing = np.interp(np.sqrt(cosines), np.linspace(0.0, 1.0, CELLS + 1), coat.transmittance)
    else:
        reflectance, passing = smooth_reflectance(eta), 1.0 - fresnel(cosines, eta)
    context = mi.BSDFContext()
    context.component = 1  # the base
    off = []
    for i, o in itertools.combinations_with_replacement(range(len(COSINES)), 2):
        si = dr.zeros(mi.SurfaceInteraction3f)
        si.wi, wo = (mi.Vector3f(math.sqrt(1.0 - COSINES[k] ** 2), 0.0, COSINES[k]) for k in (i, o))
        value = float(np.ravel(np.array(bsdf.eval(context, si, wo)))[0])
        exact = passing[i] * passing[o] * COSINES[o] / (math.pi * eta * eta * (1.0 - reflectance))
        if exact > 0.0:  # else all light is mirrored, in Mitsuba too
            off.append(value / float(exact) - 1.0)
    return min(off), max(off)


# ---- notes ---------------------------------------------------------------------------------------


def notes_of(scene: Scene) -> list[str]:
    """The notes on a scene's materials, each text once."""
    context = TranslationContext.of(scene)
    found = [note_of(material, context) for material in scene.materials.values()]
    for name in scene.materials:
        off = accuracy(scene, name)
        if off > 0.0:
            found.append(
                f"'{name}': a relative error of {off:.2g} of its light is allowed for (tables, "
                "float32: comparisons.translator.accuracy)"
            )
    found += notes_of_integrator(scene)
    return list(dict.fromkeys(note for note in found if note))


def notes_of_integrator(scene: Scene) -> list[str]:
    """The notes on errors of Mitsuba's integrators."""
    found = (
        *(note_of_samples(scene), note_of_masks(scene), note_of_passing(scene)),
        note_of_hiding(scene),
    )
    return [note for note in found if note]


def note_of_passing(scene: Scene) -> str:
    """The note on Mitsuba's error that `drops_light` describes; empty without it."""
    if not drops_light(scene):
        return ""
    return (
        "without an environment Mitsuba's path tracer drops the light of lamps that let light pass "
        "straight through: its scene has a black environment"
    )


def note_of_masks(scene: Scene) -> str:
    """The note on Mitsuba's error that `squares_opacity` describes; empty without it."""
    if not squares_opacity(scene):
        return ""
    return (
        "Mitsuba's path tracer multiplies samples of lights by the opacity of a mask twice; our "
        "own, which runs in Mitsuba, takes its place"
    )


def note_of_hiding(scene: Scene) -> str:
    """The note on Mitsuba's error that `misplaces` describes; empty without it."""
    if not misplaces(scene):
        return ""
    return (
        "Mitsuba misplaces what lies behind hidden lamps unless it is a mesh; our own integrator, "
        "which runs in Mitsuba, takes the place of its own"
    )


def note_of_samples(scene: Scene) -> str:
    """The note on Mitsuba's error that `counts_lights_often` describes; empty without it."""
    if not counts_lights_often(scene):
        return ""
    assert isinstance(scene.integrator, Direct)
    return (
        "Mitsuba's direct illumination adds up its samples of lights without extent, which it "
        f"should average: with {scene.integrator.light_samples} of them these lights are as many "
        "times too bright; compared with one sample, for which it is right"
    )


@singledispatch
def note_of(material: Any, context: TranslationContext) -> str:
    """The note on a material; empty if Mitsuba's own material is its exact counterpart."""
    return ""


@note_of.register(RoughConductor)
@note_of.register(RoughDielectric)
def _(material: RoughConductor | RoughDielectric, context: TranslationContext) -> str:
    if material.distribution == "ggx":
        return ""
    return (
        "Mitsuba's masking function of Beckmann microfacets, an approximation up to 0.31 % off for "
        "each of the two directions, is replaced by the exact one"
    )


@note_of.register(Plastic)
def _(material: Plastic, context: TranslationContext) -> str:
    eta = material.interior_ior / material.exterior_ior
    return (
        f"Mitsuba's fit of a coat's internal reflectance, which makes the base {_off(eta)} at a "
        f"relative index of {eta:.4g}, is replaced by the integral{_of_vertices(material, context)}"
    )


@note_of.register(RoughPlastic)
def _(material: RoughPlastic, context: TranslationContext) -> str:
    eta = material.interior_ior / material.exterior_ior
    alpha = max(material.alpha, MIN_ALPHA)
    return (
        "Mitsuba's tables of a rough coat's transmittance and internal reflectance, which make the "
        f"base {_off(eta, material.distribution, alpha)} at alpha {alpha:g} "
        f"({material.distribution}) and a relative index of {eta:.4g}, are replaced by finer ones"
        f"{_of_vertices(material, context)}"
    )


def _of_vertices(material: Plastic | RoughPlastic, context: TranslationContext) -> str:
    """What else a note on a plastic says if it has colours of vertices."""
    names = (material.reflectance, material.specular)
    textures = [context.textures[name] for name in names if isinstance(name, str)]
    if not any(isinstance(texture, VertexColours) for texture in textures):
        return ""
    return "; Mitsuba's own refuses colours of vertices, which our plugin looks up in its place"


def _off(eta: float, distribution: str = "", alpha: float = 0.0) -> str:
    """The error of the base of Mitsuba's own plastic, in words."""
    low, high = (100.0 * off for off in base_error(eta, distribution, alpha))
    if low < 0.0 < high:
        return f"{-low:.2f} % darker to {high:.2f} % brighter"
    ends = sorted({f"{abs(low):.2f}", f"{abs(high):.2f}"}, key=float)
    return f"{' to '.join(ends)} % {'darker' if low < 0.0 else 'brighter'}"


@note_of.register(Phong)
@note_of.register(GltfPbr)
def _(material: Phong | GltfPbr, context: TranslationContext) -> str:
    name = "Phong" if isinstance(material, Phong) else "glTF"
    return f"Mitsuba has no {name} material: our plugin is used instead"


@note_of.register(Blend)
def _(material: Blend, context: TranslationContext) -> str:
    if not has_delta(material, context):
        return ""
    return (
        "Mitsuba's blend is wrong if one of the two is a perfect mirror: with the weight w it "
        "reflects (w + (1 - w) f) / (w + (1 - w) p) of its light, where f is the other's BSDF "
        "times cosine in the mirrored direction, and p its pdf there; our plugin is used instead"
    )


@note_of.register(Mask)
def _(material: Mask, context: TranslationContext) -> str:
    return "shadow rays treat masks as opaque, in both renderers"


@note_of.register(Bump)
@note_of.register(NormalMap)
def _(material: Bump | NormalMap, context: TranslationContext) -> str:
    if isinstance(material, Bump):
        return (
            "Mitsuba's bump maps are wrong over anisotropic materials and by rotated images that "
            "are not square, and not a number where they are flat and u runs along the z axis: our "
            "plugin is used instead"
        )
    if material.flip_invalid_normals and material.use_shadowing_function:
        return ""
    return (
        "Mitsuba's bump and normal maps run with flip_invalid_normals and use_shadowing_function "
        "as the scene has them, not with both on as by default"
    )
