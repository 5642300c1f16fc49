"""Emitters of Mitsuba scenes.  Colours are radiance, intensity or irradiance as in Mitsuba."""

from collections.abc import Callable
from typing import Any

import numpy as np

from comparisons.mitsuba.reading.colours import Rgb, colour
from comparisons.mitsuba.reading.context import Reading
from comparisons.mitsuba.reading.node import Node, triple
from comparisons.mitsuba.reading.textures import colour_or_texture
from reference_rt.core.arrays import FloatArray
from reference_rt.lights import AnyLight, Constant, Directional, EnvironmentMap, Point, Spot

TOLERANCE = 1e-5
"""Of a rotation, relative."""


def emission(reading: Reading, node: Node) -> Rgb | str:
    """The radiance of a shape's emitter.  Raises SceneError for all but `area`."""
    if node.plugin != "area":
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
    if node.has("texture"):
        raise node.error("'texture' is not supported; expected none")
    m = node.transform()
    _similarity(node, m[:, :3])
    axis = m[:, 2] / np.linalg.norm(m[:, 2])
    cutoff = node.number("cutoff_angle", 20.0)
    return Spot(
        origin=triple(m[:, 3]),
        target=triple(m[:, 3] + axis),
        intensity=_plain(node, "intensity"),
        cutoff_angle=cutoff,
        beam_width=node.number("beam_width", 0.75 * cutoff),
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
    "directional": _directional,
    "constant": _constant,
    "envmap": _envmap,
}
