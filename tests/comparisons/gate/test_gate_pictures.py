"""Candidate pictures from files: what is read is what was written."""

from pathlib import Path

import numpy as np
import pytest
from picture_writers import exr, hdr, pfm, png, rgbe
from PIL import Image

from comparisons.gate.pictures_in import from_array, read_candidate, read_candidates, variance_of
from reference_rt.core.arrays import FloatArray
from reference_rt.core.exr import write_exr
from reference_rt.textures.image_file import linear
from reference_rt.util.errors import ImageError

HEIGHT, WIDTH = 5, 9


@pytest.fixture
def picture() -> FloatArray:
    """Exact in float32."""
    rng = np.random.default_rng(1)
    return np.float64(rng.uniform(0.0, 4.0, (HEIGHT, WIDTH, 3)).astype(np.float32))


def test_exr(tmp_path: Path, picture: FloatArray) -> None:
    found = read_candidate(exr(tmp_path / "a.exr", picture, "RGBA"))
    np.testing.assert_array_equal(found.radiance, picture)
    assert found.opacity is not None
    np.testing.assert_array_equal(found.opacity, picture[..., 0])
    assert not found.quantised
    layered = exr(tmp_path / "b.exr", picture, prefix="beauty.pass.")
    np.testing.assert_array_equal(read_candidate(layered, "beauty.pass").radiance, picture)
    grey = read_candidate(exr(tmp_path / "c.exr", picture, "Y"))
    np.testing.assert_array_equal(grey.radiance, np.repeat(picture[..., :1], 3, axis=-1))
    assert grey.opacity is None


def test_the_name_of_a_file_does_not_matter(tmp_path: Path, picture: FloatArray) -> None:
    path = exr(tmp_path / "a.exr", picture).rename(tmp_path / "a.png")
    np.testing.assert_array_equal(read_candidate(path).radiance, picture)


@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize("channels", [1, 2, 3, 4])
def test_png(tmp_path: Path, bits: int, channels: int) -> None:
    most = (1 << bits) - 1
    values = np.random.default_rng(bits + channels).integers(0, most, (HEIGHT, WIDTH, channels))
    found = read_candidate(png(tmp_path / "a.png", values, bits))
    scaled = values / most
    has_opacity = channels in (2, 4)
    opacity = scaled[..., -1] if has_opacity else np.ones((HEIGHT, WIDTH))
    colour = scaled[..., :-1] if has_opacity else scaled
    expected = linear(np.broadcast_to(colour, (HEIGHT, WIDTH, 3))) * opacity[..., None]
    np.testing.assert_allclose(found.radiance, expected, rtol=1e-14)
    assert found.quantised == (bits == 8)
    if has_opacity:
        np.testing.assert_allclose(np.asarray(found.opacity), opacity, rtol=1e-15)
    else:
        assert found.opacity is None


def test_png_by_pillow_with_filters_and_a_palette(tmp_path: Path) -> None:
    values = np.random.default_rng(2).integers(0, 256, (64, 48, 3)).astype(np.uint8)
    Image.fromarray(values).save(tmp_path / "a.png", optimize=True)
    found = read_candidate(tmp_path / "a.png")
    np.testing.assert_allclose(found.radiance, linear(values / 255.0), rtol=1e-14)
    few = Image.fromarray(values // 64 * 64).convert("P", palette=Image.Palette.ADAPTIVE)
    few.save(tmp_path / "b.png")
    shown = np.asarray(few.convert("RGB")) / 255.0
    np.testing.assert_allclose(read_candidate(tmp_path / "b.png").radiance, linear(shown))


@pytest.mark.parametrize(("scale", "kind"), [("-1.0", "<f4"), ("1", ">f4")])
@pytest.mark.parametrize("channels", [1, 3])
def test_pfm(tmp_path: Path, picture: FloatArray, scale: str, kind: str, channels: int) -> None:
    (tmp_path / "a.pfm").write_bytes(pfm(picture[..., :channels], scale, kind))
    expected = np.broadcast_to(picture[..., :channels], picture.shape)
    np.testing.assert_array_equal(read_candidate(tmp_path / "a.pfm").radiance, expected)


@pytest.mark.parametrize("kind", ["<f8", "<f4", ">f4", "<f2"])
def test_npy(tmp_path: Path, picture: FloatArray, kind: str) -> None:
    values = picture.astype(kind)
    np.save(tmp_path / "a.npy", values)
    np.testing.assert_array_equal(read_candidate(tmp_path / "a.npy").radiance, np.float64(values))
    np.save(tmp_path / "b.npy", np.stack([values, values + 1]))
    both = read_candidates(tmp_path / "b.npy")
    np.testing.assert_array_equal(both[1].radiance, np.float64(values + 1))
    with pytest.raises(ImageError, match="holds 2 pictures; expected one"):
        read_candidate(tmp_path / "b.npy")
    (one,) = from_array(np.concatenate([values, values[..., :1]], axis=-1))
    np.testing.assert_array_equal(np.asarray(one.opacity), np.float64(values[..., 0]))


@pytest.mark.parametrize("runs", [True, False])
def test_hdr(tmp_path: Path, picture: FloatArray, runs: bool) -> None:
    picture[:, 3:7] = picture[0, 0]  # something to run over
    picture[2, 2] = 0.0
    values = rgbe(picture)
    (tmp_path / "a.hdr").write_bytes(hdr(values, runs))
    found = read_candidate(tmp_path / "a.hdr")
    assert found.quantised
    # Half a step of the mantissa, which has 8 bits of the largest channel.
    step = picture.max(axis=-1, keepdims=True) / 128.0
    assert (np.abs(found.radiance - picture) <= 0.5 * step).all()
    assert not found.radiance[2, 2].any()


def test_hdr_rounding_has_no_bias(tmp_path: Path) -> None:
    picture = np.random.default_rng(3).uniform(0.2, 0.9, (100, 100, 3))
    (tmp_path / "a.hdr").write_bytes(hdr(rgbe(picture), runs=True))
    found = read_candidate(tmp_path / "a.hdr").radiance
    # A step is at most 2^-8, rounding is uniform in it: 5 standard errors of 10^4 numbers.
    assert (np.abs((found - picture).mean(axis=(0, 1))) < 5 * 2**-8 / 12**0.5 / 100).all()


def test_hdr_axes_and_exposure(tmp_path: Path, picture: FloatArray) -> None:
    values = rgbe(picture)
    (tmp_path / "a.hdr").write_bytes(hdr(values, runs=False))
    plain = read_candidate(tmp_path / "a.hdr").radiance
    more = "EXPOSURE=2\nEXPOSURE=4\nCOLORCORR=1 2 1\n"
    (tmp_path / "b.hdr").write_bytes(hdr(values, False, "+Y {} -X {}", more))
    found = read_candidate(tmp_path / "b.hdr").radiance
    np.testing.assert_allclose(found, plain[::-1, ::-1] / np.array([8.0, 16.0, 8.0]))


def test_variance_of_a_layer_or_a_file(tmp_path: Path, picture: FloatArray) -> None:
    names = {f"variance.{n}": picture[..., k] for k, n in enumerate("RGB")}
    write_exr(tmp_path / "a.exr", names | dict.fromkeys("RGB", 0.0 * picture[..., 0]), {})
    np.testing.assert_array_equal(variance_of(tmp_path / "a.exr"), picture)
    np.testing.assert_array_equal(variance_of(exr(tmp_path / "b.exr", picture)), picture)
    with pytest.raises(ImageError, match=r"negative or not numbers; expected >= 0"):
        variance_of(exr(tmp_path / "c.exr", -picture))
