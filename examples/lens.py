"""A glass lens, the intersection of two spheres: its light on a screen, and its focal length."""

import numpy as np

from reference_rt import Scene, Sphere

R, THICKNESS, INDEX = 2.0, 0.2, 1.5
shift = R - THICKNESS / 2
lens = Sphere(center=(0, 0, shift), radius=R) & Sphere(center=(0, 0, -shift), radius=R)
scene = Scene(shapes=(lens,))


def bent(d, n, eta):
    """Snell's law for unit directions and normals (n, 3); eta: index before over index behind."""
    cosine = -(d * n).sum(-1, keepdims=True)
    n, cosine = np.where(cosine < 0, -n, n), np.abs(cosine)
    return eta * d + (eta * cosine - np.sqrt(1 - eta**2 * (1 - cosine**2))) * n


heights = np.linspace(0.01, 0.1, 10)
o = np.stack([heights, 0 * heights, 0 * heights - 5], axis=-1)
d = np.broadcast_to([0.0, 0.0, 1.0], o.shape)
for eta in (1 / INDEX, INDEX):  # in, and out again
    hits = scene.intersect(o, d, t_min=1e-9)
    o, d = hits.p, bent(d, hits.n, eta)
focus = o[:, 2] - o[:, 0] * d[:, 2] / d[:, 0]
focal_length = 1 / ((INDEX - 1) * (2 / R - (INDEX - 1) * THICKNESS / (INDEX * R * R)))
back = focal_length * (1 - (INDEX - 1) * THICKNESS / (INDEX * R)) + THICKNESS / 2
print(f"rays near the axis meet at z = {focus[0]:.4f}; by the lensmaker's equation {back:.4f}")
print(f"rays {heights[-1]} off the axis meet at z = {focus[-1]:.4f}: spherical aberration")
