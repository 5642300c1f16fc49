"""Homogeneous media: Mitsuba's `homogeneous`, and which of them a shape bounds."""

import math
from collections.abc import Mapping
from typing import Any

from comparisons.media.phases import constant_volume, read_phase, translate_phase
from comparisons.mitsuba.context import rgb
from comparisons.mitsuba.node import Node, Reading
from comparisons.mitsuba.plugin_table import PluginTable
from reference_rt.media import AnyMedium, Homogeneous

HOMOGENEOUS = PluginTable("homogeneous", ignored=("has_spectral_extinction",))

DEFAULTS = {"sigma_t": 1.0, "albedo": 0.75}
"""Mitsuba's (src/media/homogeneous.cpp)."""


def translate_medium(medium: AnyMedium) -> dict[str, Any]:
    """A medium's dictionary.

    Mitsuba takes the colour `sigma_t` for a reflectance, and refuses values above 1: a power of two
    stands in `scale` in place of their size, and changes no bit.
    """
    size = 2.0 ** math.ceil(math.log2(max(1.0, *medium.sigma_t)))
    sigma_t = tuple(x / size for x in medium.sigma_t)
    return {
        "type": HOMOGENEOUS.plugin,
        "sigma_t": rgb(sigma_t),  # type: ignore[arg-type]
        "albedo": rgb(medium.albedo),
        "scale": medium.scale * size,
        "phase": translate_phase(medium.phase),
    }


SIDES = ("interior", "exterior")
"""The parts of a shape, in ours and in Mitsuba's descriptions."""


def media_of_shape(part: Any, media: Mapping[str, AnyMedium]) -> dict[str, Any]:
    """The dictionaries of the media that a shape bounds, by side."""
    names = {side: getattr(part, side) for side in SIDES}
    return {k: translate_medium(media[name]) for k, name in names.items() if name is not None}


# ---- reading -------------------------------------------------------------------------------------


def medium_name(reading: Reading, node: Node) -> str:
    """The name of a medium among those of `reading`, which is read if it is not yet.  Raises
    SceneError."""
    key = ("medium", node.index)
    if key not in reading.names:
        if node.plugin != HOMOGENEOUS.plugin:
            raise node.unsupported("expected a medium that is the same everywhere: homogeneous")
        with node.checking():
            medium = _read(reading, node)
        node.finish()
        name = reading.unused(node.name, "medium", reading.media)
        reading.media[name] = medium
        reading.names[key] = name
    return reading.names[key]


def _read(reading: Reading, node: Node) -> Homogeneous:
    node.ignore(*HOMOGENEOUS.ignored)
    if not node.flag("sample_emitters", True):
        raise node.error(
            "'sample_emitters' is false, so that lamps without extent light nothing in it; "
            "expected true"
        )
    colours = {
        key: constant_volume(node, key, default, "reflectance" if key == "albedo" else "unbounded")
        for key, default in DEFAULTS.items()
    }
    return Homogeneous(
        **colours,
        scale=node.number("scale", 1.0),
        phase=read_phase(reading, node.only("PhaseFunction")),
    )


NOT_FOLLOWED = (
    "is in a medium, or bounds one, which is left out: Mitsuba's integrator follows none, unless "
    "it is volpath or volpathmis"
)


def medium_of_sensor(reading: Reading, node: Node) -> dict[str, str]:
    """The name of the medium of a sensor's element, if it has one.  Raises SceneError."""
    inside = node.only("Medium")
    if inside is None:
        return {}
    if not reading.follows_media:
        reading.note(node, NOT_FOLLOWED)
        return {}
    return {"medium": medium_name(reading, inside)}


def media_names(reading: Reading, node: Node) -> dict[str, str]:
    """The names of the media of a shape's element, by side.  Raises SceneError."""
    if not reading.follows_media:
        if node.children("Medium"):
            reading.note(node, NOT_FOLLOWED)
        return {}
    found = {}
    for side, medium in node.named_children("Medium"):
        if side not in SIDES:
            raise medium.error(f"is the parameter '{side}'; expected one of: {', '.join(SIDES)}")
        found[side] = medium_name(reading, medium)
    return found
