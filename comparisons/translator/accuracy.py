"""Relative errors of materials that a comparison must allow for: of our tables, and of Mitsuba's
formulas in float32."""

import functools
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.geometry.frame import UNIT_ROUNDOFF
from comparisons.materials.translate import translate_material
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.scene import for_rays
from comparisons.textures.translate import TranslationContext
from reference_rt.core.arrays import FloatArray
from reference_rt.core.vec3 import Vec3
from reference_rt.materials import (
    Bump,
    Emissive,
    Material,
    NormalMap,
    Plastic,
    Principled,
    PrincipledThin,
    RoughPlastic,
    Wrapper,
)
from reference_rt.rendering.scene import Scene
from reference_rt.textures import NO_TEXTURES, At

PAIRS = 256
"""Pairs of directions at which tables are compared with the integrals that they tabulate."""

MARGIN = 1.5
"""Factor on the largest error found, for directions in between."""

MOST = 5e-3
"""Largest error that is allowed for: a table with a larger one is wrong, not coarse."""


def accuracy(scene: Scene, name: str | None) -> float:
    """The relative error of the light that material `name` scatters, by our tables or in Mitsuba; 0
    for exact materials, and for None."""
    return max(map(_relative, _leaves(scene, name)), default=0.0)


def _relative(material: Material) -> float:
    if isinstance(material, RoughPlastic):
        # Only the base is tabulated.  White maximises interreflection between base and coat.
        white = {"reflectance": (1.0, 1.0, 1.0), "specular": (0.0, 0.0, 0.0)}
        return min(MOST, MARGIN * table_error(material.model_copy(update=white)))
    if isinstance(material, Principled | PrincipledThin):
        coat = 0.0
        if isinstance(material, Principled) and material.clearcoat != 0.0:
            coat = min(MOST, clearcoat_error(material))
        return coat + tint_error(material) + min(MOST, rest_error(material))
    return 0.0


def coat_error(scene: Scene, name: str | None) -> float:
    """The absolute error of light that passes a coat, as a fraction of the brightest such light; 0
    for materials without a coat, and for None."""
    return max(map(_absolute, _leaves(scene, name)), default=0.0)


def is_tilted(scene: Scene, name: str | None) -> bool:
    """Whether material `name` has a bump or normal map on the outside, under wrappers at most."""
    if name is None:
        return False
    material = scene.materials[name]
    if isinstance(material, Bump | NormalMap):
        return True
    fields = material.bases if isinstance(material, Wrapper) else ("base",)
    return any(is_tilted(scene, getattr(material, field, None)) for field in fields)


def _absolute(material: Material) -> float:
    if isinstance(material, RoughPlastic):
        eta = material.interior_ior / material.exterior_ior
        return PASSED if 1.0 <= eta <= 3.0 and material.alpha <= 1.0 else COARSE
    return PASSED if isinstance(material, Plastic) else 0.0


def _leaves(scene: Scene, name: str | None) -> Iterator[Material]:
    """The materials that material `name` is made of."""
    if name is None:
        return
    material: Material = scene.materials[name]
    if isinstance(material, Wrapper | Emissive):
        fields = material.bases if isinstance(material, Wrapper) else ("base",)
        for field in fields:
            yield from _leaves(scene, getattr(material, field))
    else:
        yield material


def clearcoat_error(material: Principled) -> float:
    """The relative error of Mitsuba's clear coat: 1 + (alpha² - 1) cos² is off by some 4 u in
    float32, and its least value is alpha²."""
    gloss = 1.0 if isinstance(material.clearcoat_gloss, str) else material.clearcoat_gloss
    alpha = 0.1 + (0.001 - 0.1) * gloss
    return 4.0 * UNIT_ROUNDOFF / alpha**2


PASSED = 4.0 * UNIT_ROUNDOFF
"""Absolute error of light that passes a surface, of the brightest such light: where F is nearly 1,
1 - F keeps the rounding of F, some 4 u (measured: 15 % of a value of 5e-8)."""

COARSE = 0.03
"""The same of rough coats with an index below 1 or above 3, or with alpha above 1.  Next to the
critical angle our tables are up to 1e-2 off for each of two directions (measured: 2.4e-2; see
`reference_rt.materials.bsdfs.rough_plastic`)."""

FAINT = 1e-5
"""Least light of a pair of directions that is compared, as a fraction of the brightest pair's: some
forty times PASSED."""


def rest_error(material: Principled | PrincipledThin) -> float:
    """The relative error of 1 - x in float32, the share of a lobe next to one with the share x."""
    shares = (getattr(material, name, 0.0) for name in ("spec_trans", "metallic"))
    numbers = [x for x in shares if not isinstance(x, str) and x < 1.0]
    return max((UNIT_ROUNDOFF * x / (1.0 - x) for x in numbers), default=0.0)


OURS, THEIRS = (0.2126, 0.7152, 0.0722), (0.212671, 0.715160, 0.072169)
"""Luminance of linear sRGB: rounded as in Rec. 709, and Mitsuba's `mi.luminance`."""


def tint_error(material: Principled | PrincipledThin) -> float:
    """The relative difference of a base colour's luminance in the two renderers: tinted highlights
    and sheen are the base colour over its luminance."""
    if not any(getattr(material, name) for name in ("spec_tint", "sheen_tint")):
        return 0.0
    colours = np.eye(3) if isinstance(material.base_colour, str) else [material.base_colour]
    ours, theirs = (np.array(colours) @ weights for weights in (OURS, THEIRS))
    lit = ours > 0.0
    return float(np.abs(theirs[lit] / ours[lit] - 1.0).max(initial=0.0))


@functools.lru_cache(maxsize=64)
def table_error(material: RoughPlastic) -> float:
    """The largest relative difference of our rough plastic from its counterpart with finer
    tables."""
    ours, theirs = both_sides(material, *directions(PAIRS, seed=0))
    # Beyond the critical angle of a coat with an index below 1 there is no light but rounding.
    passes = theirs > FAINT * theirs.max()
    return float(np.abs(ours[passes] / theirs[passes] - 1.0).max(initial=0.0))


def directions(n: int, seed: int, both: bool = False) -> tuple[FloatArray, FloatArray]:
    """n pairs of unit vectors (n, 3), float32 values; z > 0 unless `both`."""
    rng = np.random.default_rng(seed)
    v = rng.normal(size=(2, n, 3))
    v /= np.linalg.norm(v, axis=-1, keepdims=True)
    if not both:
        v[..., 2] = np.maximum(np.abs(v[..., 2]), 1e-3)
    v = v.astype(np.float32).astype(np.float64)
    return v[0], v[1]


def both_sides(
    material: Material, wo: FloatArray, wi: FloatArray, theirs: bool = True
) -> tuple[FloatArray, FloatArray]:
    """f cos (n, 3) for local directions (n, 3), by our kernels and, if `theirs`, by the
    counterpart; without textures."""
    import drjit as dr

    kernels = import_module(type(material).__module__)
    table = material.tabulate(NO_TEXTURES)
    at = At(None, 0.0, 0.0, Vec3(-1.0, -1.0, -1.0))
    ours = [
        tuple(kernels.eval_pdf(table, 0, at, Vec3(*o), Vec3(*i)).value)
        for o, i in zip(wo.tolist(), wi.tolist(), strict=True)
    ]
    if not theirs:
        return np.array(ours), np.zeros(0)
    mi = mitsuba()
    bsdf = mi.load_dict(translate_material(material, TranslationContext({}, {}, Path())))
    context = mi.BSDFContext()

    def value(o: Any, i: Any) -> tuple[Any, ...]:
        si = dr.zeros(mi.SurfaceInteraction3f)
        si.t, si.wi = 1.0, o
        return (bsdf.eval(context, si, i),)

    return np.array(ours), for_rays(value, wo, wi)[0]
