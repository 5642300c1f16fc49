"""A scene of numbers, its noise, and faults to plant in it: for the tests of the statistics."""

import numpy as np

from comparisons.statistics import Margins, compare

MARGINS = Margins()
NONE = Margins(0.0, 0.0, 0.0, 0.0)
HEIGHT, WIDTH = 48, 64
LAMP = (slice(8, 14), slice(20, 44))
STILL = np.zeros((HEIGHT, WIDTH, 1), bool)
STILL[:6] = STILL[LAMP] = True


def scene():
    """A black background, a lamp that is seen directly, and surfaces; (48, 64, 3)."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH] / HEIGHT
    shade = 0.4 + 0.2 * np.sin(5.0 * x) * np.cos(7.0 * y)
    mean = shade[..., None] * np.array([1.0, 0.8, 0.3])
    mean[(x - 0.6) ** 2 + (y - 0.65) ** 2 < 0.05] *= 2.0
    mean[:6] = 0.0
    mean[LAMP] = 5.0
    return mean


def replicates(rng, mean, count=16, noise=0.1):
    """Of `noise` times the mean, skewed; background and lamp have none."""
    shape = noise**-2
    noisy = mean * rng.gamma(shape, 1.0 / shape, (count, *mean.shape))
    return np.where(STILL, mean, noisy)


def judged(changed, seed=0, count=16, noise=0.1, **options):
    rng = np.random.default_rng(seed)
    candidate = replicates(rng, changed, count, noise)
    return compare(candidate, replicates(rng, scene(), 16, noise), **options)


def patched(where, factor):
    changed = scene()
    changed[where] *= factor
    return changed


def shifted():
    return 0.5 * (scene() + np.roll(scene(), 1, axis=1))


TILE = (slice(16, 32), slice(32, 48))
FACE = (slice(20, 44), slice(10, 22))
FAULTS = {
    "gain": (np.where(STILL, scene(), scene() * 1.01), "the image mean differs"),
    "small gain": (np.where(STILL, scene(), scene() * 1.008), "the image mean differs"),
    "one channel": (
        np.where(STILL, scene(), scene() * [1.0, 1.01, 1.0]),
        "image mean differs: G +",
    ),
    "one tile": (patched(TILE, 1.06), "1 of 12 tiles differ; the worst, at x, y = (32, 16)"),
    "tile that keeps the mean": (
        patched(TILE, 1.05) + patched((TILE[0], slice(48, 64)), 0.95) - scene(),
        "2 of 12 tiles differ, though not the image mean; the worst, at x, y = (",
    ),
    "half a pixel": (shifted(), "tiles differ"),
    "one face": (patched(FACE, 0.94), "image mean differs"),
    "firefly tile": (patched(TILE, 20.0), "image mean differs"),
    "black row": (patched(30, 0.0), "image mean differs"),
    "one pixel": (patched((30, 30), 2.0), "1 of 3072 pixels differ, though not a whole tile"),
    "lamp": (patched(LAMP, 1.001), "144 of 3072 pixels differ"),
    "hue": (scene()[..., [0, 2, 1]], "the image mean differs"),
}
