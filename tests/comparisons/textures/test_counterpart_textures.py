"""Textures and environment maps against their counterparts in Mitsuba."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from comparisons.lights import translate_light
from comparisons.materials.translate import translate_material
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.context import TranslationContext, UntranslatableError
from comparisons.mitsuba.scene import for_rays
from comparisons.textures.texture import Use
from comparisons.textures.translate import translate_texture
from comparisons.translator import load
from reference_rt.core.model import types_of
from reference_rt.core.vec3 import Vec3, luminance
from reference_rt.lights import EnvironmentMap
from reference_rt.lights.emitters import environment_map
from reference_rt.materials import AnyMaterial, Diffuse, NormalMap
from reference_rt.materials.material import Material
from reference_rt.rendering.scene import Scene
from reference_rt.scene.build import build_tables
from reference_rt.textures import At, Bitmap, Checker, Product, Texture, VertexColours
from reference_rt.textures.lookup import lookup, lookup_gradient
from reference_rt.textures.texture import MayBeTexture, UvMap

TURNED = UvMap(scale=(1.3, 0.7), rotate=25.0, offset=(0.1, -0.2))

TEXTURES: tuple[Texture, ...] = (
    Checker(first=(0.1, 0.2, 0.3), second=(0.9, 0.7, 0.4), uv=TURNED),
    Checker(first=(1.0, 2.0, 3.0), second=(9.0, 7.0, 4.0), uv=TURNED),
    *(
        Bitmap(file="colours.png", filter=filter_type, wrap=wrap, uv=TURNED)
        for filter_type in ("bilinear", "nearest")
        for wrap in ("repeat", "clamp", "mirror")
    ),
    Bitmap(file="colours.png", encoding="raw"),
    Bitmap(file="colours.png", channel="green"),
    Bitmap(file="colours.png", cutoff=0.3, uv=TURNED),
    Product(of=("image", "checks"), factor=(0.5, 2.0, 1.0)),
    # Of a surface without vertex colours, which are one colour there.
    VertexColours(without=(0.3, 0.2, 0.9)),
    Product(of=("own", "image", "own"), factor=(0.5, 2.0, 1.0)),
)


def interaction(u: Any, v: Any) -> Any:
    mi = mitsuba()
    import drjit as dr  # after the choice of its LLVM

    si = dr.zeros(mi.SurfaceInteraction3f)
    si.t, si.uv = 1.0, mi.Point2f(u, v)
    return si


@pytest.mark.parametrize("texture", TEXTURES)
def test_textures(texture: Texture, image_folder: Path) -> None:
    own = VertexColours(without=(0.3, 0.2, 0.9))
    others = {"image": Bitmap(file="colours.png"), "checks": Checker(uv=TURNED), "own": own}
    scene = Scene(textures={"t": texture, **others})
    scene._folder = image_folder
    textures = build_tables(scene).textures
    context = TranslationContext.of(scene)
    rng = np.random.default_rng(1)
    u, v = rng.uniform(-2.0, 2.0, (2, 500)).astype(np.float32).astype(np.float64)
    at = [
        At(textures, a, b, Vec3(-1.0, -1.0, -1.0))
        for a, b in zip(u.tolist(), v.tolist(), strict=True)
    ]
    ours = np.array([tuple(lookup(0, a)) for a in at])
    load_dict = mitsuba().load_dict
    colours = load_dict(translate_texture(texture, "t", context, Use()))
    numbers = load_dict(translate_texture(texture, "t", context, Use(as_number=True)))
    theirs = for_rays(lambda a, b: (colours.eval(interaction(a, b)),), u, v)[0]
    one = for_rays(lambda a, b: (numbers.eval_1(interaction(a, b)),), u, v)[0]
    # uv round by 2^-23 each; from one texel to the next is a step of 1 at most, over 1/24.  An
    # edge may lie in between: none does for this seed.
    bound = 24.0 * 8.0 * 2.0**-23 * max(1.0, float(ours.max()))
    np.testing.assert_allclose(theirs, ours, rtol=0.0, atol=bound)
    grey = np.array([luminance(Vec3(*c)) for c in ours])
    np.testing.assert_allclose(one, grey, rtol=0.0, atol=bound)
    if isinstance(texture, Bitmap) and texture.filter == "bilinear" and texture.uv == UvMap():
        gradient = for_rays(lambda a, b: (numbers.eval_1_grad(interaction(a, b)),), u, v)[0]
        slopes = np.array([lookup_gradient(0, a) for a in at])
        np.testing.assert_allclose(gradient, slopes, rtol=0.0, atol=24.0 * bound)


MESH = """
film: {width: 4, height: 4}
textures: {t: TEXTURE, image: {type: bitmap, file: colours.png}, own: {type: vertex_colours}}
materials: {base: {type: diffuse}, m: MATERIAL}
shapes:
  - {type: mesh, vertices: [[-1, -1, 0], [1, -1, 0], [0, 1, 0]], faces: [[0, 1, 2]],
     uv: [[0, 0], [1, 0], [0.5, 1]], material: m}
  - {type: mesh, vertices: [[-1, -1, 1], [1, -1, 1], [0, 1, 1]], faces: [[0, 1, 2]],
     uv: [[0, 0], [1, 0], [0.5, 1]], colours: [[0.9, 0, 0], [0, 0.9, 0], [0, 0, 0.9]], material: m}
"""
KINDS = {
    "bitmap": "{type: bitmap, file: colours.png}",
    "checker": "{type: checker}",
    "vertex_colours": "{type: vertex_colours}",
    "product": "{type: product, of: [image, own], factor: [0.5, 0.4, 1]}",
}
REQUIRED = {
    "conductor": {"eta": 1, "k": 2},
    "rough_conductor": {"eta": 1, "k": 2},
    "phong": {"diffuse": 0.5},
}
"""Other fields that a material must have, by type."""

REFUSED = {("normal_map", "vertex_colours"), ("normal_map", "checker"), ("normal_map", "product")}
"""What Mitsuba lacks (docs/verdict.md)."""


def slots() -> list[tuple[type[Material], str]]:
    """All fields of materials that may name a texture."""
    return [
        (cls, field)
        for cls in types_of(AnyMaterial)
        for field, info in cls.model_fields.items()
        if any(isinstance(data, MayBeTexture) for data in info.metadata)
    ]


@pytest.mark.cases(20)
@pytest.mark.parametrize(("cls", "field"), slots())
def test_every_texture_in_every_material(
    cls: type[Material], field: str, image_folder: Path
) -> None:
    """Mitsuba loads the scene, or it is said to be not comparable."""
    kind = cls.model_fields["type"].default
    bases = {name: "base" for name in ("base", "first", "second") if name in cls.model_fields}
    material = {"type": kind, **REQUIRED.get(kind, {}), **bases, field: "t"}
    integrator = "whitted" if kind == "phong" else "path"  # the others refuse textbook Phong
    for texture, described in KINDS.items():
        text = MESH.replace("TEXTURE", described).replace("MATERIAL", json.dumps(material))
        scene = Scene.parse(f"{text}integrator: {{type: {integrator}}}", folder=image_folder)
        if (kind, texture) in REFUSED:
            with pytest.raises(UntranslatableError):
                load(scene)
        else:
            assert load(scene).mi_shapes


def test_the_scale_of_a_normal_map(image_folder: Path) -> None:
    """It is in the image that Mitsuba gets."""
    image = Bitmap(file="colours.png", encoding="raw")
    context = TranslationContext({"m": Diffuse()}, {"t": image}, image_folder)
    found = translate_material(NormalMap(base="m", normals="t", scale=3.0), context)
    texels = np.array(found["normalmap"]["bitmap"])
    expected = (2.0 * image.read(image_folder).linear - 1.0) * (3.0, 3.0, 1.0)
    np.testing.assert_allclose(2.0 * texels - 1.0, expected, rtol=0.0, atol=8 * 2.0**-24)


def test_normal_maps_that_follow_v(image_folder: Path) -> None:
    """Mitsuba gets the image with the other green where uv is mirrored."""
    image = Bitmap(file="colours.png", encoding="raw")
    context = TranslationContext({"m": Diffuse()}, {"t": image}, image_folder)
    mi = mitsuba()
    u, v = np.random.default_rng(1).uniform(0.0, 1.0, (2, 50))

    def seen(follow_v: bool, side: float) -> Any:
        material = NormalMap(base="m", normals="t", follow_v=follow_v)
        texture = mi.load_dict(translate_material(material, context)["normalmap"])

        def look(u: Any, v: Any) -> tuple[Any, ...]:
            si = interaction(u, v)
            si.dp_du, si.dp_dv = mi.Vector3f(1.0, 0.0, 0.0), mi.Vector3f(0.2, side, 0.0)
            si.sh_frame = mi.Frame3f(mi.Normal3f(0.0, 0.0, 1.0))
            return (texture.eval_3(si),)

        return for_rays(look, u, v)[0]

    plain = seen(False, -1.0)
    np.testing.assert_array_equal(seen(True, 1.0), plain)
    turned = np.where([False, True, False], 1.0 - plain, plain)
    np.testing.assert_allclose(seen(True, -1.0), turned, rtol=0.0, atol=2.0**-23)


def test_vertex_colours_where_there_are_none() -> None:
    texture = VertexColours(without=(0.1, 0.2, 0.3))
    context = TranslationContext({}, {"t": texture}, Path())
    assert translate_texture(texture, "t", context, Use())["value"] == [0.1, 0.2, 0.3]


@pytest.mark.parametrize(
    "turn", ["[]", "[{rotate: {axis: [0.3, 1, 0.1], degrees: 37}}]", "[{scale: [-1, 1, 1]}]"]
)
def test_environment_maps(turn: str, image_folder: Path) -> None:
    scene = Scene.parse(
        f"lights: [{{type: environment_map, file: sky.png, scale: 2.5, transform: {turn}}}]",
        folder=image_folder,
    )
    light = scene.lights[0]
    assert isinstance(light, EnvironmentMap)
    table = light.tabulate(image_folder)
    rng = np.random.default_rng(2)
    d = rng.normal(size=(500, 3))
    d = (d / np.linalg.norm(d, axis=1)[:, None]).astype(np.float32).astype(np.float64)
    ours = np.array([tuple(environment_map.radiance(table, Vec3(*row))) for row in d.tolist()])
    emitter = mitsuba().load_dict(translate_light(light, TranslationContext.of(scene)))

    def radiance(towards: Any) -> tuple[Any, ...]:
        si = interaction(0.0, 0.0)
        si.wi = -towards
        return (emitter.eval(si),)

    theirs = for_rays(radiance, d)[0]
    # A direction's 4 roundings, over a texel of 2 pi / 32, near the poles over its sine.
    sine = np.hypot(d[:, 0], d[:, 2])
    bound = 32.0 * 8.0 * 2.0**-24 * table.texels.max() / np.maximum(sine, 0.05)
    assert (np.abs(theirs - ours).max(axis=1) < bound).all()
