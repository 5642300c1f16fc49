"""What smooth and rough plastics have in common: a base below a coat, of which Mitsuba's own tables
and fits are corrected by our plugin `exact_coat`; and how far these are off."""

import itertools
import math
from typing import Any

import numpy as np

from comparisons.geometry.frame import UNIT_ROUNDOFF
from comparisons.materials.glass import indices, relative_index
from comparisons.materials.microfacets import gltf_alpha
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.context import TranslationContext, UntranslatableError, rgb
from comparisons.mitsuba.plugin_table import FLAG, PluginTable, Row
from comparisons.mitsuba.plugins.exact_coat import (
    CELLS,
    COLOURS,
    SUBSTITUTE,
    accepted,
    fresnel,
    rough_coat,
    smooth_reflectance,
)
from comparisons.renderers.vocabulary import GltfWriter, Look, of_index
from comparisons.textures.kinds import COLOUR_OR_TEXTURE
from reference_rt.textures import VertexColours

COAT = (
    Row("reflectance", "diffuse_reflectance", COLOUR_OR_TEXTURE, 0.5),
    Row("specular", "specular_reflectance", COLOUR_OR_TEXTURE, 1.0),
    Row("nonlinear", "nonlinear", FLAG, False),
    *indices("polypropylene"),
)


def write_coated(
    table: PluginTable, material: Any, context: TranslationContext, rough: dict[str, Any]
) -> dict[str, Any]:
    """Mitsuba's own material, wrapped in `exact_coat`, which corrects its tables.  table: has COAT;
    rough: the other values of its dictionary."""
    nested = table.write(material, context)
    base, specular = nested["diffuse_reflectance"], nested["specular_reflectance"]
    of_vertices = [part["type"] == "mesh_attribute" for part in (base, specular)]
    if any(of_vertices) and context.native:
        # Mitsuba's own need the mean of their colours, which it lacks for those of vertices.
        raise UntranslatableError(f"{type(material).__name__} with vertex colours", "material")
    eta = material.interior_ior / material.exterior_ior
    if rough and eta == 1.0:
        nested |= {"int_ior": accepted(eta), "ext_ior": 1.0}
    if context.native:
        return nested
    if rough:
        nested["sample_visible"] = rough["distribution"] == "ggx"
    exact = {"type": "exact_coat", "reflectance": base, "nonlinear": material.nonlinear, "eta": eta}
    for name, replaced in zip(COLOURS, of_vertices, strict=True):
        if replaced:
            nested[name] = rgb((SUBSTITUTE,) * 3)
    if of_vertices[1]:
        exact["specular"] = specular
    return {**exact, "nested": nested, **rough}


def look_of_coat(material: Any, name: str, writing: GltfWriter) -> Look:
    more = of_index(relative_index(material))
    alpha = gltf_alpha(getattr(material, "alpha", 0.0))
    return Look(material.reflectance, (1, 1, 1), 0.0, alpha, True, extensions=more)


PASSED = 4.0 * UNIT_ROUNDOFF
"""Absolute error of light that passes a surface, of the brightest such light: where F is nearly 1,
1 - F keeps the rounding of F, some 4 u (measured: 15 % of a value of 5e-8)."""

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


def of_vertices(material: Any, context: TranslationContext) -> str:
    """What else a note on a plastic says if it has colours of vertices."""
    names = (material.reflectance, material.specular)
    textures = [context.textures[name] for name in names if isinstance(name, str)]
    if not any(isinstance(texture, VertexColours) for texture in textures):
        return ""
    return "; Mitsuba's own refuses colours of vertices, which our plugin looks up in its place"


def base_off(eta: float, distribution: str = "", alpha: float = 0.0) -> str:
    """The error of the base of Mitsuba's own plastic, in words."""
    low, high = (100.0 * off for off in base_error(eta, distribution, alpha))
    if low < 0.0 < high:
        return f"{-low:.2f} % darker to {high:.2f} % brighter"
    ends = sorted({f"{abs(low):.2f}", f"{abs(high):.2f}"}, key=float)
    return f"{' to '.join(ends)} % {'darker' if low < 0.0 else 'brighter'}"
