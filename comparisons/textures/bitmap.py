"""Bitmaps: images as textures, and what other textures say as images."""

from functools import partial
from typing import Any

import numpy as np

from comparisons.geometry import affine
from comparisons.mitsuba.context import TranslationContext, UntranslatableError
from comparisons.mitsuba.files import Files, UnwritableError
from comparisons.mitsuba.node import Node, Reading
from comparisons.mitsuba.second import described_image, reads_image
from comparisons.renderers import NoCounterpartError
from comparisons.renderers.vocabulary import (
    LINEAR,
    NEAREST,
    WRAPS,
    CyclesWriter,
    Data,
    GltfImage,
    GltfUv,
    GltfWriter,
    Params,
    PbrtWriter,
)
from comparisons.textures.product import product
from comparisons.textures.texture import TextureType, Use, grey, to_uv, uv_of
from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.scene import Scene
from reference_rt.textures import Bitmap

FILES = (".exr", ".png", ".jpg", ".jpeg", ".hdr", ".pfm", ".bmp", ".tga")
"""Files that Mitsuba reads, and to the same values as we do."""


def _to_mitsuba(
    texture: Bitmap, name: str, context: TranslationContext, use: Use
) -> dict[str, Any]:
    along_u, along_v = texture.wraps
    if context.files is not None and (along_u != along_v or texture.cutoff is not None):
        raise UntranslatableError("Bitmap with two wraps or a cutoff", "texture")
    if along_u != along_v:
        raise UntranslatableError("Bitmap that is continued otherwise along u than v", "texture")
    as_grey = use.as_number and texture.cutoff is None and context.files is None
    if (name, as_grey) not in context.images:
        context.images[name, as_grey] = (
            in_memory_or_file(texels_of(texture, context), name, context, as_grey)
            if context.files is None
            else _in_file(texture, name, context, context.files)
        )
    m = to_uv(texture.uv, context, use, is_image=True)
    bitmap = lookup(context.images[name, as_grey], texture.filter, along_u, m)
    return bitmap if texture.cutoff is None else product([bitmap], cutoff=texture.cutoff)


def lookup(
    image: dict[str, Any], filter_type: str, wrap: str, to_uv: dict[str, Any]
) -> dict[str, Any]:
    """Mitsuba's bitmap of an image and a map."""
    return {"type": "bitmap", **image, "filter_type": filter_type, "wrap_mode": wrap, **to_uv}


def in_memory_or_file(
    texels: FloatArray, stem: str, context: TranslationContext, as_grey: bool
) -> dict[str, Any]:
    """Linear texels as parameters of Mitsuba's bitmap, never half floats;  stem: of a file's name;
    as_grey: as one channel, in memory."""
    if context.files is not None:
        return {**context.image(stem, texels), "raw": True}
    if as_grey:
        texels = grey(texels)[..., None]
    return {**context.image(stem, texels), "raw": True, "format": "variant"}


def _in_file(
    texture: Bitmap, name: str, context: TranslationContext, files: Files
) -> dict[str, Any]:
    """The texture's own file where Mitsuba reads the same values from it, else one of these."""
    path = context.folder / texture.file
    suffix = path.suffix.lower()
    is_integer = suffix in (".png", ".jpg", ".jpeg", ".bmp", ".tga")
    is_plain = suffix in FILES and (texture.scale, texture.channel) == (1.0, "all")
    if suffix == ".exr":  # of which Mitsuba reads some kinds otherwise, or not at all
        is_plain = is_plain and reads_image(path, texture.encoding, texture.layer)
    if is_plain and (is_integer or texture.encoding not in ("srgb", "radiance")):
        raw = texture.encoding == "raw" or not is_integer
        return {"filename": files.copy(texture.file, "textures", name, "file"), "raw": raw}
    context.note(f"the image {texture.file} is written as linear float32 values")
    return in_memory_or_file(texture.read(context.folder).linear, path.stem, context, False)


def texels_of(texture: Bitmap, scene: Scene | TranslationContext) -> FloatArray:
    """The image (height, width, 3) as the second reader has it."""
    path, ours = scene.folder / texture.file, texture.read(scene.folder).linear
    source = path, texture.encoding, texture.scale, texture.layer
    return described_image(*source, ours, texture.channel)


def _from_mitsuba(reading: Reading, node: Node, use: Use) -> Bitmap:
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
        uv=uv_of(node, use, is_image=True),
    )


def _to_cycles(texture: Bitmap, writing: CyclesWriter) -> Data:
    along_u, along_v = texture.wraps
    if along_u != along_v or texture.cutoff is not None:
        raise NoCounterpartError("a bitmap with two wraps, or with a cutoff")
    return {
        "type": "image",
        "uv": affine.of_uv(texture.uv)[:2].tolist(),
        "file": writing.save(texels_of(texture, writing.scene)),
        "interpolation": {"bilinear": "Linear", "nearest": "Closest"}[texture.filter],
        "extension": {"repeat": "REPEAT", "clamp": "EXTEND", "mirror": "MIRROR"}[along_u],
    }


def _to_gltf(texture: Bitmap, name: str, writing: GltfWriter) -> GltfImage:
    read = partial(texture.read, writing.scene.folder)
    texels = writing.read(read, "textures", name).linear
    kind = LINEAR if texture.filter == "bilinear" else NEAREST
    along_u, along_v = texture.wraps
    sampler = {"magFilter": kind, "minFilter": kind}
    sampler |= {"wrapS": WRAPS[along_u], "wrapT": WRAPS[along_v]}
    uv = GltfUv(affine.of_uv(texture.uv), texture.uv_set)
    return GltfImage(texels, texture.scale, uv, sampler)


def _to_pbrt(texture: Bitmap, name: str, kind: str, writing: PbrtWriter) -> tuple[str, Params]:
    wrap = texture.wraps[0]
    if texture.cutoff is not None or texture.wraps[1] != wrap or wrap == "mirror":
        raise UnwritableError("a bitmap with 'wrap: mirror', two wraps or a cutoff")
    read = partial(texture.read, writing.scene.folder)
    texels = np.asarray(writing.read(read, "textures", name).linear)
    if kind == "float":  # pbrt takes the mean of the channels
        texels = np.repeat(grey(texels)[..., None], 3, axis=-1)
    return "imagemap", {
        **pbrt_uv(texture, 1.0),
        "string filename": writing.image("texture", texels),
        "string filter": {"bilinear": "bilinear", "nearest": "point"}[texture.filter],
        "string wrap": wrap,
    }


def pbrt_uv(texture: Any, factor: float) -> Params:
    """pbrt's parameters of a map.  factor: on the coordinates.  Raises UnwritableError."""
    if texture.uv_set:
        raise UnwritableError(f"a texture with 'uv_set: {texture.uv_set}'")
    (a, b, c), (d, e, f), _ = (factor * affine.of_uv(texture.uv)).tolist()
    if b != 0.0 or d != 0.0:
        raise UnwritableError("a uv map that turns or shears")
    return {"float uscale": a, "float vscale": e, "float udelta": c, "float vdelta": f}


BITMAP = TextureType(
    description=Bitmap,
    to_mitsuba=_to_mitsuba,
    from_mitsuba={"bitmap": _from_mitsuba},
    to_cycles=_to_cycles,
    to_gltf=_to_gltf,
    to_pbrt=_to_pbrt,
)
