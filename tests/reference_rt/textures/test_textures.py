"""Textures: closed forms of every kind, and the same bits compiled."""

import math

import numpy as np
import pytest
from PIL import Image
from scipy import ndimage

import reference_rt as rt
from reference_rt.core.vec3 import Vec3, luminance
from reference_rt.scene.build import build_tables
from reference_rt.textures import (
    AnyTexture,
    At,
    Bitmap,
    Checker,
    Palette,
    VertexColours,
    colour_at,
    number_at,
)
from reference_rt.textures.image_file import linear
from reference_rt.textures.lookup import lookup, lookup_gradient
from reference_rt.textures.texture import UvMap

WIDTH, HEIGHT = 7, 5
IMAGE = np.random.default_rng(14).integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8)
NO_COLOUR = Vec3(-1.0, -1.0, -1.0)


def tables_of(tmp_path, **textures: AnyTexture):
    """The tables of these textures, in this order; `image.png` is IMAGE."""
    Image.fromarray(IMAGE).save(tmp_path / "image.png")
    (tmp_path / "empty.yaml").write_text("{}")
    scene = rt.Scene.load(tmp_path / "empty.yaml").changed(textures=textures)
    return build_tables(scene).textures


def raw(filter="bilinear", wrap="repeat", **fields):  # noqa: A002
    return Bitmap(file="image.png", encoding="raw", filter=filter, wrap=wrap, **fields)


def ask(textures, u, v, k=0, colour=NO_COLOUR):
    with np.errstate(all="ignore"):  # as `render` does: infinity times 0
        return np.array(lookup(k, At(textures, float(u), float(v), colour)))


# ---- bitmap -------------------------------------------------------------------------------------


@pytest.mark.parametrize("filtering", ["bilinear", "nearest"])
@pytest.mark.parametrize("wrap", ["repeat", "clamp", "mirror"])
def test_texels_are_met_at_their_middles(tmp_path, filtering, wrap):
    textures = tables_of(tmp_path, image=raw(filtering, wrap))
    for y in range(HEIGHT):
        for x in range(WIDTH):
            found = ask(textures, (x + 0.5) / WIDTH, 1 - (y + 0.5) / HEIGHT)
            # The place between texels is off by the roundings of u, 1 - v and their products.
            assert np.allclose(found, IMAGE[y, x] / 255, rtol=0, atol=16 * 2.0**-53)


@pytest.mark.parametrize(
    ("wrap", "mode"), [("repeat", "grid-wrap"), ("clamp", "nearest"), ("mirror", "reflect")]
)
def test_bilinear_and_nearest_against_scipy(tmp_path, wrap, mode):
    """Inside and far outside of the image, left and below too."""
    textures = tables_of(tmp_path, smooth=raw("bilinear", wrap), sharp=raw("nearest", wrap))
    rng = np.random.default_rng(15)
    u, v = rng.uniform(-2.9, 3.9, (2, 400))
    for k, order in ((0, 1), (1, 0)):
        found = np.array([ask(textures, a, b, k) for a, b in zip(u, v, strict=True)])
        at = np.stack([(1 - v) * HEIGHT - 0.5, u * WIDTH - 0.5])
        expected = np.stack(
            [
                ndimage.map_coordinates(IMAGE[..., c] / 255.0, at, order=order, mode=mode)
                for c in range(3)
            ],
            axis=-1,
        )
        # Places up to 28 texels away round by 28 times 2^-53, a few times on both sides.
        assert np.allclose(found, expected, rtol=0, atol=1e-13)


def test_wraps_written_out(tmp_path):
    """The columns that stand at -8 to 14 of seven."""
    textures = tables_of(
        tmp_path, a=raw("nearest", "repeat"), b=raw("nearest", "clamp"), c=raw("nearest", "mirror")
    )
    columns = (
        [6, *range(7), *range(7), *range(7), 0],
        [0] * 8 + [0, 1, 2, 3, 4, 5, 6] + [6] * 8,
        [6, *reversed(range(7)), *range(7), *reversed(range(7)), 0],
    )
    for k, wanted in enumerate(columns):
        for x, column in zip(range(-8, 15), wanted, strict=True):
            found = ask(textures, (x + 0.5) / WIDTH, 1 - 1.5 / HEIGHT, k)
            assert np.array_equal(found, IMAGE[1, column] / 255), (k, x)


def test_each_axis_has_its_own_wrap(tmp_path):
    """Along u as with `repeat`, along v as with `mirror`."""
    textures = tables_of(
        tmp_path, both=raw("nearest", ("repeat", "mirror")), mirrored=raw("nearest", "mirror")
    )
    for u, v in ((-0.3, 1.3), (1.6, -0.2), (2.1, 2.7)):
        assert np.array_equal(ask(textures, u, v, 0), ask(textures, u % 1.0, v, 1))


def test_channels(tmp_path):
    """Of colours, which are decoded, and of opacity, which is not, and is 1 where there is none."""
    tables_of(tmp_path)  # writes image.png
    alpha = IMAGE[..., 0] ^ 77
    Image.fromarray(np.dstack([IMAGE, alpha])).save(tmp_path / "rgba.png")
    Image.fromarray(np.dstack([IMAGE[..., 1], alpha])).save(tmp_path / "grey.png")
    expected = [*np.moveaxis(IMAGE, -1, 0), alpha]
    for k, channel in enumerate(("red", "green", "blue", "alpha")):
        rgba = Bitmap(file="rgba.png", channel=channel).read(tmp_path).linear
        plain = Bitmap(file="rgba.png", encoding="raw", channel=channel).read(tmp_path).linear
        assert np.array_equal(plain, np.repeat(expected[k][..., None] / 255, 3, axis=2))
        assert np.array_equal(rgba, plain if channel == "alpha" else linear(plain))
        grey = Bitmap(file="grey.png", encoding="raw", channel=channel).read(tmp_path).linear
        own = alpha if channel == "alpha" else IMAGE[..., 1]
        assert np.array_equal(grey[..., 2], own / 255)
    assert np.all(Bitmap(file="image.png", channel="alpha", scale=0.5).read(tmp_path).linear == 0.5)


def test_a_cutoff_is_after_the_filter(tmp_path):
    textures = tables_of(tmp_path, smooth=raw(scale=2.0), sharp=raw(scale=2.0, cutoff=0.9))
    for u, v in np.random.default_rng(20).uniform(0, 1, (50, 2)):
        assert np.array_equal(ask(textures, u, v, 1), ask(textures, u, v, 0) >= 0.9)
    assert lookup_gradient(1, At(textures, 0.3, 0.3, NO_COLOUR)) == (0.0, 0.0)


def test_products(tmp_path):
    textures = tables_of(
        tmp_path,
        lit=rt.Product(of=("image", "own"), factor=(2.0, 0.5, 1.0)),
        image=raw(uv=UvMap(scale=3.0)),
        own=VertexColours(),
        one=rt.Product(of=("own",)),
    )
    colour = Vec3(0.25, 0.5, 1.0)
    for u, v in np.random.default_rng(21).uniform(-1, 2, (20, 2)):
        image = ask(textures, u, v, 1)
        assert np.array_equal(ask(textures, u, v, 0, colour), image * (0.5, 0.25, 1.0))
        assert np.array_equal(ask(textures, u, v, 3, colour), colour)


def test_the_greatest_of_a_product_counts():
    checks = Checker(first=0.8, second=0.1)

    def scene(factor):
        bright = rt.Product(of=("a", "b"), factor=factor)
        textures = {"c": bright, "a": checks, "b": checks}
        return rt.Scene(textures=textures, materials={"m": rt.Diffuse(reflectance="c")})

    assert build_tables(scene(1.5))  # 1.5 * 0.8 * 0.8 = 0.96
    with pytest.raises(rt.SceneError, match=r"'c' has values up to 1\.024; expected at"):
        build_tables(scene(1.6))


def test_what_a_product_may_name():
    one = rt.Product(of=("a",))
    with pytest.raises(rt.SceneError, match=r"textures.b.of\[0\]: 'c' is a product itself"):
        rt.Scene(textures={"a": Checker(), "c": one, "b": rt.Product(of=("c",))})
    with pytest.raises(rt.SceneError, match=r"textures.c.of\[0\]: there is no texture 'a'"):
        rt.Scene(textures={"c": one})


def test_the_top_row_is_at_v_one(tmp_path):
    textures = tables_of(tmp_path, image=raw("nearest"))
    assert np.array_equal(ask(textures, 0.001, 0.999), IMAGE[0, 0] / 255)
    assert np.array_equal(ask(textures, 0.999, 0.001), IMAGE[-1, -1] / 255)


def test_two_images_in_one_table(tmp_path):
    other = 255 - IMAGE[:2, :3]
    Image.fromarray(other).save(tmp_path / "other.png")
    textures = tables_of(
        tmp_path,
        a=raw("nearest"),
        b=Bitmap(file="other.png", encoding="raw", filter="nearest"),
        c=raw("nearest", "clamp"),
    )
    assert np.array_equal(ask(textures, 0.4, 0.9, 1), other[0, 1] / 255)
    assert np.array_equal(ask(textures, 0.99, 0.01, 2), IMAGE[-1, -1] / 255)


def test_one_texel(tmp_path):
    Image.new("RGB", (1, 1), (51, 102, 255)).save(tmp_path / "one.png")
    for wrap in ("repeat", "clamp", "mirror"):
        for filtering in ("bilinear", "nearest"):
            one = Bitmap(file="one.png", encoding="raw", wrap=wrap, filter=filtering)
            textures = tables_of(tmp_path, one=one)
            for u, v in ((0.1, 0.9), (-3.3, 12.2), (0.0, 1.0)):
                # (1 - x) a + x a rounds.
                assert np.allclose(ask(textures, u, v), (0.2, 0.4, 1.0), rtol=4e-16, atol=0)


@pytest.mark.parametrize("far", [1e14 + 0.3, 1e15, -1e16, 1e300, -1e308, math.inf, math.nan])
@pytest.mark.parametrize("filtering", ["bilinear", "nearest"])
def test_coordinates_beyond_reason_give_colours_of_the_image(tmp_path, far, filtering):
    textures = tables_of(tmp_path, image=raw(filtering), checks=Checker())
    for u, v in ((far, 0.2), (0.2, far), (far, far)):
        found = ask(textures, u, v)
        assert np.isfinite(found).all()
        assert (found >= IMAGE.min() / 255).all()
        assert (found <= IMAGE.max() / 255 * (1 + 1e-15)).all()
        assert ask(textures, u, v, 1)[0] in (0.4, 0.2)


def test_gradient_is_the_difference_of_what_is_looked_up(tmp_path):
    """Inside a patch luminance is bilinear: along u or v alone, differences are exact but for
    rounding, also under a map."""
    turned = UvMap(scale=(1.5, -0.75), rotate=30.0, offset=(0.2, 0.7))
    textures = tables_of(tmp_path, image=raw(uv=turned), sharp=raw("nearest"), checks=Checker())
    straight = tables_of(tmp_path, image=raw())
    rng = np.random.default_rng(16)

    def light(table, u, v):
        return luminance(lookup(0, At(table, u, v, NO_COLOUR)))

    step = 1e-4
    checked = 0
    for u, v in rng.uniform(-1.0, 2.0, (200, 2)):
        x, y = u * WIDTH - 0.5, (1 - v) * HEIGHT - 0.5
        if min(x % 1, 1 - x % 1, y % 1, 1 - y % 1) < 10 * step:
            continue  # the slope jumps there
        checked += 1
        at = At(straight, u, v, NO_COLOUR)
        by_u = (light(straight, u + step, v) - light(straight, u - step, v)) / (2 * step)
        by_v = (light(straight, u, v + step) - light(straight, u, v - step)) / (2 * step)
        # Rounding of luminance, below 2^-52, over the step, and of places, times slopes up to 7.
        assert lookup_gradient(0, at) == pytest.approx((by_u, by_v), rel=0, abs=1e-10)
        m = turned.coefficients()
        there = m[0] * u + m[1] * v + m[2], m[3] * u + m[4] * v + m[5]
        along = lookup_gradient(0, At(straight, *there, NO_COLOUR))
        expected = (m[0] * along[0] + m[3] * along[1], m[1] * along[0] + m[4] * along[1])
        assert lookup_gradient(0, At(textures, u, v, NO_COLOUR)) == pytest.approx(expected)
        assert lookup_gradient(1, At(textures, u, v, NO_COLOUR)) == (0.0, 0.0)
        assert lookup_gradient(2, At(textures, u, v, NO_COLOUR)) == (0.0, 0.0)
    assert checked > 150


# ---- checker, vertex colours, maps --------------------------------------------------------------


def test_checker(tmp_path):
    textures = tables_of(tmp_path, checks=Checker(first=(0.9, 0.8, 0.7), second=0.1))
    for i in range(-4, 5):
        for j in range(-4, 5):
            found = ask(textures, i / 2 + 0.25, j / 2 + 0.25)
            assert np.array_equal(found, (0.9, 0.8, 0.7) if (i + j) % 2 == 0 else (0.1,) * 3)
    # Squares are closed below and open above.
    assert ask(textures, 0.0, 0.0)[0] == ask(textures, 0.5, 0.5)[0] == 0.9
    assert ask(textures, np.nextafter(0.5, 0), 0.5)[0] == 0.1
    assert ask(textures, -(2.0**-1074), 0.0)[0] in (0.9, 0.1)


def test_vertex_colours(tmp_path):
    textures = tables_of(tmp_path, own=VertexColours(without=(0.1, 0.2, 0.3)))
    assert ask(textures, 0.3, 0.3).tolist() == [0.1, 0.2, 0.3]
    assert ask(textures, 0.3, 0.3, colour=Vec3(0.0, 0.5, 1.0)).tolist() == [0.0, 0.5, 1.0]


def test_vertex_colours_of_a_mesh(tmp_path):
    """Interpolated over a triangle, through a whole render; a sphere has those of `without`."""
    (tmp_path / "one.ply").write_text(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
        "property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
        "-1 -1 0 255 0 0\n1 -1 0 0 255 0\n-1 1 0 0 0 255\n3 0 1 2\n"
    )
    (tmp_path / "scene.yaml").write_text(
        "camera: {type: orthographic, eye: [0, 0, 5], width: 2}\n"
        "film: {width: 16, height: 16, layers: [albedo]}\n"
        "sampler: {type: grid, spp: 1}\n"
        "integrator: {type: whitted}\n"
        "textures: {own: {type: vertex_colours, without: [0.1, 0.2, 0.3]}}\n"
        "materials: {paint: {type: diffuse, reflectance: own}}\n"
        "shapes:\n"
        "  - {type: mesh, file: one.ply, material: paint}\n"
        "  - {type: sphere, center: [0.7, 0.7, 0], radius: 0.2, material: paint}\n"
    )
    scene = rt.Scene.load(tmp_path / "scene.yaml")
    albedo = rt.render(scene).layers["albedo"]
    cast = rt.render(scene.changed(integrator=rt.RayCast(), sampler=None)).colour
    assert np.array_equal(albedo, cast)
    y, x = 15, 3  # the middle of the pixel: x = -1 + 3.5/8, y = -1 + 0.5/8
    b1, b2 = 3.5 / 16, 0.5 / 16
    assert albedo[y, x] == pytest.approx((1 - b1 - b2, b1, b2), rel=1e-14)
    assert albedo[2, 13].tolist() == [0.1, 0.2, 0.3]
    assert albedo[0, 15].tolist() == [0.0, 0.0, 0.0]


def test_uv_maps_scale_then_turn_then_move():
    m = UvMap(scale=(2.0, 3.0), rotate=90.0, offset=(0.5, -0.25)).coefficients()
    # (1, 0) -> (2, 0) -> (0, 2) -> (0.5, 1.75); (0, 1) -> (0, 3) -> (-3, 0) -> (-2.5, -0.25)
    assert m.tolist() == [0.0, -3.0, 0.5, 2.0, 0.0, -0.25]
    assert UvMap(scale=4.0).coefficients().tolist() == [4.0, 0.0, 0.0, 0.0, 4.0, 0.0]
    turned = UvMap(rotate=30.0).coefficients()
    assert turned == pytest.approx([math.sqrt(0.75), -0.5, 0.0, 0.5, math.sqrt(0.75), 0.0])
    for quarter, expected in ((180.0, [-1, 0, 0, 0, -1, 0]), (-90.0, [0, 1, 0, -1, 0, 0]),
                              (3600090.0, [0, -1, 0, 1, 0, 0])):  # fmt: skip
        assert UvMap(rotate=quarter).coefficients().tolist() == expected
    for degrees in (1e9, 1e22, -1e300):
        m = UvMap(rotate=degrees).coefficients()
        assert m[[0, 1]] == pytest.approx(m[[4, 3]] * (1, -1), abs=1e-15)
        assert m[0] * m[4] - m[1] * m[3] == pytest.approx(1.0, rel=1e-15)


def test_a_mapped_texture_is_the_texture_at_the_mapped_place(tmp_path):
    uv = UvMap(scale=(2.0, 0.5), rotate=40.0, offset=(0.3, 0.1))
    textures = tables_of(tmp_path, straight=raw(), mapped=raw(uv=uv))
    m = uv.coefficients()
    for u, v in np.random.default_rng(17).uniform(-1, 2, (50, 2)):
        at = m[0] * u + m[1] * v + m[2], m[3] * u + m[4] * v + m[5]
        assert np.array_equal(ask(textures, u, v, 1), ask(textures, *at, 0))


# ---- parameters ---------------------------------------------------------------------------------


def test_parameters(tmp_path):
    textures = tables_of(tmp_path, checks=Checker(first=(0.9, 0.5, 0.1), second=(0.0, 0.0, 0.0)))
    palette = Palette({"checks": 0}, (0.9,))
    at = At(textures, 0.1, 0.1, NO_COLOUR)
    assert colour_at(palette.colours("checks"), 0, at) == (0.9, 0.5, 0.1)
    assert colour_at(palette.colours((0.3, 0.2, 0.1)), 0, at) == (0.3, 0.2, 0.1)
    expected = 0.9 * 0.212671 + 0.5 * 0.715160 + 0.1 * 0.072169  # sRGB's luminance
    assert number_at(palette.numbers("checks"), 0, at) == pytest.approx(expected, rel=1e-4)
    assert number_at(palette.numbers(0.7), 0, at) == 0.7
    with pytest.raises(ValueError, match=r"values up to 0.9; expected at most 0.5"):
        palette.numbers("checks", most=0.5)
