"""Colours, numbers and textures of Mitsuba scenes.

Our shapes get the texture coordinates that Mitsuba's have, so that a texture needs no knowledge of
the shape.  Mitsuba's v = 0 is the top row of an image, ours the bottom one: the map of an image
ends with 1 - v.
"""

import math
from typing import Any

import numpy as np

from comparisons.mitsuba.node import Node, Reading
from comparisons.mitsuba.parse import FLIP as FLIP_STEPS
from comparisons.mitsuba.parse import Step, Written, scalar
from reference_rt.core.arrays import FloatArray
from reference_rt.textures import Bitmap, Checker, Texture, VertexColours
from reference_rt.textures.texture import UvMap

# ---- colours and numbers -------------------------------------------------------------------------
# `rgb` is taken as it is, spectra as Mitsuba's rgb variants convert them: an integral over
# wavelengths is taken from Mitsuba itself, as the conversion of units is not what a comparison
# checks.


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


# ---- parameters that may be textures -------------------------------------------------------------


FLIP = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 1.0], [0.0, 0.0, 1.0]])
"""The map of (u, v) to (u, 1 - v)."""

TOLERANCE = 1e-6
"""Relative to the map's size: XML has about seven digits, and Mitsuba's scenes are float32."""


def colour_or_texture(
    reading: Reading, node: Node, key: str, default: float | Rgb, use: str = "reflectance"
) -> Rgb | str:
    """A colour, or the name of a texture of `reading`.  use: see `colour`."""
    if node.has(key) and node.kind_of(key) == "ResolvedReference":
        value = node.take(key)
        if value.kind != "Texture":
            raise node.error(f"'{key}' is a {value.kind.lower()}; expected a texture")
        if value.plugin in SPECTRA:
            return constant(value)
        if value.index in reading.fields:
            field = reading.fields[value.index]
            return colour_or_texture(reading, value, field, FIELDS[field], use)
        return texture_name(reading, value, as_number=False)
    return colour(node, key, default, use)


def number_or_texture(reading: Reading, node: Node, key: str, default: float) -> float | str:
    """A number, or the name of a texture whose luminance it is."""
    if not node.has(key):
        return default
    kind = node.kind_of(key)
    if kind in ("Float", "Integer"):
        return node.number(key, default)
    if kind == "ResolvedReference":
        value = node.take(key)
        if value.kind != "Texture":
            raise node.error(f"'{key}' is a {value.kind.lower()}; expected a number or a texture")
        if value.index in reading.fields:
            field = "color1" if reading.fields[value.index] == "color0" else "color0"
            return number_or_texture(reading, value, field, FIELDS[field])  # see `_checker`
        if value.plugin not in SPECTRA:
            return texture_name(reading, value, as_number=True)
        if value.plugin in ("uniform", "rawconstant"):
            return constant(value)[0]
        return luminance(constant(value))
    return luminance(colour(node, key, default))


def projected(
    reading: Reading, node: Node, key: str, default: float | Rgb, use: str = "reflectance"
) -> Rgb | str:
    """`colour_or_texture` for a light that projects it: (0, 0) is the upper left corner of the
    image in Mitsuba, the lower left one in ours."""
    if node.has(key) and node.kind_of(key) == "ResolvedReference":
        value = node.take(key)
        if value.kind == "Texture" and value.plugin not in SPECTRA:
            return texture_name(reading, value, as_number=False, is_projected=True)
        if value.kind == "Texture":
            return constant(value)
        raise node.error(f"'{key}' is a {value.kind.lower()}; expected a texture")
    return colour(node, key, default, use)


def texture_name(reading: Reading, node: Node, as_number: bool, is_projected: bool = False) -> str:
    """The name of a texture of `reading`, which is read if it is not yet.

    as_number: whether its luminance stands for a number;  is_projected: see `projected`.
    """
    key = ("texture", node.index, as_number and node.plugin == "checkerboard", is_projected)
    if key not in reading.names:
        with node.checking():
            texture = _texture(reading, node, as_number, is_projected)
        name = reading.unused(node.name, node.plugin, reading.textures)
        reading.textures[name] = texture
        if isinstance(texture, VertexColours):
            reading.attributes[name] = node.text("name", "")
        node.finish()
        reading.names[key] = name
    return reading.names[key]


def _texture(reading: Reading, node: Node, as_number: bool, is_projected: bool) -> Texture:
    if node.plugin == "bitmap":
        return _bitmap(reading, node, is_projected)
    if node.plugin == "checkerboard":
        return _checker(node, as_number, is_projected)
    if node.plugin == "mesh_attribute":
        return _attribute(node)
    raise node.unsupported("expected bitmap, checkerboard, mesh_attribute or a colour")


def _bitmap(reading: Reading, node: Node, is_projected: bool) -> Bitmap:
    node.ignore("accel")
    for key in ("bitmap", "data"):
        if node.has(key):
            raise node.error(f"'{key}', an image in memory, is not supported; expected a file")
    # By default 8-bit images are kept as they are; half floats, 2^-11 off, are not imitated.
    node.choice("format", "auto", ("auto", "variant", "float16", "fp16", "uint8"))
    return Bitmap(
        file=reading.relative(reading.file(node)),
        filter=node.choice("filter_type", "bilinear", ("bilinear", "nearest")),
        wrap=node.choice("wrap_mode", "repeat", ("repeat", "mirror", "clamp")),
        encoding="raw" if node.flag("raw") else "auto",
        uv=_uv(node, is_image=True, is_projected=is_projected),
    )


FIELDS = {"color0": 0.4, "color1": 0.2}
"""The fields of a checkerboard, and Mitsuba's defaults."""


def is_checker_of_textures(node: Node) -> bool:
    return node.plugin == "checkerboard" and any(
        child.plugin not in SPECTRA for child in node.clone().children("Texture")
    )


def fields_of(node: Node) -> Checker:
    """0 in the fields `color0` of a checkerboard, 1 in the others."""
    node.ignore(*FIELDS)
    uv = _uv(node, is_image=False, is_projected=False)
    node.finish()
    return Checker(first=(0.0, 0.0, 0.0), second=(1.0, 1.0, 1.0), uv=uv)


def _checker(node: Node, as_number: bool, is_projected: bool) -> Checker:
    first, second = (colour(node, key, default) for key, default in FIELDS.items())
    if as_number:
        # Mitsuba's `eval_1` exchanges the two colours of its `eval` (src/textures/checkerboard.cpp,
        # 3.9.1).
        first, second = (luminance(second),) * 3, (luminance(first),) * 3
    return Checker(
        first=first, second=second, uv=_uv(node, is_image=False, is_projected=is_projected)
    )


def _attribute(node: Node) -> VertexColours:
    name = str(node.properties.get("name", ""))
    if not name.startswith(("vertex_", "face_")):
        raise node.error(f"'name' is '{name}'; expected vertex_... or face_...")
    return VertexColours(scale=node.number("scale", 1.0))


def to_uv(node: Node) -> FloatArray:
    """The map of a texture's coordinates, (3, 3), homogeneous."""
    value = node.take("to_uv")
    if value is None:
        return np.eye(3)
    try:
        m = np.array(value.matrix, np.float64)
    except (AttributeError, TypeError, ValueError):
        raise node.error("'to_uv' is no transform; expected one") from None
    if m.shape == (4, 4):  # of XML; what concerns z is left out, as Mitsuba does
        m = m[np.ix_([0, 1, 3], [0, 1, 3])]
    if m.shape != (3, 3) or not np.isfinite(m).all():
        raise node.error("'to_uv' is not finite; expected a finite transform")
    if np.abs(m[2] - [0.0, 0.0, 1.0]).max() > 0.0:
        raise node.error("'to_uv' is a perspective map; expected an affine one")
    return m


def _uv(node: Node, is_image: bool, is_projected: bool) -> UvMap:
    """The texture's map in our coordinates.  is_image: its v is 0 at the top;  is_projected: so is
    that of the places where it is looked up."""
    m, steps = to_uv(node), node.written("to_uv") or ()
    own = steps[2 if is_projected else 0 : -2 if is_image else len(steps)]
    flips = (FLIP_STEPS if is_projected else ()), (FLIP_STEPS if is_image else ())
    if steps and (*flips[0], *own, *flips[1]) == steps:
        found = _of_steps(own)
        if found is not None:
            return found
    if is_projected:
        m = m @ FLIP
    return uv_map(FLIP @ m if is_image else m)


def _of_steps(steps: Written) -> UvMap | None:
    """A scale, a rotation and a translation, or a matrix alone; None for anything else."""
    found: dict[str, Any] = {}
    order = ["scale", "rotate", "translate"]
    for step in steps:
        if not isinstance(step, Step):
            return None
        if step.kind == "matrix" and len(steps) == 1:
            a, b, _, c, d, e, _, f = step.numbers[:8]
            return UvMap(matrix=((a, b, c), (d, e, f)))
        if step.kind not in order:
            return None
        order = order[order.index(step.kind) + 1 :]
        x, y, z = step.numbers[:3]
        if step.kind == "rotate":
            if (x, y, z) != (0.0, 0.0, 1.0):
                return None
            found["rotate"] = step.numbers[3]
        else:
            found["scale" if step.kind == "scale" else "offset"] = (x, y)
    return UvMap(**found)


def uv_map(m: FloatArray) -> UvMap:
    """The map m (3, 3), homogeneous, as scale, rotation and offset; one that shears as a matrix."""
    a, b = m[:2, 0], m[:2, 1]
    size = float(np.hypot(*a) + np.hypot(*b))
    if abs(float(a @ b)) > TOLERANCE * size**2:
        first, second = m[:2].tolist()
        return UvMap(matrix=(tuple(first), tuple(second)))
    along = a if np.hypot(*a) > 0.0 else np.array([b[1], -b[0]])
    # A turn of at most a right angle: then the scale of u is positive only if it is in XML, too.
    angle = math.degrees(math.atan2(along[1], along[0]))
    sign = 1.0
    if abs(angle) > 90.0:
        angle -= math.copysign(180.0, angle)
        sign = -1.0
    turn = math.radians(angle)
    c, s = math.cos(turn), math.sin(turn)
    values: dict[str, Any] = {
        "scale": (sign * float(np.hypot(*a)), float(c * b[1] - s * b[0])),
        "rotate": angle,
        "offset": (float(m[0, 2]), float(m[1, 2])),
    }
    plain = UvMap()
    return UvMap(**{k: v for k, v in values.items() if v != getattr(plain, k)})
