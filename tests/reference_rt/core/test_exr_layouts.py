"""OpenEXR files of luminance and chroma, and of deep pixels: what their writers had, and one line
for what is wrong."""

import struct
import warnings

import numpy as np
import OpenEXR
import pytest
from exr_writer import attribute, exr
from mesh_writers import written

import reference_rt as rt
from comparisons.gate.pictures_in import read_candidates
from reference_rt.core.image_files import open_image
from reference_rt.core.image_files.luminance_chroma import REC709, luminance_weights
from reference_rt.rendering.image import read_image as read_picture
from reference_rt.textures.image_file import read_image, read_texels

HEIGHT, WIDTH = 44, 56
Y_OF = np.array([0.2126, 0.7152, 0.0722])
"""Weights of Rec. 709, to four digits: those of its chromaticities differ by 4e-5."""


def waves():
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    red = 0.5 + 0.3 * np.sin(x / 5) + 0.05 * np.cos(y / 6)
    return np.stack([red, 0.6 + 0.01 * x, 0.4 + 0.2 * np.cos(y / 4)], axis=-1)


def in_chroma(rgb, step=2, prefix="", kind="<f4", weights=Y_OF, **more):
    luminance = rgb @ weights
    planes = {"Y": luminance}
    for name, k in (("RY", 0), ("BY", 2)):
        planes[name] = ((rgb[..., k] - luminance) / luminance)[::step, ::step]
    if more.pop("opacity", False):
        planes["A"] = np.full(luminance.shape, 0.25)
    made = {prefix + n: np.ascontiguousarray(p, kind) for n, p in planes.items()}
    return exr(made, {prefix + "RY": step, prefix + "BY": step}, **more)


def test_weights_of_luminance():
    """Those that Rec. 709 states, to their four digits; white is 1 for any primaries."""
    assert np.abs(luminance_weights(REC709) - Y_OF).max() < 1e-4
    other = luminance_weights((0.7347, 0.2653, 0.0, 1.0, 0.0001, 0.077, 0.32168, 0.33767))
    assert other.sum() == pytest.approx(1.0, abs=1e-12)
    for wrong in ((0.3,) * 8, (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3, 0.0)):
        with pytest.raises(ValueError, match="has primaries that span no colours"):
            luminance_weights(wrong)


@pytest.mark.parametrize("kind", ["<f4", "<f2"])
@pytest.mark.parametrize("step", [1, 2])
def test_constant_colours(tmp_path, step, kind):
    rgb = np.broadcast_to([1.0, 0.5, 0.25], (HEIGHT, WIDTH, 3))
    path = written(tmp_path, in_chroma(rgb, step, kind=kind), "a.exr")
    rounding = {"<f4": 1e-4, "<f2": 3e-3}[kind]  # the weights' digits; halves of chroma and Y
    assert np.abs(read_image(path, "auto") - rgb).max() < rounding


def test_waves(tmp_path):
    """At samples of chroma exact; between them the filter's error for waves of 25 pixels."""
    rgb = waves()
    path = written(tmp_path, in_chroma(rgb), "a.exr")
    error = np.abs(read_image(path, "auto") - rgb)
    assert error[::2, ::2].max() < 1e-4
    assert error[14:-14, 14:-14].max() < 2e-3  # where the filter has all of its samples
    assert error.max() < 0.06  # at borders the last sample repeats
    half = written(tmp_path, in_chroma(rgb[:, ::-1]), "b.exr")
    assert np.abs(read_image(half, "auto") - rgb[:, ::-1])[14:-14, 14:-14].max() < 2e-3


def test_layers_opacity_and_primaries(tmp_path):
    rgb = np.broadcast_to([0.2, 0.6, 0.9], (HEIGHT, WIDTH, 3))
    path = written(tmp_path, in_chroma(rgb, prefix="beauty.", opacity=True), "a.exr")
    assert open_image(path).has_opacity
    assert np.abs(read_image(path, "auto", layer="beauty") - rgb).max() < 1e-4
    assert np.abs(read_picture(path) - rgb).max() < 1e-4
    opacity = read_texels(path, "auto", 1.0, channel="alpha")
    assert (opacity.linear == 0.25).all()
    (picture,) = read_candidates(path)
    assert np.abs(picture.radiance - rgb).max() < 1e-4
    wide = (0.7347, 0.2653, 0.0, 1.0, 0.0001, 0.077, 0.32168, 0.33767)
    more = attribute(b"chromaticities", b"chromaticities", struct.pack("<8f", *wide))
    path = written(tmp_path, in_chroma(rgb, weights=luminance_weights(wide), more=more), "b.exr")
    assert np.abs(read_image(path, "auto") - rgb).max() < 1e-5


def test_negative_overshoots_become_zero(tmp_path):
    """Of the filter, beside an edge between saturated colours."""
    rgb = np.full((HEIGHT, WIDTH, 3), 1e-3)
    rgb[:, : WIDTH // 2, 0] = rgb[:, WIDTH // 2 :, 2] = 1.0
    found = read_image(written(tmp_path, in_chroma(rgb), "a.exr"), "auto")
    assert found.min() == 0.0
    assert np.abs(found - rgb)[::2, ::2].max() < 1e-3


def test_wrong_chroma(tmp_path):
    rgb, plane = waves(), np.ones((HEIGHT, WIDTH), "<f4")
    quarter = {"RY": plane[::4, ::4].copy(), "BY": plane[::4, ::4].copy()}
    for content, said in (
        (exr({"Y": plane, **quarter}, {"RY": 4, "BY": 4}), "cannot be read as EXR"),
        (exr({"Y": plane, "RY": plane[::2, ::2].copy(), "BY": plane}, {"RY": 2}), "of every seco"),
        (exr({"Y": plane, "RY": plane}), "has channels RY, Y; expected R, G, B, or Y"),
        (in_chroma(rgb)[:-50], "cannot be read as EXR"),
        (in_chroma(rgb * np.nan), "is not finite; expected finite ones"),
    ):
        path = written(tmp_path, content, "a.exr")
        with pytest.raises(ValueError, match=said) as caught:
            read_image(path, "auto")
        assert str(path) in str(caught.value)
        assert "\n" not in str(caught.value)


# ---- deep pixels --------------------------------------------------------------------------------

DEEP = 20, 7
"""Height and width: more lines than are compressed together."""


def deep(kind=np.float32):
    """Samples by pixel, from none to four; and what the first ones are."""
    rng = np.random.default_rng(6)
    counts = rng.integers(0, 5, DEEP)
    samples, firsts = {}, {}
    for name in "RGBAZ":
        plane = np.empty(DEEP, object)
        firsts[name] = np.zeros(DEEP)
        for at in np.ndindex(DEEP):
            plane[at] = np.round(rng.uniform(size=counts[at]), 3).astype(kind)
            if counts[at]:
                firsts[name][at] = plane[at][0]
        samples[name] = plane
    return samples, firsts


def write_deep(path, planes, compression="ZIPS", **more):
    kind = getattr(OpenEXR, f"{compression}_COMPRESSION")
    header = {"type": OpenEXR.deepscanline, "compression": kind, **more}
    OpenEXR.File(header, planes).write(str(path))
    return path


@pytest.mark.parametrize("compression", ["NO", "RLE", "ZIPS"])
@pytest.mark.parametrize("kind", [np.float32, np.float16])
def test_first_samples(tmp_path, compression, kind):
    planes, firsts = deep(kind)
    path = write_deep(tmp_path / "a.exr", planes, compression)
    with pytest.warns(rt.SceneWarning, match=r"a.exr has deep pixels, of which the first samples"):
        found = read_image(path, "auto")
    assert np.array_equal(found, np.stack([firsts[c] for c in "RGB"], axis=-1))
    with pytest.warns(rt.SceneWarning, match="of which the first samples"):
        opacity = read_texels(path, "auto", 1.0, channel="alpha")
    assert np.array_equal(opacity.linear[..., 0], firsts["A"])
    (picture,) = read_candidates(path)
    assert "of which the first samples are read" in picture.note


def test_deep_runs_of_one_value(tmp_path):
    """What shrinks under every compression, and one pixel only with samples."""
    planes = {name: np.empty(DEEP, object) for name in "RGB"}
    for at in np.ndindex(DEEP):
        for name in "RGB":
            planes[name][at] = np.full(300 if at == (3, 4) else 0, 0.75, np.float32)
    expected = np.zeros((*DEEP, 3))
    expected[3, 4] = 0.75
    for compression in ("NO", "RLE", "ZIPS"):
        path = write_deep(tmp_path / "a.exr", planes, compression)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            assert np.array_equal(read_image(path, "auto"), expected), compression


def test_wrong_deep_files(tmp_path):
    planes, _ = deep()
    whole = write_deep(tmp_path / "a.exr", planes).read_bytes()
    tiled = {"type": OpenEXR.deeptile, "tiles": OpenEXR.TileDescription()}
    write_deep(tmp_path / "tiles.exr", planes, **tiled)
    first = whole.index(b"\0\0", 400)
    cases = [
        ((tmp_path / "tiles.exr").read_bytes(), "has deep pixels in tiles; expected"),
        (whole[:-9], "is truncated|damaged"),
        (whole[: first + 60], "is truncated|damaged"),
    ]
    for content, said in cases:
        path = written(tmp_path, content, "b.exr")
        with pytest.raises(ValueError, match=said) as caught:
            read_image(path, "auto")
        assert str(path) in str(caught.value)
    rng = np.random.default_rng(2)
    for _ in range(300):
        data = bytearray(whole)
        for at in rng.integers(8, len(data), 3):
            data[at] = rng.integers(256)
        path = written(tmp_path, bytes(data), "b.exr")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                assert read_image(path, "auto").shape[2] == 3
            except ValueError as error:
                assert "\n" not in str(error)  # noqa: PT017


def test_deep_pixels_do_not_fill_the_memory(tmp_path):
    """A block that says it unpacks to 2 GiB."""
    planes, _ = deep()
    data = bytearray(write_deep(tmp_path / "a.exr", planes).read_bytes())
    offsets = next(k for k in range(300, 900) if struct.unpack_from("<Q", data, k)[0] == k + 8 * 20)
    (block,) = struct.unpack_from("<Q", data, offsets)
    struct.pack_into("<Q", data, block + 20, 1 << 31)
    with pytest.raises(ValueError, match=r"a block of lines unpacks from \d+ to 2147483648 bytes"):
        read_image(written(tmp_path, bytes(data), "b.exr"), "auto")
