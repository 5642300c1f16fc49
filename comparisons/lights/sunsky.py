"""Mitsuba's `sunsky` as an environment map: Mitsuba evaluates it, and we keep the image.

The sky is taken at the centres of the image's pixels.  The sun is smaller than a few of them, so
its light is spread over the nearest ones, with the weights of the interpolation between them: the
flux is the sun's, its edge is softer by a pixel.
"""

import hashlib
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.mitsuba.backend import cache_folder, mitsuba
from comparisons.mitsuba.node import Node, Reading
from comparisons.mitsuba.scene import for_rays
from reference_rt.core.arrays import FloatArray
from reference_rt.lights import EnvironmentMap
from reference_rt.util.files import replacing

WIDTH, HEIGHT = 2048, 1025
"""Pixels: 0.18 degrees each, a third of the sun's diameter."""

RINGS, SPOKES = 48, 96
"""Directions to the sun's disk that are evaluated."""


def read_sunsky(reading: Reading, node: Node) -> EnvironmentMap:
    """The environment map.  Raises SceneError."""
    node.ignore(*node.keys)
    values = {}
    for key in node.keys:
        value = node.properties[key]
        if type(value).__name__ == "ResolvedReference":
            raise node.error(f"'{key}' is a nested element; expected a number or a colour")
        values[key] = value
    shown = ", ".join(f"{key} = {value}" for key, value in sorted(values.items()))
    made_by = f"{shown} {mitsuba().__version__}".encode() + Path(__file__).read_bytes()
    path = cache_folder() / "skies" / f"{hashlib.sha256(made_by).hexdigest()[:24]}.npy"
    if not path.is_file():
        _write(path, _image(values))
    reading.note(
        node,
        f"becomes an environment map of {WIDTH} x {HEIGHT} pixels, evaluated by Mitsuba; the edge "
        "of the sun is softer by a pixel",
    )
    return EnvironmentMap(file=reading.relative(path))


def _write(path: Path, image: FloatArray) -> None:
    with replacing(path) as temporary, temporary.open("wb") as file:
        np.save(file, image.astype(np.float32))


def _image(values: dict[str, Any]) -> FloatArray:
    """(height, width, 3): the image as `EnvironmentMap` has it."""
    sky = _emitter(values, sun_scale=0.0)
    polar = np.pi * np.arange(HEIGHT) / (HEIGHT - 1)
    azimuth = 2.0 * np.pi * (np.arange(WIDTH) + 0.5) / WIDTH
    rows = [_radiance(sky, _directions(theta, azimuth)) for theta in polar]
    image = np.stack(rows)
    if values.get("sun_scale", 1.0) > 0.0:
        image += _sun(_emitter(values, sky_scale=0.0), values)
    return image


def _emitter(values: dict[str, Any], **changed: float) -> Any:
    mi = mitsuba()
    properties = mi.Properties("sunsky")
    for key, value in {**values, **changed}.items():
        properties[key] = value
    return mi.PluginManager.instance().create_object(properties)


def _directions(polar: Any, azimuth: Any) -> FloatArray:
    """(n, 3): the directions of places of the map: its top is +y, its middle +z."""
    s = np.sin(polar)
    x, z = s * np.sin(azimuth), -s * np.cos(azimuth)
    return np.stack([x, np.cos(polar) + 0.0 * x, z], axis=-1)


def _radiance(emitter: Any, d: FloatArray) -> FloatArray:
    """(n, 3) from directions (n, 3)."""
    import drjit as dr

    mi = mitsuba()

    def value(away: Any) -> tuple[Any, ...]:
        si = dr.zeros(mi.SurfaceInteraction3f)
        si.wi = away
        return (emitter.eval(si),)

    return np.asarray(for_rays(value, -d)[0])


def _sun(emitter: Any, values: dict[str, Any]) -> FloatArray:
    """The sun's light alone, as an image."""
    mi = mitsuba()
    parameters = mi.traverse(emitter)
    towards = np.array(parameters["sun_direction"], np.float64).ravel()
    to_world = np.array(parameters["to_world"].matrix, np.float64).reshape(4, 4)[:3, :3]
    # Given as a direction it is the world's; from a place and a time it may be the emitter's own.
    both = np.stack([towards, to_world @ towards])
    both /= np.linalg.norm(both, axis=1)[:, None]
    axis = both[np.argmax(_radiance(emitter, both).sum(axis=1))]
    half = np.radians(0.5 * values.get("sun_aperture", 0.5358))
    edges = np.linspace(0.0, half, RINGS + 1)
    off = 0.5 * (edges[1:] + edges[:-1])
    solid_angle = 2.0 * np.pi * (np.cos(edges[:-1]) - np.cos(edges[1:])) / SPOKES
    turn = 2.0 * np.pi * (np.arange(SPOKES) + 0.5) / SPOKES
    across = np.linalg.svd(axis[None])[2][1:]
    sides = np.cos(turn)[:, None] * across[0] + np.sin(turn)[:, None] * across[1]
    d = np.cos(off)[:, None, None] * axis + np.sin(off)[:, None, None] * sides
    d = d.reshape(-1, 3)
    flux = _radiance(emitter, d) * np.repeat(solid_angle, SPOKES)[:, None]
    # The place in the map, and the four pixels around it.
    y = np.arccos(np.clip(d[:, 1], -1.0, 1.0)) / np.pi * (HEIGHT - 1)
    x = np.arctan2(d[:, 0], -d[:, 2]) / (2.0 * np.pi) * WIDTH - 0.5
    row, column = np.minimum(np.floor(y).astype(int), HEIGHT - 2), np.floor(x).astype(int)
    image = np.zeros((HEIGHT, WIDTH, 3))
    for down in (0, 1):
        for right in (0, 1):
            weight = np.abs(1.0 - down - (y - row)) * np.abs(1.0 - right - (x - column))
            place = row + down, (column + right) % WIDTH
            np.add.at(image, place, flux * weight[:, None])
    return image / _solid_angles()[:, None, None]


def _solid_angles() -> FloatArray:
    """(height,): the integral of a pixel's weight over all directions: of a hat around its polar
    angle times the sine, times the width of a pixel."""
    step = np.pi / (HEIGHT - 1)
    polar = step * np.arange(HEIGHT)
    inner = 2.0 * np.sin(polar) * (1.0 - np.cos(step)) / step
    inner[[0, -1]] = 1.0 - np.sin(step) / step
    return np.asarray(inner * 2.0 * np.pi / WIDTH)
