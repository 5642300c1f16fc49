"""Environment maps as pbrt has them: squares on which equal areas are equal solid angles (Clarberg
2008)."""

import math
from functools import partial

import numpy as np
from scipy.ndimage import map_coordinates

from comparisons.renderers.vocabulary import PbrtWriter
from reference_rt.core.arrays import FloatArray
from reference_rt.lights import EnvironmentMap
from reference_rt.lights.emitters.environment_map import orthogonal
from reference_rt.textures.image_file import read_image


def image_of(light: EnvironmentMap, writing: PbrtWriter) -> str:
    """The name of an image.  pbrt does not interpolate: ours is sampled again, finer."""
    path, number = writing.scene.folder / light.file, writing.scene.lights.index(light)
    read = partial(read_image, path, light.encoding, light.scale, light.layer)
    texels = writing.read(read, "lights", number)
    side = min(2048, 2 ** math.ceil(math.log2(max(256, 1.2 * texels.shape[1]))))
    turned = orthogonal(light.transform)
    total = np.zeros((side, side, 3))
    for offset in _FOUR:
        v, u = (np.mgrid[:side, :side] + np.array(offset)[:, None, None]) / side
        total += radiance_of(texels, square_to_sphere(u, v) @ turned)
    writing.note(f"'{light.file}' is sampled again, as an equal-area map of {side} x {side} pixels")
    return writing.image("environment", total / len(_FOUR))


_FOUR = ((0.25, 0.25), (0.25, 0.75), (0.75, 0.25), (0.75, 0.75))
"""Points of a pixel whose mean it is."""


def square_to_sphere(u: FloatArray, v: FloatArray) -> FloatArray:
    """The direction (..., 3) of a point inside the unit square (PBR 4ed, 3.8.3)."""
    x, y = 2.0 * u - 1.0, 2.0 * v - 1.0
    inside = 1.0 - (np.abs(x) + np.abs(y))
    r = 1.0 - np.abs(inside)
    phi = ((np.abs(y) - np.abs(x)) / r + 1.0) * (math.pi / 4.0)
    across = r * np.sqrt(2.0 - r * r)
    z = np.copysign(1.0 - r * r, inside)
    return np.stack(
        [np.copysign(np.cos(phi), x) * across, np.copysign(np.sin(phi), y) * across, z], axis=-1
    )


def radiance_of(texels: FloatArray, d: FloatArray) -> FloatArray:
    """A map of ours in unit directions (..., 3) of its own space: bilinear between texels, as
    `EnvironmentMaps` says."""
    height, width = texels.shape[:2]
    across = np.arctan2(d[..., 0], -d[..., 2]) * (width / (2.0 * math.pi)) - 0.5
    down = np.arccos(np.clip(d[..., 1], -1.0, 1.0)) * ((height - 1) / math.pi)
    found = np.empty_like(d)
    for k in range(3):
        found[..., k] = map_coordinates(texels[..., k], [down, across], order=1, mode="grid-wrap")
    return found
