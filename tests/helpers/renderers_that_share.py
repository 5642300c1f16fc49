"""Unbiased renderers whose pixels share random numbers, for the tests of the verdict.

Each is a function (rng, count, side) -> (count, side, side, 3): independent replicates, of which
every one uses a few random numbers for many pixels. `truth` gives their common mean.
"""

from collections.abc import Callable
from functools import cache, partial

import numpy as np
from scipy import ndimage

from comparisons.results.case import FloatArray

Renderer = Callable[[np.random.Generator, int, int], FloatArray]

COLOUR = np.array([1.0, 0.8, 0.3])


@cache
def floor(side: int) -> tuple[FloatArray, FloatArray]:
    """Points (side^2, 3) of a floor seen from above, and their reflectance (side, side, 3)."""
    y, x = (np.mgrid[0:side, 0:side] + 0.5) / side
    checks = 0.5 + 0.4 * ((np.floor(6.0 * x) + np.floor(6.0 * y)) % 2.0)
    points = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    return points, checks[..., None] * COLOUR


def light(points: FloatArray, lamps: FloatArray, clamp: float = 0.0) -> FloatArray:
    """(points, lamps): irradiance from points of a lamp that shines downwards, past a ball."""
    between = lamps[None] - points[:, None]
    squared = (between**2).sum(axis=-1)
    ball = np.array([0.45, 0.55, 0.15]) - points[:, None]
    along = np.clip((ball * between).sum(axis=-1) / squared, 0.0, 1.0)
    hidden = ((along[..., None] * between - ball) ** 2).sum(axis=-1) < 0.15**2
    return np.where(hidden, 0.0, between[..., 2] ** 2 / np.maximum(squared, clamp) ** 2)


def lamp_points(u: FloatArray) -> FloatArray:
    """(n, 2) in the unit square -> (n, 3) on a square lamp."""
    return np.column_stack([0.3 + 0.5 * u[:, 0], 0.2 + 0.5 * u[:, 1], np.full(len(u), 0.7)])


def same_sequence(samples: int, rng: np.random.Generator, count: int, side: int) -> FloatArray:
    """Every pixel aims its shadow rays at the same points of the lamp."""
    points, reflectance = floor(side)
    found = [
        light(points, lamp_points(rng.random((samples, 2)))).mean(axis=1) for _ in range(count)
    ]
    return np.stack(found).reshape(count, side, side, 1) * reflectance


def rotated_sequence(samples: int, rng: np.random.Generator, count: int, side: int) -> FloatArray:
    """The same points of the lamp, moved by an offset of each pixel that never changes (Cranley and
    Patterson's rotation): neighbours look independent."""
    offsets = np.random.default_rng(9).random((side, side))
    _, reflectance = floor(side)
    u = rng.random((count, samples, 1, 1))
    turned = (u + offsets) % 1.0
    return (2.0 * turned).mean(axis=1)[..., None] * reflectance


def photon_map(
    photons: int, radius: float, rng: np.random.Generator, count: int, side: int
) -> FloatArray:
    """Photons that are counted within discs of `radius` pixels around each pixel."""
    _, reflectance = floor(side)
    pad = int(np.ceil(radius)) + 1
    wide = side + 2 * pad
    y, x = np.mgrid[-pad : pad + 1, -pad : pad + 1]
    disc = (x**2 + y**2 <= radius**2).astype(float)
    expected = photons * disc.sum()
    found = []
    for _ in range(count):
        met = rng.poisson(photons, (wide, wide)).astype(float)
        spread = ndimage.convolve(met, disc, mode="constant") if radius > 0 else met
        found.append(spread[pad : pad + side, pad : pad + side, None] / expected * reflectance)
    return np.stack(found)


def point_lights(lights: int, rng: np.random.Generator, count: int, side: int) -> FloatArray:
    """Virtual point lights on the lamp and on two walls, the same for all pixels; clamped."""
    points, reflectance = floor(side)
    found = []
    for _ in range(count):
        u = rng.random((lights, 2))
        where = rng.integers(0, 2, lights)
        lamps = np.stack([-0.02 + 1.04 * where, u[:, 0], 0.02 + 0.6 * u[:, 1]], axis=1)
        found.append(light(points, lamps, clamp=0.01).mean(axis=1))
    return np.stack(found).reshape(count, side, side, 1) * reflectance


def denoised(how: str, width: float, rng: np.random.Generator, count: int, side: int) -> FloatArray:
    """Noise through a filter that preserves edges, such as a denoiser guided by the reflectance."""
    _, reflectance = floor(side)
    noise = 0.5 * rng.standard_normal((count, side, side, 3))
    if how == "box":
        noise = ndimage.uniform_filter(noise, (1, int(width), int(width), 1), mode="reflect")
    else:
        noise = ndimage.gaussian_filter(noise, (0, width, width, 0), mode="reflect")
    return (1.0 + noise) * reflectance


def upsampled(
    factor: int, order: int, rng: np.random.Generator, count: int, side: int
) -> FloatArray:
    """Light that is computed at every `factor`-th pixel, and interpolated."""
    _, reflectance = floor(side)
    small = rng.gamma(4.0, 0.25, (count, -(-side // factor), -(-side // factor), 3))
    large = ndimage.zoom(small, (1, factor, factor, 1), order=order, mode="nearest", grid_mode=True)
    return large[:, :side, :side] * reflectance


def common_brightness(share: float, rng: np.random.Generator, count: int, side: int) -> FloatArray:
    """Noise of each pixel, and a lamp whose strength is drawn once for all pixels."""
    _, reflectance = floor(side)
    own = 0.3 * rng.standard_normal((count, side, side, 3))
    y, x = np.mgrid[0:side, 0:side] / side
    lamp = 0.3 * share * rng.standard_normal((count, 1, 1, 1)) * (0.5 + x * y)[..., None]
    return (1.0 + own + lamp) * reflectance


def rare_lamp(chance: float, rng: np.random.Generator, count: int, side: int) -> FloatArray:
    """One lamp of several, drawn once for all pixels, and seldom; its shadow is sharp."""
    _, reflectance = floor(side)
    points, _ = floor(side)
    lit = light(points, np.array([[0.2, 0.8, 0.5]])).reshape(side, side, 1)
    lit = 0.05 * lit / lit.mean()
    own = 0.1 * rng.standard_normal((count, side, side, 1))
    drawn = rng.poisson(64 * chance, (count, 1, 1, 1)) / (64 * chance)
    return (1.0 + own + lit * drawn) * reflectance


RENDERERS: dict[str, Renderer] = {
    "same sequence, 1 sample": partial(same_sequence, 1),
    "same sequence, 16 samples": partial(same_sequence, 16),
    "same sequence, 64 samples": partial(same_sequence, 64),
    "rotated sequence, 1 sample": partial(rotated_sequence, 1),
    "rotated sequence, 16 samples": partial(rotated_sequence, 16),
    "photon map, radius 1": partial(photon_map, 2.0, 1.0),
    "photon map, radius 3": partial(photon_map, 1.0, 3.0),
    "photon map, radius 8": partial(photon_map, 0.1, 8.0),
    "photon map, radius 20": partial(photon_map, 0.02, 20.0),
    "photon map, few photons": partial(photon_map, 0.006, 8.0),  # fewer leave pictures black
    "1 point light": partial(point_lights, 1),
    "8 point lights": partial(point_lights, 8),
    "64 point lights": partial(point_lights, 64),
    "box filter of 3": partial(denoised, "box", 3),
    "box filter of 9": partial(denoised, "box", 9),
    "Gaussian of 1 pixel": partial(denoised, "Gaussian", 1.0),
    "Gaussian of 3 pixels": partial(denoised, "Gaussian", 3.0),
    "Gaussian of 10 pixels": partial(denoised, "Gaussian", 10.0),
    "a quarter of the resolution": partial(upsampled, 4, 0),
    "a quarter of the resolution, smooth": partial(upsampled, 4, 1),
    "a sixteenth of the resolution": partial(upsampled, 16, 0),
    "common brightness, weak": partial(common_brightness, 0.5),
    "common brightness, strong": partial(common_brightness, 2.0),
    "rare lamp": partial(rare_lamp, 1 / 64),
    "common lamp": partial(rare_lamp, 1 / 8),
}
"""By name; every one has the mean `truth`."""


@cache
def truth(name: str, side: int) -> FloatArray:
    """The mean of a renderer, (side, side, 3), by quadrature: its error is far below its noise."""
    points, reflectance = floor(side)
    steps = (np.arange(48) + 0.5) / 48
    u = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    if name.startswith("same sequence"):
        mean = np.concatenate(
            [light(part, lamp_points(u)).mean(axis=1) for part in np.array_split(points, 16)]
        )
        return np.asarray(mean.reshape(side, side, 1) * reflectance)
    if "point light" in name:
        walls = [
            np.column_stack([np.full(len(u), x), u[:, 0], 0.02 + 0.6 * u[:, 1]])
            for x in (-0.02, 1.02)
        ]
        mean = np.concatenate(
            [
                sum(light(part, wall, clamp=0.01).mean(axis=1) for wall in walls) / 2.0
                for part in np.array_split(points, 16)
            ]
        )
        return np.asarray(mean.reshape(side, side, 1) * reflectance)
    if "lamp" in name:
        lit = light(points, np.array([[0.2, 0.8, 0.5]])).reshape(side, side, 1)
        return np.asarray((1.0 + 0.05 * lit / lit.mean()) * reflectance)
    return reflectance


def independent(name: str, rng: np.random.Generator, count: int, side: int) -> FloatArray:
    """Another renderer of the same picture, whose pixels are independent: 10 % of noise."""
    return truth(name, side) * (1.0 + 0.1 * rng.standard_normal((count, side, side, 3)))
