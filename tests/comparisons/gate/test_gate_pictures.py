"""Candidate pictures from files: layers, palettes, several pictures, exposure, variances.

`test_image_readers` has every kind of file."""

from pathlib import Path

import numpy as np
import pytest
from picture_writers import exr, hdr, rgbe
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


def test_layers_of_exr(tmp_path: Path, picture: FloatArray) -> None:
    layered = exr(tmp_path / "b.exr", picture, prefix="beauty.pass.")
    np.testing.assert_array_equal(read_candidate(layered, "beauty.pass").radiance, picture)


def test_png_by_pillow_with_filters_and_a_palette(tmp_path: Path) -> None:
    values = np.random.default_rng(2).integers(0, 256, (64, 48, 3)).astype(np.uint8)
    Image.fromarray(values).save(tmp_path / "a.png", optimize=True)
    found = read_candidate(tmp_path / "a.png")
    np.testing.assert_allclose(found.radiance, linear(values / 255.0), rtol=1e-14)
    few = Image.fromarray(values // 64 * 64).convert("P", palette=Image.Palette.ADAPTIVE)
    few.save(tmp_path / "b.png")
    shown = np.asarray(few.convert("RGB")) / 255.0
    np.testing.assert_allclose(read_candidate(tmp_path / "b.png").radiance, linear(shown))


def test_arrays_of_several_pictures(tmp_path: Path, picture: FloatArray) -> None:
    values = picture.astype("<f2")
    np.save(tmp_path / "b.npy", np.stack([values, values + 1]))
    both = read_candidates(tmp_path / "b.npy")
    np.testing.assert_array_equal(both[1].radiance, np.float64(values + 1))
    with pytest.raises(ImageError, match="holds 2 pictures; expected one"):
        read_candidate(tmp_path / "b.npy")
    (one,) = from_array(np.concatenate([values, values[..., :1]], axis=-1))
    np.testing.assert_array_equal(np.asarray(one.opacity), np.float64(values[..., 0]))


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
    with pytest.raises(ImageError, match=r"negative or NaN; expected >= 0"):
        variance_of(exr(tmp_path / "c.exr", -picture))
