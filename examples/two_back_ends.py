"""Are two back ends the same renderer?  A disk lamp over a floor, in float64, and with sums of
float16; both have the same random numbers, so that small errors are seen.

`python examples/two_back_ends.py float32` adds in float32, which agrees.
"""

import sys

import numpy as np

import comparisons


def render(seed, number, samples=1024):
    """Direct light by points of a lamp of radius 1 at height 1; the sum has the type `number`."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[-2:2:24j, -2:2:24j]
    total = np.zeros((24, 24, 3), number)
    for _ in range(samples):
        radius, angle = np.sqrt(rng.random(x.shape)), 2.0 * np.pi * rng.random(x.shape)
        squared = (x - radius * np.cos(angle)) ** 2 + (y - radius * np.sin(angle)) ** 2 + 1.0
        total += (np.array([1.0, 0.8, 0.5]) / squared[..., None] ** 2).astype(number)
    return total.astype(float) / samples


number = np.dtype(sys.argv[1] if len(sys.argv) > 1 else "float16")
a, b = (np.stack([render(seed, n) for seed in range(8)]) for n in (np.float64, number))
case = comparisons.gate_pair(a, b, spp=1024)
print(case.verdict, "-", case.notes[0])
print(case.reason if case.cause is None else f"{case.cause.name}: {case.cause.evidence}")
