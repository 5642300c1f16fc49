"""The radiance of a dictionary's scene along rays, by our reading of it and by Mitsuba itself."""

from typing import Any

import numpy as np

from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.scene import for_rays
from comparisons.translator.reading import read_dict
from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.scene import Scene

ROBUST = {"type": "scene", "embree_use_robust_intersections": True}


def both_scenes(scene: dict[str, Any]) -> tuple[Scene, Any]:
    """Our reading, and Mitsuba's own scene."""
    whole = {**ROBUST, **scene}
    return read_dict(whole, Scene), mitsuba().load_dict(whole, optimize=False)


def rays_at(target: tuple[float, float, float], radius: float, n: int, seed: int) -> Any:
    """n rays from a sphere of `radius` around the target into its middle; float32 values."""
    rng = np.random.default_rng(seed)
    o = rng.normal(size=(n, 3))
    o *= 4.0 * radius / np.linalg.norm(o, axis=1, keepdims=True)
    to = rng.uniform(-0.6, 0.6, (n, 3)) * radius
    d = to - o
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    o = o + np.array(target)
    return o.astype(np.float32).astype(np.float64), d.astype(np.float32).astype(np.float64)


def hits_of(mi_scene: Any, o: FloatArray, d: FloatArray) -> tuple[Any, ...]:
    """t (inf for a miss), geometric normal, shading normal and uv of Mitsuba's first hits."""
    mi = mitsuba()

    def hit(origin: Any, direction: Any) -> tuple[Any, ...]:
        si = mi_scene.ray_intersect(mi.Ray3f(mi.Point3f(origin), direction))
        return si.t, si.n, si.sh_frame.n, si.uv

    return for_rays(hit, o, d)


def theirs_along(
    mi_scene: Any, o: FloatArray, d: FloatArray, repeats: int, seed: int = 0
) -> tuple[FloatArray, FloatArray]:
    """Mitsuba's radiance along rays (n, 3), mean and its standard error; needs a fast variant."""
    mi = mitsuba()
    n = len(o)
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(seed, n * repeats)
    rays = mi.RayDifferential3f(
        mi.Point3f(np.repeat(o, repeats, axis=0).T.astype(np.float32)),
        mi.Vector3f(np.repeat(d, repeats, axis=0).T.astype(np.float32)),
    )
    found = mi_scene.integrator().sample(mi_scene, sampler, rays)[0]
    values = np.array(found, np.float64).T.reshape(n, repeats, 3)
    return values.mean(axis=1), values.std(axis=1, ddof=1) / np.sqrt(repeats)


def deviations(
    scene: dict[str, Any], o: FloatArray, d: FloatArray, samples: int, bound: float = 0.0
) -> FloatArray:
    """How far the two radiances are apart, beyond the relative `bound`, in standard errors of the
    difference (n, 3).

    The error is at least 1e-3 of the light: below it an error is that of float32 and of estimated
    deviations.
    """
    ours, theirs = both_scenes(scene)
    a = ours.radiance(o, d, spp=samples)
    b, error = theirs_along(theirs, o, d, samples)
    size = np.maximum(np.abs(a.mean), np.abs(b))
    spread = np.sqrt(a.standard_error**2 + error**2 + (1e-3 * size) ** 2 + 1e-12)
    return np.sign(a.mean - b) * np.maximum(np.abs(a.mean - b) - bound * size, 0.0) / spread
