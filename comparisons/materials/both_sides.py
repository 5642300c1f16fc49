"""A material by our kernels and by its counterpart in Mitsuba, pair of directions by pair."""

from importlib import import_module
from typing import Any

import numpy as np

from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.scene import for_rays
from reference_rt.core.arrays import FloatArray
from reference_rt.core.vec3 import Vec3
from reference_rt.materials import Material
from reference_rt.textures import NO_TEXTURES, At


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
    material: Material, wo: FloatArray, wi: FloatArray, counterpart: dict[str, Any] | None
) -> tuple[FloatArray, FloatArray]:
    """f cos (n, 3) for local directions (n, 3), by our kernels and by the counterpart, if there is
    one; without textures."""
    kernels = import_module(type(material).__module__)
    table = material.tabulate(NO_TEXTURES)
    at = At(None, 0.0, 0.0, Vec3(-1.0, -1.0, -1.0))
    ours = [
        tuple(kernels.eval_pdf(table, 0, at, Vec3(*o), Vec3(*i)).value)
        for o, i in zip(wo.tolist(), wi.tolist(), strict=True)
    ]
    if counterpart is None:
        return np.array(ours), np.zeros(0)
    mi = mitsuba()
    import drjit as dr  # after the choice of its LLVM

    bsdf = mi.load_dict(counterpart)
    context = mi.BSDFContext()

    def value(o: Any, i: Any) -> tuple[Any, ...]:
        si = dr.zeros(mi.SurfaceInteraction3f)
        si.t, si.wi = 1.0, o
        return (bsdf.eval(context, si, i),)

    return np.array(ours), for_rays(value, wo, wi)[0]
