"""The contract of a type of textures: what the comparison knows of it, in one file a type; and the
map of texture coordinates, to and from Mitsuba.

Our shapes get the texture coordinates that Mitsuba's have, so that a texture needs no knowledge of
the shape.  Mitsuba's v = 0 is the top row of an image, ours the bottom one: the map of an image
ends with 1 - v.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from comparisons.geometry import affine
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.context import TranslationContext
from comparisons.mitsuba.files import matrix_step
from comparisons.mitsuba.node import Node, Reading
from comparisons.mitsuba.parse import FLIP as FLIP_STEPS
from comparisons.mitsuba.parse import Step, Written
from comparisons.renderers.vocabulary import (
    CyclesWriter,
    Data,
    GltfImage,
    GltfWriter,
    Params,
    PbrtWriter,
)
from reference_rt.core.arrays import FloatArray
from reference_rt.core.vec3 import Vec3, luminance
from reference_rt.textures import Texture
from reference_rt.textures.texture import UvMap


class Use(NamedTuple):
    """What a texture is looked up for.  as_number: its luminance stands for a number;  projected:
    by a light, whose image has v = 0 at the top."""

    as_number: bool = False
    projected: bool = False


class Nested(NamedTuple):
    """In a dictionary of Mitsuba's: the colours of the texture, or the BSDF, with this name."""

    name: str


@dataclass(frozen=True, kw_only=True)
class TextureType:
    """What the comparison knows of a type of textures; None where a renderer has none.

    to_mitsuba: the dictionary of a texture with a name;  from_mitsuba: a texture of an element, by
    Mitsuba's plugin, but for what our own cannot be read from;  to_cycles;  to_gltf: its image;
    to_pbrt: plugin and parameters of a texture with a name, as "rgb" or "float";  to_povray: a
    pigment where x, y are u, v and z is 0.
    """

    description: type[Texture]
    to_mitsuba: Callable[[Any, str, TranslationContext, Use], dict[str, Any]]
    from_mitsuba: Mapping[str, Callable[[Reading, Node, Use], Texture]]
    to_cycles: Callable[[Any, CyclesWriter], Data] | None
    to_gltf: Callable[[Any, str, GltfWriter], GltfImage] | None
    to_pbrt: Callable[[Any, str, str, PbrtWriter], tuple[str, Params]] | None
    to_povray: Callable[[Any], str] | None = None


def grey(texels: FloatArray) -> FloatArray:
    """The luminance (height, width) of linear texels (height, width, 3)."""
    return np.asarray(luminance(Vec3(*np.moveaxis(texels, -1, 0))))


def uv_attribute(uv_set: int) -> str:
    """The name of the attribute of Mitsuba's meshes that has a further set of coordinates."""
    return f"vertex_uv_{uv_set}"


# ---- maps of texture coordinates, to Mitsuba -----------------------------------------------------

FLIP = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 1.0], [0.0, 0.0, 1.0]])
"""The map of (u, v) to (u, 1 - v)."""


def to_uv(uv: UvMap, context: TranslationContext, use: Use, is_image: bool) -> dict[str, Any]:
    """A texture's map as Mitsuba's parameter, none for the identity in a file.  is_image: its v is
    0 at the top."""
    if context.files is not None:
        steps = (*_flip(use.projected), *steps_of(uv), *_flip(is_image))
        return {"to_uv": steps} if steps else {}
    m = FLIP @ affine.of_uv(uv) if is_image else affine.of_uv(uv)
    if use.projected:
        m = np.array(transform_2d(m).matrix, np.float64) @ FLIP
    return {"to_uv": transform_2d(m)}


def transform_2d(matrix: FloatArray) -> Any:
    return mitsuba().ScalarTransform3f(matrix)


def _flip(there: bool) -> tuple[Step, ...]:
    return FLIP_STEPS if there else ()


def steps_of(uv: UvMap) -> tuple[Step, ...]:
    """A map of texture coordinates as steps, none for the identity."""
    if uv.matrix is not None:
        (a, b, c), (d, e, f) = uv.matrix
        rows = np.array([[a, b, 0.0, c], [d, e, 0.0, f], [0.0, 0.0, 1.0, 0.0]])
        return (matrix_step(rows),)
    found = []
    if uv.scale != (1.0, 1.0):
        found.append(Step("scale", (*uv.scale, 1.0)))
    if uv.rotate != 0.0:
        found.append(Step("rotate", (0.0, 0.0, 1.0, uv.rotate)))
    if uv.offset != (0.0, 0.0):
        found.append(Step("translate", (*uv.offset, 0.0)))
    return tuple(found)


# ---- and from Mitsuba ----------------------------------------------------------------------------

TOLERANCE = 1e-6
"""Relative to the map's size: XML has about seven digits, and Mitsuba's scenes are float32."""


def matrix_of(node: Node) -> FloatArray:
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


def uv_of(node: Node, use: Use, is_image: bool) -> UvMap:
    """A texture's map in our coordinates.  is_image: its v is 0 at the top."""
    m, steps = matrix_of(node), node.written("to_uv") or ()
    own = steps[2 if use.projected else 0 : -2 if is_image else len(steps)]
    if steps and (*_flip(use.projected), *own, *_flip(is_image)) == steps:
        found = _of_steps(own)
        if found is not None:
            return found
    if use.projected:
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
