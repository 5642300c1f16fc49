"""Image readers: every kind of file, as a texture, an environment map and a candidate."""

import io
import math
import zlib
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from picture_writers import exr, hdr, npy, pfm, png, rgbe
from PIL import Image

import reference_rt as rt
from comparisons.gate.pictures_in import read_candidate
from reference_rt.core.image_files import open_image
from reference_rt.scene.build import build_tables
from reference_rt.textures.bitmap import texel
from reference_rt.textures.image_file import linear, read_image
from reference_rt.util import memory
from reference_rt.util.errors import ImageError

HEIGHT, WIDTH = 6, 11
RNG = np.random.default_rng(7)
FLOATS = np.float64(RNG.uniform(0.0, 4.0, (HEIGHT, WIDTH, 4)).astype(np.float32))
FLOATS[..., 3] = 1.0
HALVES = FLOATS.astype(np.float16).astype(np.float64)
FLOATS[1, 2:9] = FLOATS[1, 2]  # something to run over
RGBE = rgbe(FLOATS[..., :3])


def radiance_of(codes, middle=0.0):
    """By Ward's formula.  middle: 0.5 takes the middle of each interval but of the first, which is
    black."""
    mantissa = np.where(codes[..., :3] > 0, codes[..., :3] + middle, 0.0)
    return mantissa * 2.0 ** (codes[..., 3:].astype(np.float64) - 136.0)


def codes(bits, channels):
    return np.random.default_rng(bits + channels).integers(0, 1 << bits, (HEIGHT, WIDTH, channels))


def decoded(values, bits):
    """(colours, opacity or None) that a PNG of these codes shows."""
    scaled = values / float((1 << bits) - 1)
    has_opacity = scaled.shape[2] in (2, 4)
    colours = scaled[..., :-1] if has_opacity else scaled
    colours = np.broadcast_to(colours, (HEIGHT, WIDTH, 3))
    return linear(np.ascontiguousarray(colours)), scaled[..., -1] if has_opacity else None


def exr_of(values, header):
    def write(path):
        planes = {c: np.ascontiguousarray(values[..., k]) for k, c in enumerate("RGB")}
        with OpenEXR.File(header, planes) as file:
            file.write(str(path))

    return write


HALF = {"compression": OpenEXR.PIZ_COMPRESSION}
TILED = {"type": OpenEXR.tiledimage, "tiles": OpenEXR.TileDescription()}


def floats(make):
    return lambda path: path.write_bytes(make())


GREY = np.repeat(FLOATS[..., :1], 3, axis=-1)
COLOUR = FLOATS[..., :3]
FLIPS = {"-Y {} +X {}": (1, 1), "+Y {} +X {}": (-1, 1), "-Y {} -X {}": (1, -1)}
FLIPS |= {"+Y {} -X {}": (-1, -1)}

CANDIDATES: dict[str, np.ndarray] = {}
"""What the gate reads where it differs: of .hdr the middle of what a code stands for."""

KINDS = {
    "float.exr": (lambda path: exr(path, COLOUR), COLOUR, None),
    "half.exr": (exr_of(HALVES.astype(np.float16), HALF), HALVES[..., :3], None),
    "tiled.exr": (exr_of(FLOATS.astype(np.float32), TILED), COLOUR, None),
    "grey.exr": (lambda path: exr(path, COLOUR, "Y"), GREY, None),
    "opacity.exr": (lambda path: exr(path, FLOATS, "RGBA"), COLOUR, FLOATS[..., 0]),
    "little.pfm": (floats(lambda: pfm(COLOUR, "-1.0")), COLOUR, None),
    "big.pfm": (floats(lambda: pfm(COLOUR, "1.0", ">f4")), COLOUR, None),
    "grey little.pfm": (floats(lambda: pfm(FLOATS[..., :1], "-1")), GREY, None),
    "grey big.pfm": (floats(lambda: pfm(FLOATS[..., :1], "1", ">f4")), GREY, None),
    "float16.npy": (floats(lambda: npy(HALVES[..., :3].astype("<f2"))), HALVES[..., :3], None),
    "float32.npy": (floats(lambda: npy(COLOUR.astype(">f4"))), COLOUR, None),
    "float64.npy": (floats(lambda: npy(COLOUR)), COLOUR, None),
    "longdouble.npy": (floats(lambda: npy(COLOUR.astype(np.longdouble))), COLOUR, None),
    "columns.npy": (floats(lambda: npy(np.asfortranarray(COLOUR))), COLOUR, None),
    "opacity.npy": (floats(lambda: npy(FLOATS)), COLOUR, FLOATS[..., 3]),
}
for _axes, (_rows, _columns) in FLIPS.items():
    for _runs in (True, False):
        _name = f"{_axes.replace(' {}', '')}, {'runs' if _runs else 'flat'}.hdr"
        KINDS[_name] = (
            floats(lambda axes=_axes, runs=_runs: hdr(RGBE, runs, axes)),
            radiance_of(RGBE)[::_rows, ::_columns],
            None,
        )
        CANDIDATES[_name] = radiance_of(RGBE, 0.5)[::_rows, ::_columns]
for _bits in (8, 16):
    for _channels in (1, 2, 3, 4):
        _values = codes(_bits, _channels)
        KINDS[f"{_bits} bits, {_channels}.png"] = (
            lambda path, values=_values, bits=_bits: png(path, values, bits),
            *decoded(_values, _bits),
        )

AS_TEXTURES = {
    "quality.jpg": {"format": "JPEG"},
    "picture.webp": {"format": "WEBP", "lossless": True},
    "picture.bmp": {"format": "BMP"},
    "picture.tif": {"format": "TIFF"},
}
"""Which scenes take besides, and the gate refuses."""


def write(name, path):
    if name in KINDS:
        KINDS[name][0](path)
    else:
        Image.fromarray(codes(8, 3).astype(np.uint8)).save(path, **AS_TEXTURES[name])


def bitmap_of(path):
    scene = rt.Scene(textures={"t": rt.Bitmap(file=str(path))})
    bitmaps = build_tables(scene).textures.bitmaps
    return texels_of(bitmaps, 0)


def texels_of(bitmaps, i):
    """(height, width, 3): all texels of an image, as kernels see them."""
    rows, columns = range(bitmaps.height[i]), range(bitmaps.width[i])
    return np.array([[texel(bitmaps, i, x, y) for x in columns] for y in rows])


def environment_of(path):
    scene = rt.Scene(lights=(rt.EnvironmentMap(file=str(path)),))
    return build_tables(scene).lights.environment.texels


def what_is_said(consumer, path):
    """The error; None if there is none."""
    try:
        consumer(path)
    except (rt.SceneError, ImageError) as error:
        return str(error)
    return None


def gate_of(path):
    return read_candidate(path).radiance


@pytest.mark.parametrize("name", KINDS)
def test_every_kind_in_every_place(tmp_path, name):
    """To the bit; of a texture whatever the file is called."""
    _, colours, opacity = KINDS[name]
    write(name, tmp_path / name)
    for consumer in (bitmap_of, environment_of):
        np.testing.assert_array_equal(consumer(tmp_path / name), colours, consumer.__name__)
    found = read_candidate(tmp_path / name)
    # Of codes, a colour counts as much as it is opaque; floats are premultiplied.
    covered = opacity is not None and name.endswith(".png")
    expected = colours * opacity[..., None] if covered else CANDIDATES.get(name, colours)
    np.testing.assert_array_equal(found.radiance, expected)
    assert found.quantised == (name.startswith("8 bits") or name.endswith(".hdr"))
    if opacity is None:
        assert found.opacity is None
    else:
        np.testing.assert_array_equal(found.opacity, opacity)
    other = (tmp_path / name).rename(tmp_path / "picture.dat")
    np.testing.assert_array_equal(bitmap_of(other), colours)


@pytest.mark.parametrize("name", AS_TEXTURES)
def test_other_kinds_in_scenes(tmp_path, name):
    write(name, tmp_path / name)
    with Image.open(tmp_path / name) as image:
        expected = linear(np.asarray(image) / 255.0)
    for consumer in (bitmap_of, environment_of):
        np.testing.assert_array_equal(consumer(tmp_path / name), expected)
    with pytest.raises(ImageError, match=r"is not an image that can be read; expected EXR, PNG"):
        gate_of(tmp_path / name)


@pytest.mark.cases(8)
@pytest.mark.parametrize("name", [*KINDS, *AS_TEXTURES])
def test_damaged_files_in_every_place(tmp_path, name, capfd):
    """Truncated anywhere, or with bytes of others: one line of ours, or a picture; nothing printed
    by the libraries, and no other error."""
    path = tmp_path / name
    write(name, path)
    whole = path.read_bytes()
    rng = np.random.default_rng(11)
    cuts = {0, 1, 3, 7, 12, 20, 60, len(whole) // 3, len(whole) // 2, len(whole) - 1}
    damaged = [whole[:cut] for cut in sorted(cuts)]
    for _ in range(12):
        changed = bytearray(whole)
        for at in rng.integers(0, min(len(whole), 400), 3):
            changed[at] = rng.integers(0, 256)
        damaged.append(bytes(changed))
    for k, content in enumerate(damaged):
        path.write_bytes(content)
        for consumer in (bitmap_of, environment_of, gate_of):
            said = what_is_said(consumer, path)
            if said is None:
                # A picture cut short is none, but for what follows its last pixel.
                assert k >= len(cuts) or len(content) > 0.75 * len(whole), (consumer, k)
            else:
                assert "\n" not in said
                assert str(path) in said
    assert capfd.readouterr() == ("", "")


def test_signalling_nans_are_not_finite(tmp_path):
    """They raise floating point exceptions where they are converted."""
    values = np.full((4, 4, 3), 0x7FA00000, "<u4").view("<f4")
    (tmp_path / "a.pfm").write_bytes(b"PF\n4 4\n-1\n" + values.tobytes())
    (tmp_path / "a.npy").write_bytes(npy(values))
    for name in ("a.pfm", "a.npy"):
        with pytest.raises(rt.SceneError, match="is not finite; expected finite ones"):
            bitmap_of(tmp_path / name)
        assert np.isnan(gate_of(tmp_path / name)).all()


def test_many_bitmaps_are_one_array(tmp_path):
    """Each in its place, without copies of the others."""
    names = ("float.exr", "8 bits, 3.png", "little.pfm", "8 bits, 3.png")
    for name in names:
        write(name, tmp_path / name)
    textures = {f"t{k}": rt.Bitmap(file=name) for k, name in enumerate(names)}
    (tmp_path / "scene.json").write_text(rt.Scene(textures=textures).to_json())
    bitmaps = build_tables(rt.Scene.load(tmp_path / "scene.json")).textures.bitmaps
    for k, name in enumerate(names):
        np.testing.assert_array_equal(texels_of(bitmaps, k), KINDS[name][1])
    # Codes of a byte take one; two images share what they mean, and each begins at a float64.
    values = 3 * HEIGHT * WIDTH
    assert bitmaps.itemsize.tolist() == [4, 1, 4, 1]
    assert len(bitmaps.memory.codes8) == 8 * sum(math.ceil(n * values / 8) for n in (4, 1, 4, 1))
    assert len(bitmaps.decoded) == 256
    assert bitmaps.memory.codes8.base is bitmaps.memory.floats64.base


@pytest.mark.parametrize("name", ["8 bits, 1.png", "8 bits, 3.png", "16 bits, 3.png", "half.exr"])
def test_padding_is_the_same_each_time(tmp_path, name):
    """Checkpoints know a scene by all bytes of its tables."""
    write(name, tmp_path / name)
    found = set()
    for k in range(8):
        out = np.full(4096, k, np.uint8)
        texels = rt.Bitmap(file=name).read(tmp_path, out)
        found.add(texels.data.tobytes())
        assert len(texels.data) % 8 == 0
    assert len(found) == 1


def test_one_scene_has_bitmaps_of_all_kinds(tmp_path):
    """The same values as those of an array of float64, whatever their encoding and scale."""
    rng = np.random.default_rng(3)
    names = rng.permutation([*KINDS, *AS_TEXTURES])
    textures = {}
    for name in names:
        write(name, tmp_path / name)
        encoding, scale = rng.choice(["auto", "srgb", "raw"]), rng.choice([1.0, 0.7, 1e-5])
        path = str(tmp_path / name)
        textures[name] = rt.Bitmap(file=path, encoding=str(encoding), scale=float(scale))
    bitmaps = build_tables(rt.Scene(textures=textures)).textures.bitmaps
    for k, (name, texture) in enumerate(textures.items()):
        expected = read_image(tmp_path / name, texture.encoding, texture.scale)
        np.testing.assert_array_equal(texels_of(bitmaps, k), expected, err_msg=name)
        np.testing.assert_array_equal(texture.read(tmp_path).linear, expected)
        assert bitmaps.greatest[k] == expected.max()
    assert set(bitmaps.itemsize.tolist()) == {1, 2, 4, 8}
    assert set(bitmaps.channels.tolist()) == {1, 3}
    # Of codes of 8 and of 16 bits and of half floats, two encodings and three scales each.
    assert len(bitmaps.decoded) <= 6 * 256 + 12 * 65536


# ---- memory -------------------------------------------------------------------------------------


@pytest.mark.parametrize("consumer", [bitmap_of, environment_of, gate_of])
def test_what_would_not_fit_into_memory_is_refused_by_its_header(tmp_path, consumer):
    """Before anything is decoded: the files have no pixels."""
    whole = io.BytesIO()
    Image.new("RGB", (8, 8)).save(whole, "PNG")
    huge = (1 << 19).to_bytes(4, "big")
    picture = bytearray(whole.getvalue())
    picture[16:24] = huge + huge
    picture[29:33] = zlib.crc32(bytes(picture[12:29])).to_bytes(4, "big")
    (tmp_path / "a.png").write_bytes(picture)
    said = {
        gate_of: "declares 524288 x 524288",
        bitmap_of: "which take 2816.0 GiB of memory",  # three bytes a pixel, and eight to read it
        environment_of: "which take 9216.0 GiB of memory",
    }[consumer]
    with pytest.raises((rt.SceneError, ImageError), match=said):
        consumer(tmp_path / "a.png")


def test_many_textures_that_would_not_fit_together(tmp_path, monkeypatch):
    KINDS["little.pfm"][0](tmp_path / "a.pfm")
    size = 12 * HEIGHT * WIDTH
    monkeypatch.setattr(memory, "machine_memory", lambda: 3 * size)
    textures = {f"t{k}": rt.Bitmap(file=str(tmp_path / "a.pfm")) for k in range(3)}
    build_tables(rt.Scene(textures=textures))
    textures["t3"] = rt.Bitmap(file=str(tmp_path / "a.pfm"))
    with pytest.raises(rt.SceneError, match=f"has 4 bitmaps of {4 * size} bytes in all"):
        build_tables(rt.Scene(textures=textures))


def test_pillows_own_limit_is_not_ours():
    """It is of the process, and stays what it was."""
    before = Image.MAX_IMAGE_PIXELS
    assert before is not None
    with pytest.raises(OSError, match="No such file"):
        open_image(Path("missing.png"))
    assert before == Image.MAX_IMAGE_PIXELS
