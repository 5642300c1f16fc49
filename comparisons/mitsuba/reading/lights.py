"""Emitters of Mitsuba scenes.  Colours are radiance, intensity or irradiance as in Mitsuba."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from comparisons.mitsuba.reading.colours import Rgb, colour
from comparisons.mitsuba.reading.context import Reading
from comparisons.mitsuba.reading.films import Frame
from comparisons.mitsuba.reading.node import Node, triple
from comparisons.mitsuba.reading.sensors import angle
from comparisons.mitsuba.reading.sunsky import read_sunsky
from comparisons.mitsuba.reading.textures import colour_or_texture, projected
from comparisons.mitsuba.reading.written import as_transform
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
        direction = triple(node.transform()[:, 2])
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
    turn: Any = ()
    if not np.array_equal(rotation, np.eye(3)):
        of_axes = np.column_stack([linear, np.zeros(3)])
        turn = as_transform(node.written(), of_axes)
        if "matrix" in turn[0] and len(turn) == 1 and not is_similarity(linear):
            turn = ({"matrix": np.column_stack([rotation, np.zeros(3)]).tolist()},)
    return EnvironmentMap(
        file=reading.relative(reading.file(node)), scale=node.number("scale", 1.0), transform=turn
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
