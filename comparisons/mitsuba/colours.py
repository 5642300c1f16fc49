"""Colours and indices of refraction in Mitsuba's scenes.

`rgb` is taken as it is, spectra as Mitsuba's rgb variants convert them: an integral over
wavelengths is taken from Mitsuba itself, as the conversion is not what a comparison checks.
"""

from typing import Any

import numpy as np

from comparisons.mitsuba.node import Node
from comparisons.mitsuba.parse import scalar

Rgb = tuple[float, float, float]

SPECTRA = ("uniform", "srgb", "d65", "rawconstant", "blackbody", "regular", "irregular")
"""Plugins that are the same everywhere on a surface."""

IOR = {
    "vacuum": 1.0, "helium": 1.000036, "hydrogen": 1.000132, "air": 1.000277,
    "carbon dioxide": 1.00045, "water": 1.3330, "acetone": 1.36, "ethanol": 1.361,
    "carbon tetrachloride": 1.461, "glycerol": 1.4729, "benzene": 1.501, "silicone oil": 1.52045,
    "bromine": 1.661, "water ice": 1.31, "fused quartz": 1.458, "pyrex": 1.470,
    "acrylic glass": 1.49, "polypropylene": 1.49, "bk7": 1.5046, "sodium chloride": 1.544,
    "amber": 1.55, "pet": 1.5750, "diamond": 2.419,
}  # fmt: skip
"""Mitsuba's indices of refraction by name (include/mitsuba/render/ior.h, 3.9.1)."""

_LUMINANCE = (0.212671, 0.715160, 0.072169)
"""Mitsuba's weights (include/mitsuba/core/spectrum.h)."""


def colour(node: Node, key: str, default: float | Rgb, use: str = "reflectance") -> Rgb:
    """Linear sRGB.  use: "reflectance", "emission" or "unbounded", by which Mitsuba chooses the
    white of a spectrum.  Raises SceneError."""
    if not node.has(key):
        return default if isinstance(default, tuple) else (default, default, default)
    kind = node.kind_of(key)
    value = node.take(key)
    if isinstance(value, Node):
        return constant(value)
    if kind in ("Float", "Integer"):
        return (float(value),) * 3
    if kind == "Color":
        return _rgb(value)
    if kind == "Spectrum":
        return _converted(node, key, use)
    raise node.error(f"'{key}' is no colour; expected a number, <rgb>, <spectrum> or a texture")


def constant(node: Node) -> Rgb:
    """The colour of a spectrum that is an element of its own."""
    if node.plugin not in SPECTRA:
        raise node.unsupported(f"expected a colour, or one of: {', '.join(SPECTRA)}")
    if node.plugin == "uniform" and node.keys == ["value"]:
        return (node.number("value", 1.0),) * 3
    if node.plugin == "srgb" and node.keys == ["color"] and node.kind_of("color") == "Color":
        return _rgb(node.take("color"))
    values = {key: node.take(key) for key in node.keys}
    if any(isinstance(value, Node) for value in values.values()):
        raise node.error("has a texture inside; expected a colour")
    with scalar() as mi:
        try:
            texture = mi.load_dict({"type": node.plugin, **values})
            return _rgb(texture.eval(mi.SurfaceInteraction3f()))
        except (RuntimeError, NotImplementedError) as error:
            reason = " ".join(str(error).split())
            raise node.error(f"Mitsuba's rgb variants cannot use it: {reason}") from None


def _converted(node: Node, key: str, use: str) -> Rgb:
    """A value of Mitsuba's type Spectrum."""
    with scalar() as mi:
        props = node.properties
        function = {
            "reflectance": props.get_texture,
            "emission": props.get_emissive_texture,
            "unbounded": props.get_unbounded_texture,
        }[use]
        try:
            return _rgb(function(key).eval(mi.SurfaceInteraction3f()))
        except RuntimeError as error:
            raise node.error(f"'{key}': {' '.join(str(error).split())}") from None


def _rgb(value: Any) -> Rgb:
    r, g, b = np.array(value, np.float64).reshape(3).tolist()
    return r, g, b


def luminance(rgb: Rgb) -> float:
    """Mitsuba's luminance, by which a colour stands for a number."""
    return sum(w * x for w, x in zip(_LUMINANCE, rgb, strict=True))


def index_of_refraction(node: Node, key: str, default: str) -> float:
    """A number, or the name of a substance."""
    if node.has(key) and node.kind_of(key) in ("Float", "Integer"):
        return node.number(key, 1.0)
    name = node.text(key, default).lower()
    if name not in IOR:
        raise node.error(f"'{key}' is '{name}'; expected a number or one of: {', '.join(IOR)}")
    return IOR[name]


def metal(node: Node, name: str) -> tuple[Rgb, Rgb]:
    """eta and k of one of Mitsuba's metals by name.  Raises SceneError."""
    with scalar() as mi:
        try:
            values = mi.traverse(mi.load_dict({"type": "conductor", "material": name}))
        except RuntimeError as error:
            raise node.error(
                f"'material' is '{name}', for which Mitsuba has no table "
                f"({' '.join(str(error).split())}); expected one of those in its documentation"
            ) from None
        return _rgb(values["eta.value"]), _rgb(values["k.value"])
