"""The script in `scenes` gives the images that lie beside it, and they are what they should be."""

import runpy
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from reference_rt import read_image
from reference_rt.core.exr import read_exr

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


def test_sky_is_what_the_script_writes(script):
    channels, _ = read_exr(TEXTURES / "sky.exr")
    stored = np.stack([channels[c] for c in "RGB"], axis=-1)
    assert stored.shape == (128, 256, 3)
    # The last bit of float32 is left to the machine's sine.
    np.testing.assert_array_max_ulp(stored.astype(np.float32), script["sky"](), maxulp=1)


def test_the_exposed_sky_is_the_sky_at_twice_its_radiance(script):
    assert (TEXTURES / "sky_exposed.hdr").read_bytes() == script["exposed_sky"]()
    means = script["sky"]().reshape(16, 8, 32, 8, 3).mean(axis=(1, 3))
    # A mantissa of 8 bits of the brightest channel, rounded down.
    step = 2.0 * means.max(axis=-1, keepdims=True) / 128.0
    found = read_image(TEXTURES / "sky_exposed.hdr")
    assert np.all((found <= 2.0 * means) & (found > 2.0 * means - step))
