"""Checkers: Mitsuba's checkerboard, or an image of four texels where its colours are too bright."""

from typing import Any

import numpy as np

from comparisons.geometry import affine
from comparisons.mitsuba.colours import SPECTRA, colour
from comparisons.mitsuba.colours import luminance as luminance_of
from comparisons.mitsuba.context import TranslationContext, rgb
from comparisons.mitsuba.node import Node, Reading
from comparisons.renderers import NoCounterpartError
from comparisons.renderers.vocabulary import (
    NEAREST,
    WRAPS,
    CyclesWriter,
    Data,
    GltfImage,
    GltfUv,
    GltfWriter,
    Params,
    PbrtWriter,
    plain_rgb,
    pov_vector,
)
from comparisons.textures.bitmap import in_memory_or_file, lookup, pbrt_uv
from comparisons.textures.texture import TextureType, Use, to_uv, uv_of
from reference_rt.core.vec3 import Vec3, luminance
from reference_rt.textures import Checker

FIELDS = {"color0": 0.4, "color1": 0.2}
"""The fields of a checkerboard, and Mitsuba's defaults."""


def _to_mitsuba(
    texture: Checker, name: str, context: TranslationContext, use: Use
) -> dict[str, Any]:
    first, second = texture.first, texture.second
    if max(*first, *second) > 1.0:
        # Mitsuba's checkerboard limits its colours to reflectances; an image of four texels is the
        # same texture.
        four = in_memory_or_file(_texels(texture), "checker", context, use.as_number)
        return lookup(four, "nearest", "repeat", to_uv(texture.uv, context, use, is_image=True))
    places: tuple[Any, Any] = (rgb(first), rgb(second))
    if use.as_number:
        # Mitsuba's `eval_1` swaps the two colours of its `eval` (3.9.1).
        places = (rgb(second), rgb(first))
        if context.files is None:
            places = (float(luminance(Vec3(*second))), float(luminance(Vec3(*first))))
    fields = dict(zip(FIELDS, places, strict=True))
    return {"type": "checkerboard", **fields, **to_uv(texture.uv, context, use, is_image=False)}


def _texels(texture: Checker) -> Any:
    first, second = texture.first, texture.second
    return np.array([[second, first], [first, second]])


def _from_mitsuba(reading: Reading, node: Node, use: Use) -> Checker:
    first, second = (colour(node, key, default) for key, default in FIELDS.items())
    if use.as_number:
        # Mitsuba's `eval_1` exchanges the two colours of its `eval` (src/textures/checkerboard.cpp,
        # 3.9.1).
        first, second = (luminance_of(second),) * 3, (luminance_of(first),) * 3
    return Checker(first=first, second=second, uv=uv_of(node, use, is_image=False))


def is_checker_of_textures(node: Node) -> bool:
    return node.plugin == "checkerboard" and any(
        child.plugin not in SPECTRA for child in node.clone().children("Texture")
    )


def fields_of(node: Node) -> Checker:
    """0 in the fields `color0` of a checkerboard, 1 in the others."""
    node.ignore(*FIELDS)
    uv = uv_of(node, Use(), is_image=False)
    node.finish()
    return Checker(first=(0.0, 0.0, 0.0), second=(1.0, 1.0, 1.0), uv=uv)


def _to_cycles(texture: Checker, writing: CyclesWriter) -> Data:
    uv = affine.of_uv(texture.uv)[:2].tolist()
    colours = {"first": plain_rgb(texture.first), "second": plain_rgb(texture.second)}
    return {"type": "checker", "uv": uv, **colours}


def _to_gltf(texture: Checker, name: str, writing: GltfWriter) -> GltfImage:
    texels = _texels(texture)
    sampler = {"magFilter": NEAREST, "minFilter": NEAREST}
    sampler |= {"wrapS": WRAPS["repeat"], "wrapT": WRAPS["repeat"]}
    uv = GltfUv(affine.of_uv(texture.uv), texture.uv_set)
    return GltfImage(texels, float(texels.max()) or 1.0, uv, sampler)


def _to_pbrt(texture: Checker, name: str, kind: str, writing: PbrtWriter) -> tuple[str, Params]:
    """pbrt's fields have side 1, ours 1/2."""
    pair: tuple[Any, ...] = (texture.first, texture.second)
    if kind == "float":
        pair = tuple(float(luminance(Vec3(*one))) for one in pair)
    colours = {f"{kind} tex{k}": value for k, value in enumerate(pair, 1)}
    return "checkerboard", {**pbrt_uv(texture, 2.0), **colours}


def _to_povray(texture: Checker) -> str:
    """POV-Ray's fields have side 1, ours 1/2; the plane z = 0 is in the middle of a layer."""
    if abs(np.linalg.det(affine.of_uv(texture.uv))) == 0.0:
        raise NoCounterpartError("a texture that is one line")
    first, second = (f"rgb {pov_vector(c)}" for c in (texture.first, texture.second))
    (a, b, c), (d, e, f), _ = np.linalg.inv(affine.of_uv(texture.uv))
    m = pov_vector([a, d, 0, b, e, 0, 0, 0, 1, c, f, 0])
    return f"checker {first}, {second} translate <0,0,-0.5> scale <0.5,0.5,1> matrix {m}"


CHECKER = TextureType(
    description=Checker,
    to_mitsuba=_to_mitsuba,
    from_mitsuba={"checkerboard": _from_mitsuba},
    to_cycles=_to_cycles,
    to_gltf=_to_gltf,
    to_pbrt=_to_pbrt,
    to_povray=_to_povray,
)
