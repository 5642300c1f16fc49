"""Check a tracer of your own, ray by ray: here a sphere by the textbook's quadratic equation."""

import numpy as np

from reference_rt import Scene, Sphere

center, radius = np.array([1e5, 0.0, 0.0]), 1.0


def my_sphere(o, d):
    """t of the first hit of rays (n, 3), inf for a miss."""
    a, b = (d * d).sum(1), 2.0 * (d * (o - center)).sum(1)
    c = ((o - center) ** 2).sum(1) - radius**2
    root = b * b - 4.0 * a * c
    with np.errstate(invalid="ignore"):
        t = (-b - np.sqrt(root)) / (2.0 * a)
    return np.where(t > 0.0, t, np.inf)  # NaN, where there is no root, becomes inf


rng = np.random.default_rng(0)
targets = center + rng.normal(size=(100_000, 3)) * 0.5
origins = np.zeros_like(targets)
exact = Scene(shapes=(Sphere(center=center, radius=radius),)).intersect(origins, targets).t
mine = my_sphere(origins, targets)

wrong = np.isfinite(mine) != np.isfinite(exact)
both = np.isfinite(mine) & np.isfinite(exact)
error = np.abs(mine[both] - exact[both]) * 1e5  # t is in units of 1e5 radii
print(f"{wrong.sum()} of {len(wrong)} rays hit one sphere and miss the other")
print(f"the points of the others are up to {error.max():.1e} radii apart")
