"""Is a renderer's gradient right?  A floor under a lamp, in NumPy, and its derivative by the lamp's
height: once right, and once without the change of the distance, as where it is "detached".

    python examples/gradient.py

The renderer's own pictures say which is right: no other renderer, and no scene, is needed.
"""

import math

import numpy as np

from comparisons import gate_derivative

SIZE, SPP, HEIGHT = 16, 64, 1.5
ALBEDO, INTENSITY = 0.7, np.array([8.0, 6.0, 3.0])


def distances(height: float, seed: int) -> np.ndarray:
    """From the lamp to random points of each pixel of the floor, (SPP, SIZE, SIZE)."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[0:SIZE, 0:SIZE]
    across, along = (4.0 * (v + rng.random((SPP, SIZE, SIZE))) / SIZE - 2.0 for v in (x, y))
    return np.sqrt(across**2 + along**2 + height**2)


def picture(height: float, seed: int) -> np.ndarray:
    """Lambert's law: albedo / pi, intensity / r^2, and the cosine, height / r."""
    r = distances(height, seed)
    light = (ALBEDO / math.pi * height / r**3).mean(axis=0)
    return light[..., None] * INTENSITY


def derivative(height: float, seed: int, *, detached: bool = False) -> np.ndarray:
    """By hand, as a differentiable renderer has it."""
    r = distances(height, seed)
    change = 1.0 / r**3 - (0.0 if detached else 3.0 * height**2 / r**5)
    return (ALBEDO / math.pi * change).mean(axis=0)[..., None] * INTENSITY


for detached in (False, True):
    found = [derivative(HEIGHT, seed, detached=detached) for seed in range(100, 116)]
    case = gate_derivative(np.stack(found), primal=picture, at=HEIGHT)
    what = "without the distance" if detached else "whole"
    print(f"the derivative {what}: {case.verdict}: {case.reason.partition(';')[0]}")
