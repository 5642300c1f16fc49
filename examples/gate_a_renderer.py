"""Gate a renderer of your own: ambient occlusion under a white sky, in NumPy.

`python examples/gate_a_renderer.py 0.4` has the wrong cosine, and fails.
"""

import sys

import numpy as np

import comparisons
from reference_rt import Scene

SCENE = """
camera: {type: perspective, eye: [0, 1, 4], target: [0, 0.5, 0], fov: 40}
film: {width: 48, height: 36}
integrator: {type: path, max_depth: 2}
materials: {white: {type: diffuse, reflectance: 0.8}}
shapes:
  - {type: plane, material: white, transform: [{rotate: {axis: [1, 0, 0], degrees: -90}}]}
  - {type: sphere, material: white, center: [0, 0.5, 0], radius: 0.5}
lights: [{type: constant, radiance: 1}]
"""
scene = Scene.parse(SCENE)


def my_renderer(seed, samples=64, power=0.5):
    """Cosine-weighted directions: z is the square root of a random number.  Another power is a
    bug."""
    rng = np.random.default_rng(seed)
    picture = np.zeros((36, 48, 3))
    for _ in range(samples):
        rays = scene.camera_rays(offsets=rng.random((36, 48, 2)) - 0.5)
        hits = scene.intersect(rays.origins, rays.directions)
        hit = np.isfinite(hits.t)
        z, angle = rng.random(hit.shape) ** power, 2.0 * np.pi * rng.random(hit.shape)
        n = hits.n / np.where(hit, 1.0, np.inf)[..., None]
        t = np.cross(n, np.where(np.abs(n[..., :1]) > 0.5, [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]))
        t /= np.maximum(np.linalg.norm(t, axis=-1, keepdims=True), 1e-9)
        around = np.cos(angle)[..., None] * t + np.sin(angle)[..., None] * np.cross(n, t)
        wi = np.sqrt(1.0 - z * z)[..., None] * around + z[..., None] * n
        open_sky = ~scene.occluded(np.where(hit[..., None], hits.p, 0.0) + 1e-9 * n, wi)
        picture += np.where(hit, 0.8 * open_sky, 1.0)[..., None]
    return picture / samples


power = float(sys.argv[1]) if len(sys.argv) > 1 else 0.5
pictures = np.stack([my_renderer(seed, power=power) for seed in range(8)])
case = comparisons.gate(pictures, scene=scene, limit=0.02)
print(case.verdict, "-", case.reason)
