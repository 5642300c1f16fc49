"""Candidate pictures from files: layers, palettes, several pictures, exposure, variances.

`test_image_readers` has every kind of file."""

from pathlib import Path

import numpy as np
import pytest
from picture_writers import exr, hdr, rgbe
from PIL import Image

import comparisons
from comparisons.gate.displayed import _is_dithered
from comparisons.gate.gate import gate_pictures
from comparisons.gate.pictures_in import (
    Picture,
    from_array,
    read_candidate,
    read_candidates,
    variance_of,
)
from comparisons.gate.reference import of_files
from reference_rt.core.arrays import FloatArray
from reference_rt.core.exr import write_exr
from reference_rt.rendering.image import srgb
from reference_rt.textures.image_file import linear
from reference_rt.util.errors import ImageError, UsageError

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


def test_the_package_is_called(tmp_path: Path, picture: FloatArray) -> None:
    """With arrays, files, or a list of both; a dark copy differs by its gain."""
    np.save(tmp_path / "b.npy", picture)
    for given in (picture, tmp_path / "b.npy", [tmp_path / "b.npy"]):
        same = comparisons.gate(given, reference=str(tmp_path / "b.npy"), noise_free=True)
        assert same.verdict == "unchanged"
    dark = comparisons.gate(0.5 * picture, reference=picture, noise_free=True)
    assert dark.verdict == "differ"
    assert "<img" in dark._repr_html_()
    with pytest.raises(UsageError, match="expected a scene, reference or baseline"):
        comparisons.gate(picture)


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


def with_primaries(path: Path, picture: FloatArray, *xy: float) -> Path:
    import OpenEXR

    header = {"type": OpenEXR.scanlineimage, "chromaticities": xy}
    OpenEXR.File(header, {"RGB": picture.astype(np.float32)}).write(str(path))
    return path


REC_2020 = (0.708, 0.292, 0.170, 0.797, 0.131, 0.046, 0.3127, 0.3290)
ACES_CG = (0.713, 0.293, 0.165, 0.830, 0.128, 0.044, 0.32168, 0.33767)


def test_primaries_in_the_header_are_heeded(tmp_path: Path, picture: FloatArray) -> None:
    """Matrices of ITU-R BT.2087 and of the Academy, to four digits."""
    to_2020 = [[0.6274, 0.3293, 0.0433], [0.0691, 0.9195, 0.0114], [0.0164, 0.0880, 0.8956]]
    to_aces = [[0.6131, 0.3395, 0.0474], [0.0702, 0.9164, 0.0134], [0.0206, 0.1096, 0.8698]]
    for xy, matrix in ((REC_2020, to_2020), (ACES_CG, to_aces)):
        stored = picture @ np.array(matrix).T
        found = read_candidate(with_primaries(tmp_path / "a.exr", stored, *xy))
        np.testing.assert_allclose(found.radiance, picture, atol=2e-3)
        assert "its header names other primaries than sRGB's" in found.note
        judged = gate_pictures([found], of_files([Picture(picture)], None, True))
        assert found.note in judged.notes
    own = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
    found = read_candidate(with_primaries(tmp_path / "a.exr", picture, *own))
    np.testing.assert_array_equal(found.radiance, picture)
    assert not found.note
    for bad in ((0.3, 0.3) * 4, (0.64, 0.0, *own[2:]), (np.nan, *own[1:])):
        with pytest.raises(ImageError, match=r"primar|chromaticities"):
            read_candidate(with_primaries(tmp_path / "a.exr", picture, *bad))


def test_layers_are_named_with_the_option(tmp_path: Path, picture: FloatArray) -> None:
    channels = {f"{layer}.{n}": picture[..., 0] for layer in ("beauty", "normal") for n in "RGB"}
    write_exr(tmp_path / "a.exr", channels, {})
    with pytest.raises(ImageError, match=r"expected --layer \(or --reference-layer\) as one of"):
        read_candidate(tmp_path / "a.exr")


def shown(values: FloatArray, codes: FloatArray) -> Picture:
    """Linear values as an 8-bit picture stores them, with noise of so many codes before that."""
    encoded = np.clip(np.round(255.0 * srgb(values) + codes), 0.0, 255.0)
    return Picture(linear(encoded / 255.0), quantised=True, displayed=True)


def test_a_dithered_picture_without_noise_is_the_reference() -> None:
    """Not one that is cut off instead of rounded, a bit brighter, or wrong in a tile or a pixel."""
    y, x = np.mgrid[0:48, 0:64] / 64.0
    exact = (0.3 + 0.2 * np.sin(5.0 * x) * np.cos(7.0 * y))[..., None] * np.array([1.0, 0.8, 0.3])
    tile, pixel = np.zeros((2, *exact.shape))
    tile[16:32, 16:32] = 0.3
    pixel[5, 9] = 2.0
    reference = of_files([Picture(exact)], None, True)
    for seed in range(20):
        dither = np.random.default_rng(seed).uniform(-0.5, 0.5, exact.shape)
        assert _is_dithered(shown(exact, dither).radiance, exact)
        for change in (0.0 * dither, dither - 0.5, dither + 0.1, dither + tile, dither + pixel):
            assert not _is_dithered(shown(exact, change).radiance, exact)
    for change, verdict in ((dither, "agree"), (dither - 0.5, "differ")):
        case = gate_pictures([shown(exact, change)], reference)
        assert case.verdict == verdict, case.reason
        assert ("as those of dithering" in str(case.notes)) == (verdict == "agree")
