"""A sphere from afar, as a contestant of F1 sees it."""

import numpy as np

from comparisons.experiments.stability.far.spheres import answers, in_mitsuba
from comparisons.experiments.stability.harness.outcomes import MITSUBA, FloatArray
from comparisons.experiments.stability.harness.rays import Rays
from comparisons.experiments.stability.harness.shots import Shot, pixel_grid
from comparisons.geometry.frame import round32
from comparisons.mitsuba.backend import scalar
from reference_rt.shapes import Sphere

PIXELS = 192
VIEW = (0.36, 0.48, 0.8)


def _heights(contestant: str, x: float) -> FloatArray:
    """How far in front of the centre's plane the sphere is met, in radii; NaN for misses."""
    view = np.array(VIEW)
    right = np.cross([0.0, 0.0, 1.0], view)
    right /= np.linalg.norm(right)
    up = np.cross(view, right)
    u, v = pixel_grid(PIXELS, 1.2)
    target = u[:, None] * right + v[:, None] * up
    o = np.broadcast_to(view * x, target.shape).copy()
    d = target / x - view
    if contestant == MITSUBA:
        with scalar():
            t = in_mitsuba(Sphere(), round32(o), round32(d))
    else:
        n = len(o)
        columns = {"center": np.zeros((n, 3)), "radius": np.ones(n)}
        t = answers(Rays("spheres", columns, np.ones(n), o, d))[contestant]
    return np.where(np.isfinite(t), x - t, np.nan)


def shoot(contestant: str, x: float) -> Shot:
    """Brighter is nearer; grey is a miss, red is off the sphere by more than a tenth."""
    z = _heights(contestant, x)
    level = np.clip(0.55 + 0.4 * z, 0.0, 1.0)
    pixels = np.repeat((255.0 * np.nan_to_num(level))[:, None], 3, axis=1)
    pixels[np.isnan(z)] = 40.0
    u, v = pixel_grid(PIXELS, 1.2)
    exact = np.sqrt(np.maximum(1.0 - (u**2 + v**2), 0.0))
    pixels[np.abs(z - exact) > 0.1] = (200.0, 30.0, 30.0)
    caption = (
        f"A sphere from {x:g} radii away: brighter is nearer, red is off by more than a tenth of"
        " the radius, dark is a miss."
    )
    return Shot(pixels.reshape(PIXELS, PIXELS, 3).astype(np.uint8), caption)
