"""Radiance's .hdr: decoded as Mitsuba decodes it, in every order of pixels and every packing."""

from itertools import product

import numpy as np
import pytest
from picture_writers import hdr, rgbe

import reference_rt as rt
from reference_rt.core.image_files import open_image

RNG = np.random.default_rng(1)
CODES = rgbe(RNG.exponential(size=(9, 11, 3)) ** 3)
CODES[0, 3:6] = CODES[0, 3]  # runs
CODES[2] = 0


def image_of(path, **how):
    return np.concatenate([strip.colours for strip in open_image(path, **how).strips()])


def old_runs(codes):
    """Scanlines as before 1991: a repeated pixel is 1, 1, 1 and the low byte of the number, then
    the same with the next byte."""
    out = bytearray()
    for row in codes:
        x = 0
        while x < len(row):
            same = 1
            while x + same < len(row) and (row[x + same] == row[x]).all():
                same += 1
            out += row[x].tobytes()
            left = same - 1
            while left:
                out += bytes([1, 1, 1, left & 255])
                left >>= 8
            x += same
    return bytes(out)


@pytest.mark.parametrize("more", ["", "EXPOSURE=2\nCOLORCORR=1 2 4\n"])
@pytest.mark.parametrize("runs", [True, False])
def test_decoded_as_mitsuba_does(tmp_path, runs, more):
    pytest.importorskip("mitsuba")
    from comparisons.mitsuba.backend import mitsuba

    (tmp_path / "a.hdr").write_bytes(hdr(CODES, runs, more=more))
    theirs = np.array(mitsuba().Bitmap(str(tmp_path / "a.hdr")))[..., :3]
    np.testing.assert_array_equal(image_of(tmp_path / "a.hdr"), theirs)


ORDERS = [f"{y}Y {{}} {x}X {{}}" for x, y in product("+-", "+-")]
ORDERS += [f"{x}X {{}} {y}Y {{}}" for x, y in product("+-", "+-")]


@pytest.mark.parametrize("packing", ["flat", "runs", "old runs"])
@pytest.mark.parametrize("order", ORDERS)
def test_all_orders_of_pixels_are_one_picture(tmp_path, order, packing):
    (tmp_path / "a.hdr").write_bytes(hdr(CODES, False))
    scanlines = CODES[:: 1 if "-Y" in order else -1, :: 1 if "+X" in order else -1]
    scanlines = scanlines.transpose(1, 0, 2) if order[1] == "X" else scanlines
    text = hdr(scanlines, packing == "runs", order)
    if packing == "old runs":
        text = text[: -scanlines.size] + old_runs(scanlines)
    (tmp_path / "b.hdr").write_bytes(text)
    found = image_of(tmp_path / "b.hdr")
    np.testing.assert_array_equal(found, image_of(tmp_path / "a.hdr"))


def test_a_long_run_of_the_old_kind_takes_several_bytes(tmp_path):
    codes = np.tile(CODES[1, 1], (1, 70000, 1))
    text = hdr(codes, False)[: -codes.size] + old_runs(codes)
    assert text.endswith(bytes([1, 1, 1, 69999 & 255, 1, 1, 1, 69999 >> 8 & 255, 1, 1, 1, 1]))
    (tmp_path / "a.hdr").write_bytes(text)
    assert (
        image_of(tmp_path / "a.hdr") == np.ldexp(1.0, int(codes[0, 0, 3]) - 136) * codes[0, 0, :3]
    ).all()


@pytest.mark.parametrize(
    ("pixels", "fact"),
    [
        (bytes([1, 1, 1, 11]), "after a pixel"),
        (bytes([9, 9, 9, 128, 1, 1, 1, 9]), "truncated"),
        (bytes([9, 9, 9, 128, 1, 1, 1, 11]), "malformed"),
        (bytes([9, 9, 9, 128] + 6 * [1, 1, 1, 0]), "after a pixel"),
        (bytes([9, 9, 9, 128, 1, 1, 1]), "expected 44"),
    ],
)
def test_runs_of_the_old_kind_that_do_not_fit(tmp_path, pixels, fact):
    (tmp_path / "a.hdr").write_bytes(hdr(CODES[:1], False)[: -CODES[:1].size] + pixels)
    with pytest.raises(ValueError, match=fact):
        image_of(tmp_path / "a.hdr")


def test_radiances_own_decoding_is_an_option(tmp_path):
    (tmp_path / "a.hdr").write_bytes(hdr(CODES, True, more="EXPOSURE=2\nCOLORCORR=1 2 4\n"))
    middle = CODES[..., :3] + np.where(CODES[..., :3] > 0, 0.5, 0.0)
    power = np.ldexp(1.0, CODES[..., 3:].astype(int) - 136)
    expected = np.where(CODES[..., 3:] > 0, middle * power, 0.0) / np.array([2.0, 4.0, 8.0])
    found = rt.Bitmap(file="a.hdr", encoding="radiance").read(tmp_path).linear
    np.testing.assert_array_equal(found, expected)
    sky = rt.EnvironmentMap(file="a.hdr", encoding="radiance").tabulate(tmp_path)
    np.testing.assert_array_equal(sky.texels, expected)
    assert (rt.EnvironmentMap(file="a.hdr").tabulate(tmp_path).texels != expected).any()


@pytest.mark.parametrize("kind", [rt.Bitmap, rt.EnvironmentMap])
def test_it_is_refused_for_other_files(tmp_path, kind):
    np.save(tmp_path / "a.npy", np.ones((4, 4, 3)))
    with pytest.raises(ValueError, match=r"a\.npy: is no Radiance image; expected one"):
        kind(file="a.npy", encoding="radiance").tabulate(tmp_path)
