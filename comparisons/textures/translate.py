"""Textures -> Mitsuba, parameters that may be textures, the `TranslationContext`, and the error for
parts of a scene that have no counterpart."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import singledispatch
from pathlib import Path
from typing import Any, Self

import numpy as np

from comparisons.geometry import affine
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.second import described_image
from comparisons.renderers import NoCounterpartError
from reference_rt.core.arrays import FloatArray
from reference_rt.core.vec3 import Vec3, luminance
from reference_rt.materials.material import Material
from reference_rt.rendering.scene import Scene
from reference_rt.textures import Bitmap, Checker, Product, Texture, VertexColours
from reference_rt.textures.texture import UvMap


class UntranslatableError(NoCounterpartError):
    """A part of a scene has no counterpart in Mitsuba."""

    def __init__(self, part: Any, kind: str) -> None:
        name = part if isinstance(part, str) else type(part).__name__
        self.part, self.kind = name, kind
        super().__init__(
            f"the {kind} {name} cannot be compared: comparisons.translator has no "
            "translation for it"
        )


# ----  --------------------------------------------------------------------------------------------


FLIP = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 1.0], [0.0, 0.0, 1.0]])
"""The map of (u, v) to (u, 1 - v): v = 0 is the top row of Mitsuba's images, the bottom of ours."""

VERTEX_COLOUR, VERTEX_LUMINANCE = "vertex_color", "vertex_luminance"
"""Names of mesh attributes."""


@dataclass(frozen=True)
class TranslationContext:
    """The context of a translation: the scene's materials and textures, by name; the folder of its
    files;  has_colours: whether the material belongs to a mesh with vertex colours;  native: use
    Mitsuba's own materials even where our plugins are more exact;  images: cache of Mitsuba's
    bitmaps;  in_file: the texture with a name, as colours or as numbers, in a scene
    file;  None: in memory."""

    materials: Mapping[str, Material]
    textures: Mapping[str, Texture]
    folder: Path
    has_colours: bool = False
    native: bool = False
    images: dict[Any, Any] = field(default_factory=dict)
    in_file: Callable[[str, "TranslationContext", bool], dict[str, Any]] | None = None

    @classmethod
    def of(cls, scene: Scene, native: bool = False) -> Self:
        return cls(scene.materials, scene.textures, scene.folder, native=native)


def rgb(colour: tuple[float, float, float]) -> dict[str, Any]:
    """Linear sRGB, which rgb variants use unchanged."""
    return {"type": "rgb", "value": list(colour)}


def colour(value: tuple[float, float, float] | str, context: TranslationContext) -> dict[str, Any]:
    """A colour, or the texture with that name.  Raises UntranslatableError, ValueError for a file
    that cannot be used."""
    if isinstance(value, str):
        return _translated(value, context, False)
    return rgb(value)


def _translated(name: str, context: TranslationContext, as_number: bool) -> dict[str, Any]:
    if context.in_file is not None:
        return context.in_file(name, context, as_number)
    return translate_texture(context.textures[name], name, context, as_number)


def projected(
    value: tuple[float, float, float] | str, context: TranslationContext
) -> dict[str, Any]:
    """The same for a light that projects it: Mitsuba's v is 0 at the top of such an image."""
    found = colour(value, context)
    if "to_uv" in found:
        found["to_uv"] = _to_uv(np.array(found["to_uv"].matrix, np.float64) @ FLIP)
    return found


def number(value: float | str, context: TranslationContext) -> float | dict[str, Any]:
    """A number, or the luminance of the texture with that name.

    Mitsuba gets one channel with our luminance: its own weights have other digits (0.212671 for
    0.2126).  Raises as `colour` does.
    """
    if isinstance(value, str):
        return _translated(value, context, True)
    return value


@singledispatch
def translate_texture(
    texture: Any, name: str, context: TranslationContext, as_number: bool
) -> dict[str, Any]:
    """A texture's dict, of colours or of numbers.  Raises as `colour` does."""
    raise UntranslatableError(texture, "texture")


@translate_texture.register
def _(texture: Checker, name: str, context: TranslationContext, as_number: bool) -> dict[str, Any]:
    first, second = texture.first, texture.second
    if max(*first, *second) > 1.0:
        # Mitsuba's checkerboard limits its colours to reflectances; an image of four texels is the
        # same texture.
        rows = np.array([[second, first], [first, second]])
        return _lookup(_image(rows, as_number), "nearest", "repeat", texture.uv)
    places: tuple[Any, Any] = (rgb(first), rgb(second))
    if as_number:
        # Mitsuba's `eval_1` swaps the two colours of its `eval` (3.9.1).
        places = (float(luminance(Vec3(*second))), float(luminance(Vec3(*first))))
    return {
        "type": "checkerboard",
        "color0": places[0],
        "color1": places[1],
        "to_uv": _to_uv(affine.of_uv(texture.uv)),
    }


@translate_texture.register
def _(texture: Bitmap, name: str, context: TranslationContext, as_number: bool) -> dict[str, Any]:
    along_u, along_v = texture.wraps
    if along_u != along_v:
        raise UntranslatableError("Bitmap that is continued otherwise along u than v", "texture")
    as_grey = as_number and texture.cutoff is None
    key = (name, as_grey)
    if key not in context.images:
        context.images[key] = _image(texels_of(texture, context), as_grey)
    found = _lookup(context.images[key], texture.filter, along_u, texture.uv)
    return found if texture.cutoff is None else product([found], cutoff=texture.cutoff)


def texels_of(texture: Bitmap, context: TranslationContext) -> FloatArray:
    """The image (height, width, 3) as the second reader has it."""
    path, ours = context.folder / texture.file, texture.read(context.folder).linear
    source = path, texture.encoding, texture.scale, texture.layer
    return described_image(*source, ours, texture.channel)


@translate_texture.register
def _(texture: Product, name: str, context: TranslationContext, as_number: bool) -> dict[str, Any]:
    return product([_translated(of, context, False) for of in texture.of], texture.factor)


def product(
    of: list[dict[str, Any]],
    factor: tuple[float, float, float] = (1.0, 1.0, 1.0),
    cutoff: float = 0.0,
    follow_v: bool = False,
) -> dict[str, Any]:
    """Our plugin `comparisons.mitsuba.plugins.materials`, of colours and of numbers."""
    nested = {f"of_{k}": part for k, part in enumerate(of)}
    factors = {f"factor_{k}": value for k, value in enumerate(factor)}
    options = {"cutoff": cutoff, "follow_v": follow_v}
    return {"type": "texture_product", **options, **factors, **nested}


@translate_texture.register
def _(
    texture: VertexColours, name: str, context: TranslationContext, as_number: bool
) -> dict[str, Any]:
    if not context.has_colours:
        if as_number:
            return {"type": "uniform", "value": float(luminance(Vec3(*texture.without)))}
        return rgb(texture.without)
    attribute = VERTEX_LUMINANCE if as_number else VERTEX_COLOUR
    return {"type": "mesh_attribute", "name": attribute, "scale": texture.scale}


def _image(texels: FloatArray, as_number: bool) -> Any:
    if as_number:
        texels = np.asarray(luminance(Vec3(*np.moveaxis(texels, -1, 0))))[..., None]
    return mitsuba().Bitmap(np.ascontiguousarray(texels, dtype=np.float32))


def _lookup(image: Any, filter_type: str, wrap: str, uv: UvMap) -> dict[str, Any]:
    return {
        "type": "bitmap",
        "bitmap": image,
        "raw": True,
        "format": "variant",  # never half floats
        "filter_type": filter_type,
        "wrap_mode": wrap,
        "to_uv": _to_uv(FLIP @ affine.of_uv(uv)),
    }


def _to_uv(matrix: FloatArray) -> Any:
    return mitsuba().ScalarTransform3f(matrix)


def depends_on_uv(texture: Texture) -> bool:
    """Whether the texture depends on a surface's uv."""
    return not isinstance(texture, VertexColours)
