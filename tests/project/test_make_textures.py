"""The script in `scenes` gives the images that lie beside it, and they are what they should be."""

import math
import runpy
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from reference_rt.core.exr import read_exr
from reference_rt.textures.image_file import read_image

SCENES = Path(__file__).parents[2] / "scenes"
TEXTURES = SCENES / "textures"


@pytest.fixture(scope="module")
def script():
    return runpy.run_path(str(SCENES / "make_textures.py"))


def pixels(name):
    with Image.open(TEXTURES / name) as image:
        return np.array(image)


@pytest.mark.parametrize(
    ("name", "function", "kind"),
    [
        ("tiles.png", "tiles", np.uint8),
        ("tiles_height.png", "height", np.uint16),
        ("tiles_roughness.png", "roughness", np.uint8),
        ("leaf.png", "leaf", np.uint8),
    ],
)
def test_images_are_what_the_script_writes(script, name, function, kind):
    made = script[function]()
    assert made.dtype == kind
    assert np.array_equal(pixels(name), made)


def test_normals_are_those_of_the_height_map(script):
    heights, stored = pixels("tiles_height.png"), pixels("tiles_normal.png")
    assert np.array_equal(stored, script["normals"](heights))
    n = stored / 255.0 * 2.0 - 1.0
    # 8 bits: each component within 1/255 of a unit vector's.
    assert np.abs(np.linalg.norm(n, axis=-1) - 1.0).max() < math.sqrt(3) / 255
    assert n[..., 2].min() > 0.3
    # Where the height rises to the right, normals lean to the left; upwards likewise (rows go
    # down).
    h = heights.astype(float)
    for component, slope in (
        (0, np.roll(h, -1, axis=1) - np.roll(h, 1, axis=1)),
        (1, np.roll(h, 1, axis=0) - np.roll(h, -1, axis=0)),
    ):
        steep = np.abs(slope) > 0.2 * np.abs(slope).max()
        assert np.array_equal(n[steep][:, component] < 0.0, slope[steep] > 0.0)


def test_tiles_repeat_without_a_seam(script):
    """No step over the border is larger than the largest inside."""
    for name in ("tiles.png", "tiles_height.png", "tiles_roughness.png", "tiles_normal.png"):
        image = pixels(name).astype(float)
        for axis in (0, 1):
            inside = np.abs(np.diff(image, axis=axis)).max()
            across = np.abs(image.take(0, axis) - image.take(-1, axis)).max()
            assert across <= inside, name


def test_the_leaf_has_holes():
    leaf = read_image(TEXTURES / "leaf.png", "raw")[..., 0]
    assert set(np.unique(leaf)[[0, -1]]) == {0.0, 1.0}
    assert 0.2 < leaf.mean() < 0.5
    assert not leaf[:, [0, -1]].any()  # nothing is cut off
    assert not leaf[[0, -1]].any()
    for u, v, opacity in ((0.62, 0.42, 0.0), (0.41, 0.55, 0.0), (0.54, 0.68, 0.0),
                          (0.5, 0.5, 1.0), (0.5, 0.1, 1.0)):  # fmt: skip
        assert leaf[int((1 - v) * 128), int(u * 128)] == opacity


def test_sky_is_what_the_script_writes(script):
    channels, _ = read_exr(TEXTURES / "sky.exr")
    stored = np.stack([channels[c] for c in "RGB"], axis=-1)
    assert stored.shape == (128, 256, 3)
    # The last bit of float32 is left to the machine's sine.
    np.testing.assert_array_max_ulp(stored.astype(np.float32), script["sky"](), maxulp=1)


def test_the_sun_is_where_it_should_be(script):
    sky = read_image(TEXTURES / "sky.exr", "auto")
    assert sky.min() > 0.05
    elevation, azimuth, radius = script["SUN"]
    y, x = np.indices(sky.shape[:2])
    polar, turn = y * math.pi / 127, ((x + 0.5) / 256 - 0.5) * 2 * math.pi
    area = np.sin(polar) * (math.pi / 127) * (2 * math.pi / 256)
    bright = sky[..., 0] > 100.0
    # A texel is 1.4 degrees.
    assert np.sum(polar[bright] * area[bright]) / area[bright].sum() == pytest.approx(
        math.pi / 2 - elevation, abs=0.01
    )
    assert np.sum(turn[bright] * area[bright]) / area[bright].sum() == pytest.approx(
        azimuth, abs=0.01
    )
    extra = np.where(bright, sky[..., 0] - np.median(sky[..., 0]), 0.0)
    disc = 2 * math.pi * (1 - math.cos(radius))
    assert np.sum(extra * area) == pytest.approx(420.0 * disc, rel=0.1)  # a disc of 14 texels


def test_all_are_small():
    assert sum(path.stat().st_size for path in TEXTURES.iterdir()) < 500_000
