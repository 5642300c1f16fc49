"""Images for textures: how every kind of file is read, and the message of every fault."""

import re
import struct
import zlib

import numpy as np
import OpenEXR
import pytest
from PIL import Image

import reference_rt as rt
from reference_rt.core.exr import write_exr
from reference_rt.rendering.image import srgb
from reference_rt.scene.build import build_tables
from reference_rt.textures.bitmap import lookup
from reference_rt.textures.image_file import linear, read_image

IMAGE = np.random.default_rng(14).integers(0, 256, (5, 7, 3), dtype=np.uint8)


def png(width, height, depth, colour_type, rows):
    """The bytes of a .png."""

    def chunk(kind, data):
        body = kind + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    header = struct.pack(">IIBBBBB", width, height, depth, colour_type, 0, 0, 0)
    data = zlib.compress(b"".join(b"\0" + row for row in rows))
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", data)
            + chunk(b"IEND", b""))  # fmt: skip


def test_srgb_curve_is_undone():
    codes = np.arange(256) / 255.0
    assert linear(np.array([0.0, 1.0])).tolist() == [0.0, 1.0]
    # The standard's two curves are inverse to its 8 digits; where they join, to 1e-7.
    assert np.allclose(srgb(linear(codes)), codes, rtol=0, atol=2e-8)
    assert linear(np.array(0.5)) == pytest.approx(((0.5 + 0.055) / 1.055) ** 2.4, rel=1e-15)
    assert linear(np.array(0.04)) == 0.04 / 12.92


def test_encodings(tmp_path):
    grey = np.full((2, 2, 3), 128, np.uint8)
    Image.fromarray(grey).save(tmp_path / "a.png")
    write_exr(tmp_path / "a.exr", {c: np.full((2, 2), 0.5) for c in "RGB"}, {})
    decoded = float(linear(np.array(128 / 255)))
    for name, encoding, expected in (
        ("a.png", "auto", decoded),
        ("a.png", "srgb", decoded),
        ("a.png", "raw", 128 / 255),
        ("a.exr", "auto", 0.5),
        ("a.exr", "raw", 0.5),
        ("a.exr", "srgb", float(linear(np.array(0.5)))),
    ):
        values = read_image(tmp_path / name, encoding)
        assert values.shape == (2, 2, 3)
        assert values.dtype == np.float64
        assert (values == expected).all(), (name, encoding)


def test_modes_of_images(tmp_path):
    """Grey, with opacity, of a palette, of one bit: what they show, without the opacity."""
    rgb = Image.fromarray(IMAGE)
    rgba = rgb.copy()
    rgba.putalpha(Image.fromarray(IMAGE[..., 0]))
    grey = Image.fromarray(IMAGE[..., 1])
    two = Image.fromarray(np.where(IMAGE[..., 1] > 127, 255, 0).astype(np.uint8)).convert("1")
    palette = Image.new("P", (2, 1))
    palette.putpalette([255, 0, 0, 0, 255, 0])
    palette.putpixel((1, 0), 1)
    expected = {
        "rgba": (rgba, IMAGE / 255),
        "grey": (grey, np.repeat(IMAGE[..., 1:2] / 255, 3, axis=-1)),
        "two": (two, np.repeat(IMAGE[..., 1:2] > 127, 3, axis=-1).astype(float)),
        "palette": (palette, np.array([[[1.0, 0, 0], [0, 1, 0]]])),
    }
    for name, (image, values) in expected.items():
        options = {"transparency": b"\x00\xff"} if name == "palette" else {}
        image.save(tmp_path / f"{name}.png", **options)
        assert np.array_equal(read_image(tmp_path / f"{name}.png", "raw"), values), name


def test_exr_channels(tmp_path):
    """Colours, or grey, of the layer that is asked for, or of the only one."""
    path, plane = tmp_path / "a.exr", np.ones((3, 4))

    def colour(names, layer="", parts=()):
        planes = [{name: k * plane for k, name in enumerate(n.split(), 1)} for n in (names, *parts)]
        if parts:
            made = [
                OpenEXR.Part(
                    {"type": OpenEXR.scanlineimage, "name": str(k)},
                    {n: p.astype(np.float32) for n, p in one.items()},
                )
                for k, one in enumerate(planes)
            ]
            OpenEXR.File(made).write(str(path))
        else:
            write_exr(path, planes[0], {})
        return read_image(path, "auto", layer=layer)[1, 2].tolist()

    assert colour("R G B") == colour("r g b") == colour("beauty.R beauty.G beauty.B") == [1, 2, 3]
    assert colour("V.Depth.Z V.Combined.R V.Combined.G V.Combined.B V.Combined.A") == [2, 3, 4]
    assert colour("a.R a.G a.B R G B") == [4, 5, 6]
    assert colour("a.R a.G a.B R G B", "a") == [1, 2, 3]
    assert colour("Z", parts=["b.R b.G b.B"]) == [1, 2, 3]
    assert colour("a.R a.G a.B", "b", parts=["Z b.R b.G b.B"]) == [2, 3, 4]
    assert colour("R") == colour("beauty.R") == colour("Y") == colour("y") == [1, 1, 1]
    for names, layer, said in (
        ("a.R a.G a.B b.R b.G b.B", "", "several pictures; expected `layer` as one of: a, b"),
        ("a.R a.G a.B", "b", "expected b.R, b.G, b.B, or b.Y"),
        ("R Z", "", "has channels R, Z; expected R, G, B, or Y"),
        ("Y RY", "", "has channels RY, Y; expected R, G, B, or Y"),
    ):
        with pytest.raises(ValueError, match=re.escape(said)):
            colour(names, layer)


def faults(folder):
    """(file, what is said of it) for every fault."""
    exr = {c: np.full((3, 4), 0.5) for c in "RGB"}
    write_exr(folder / "good.exr", exr, {})
    Image.fromarray(IMAGE).save(folder / "good.png")
    Image.fromarray(IMAGE).save(folder / "good.jpg")
    for name, part in (("good.exr", 0.9), ("good.png", 0.6), ("good.jpg", 0.6)):
        data = (folder / name).read_bytes()
        (folder / name.replace("good", "cut")).write_bytes(data[: int(part * len(data))])
    for name in ("text.png", "text.exr"):
        (folder / name).write_text("No image.\n")
    for name in ("empty.png", "empty.exr"):
        (folder / name).write_bytes(b"")
    (folder / "zero.png").write_bytes(png(0, 1, 8, 2, [b""]))
    for name, value in (("nan", np.nan), ("inf", np.inf), ("negative", -0.25)):
        bad = {c: plane.copy() for c, plane in exr.items()}
        bad["G"][1, 2] = value
        write_exr(folder / f"{name}.exr", bad, {})
    (folder / "folder.png").mkdir()
    return [
        ("missing.png", "No such file"),
        ("missing.exr", "No such file"),
        ("cut.png", "cannot be read"),
        ("cut.jpg", "cannot be read"),
        ("cut.exr", "cannot be read as EXR"),
        ("text.png", "is not an image that can be read"),
        ("text.exr", "is not an image that can be read"),
        ("empty.png", "is empty; expected an image"),
        ("empty.exr", "is empty; expected an image"),
        ("zero.png", "image"),
        ("nan.exr", "the pixel at column 2, row 1 is not finite; expected finite ones"),
        ("inf.exr", "the pixel at column 2, row 1 is not finite; expected finite ones"),
        ("negative.exr", "the pixel at column 2, row 1 is negative; expected"),
        ("folder.png", "cannot be read"),
    ]


def test_files_of_every_fault(tmp_path, refused):
    """One line with the file, exit code 3, nothing written."""
    made = faults(tmp_path)
    scene = tmp_path / "scene.yaml"
    for name, said in made:
        with pytest.raises(ValueError, match=said) as caught:
            read_image(tmp_path / name, "auto")
        assert "\n" not in str(caught.value)
        assert name in str(caught.value)
    for name, said in made:
        scene.write_text(
            f"textures:\n  wood:\n    {{type: bitmap, file: {name}}}\n"
            "materials: {m: {type: diffuse, reflectance: wood}}\n"
            "shapes: [{type: sphere, material: m}]\n"
        )
        line = refused(3, "render", str(scene), "-o", str(tmp_path / "out.exr"))
        assert "textures.wood" in line
        assert said in line
        assert name in line


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "materials: {m: {type: diffuse, reflectance: wood}}",
            "no texture 'wood'; expected numbers",
        ),
        ("textures: {t: {type: marble}}", "unknown type 'marble'"),
        ("textures: {t: {type: bitmap}}", "textures.t.file"),
        ("textures: {t: {type: bitmap, file: a.png, wrap: fold}}", "textures.t.wrap"),
        ("textures: {t: {type: bitmap, file: a.png, filter: cubic}}", "textures.t.filter"),
        ("textures: {t: {type: bitmap, file: a.png, encoding: half}}", "textures.t.encoding"),
        ("textures: {t: {type: checker, first: -1}}", "numbers of at least 0"),
        ("textures: {t: {type: checker, uv: {scale: [1, 2, 3]}}}", "textures.t.uv.scale"),
        ("textures: {t: {type: checker, uv: {scale: [true, 1]}}}", "textures.t.uv.scale"),
        ("textures: {t: {type: checker, uv: {rotate: .nan}}}", "textures.t.uv.rotate"),
        ("textures: {t: {type: checker, uv: {scale: 1" + "0" * 400 + "}}}", "textures.t.uv.scale"),
        ("materials: {m: {type: mask, base: m, opacity: 1" + "0" * 400 + "}}", "from 0 to 1"),
        ("materials: {m: {type: mask, base: m, opacity: [1, 1]}}", "or the name of a texture"),
    ],
    ids=lambda text: text[:60],
)
def test_wrong_scenes(tmp_path, refused, text, said):
    scene = tmp_path / "scene.yaml"
    scene.write_text(text + "\n")
    line = refused(3, "render", str(scene), "-o", str(tmp_path / "out.exr"))
    assert said in line
    assert str(scene) in line


def test_bitmaps_are_read_beside_the_scene(tmp_path):
    """A file name is relative to the scene's folder."""
    (tmp_path / "deep").mkdir()
    Image.fromarray(IMAGE).save(tmp_path / "deep" / "image.png")
    (tmp_path / "scene.yaml").write_text(
        "textures: {t: {type: bitmap, file: deep/image.png, encoding: raw, filter: nearest}}\n"
    )
    textures = build_tables(rt.Scene.load(tmp_path / "scene.yaml")).textures
    assert np.array_equal(lookup(textures.bitmaps, 0, 0.01, 0.99), IMAGE[0, 0] / 255)


@pytest.mark.parametrize("tag", [256, 257, 278], ids=["width", "height", "rows of a strip"])
def test_a_tiff_whose_strips_leave_pixels_out_is_refused(tmp_path, tag):
    """Of a width or height that a bit made large, or of strips that end before the last row.  The
    rest would be black, and take seconds."""
    sound = tmp_path / "sound.tif"
    Image.fromarray(IMAGE).save(sound)
    assert np.array_equal(read_image(sound, "linear").shape, (5, 7, 3))
    content = bytearray(sound.read_bytes())
    (first,) = struct.unpack_from("<I", content, 4)
    (count,) = struct.unpack_from("<H", content, first)
    for k in range(count):
        at = first + 2 + 12 * k
        (name,) = struct.unpack_from("<H", content, at)
        if name == tag:
            value = 2 if tag == 278 else 3 * 2**20
            struct.pack_into("<HHII", content, at, name, 4, 1, value)
    damaged = tmp_path / "damaged.tif"
    damaged.write_bytes(content)
    with pytest.raises(ValueError, match=r"damaged\.tif: cannot be read: .*expected a whole image"):
        read_image(damaged, "linear")
