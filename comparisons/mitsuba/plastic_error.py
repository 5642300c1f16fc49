"""The error of Mitsuba's own plastic materials, measured on its BSDF."""

import itertools
import math

import numpy as np

from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.plugins.exact_coat import (
    CELLS,
    accepted,
    fresnel,
    rough_coat,
    smooth_reflectance,
)

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
