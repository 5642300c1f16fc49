"""Textures -> Mitsuba, in memory and in scene files, and parameters that may be textures."""

from functools import singledispatch
from typing import Any

import numpy as np

from comparisons.geometry import affine
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.context import TranslationContext, UntranslatableError, rgb
from comparisons.mitsuba.files import Files, matrix_step
from comparisons.mitsuba.parse import FLIP as FLIP_STEPS
from comparisons.mitsuba.parse import Step
from comparisons.mitsuba.second import described_image
from reference_rt.core.arrays import FloatArray
from reference_rt.core.vec3 import Vec3, luminance
from reference_rt.textures import Bitmap, Checker, Product, Texture, VertexColours
from reference_rt.textures.texture import UvMap

FLIP = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 1.0], [0.0, 0.0, 1.0]])
"""The map of (u, v) to (u, 1 - v): v = 0 is the top row of Mitsuba's images, the bottom of ours."""

VERTEX_COLOUR, VERTEX_LUMINANCE = "vertex_color", "vertex_luminance"
"""Names of mesh attributes."""


def colour(value: tuple[float, float, float] | str, context: TranslationContext) -> dict[str, Any]:
    """A colour, or the texture with that name.  Raises UntranslatableError, ValueError for a file
    that cannot be used."""
    if isinstance(value, str):
        return translate_texture(context.textures[value], value, context, False)
    return rgb(value)


def projected(
    value: tuple[float, float, float] | str, context: TranslationContext
) -> dict[str, Any]:
    """The same for a light that projects it: Mitsuba's v is 0 at the top of such an image."""
    found = colour(value, context)
    if context.files is not None and found["type"] in ("bitmap", "checkerboard"):
        found["to_uv"] = (*FLIP_STEPS, *found.get("to_uv", ()))
    elif "to_uv" in found:
        found["to_uv"] = _transform(np.array(found["to_uv"].matrix, np.float64) @ FLIP)
    return found


def number(value: float | str, context: TranslationContext) -> float | dict[str, Any]:
    """A number, or the luminance of the texture with that name.

    Mitsuba gets one channel with our luminance: its own weights have other digits (0.212671 for
    0.2126).  Raises as `colour` does.
    """
    if isinstance(value, str):
        return translate_texture(context.textures[value], value, context, True)
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
        four = _image(rows, "checker", context, as_number)
        return _lookup(four, "nearest", "repeat", texture.uv, context)
    places: tuple[Any, Any] = (rgb(first), rgb(second))
    if as_number:
        # Mitsuba's `eval_1` swaps the two colours of its `eval` (3.9.1).
        places = places[::-1]
        if context.files is None:
            places = (float(luminance(Vec3(*second))), float(luminance(Vec3(*first))))
    return {
        "type": "checkerboard",
        "color0": places[0],
        "color1": places[1],
        **_to_uv(texture.uv, context, is_image=False),
    }


@translate_texture.register
def _(texture: Bitmap, name: str, context: TranslationContext, as_number: bool) -> dict[str, Any]:
    along_u, along_v = texture.wraps
    if context.files is not None and (along_u != along_v or texture.cutoff is not None):
        raise UntranslatableError("Bitmap with two wraps or a cutoff", "texture")
    if along_u != along_v:
        raise UntranslatableError("Bitmap that is continued otherwise along u than v", "texture")
    as_grey = as_number and texture.cutoff is None
    key = (name, as_grey and context.files is None)
    if key not in context.images:
        context.images[key] = (
            _image(texels_of(texture, context), name, context, as_grey)
            if context.files is None
            else _file_of(texture, name, context, context.files)
        )
    found = _lookup(context.images[key], texture.filter, along_u, texture.uv, context)
    return found if texture.cutoff is None else product([found], cutoff=texture.cutoff)


def texels_of(texture: Bitmap, context: TranslationContext) -> FloatArray:
    """The image (height, width, 3) as the second reader has it."""
    path, ours = context.folder / texture.file, texture.read(context.folder).linear
    source = path, texture.encoding, texture.scale, texture.layer
    return described_image(*source, ours, texture.channel)


@translate_texture.register
def _(texture: Product, name: str, context: TranslationContext, as_number: bool) -> dict[str, Any]:
    if context.files is not None:
        raise UntranslatableError(texture, "texture")
    return product([colour(of, context) for of in texture.of], texture.factor)


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
    # Files of meshes have no luminance: Mitsuba takes that of the colour.
    in_memory = as_number and context.files is None
    attribute = VERTEX_LUMINANCE if in_memory else VERTEX_COLOUR
    return {"type": "mesh_attribute", "name": attribute, "scale": texture.scale}


# ---- images --------------------------------------------------------------------------------------


IMAGES = (".exr", ".png", ".jpg", ".jpeg", ".hdr", ".pfm", ".bmp", ".tga")
"""Files that Mitsuba reads, and to the same values as we do."""


def _image(
    texels: FloatArray, stem: str, context: TranslationContext, as_number: bool
) -> dict[str, Any]:
    """Linear texels as parameters of a bitmap, which are never half floats."""
    if context.files is not None:
        return {**context.image(stem, texels), "raw": True}
    if as_number:
        texels = np.asarray(luminance(Vec3(*np.moveaxis(texels, -1, 0))))[..., None]
    return {**context.image(stem, texels), "raw": True, "format": "variant"}


def _file_of(
    texture: Bitmap, name: str, context: TranslationContext, files: Files
) -> dict[str, Any]:
    """A texture's own file where Mitsuba reads the same values from it; else one of its values."""
    path = context.folder / texture.file
    suffix = path.suffix.lower()
    is_integer = suffix in (".png", ".jpg", ".jpeg", ".bmp", ".tga")
    is_plain = suffix in IMAGES and (texture.scale, texture.channel) == (1.0, "all")
    if is_plain and (is_integer or texture.encoding not in ("srgb", "radiance")):
        raw = texture.encoding == "raw" or not is_integer
        return {"filename": files.copy(texture.file, "textures", name, "file"), "raw": raw}
    context.note(f"the image {texture.file} is written as linear float32 values")
    return _image(texture.read(context.folder).linear, path.stem, context, False)


def _lookup(
    image: dict[str, Any], filter_type: str, wrap: str, uv: UvMap, context: TranslationContext
) -> dict[str, Any]:
    return {
        "type": "bitmap",
        **image,
        "filter_type": filter_type,
        "wrap_mode": wrap,
        **_to_uv(uv, context, is_image=True),
    }


def _to_uv(uv: UvMap, context: TranslationContext, is_image: bool) -> dict[str, Any]:
    """A texture's map, none for the identity in a file.  is_image: its v is 0 at the top."""
    if context.files is None:
        m = affine.of_uv(uv)
        return {"to_uv": _transform(FLIP @ m if is_image else m)}
    steps = (*steps_of(uv), *(FLIP_STEPS if is_image else ()))
    return {"to_uv": steps} if steps else {}


def _transform(matrix: FloatArray) -> Any:
    return mitsuba().ScalarTransform3f(matrix)


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


def depends_on_uv(texture: Texture) -> bool:
    """Whether the texture depends on a surface's uv."""
    return not isinstance(texture, VertexColours)
