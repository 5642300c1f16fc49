"""Pictures as text: decoded again, they are the pictures."""

import re

import numpy as np
import pytest
from fake_terminal import decoded_sixels

from reference_rt.cli.terminal_answer import says_sixels
from reference_rt.cli.terminal_picture import cell, half_blocks, sixels

CELL = re.compile(r"\x1b\[38;2;(\d+);(\d+);(\d+);48;2;(\d+);(\d+);(\d+)m▀")


def picture(rows, columns, colours=16):
    """Random pixels of a few colours, so that a palette loses nothing."""
    rng = np.random.default_rng(rows * 1000 + columns)
    palette = rng.integers(0, 256, (colours, 3), dtype=np.uint8)
    return palette[rng.integers(0, colours, (rows, columns))]


def decoded_blocks(text):
    """The pixels of half blocks."""
    rows = []
    for line in text.splitlines():
        cells = np.array([[int(x) for x in cell] for cell in CELL.findall(line)])
        assert CELL.sub("", line) == "\x1b[0m"
        rows += [cells[:, :3], cells[:, 3:]]
    return np.array(rows, np.uint8)


def of_sixels(text):
    """The pixels of a sixel string, in percent."""
    found = re.fullmatch(r"\x1b7\x1bP(.*)\x1b\\\x1b8(\n+)", text, re.DOTALL)
    pixels = decoded_sixels(found[1])
    assert len(found[2]) == -(-len(pixels) // cell()[1])  # the next line is below
    return pixels


@pytest.mark.parametrize(("rows", "columns"), [(2, 3), (8, 12), (6, 1)])
def test_half_blocks_are_the_pixels(rows, columns):
    pixels = picture(rows, columns)
    assert (decoded_blocks(half_blocks(pixels, 80, 24)) == pixels).all()


def test_an_odd_last_row_is_padded_with_black():
    pixels = picture(5, 4)
    found = decoded_blocks(half_blocks(pixels, 80, 24))
    assert (found[:5] == pixels).all()
    assert (found[5] == 0).all()


@pytest.mark.parametrize(("columns", "rows"), [(10, 5), (4, 50), (80, 1), (1, 1)])
def test_large_pictures_fit(columns, rows):
    text = half_blocks(picture(90, 160), columns, rows)
    found = decoded_blocks(text)
    assert len(text.splitlines()) <= rows
    assert found.shape[1] <= columns


def test_scaling_down_keeps_the_mean():
    pixels = picture(64, 64)
    found = decoded_blocks(half_blocks(pixels, 16, 8))
    expected = pixels.reshape(16, 4, 16, 4, 3).mean(axis=(1, 3))
    assert np.abs(found - expected).max() <= 1.0  # each of two passes rounds to integers


@pytest.mark.parametrize(("rows", "columns"), [(1, 1), (6, 8), (13, 20), (31, 7)])
def test_sixels_are_the_pixels(rows, columns):
    pixels = picture(rows, columns)
    found = of_sixels(sixels(pixels, 80, 24))
    # The palette is in whole percent: half a percent is 1.3 of 255.
    assert np.abs(found * 2.55 - pixels).max() <= 1.3


def test_pixels_have_the_nearest_colour_of_the_palette():
    """Of a picture of many colours, whose palette is made of a part of its pixels."""
    rng = np.random.default_rng(5)
    y, x = np.mgrid[:60, :200]
    mean = np.stack([x * 1.2, y * 4.0, (x + y) * 0.9], axis=-1)
    pixels = np.clip(mean + rng.normal(0.0, 10.0, mean.shape), 0, 255).astype(np.uint8)
    shown = of_sixels(sixels(pixels, 400, 200)) * 2.55
    palette = np.unique(shown.reshape(-1, 3), axis=0)
    assert 128 <= len(palette) <= 256
    distances = np.linalg.norm(pixels.reshape(-1, 1, 3) - palette, axis=-1)
    off = np.linalg.norm(shown - pixels, axis=-1).ravel() - distances.min(axis=1)
    # Pillow finds the colour nearest to a box of 4 x 4 x 4 around the pixel; and see above.
    assert off.max() <= np.sqrt(3.0) * (4.0 + 2.0 * 1.3)
    assert np.sqrt(np.mean(distances.min(axis=1) ** 2)) <= 10.0 * np.sqrt(3.0)  # the noise's


def test_large_pictures_fit_as_sixels():
    width, height = cell()
    found = of_sixels(sixels(picture(300, 300), 80 // width, 80 // height))
    side = min(80 // width * width, 80 // height * height)
    assert found.shape[:2] == (side, side)
    assert (found >= 0).all()


@pytest.mark.parametrize(
    ("answer", "draws"),
    [
        (b"\x1b[?62;4;22c", True),
        (b"\x1b[?63;1;2;4c", True),
        (b"\x1b[?62;22c", False),
        (b"\x1b[?4c", False),  # the first number is the model: a VT132
        (b"\x1b[?64;14;44c", False),
        (b"\x1b_Gi=31;OK\x1b\\\x1b[?62;4c", True),
        (b"\x1b[?62;4;22", False),  # cut off
        (b"", False),
    ],
)
def test_what_the_terminal_says(answer, draws):
    assert says_sixels(answer) is draws
