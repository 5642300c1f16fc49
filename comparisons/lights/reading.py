"""Emitters of Mitsuba scenes.  Colours are radiance, intensity or irradiance as in Mitsuba."""

import hashlib
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.cameras.reading import Frame, angle
from comparisons.mitsuba.backend import cache_folder, mitsuba
from comparisons.mitsuba.colours import Rgb, colour
from comparisons.mitsuba.node import Node, Reading, triple
from comparisons.mitsuba.parse import as_transform
from comparisons.mitsuba.scene import for_rays
from comparisons.textures.reading import colour_or_texture, projected
from reference_rt.core.arrays import FloatArray
from reference_rt.core.image_files import open_image
from reference_rt.core.transform import is_similarity
from reference_rt.lights import (
    AnyLight,
    Constant,
    Directional,
    EnvironmentMap,
    Point,
    Projector,
    Spot,
)
from reference_rt.textures import Bitmap
from reference_rt.util.files import replacing

# ---- `sunsky` as an environment map: Mitsuba evaluates it, and we keep the image -----------------
# The sky is taken at the centres of the image's pixels. The sun is smaller than a few of them, so
# its light is spread over the nearest ones, with the weights of the interpolation between them: the
# flux is the sun's, its edge is softer by a pixel.


WIDTH, HEIGHT = 2048, 1025
"""Pixels: 0.18 degrees each, a third of the sun's diameter."""

RINGS, SPOKES = 48, 96
"""Directions to the sun's disk that are evaluated."""


def read_sunsky(reading: Reading, node: Node) -> AnyLight:
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


# ---- emitters ------------------------------------------------------------------------------------


TOLERANCE = 1e-5
"""Of a rotation, relative."""


def belongs_to_shape(node: Node) -> bool:
    """Whether an emitter is a lamp's; the second plugin is ours."""
    return node.plugin in ("area", "mesh_area")


def emission(reading: Reading, node: Node) -> Rgb | str:
    """The radiance of a shape's emitter.  Raises SceneError for all but `area`."""
    if not belongs_to_shape(node):
        raise node.unsupported("expected 'area', as the emitter of a shape")
    node.ignore("sampling_weight")  # which lights are sampled does not change the picture
    radiance = colour_or_texture(reading, node, "radiance", 1.0, "emission")
    node.finish()
    return radiance


def read_light(reading: Reading, node: Node) -> None:
    """Add an emitter that belongs to no shape.  Raises SceneError."""
    if node.plugin not in _READERS:
        raise node.unsupported(f"expected one of: {', '.join(sorted(_READERS))}, or area in shapes")
    node.ignore("sampling_weight")
    with node.checking():
        light = _READERS[node.plugin](reading, node)
    node.finish()
    reading.lights.append(light)


def _plain(node: Node, key: str) -> Rgb:
    """A colour that is no texture."""
    return colour(node, key, 1.0, "emission")


def _point(reading: Reading, node: Node) -> AnyLight:
    if node.has("position"):
        if node.has("to_world"):
            raise node.error("has both 'position' and 'to_world'; expected one of them")
        position = node.vector("position", (0.0, 0.0, 0.0))
    else:
        position = triple(node.transform()[:, 3])
    return Point(position=position, intensity=_plain(node, "intensity"))


def _spot(reading: Reading, node: Node) -> AnyLight:
    m = node.transform()
    rotation = _similarity(node, m[:, :3])
    axis = m[:, 2] / np.linalg.norm(m[:, 2])
    cutoff = node.number("cutoff_angle", 20.0)
    image: dict[str, Any] = {}
    if node.has("texture"):
        texture = projected(reading, node, "texture", 1.0)
        if not isinstance(texture, str):
            raise node.error("'texture' is a colour, which Mitsuba refuses, too; expected an image")
        _check_upright(node, rotation)
        image = {"texture": texture, "up": triple(-rotation[:, 1])}
    look, _ = node.looks()
    if look is not None and image:
        x, y, z = look.up
        image["up"] = (-x, -y, -z)
    return Spot(
        **image,
        origin=triple(m[:, 3]) if look is None else look.origin,
        target=triple(m[:, 3] + axis) if look is None else look.target,
        intensity=_plain(node, "intensity"),
        cutoff_angle=cutoff,
        beam_width=node.number("beam_width", 0.75 * cutoff),
    )


def _projector(reading: Reading, node: Node) -> AnyLight:
    m, (look, scale) = node.transform(), node.looks()
    _check_size(node, m[:, 2])
    # What is taller than the image's pixels is a scale of y alone.
    tall = float(np.linalg.norm(m[:, 1]) / np.linalg.norm(m[:, 2]))
    if look is not None:
        tall = scale[1]
    elif abs(tall - 1.0) <= TOLERANCE:
        tall = 1.0
    rotation = _similarity(node, m[:, :3] / np.array([1.0, tall, 1.0]))
    _check_upright(node, rotation)
    origin, target, up = look or (
        triple(m[:, 3]),
        triple(m[:, 3] + rotation[:, 2]),
        triple(rotation[:, 1]),
    )
    irradiance = projected(reading, node, "irradiance", 1.0, "emission")
    width, height = 1, 1
    if isinstance(irradiance, str) and isinstance(reading.textures[irradiance], Bitmap):
        file = reading.parsed.folder / reading.textures[irradiance].file
        image = open_image(file)
        width, height = image.width, image.height
    fov, wide = angle(node, Frame(width, height, 0, 0, width, height))
    # Mitsuba's intensity is pi times that of the irradiance at distance 1.
    return Projector(
        origin=origin,
        target=target,
        up=up,
        irradiance=irradiance,
        scale=math.pi * node.number("scale", 1.0),
        fov=fov["fov"] if fov["fov_axis"] == "x" else math.degrees(2.0 * math.atan(wide)),
        aspect=width / height / tall,
    )


def _check_upright(node: Node, rotation: FloatArray) -> None:
    """Raise SceneError for a map that mirrors the image."""
    if np.linalg.det(rotation) < 0.0:
        raise node.error(
            "'to_world' mirrors the image, which is not supported; expected a rotation"
        )


def _directional(reading: Reading, node: Node) -> AnyLight:
    if node.has("direction"):
        if node.has("to_world"):
            raise node.error("has both 'direction' and 'to_world'; expected one of them")
        direction = node.vector("direction", (0.0, 0.0, 1.0))
    else:
        axis = node.transform()[:, 2]
        _check_size(node, axis)
        direction = triple(axis)
    return Directional(direction=direction, irradiance=_plain(node, "irradiance"))


def _constant(reading: Reading, node: Node) -> AnyLight:
    node.ignore("to_world")
    return Constant(radiance=_plain(node, "radiance"))


def _envmap(reading: Reading, node: Node) -> AnyLight:
    node.ignore("mis_compensation")  # of sampling
    if node.has("bitmap"):
        raise node.error("'bitmap', an image in memory, is not supported; expected a file")
    linear = node.transform()[:, :3]  # Mitsuba ignores a translation, too
    rotation = _similarity(node, linear)
    _check_size(node, linear[:, 2])
    turn: Any = ()
    if not np.array_equal(rotation, np.eye(3)):
        of_axes = np.column_stack([linear, np.zeros(3)])
        turn = as_transform(node.written(), of_axes)
        if "matrix" in turn[0] and len(turn) == 1 and not is_similarity(linear):
            turn = ({"matrix": np.column_stack([rotation, np.zeros(3)]).tolist()},)
    return EnvironmentMap(
        file=reading.relative(reading.file(node)), scale=node.number("scale", 1.0), transform=turn
    )


def _check_size(node: Node, axis: FloatArray) -> None:
    """Raise SceneError for a scale that Mitsuba's lights do not divide out."""
    size = float(np.linalg.norm(axis))
    if abs(size - 1.0) > TOLERANCE:
        raise node.error(
            f"'to_world' scales by {size:g}, which distorts Mitsuba's picture: it takes the vector "
            "for one of length 1; expected a rotation and a translation"
        )


def _similarity(node: Node, linear: FloatArray) -> FloatArray:
    """The orthogonal map of a similarity.  Raises SceneError for another map."""
    gram = linear.T @ linear
    size = float(np.trace(gram)) / 3.0
    if not size > 0.0 or np.abs(gram - size * np.eye(3)).max() > TOLERANCE * size:
        raise node.error("'to_world' shears or scales unevenly; expected a rotation")
    if np.array_equal(linear, np.eye(3)):
        return linear
    u, _, v = np.linalg.svd(linear)
    return np.asarray(u @ v)


_READERS: dict[str, Callable[[Reading, Node], AnyLight]] = {
    "point": _point,
    "spot": _spot,
    "projector": _projector,
    "directional": _directional,
    "constant": _constant,
    "envmap": _envmap,
    "sunsky": read_sunsky,
}
