"""The input rung: each defect of a picture is reported as what it is."""

from functools import cache

import numpy as np
import pytest
from scipy import ndimage

from comparisons.results.case import FloatArray
from comparisons.rungs.input import input_rung
from reference_rt.rendering.image import srgb
from reference_rt.textures.image_file import linear

HEIGHT, WIDTH = 48, 64


def picture() -> FloatArray:
    """A smooth picture with an edge, a fine texture and a lamp that is brighter than 1."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH] / 32.0
    value = 0.5 + 0.2 * np.sin(3.0 * x) * y + 0.1 * np.sin(40.0 * x * y)
    value[:, 40:] *= 0.3
    value[4:12, 8:24] = 5.0 + x[4:12, 8:24]
    return np.stack([value, 0.8 * value, 0.6 * value + 0.02 * x], axis=-1)


def noisy(seed: int, count: int = 8, noise: float = 0.05) -> FloatArray:
    rng = np.random.default_rng(seed)
    clean = picture()
    return clean * (1.0 + noise * rng.normal(size=(count, *clean.shape)))


def test_independent_replicates_are_in_order() -> None:
    for seed in range(0, 40, 2):
        result = input_rung(noisy(seed), noisy(seed + 1, count=6))
        assert (result.name, result.status) == ("input", "agree"), result.reason
    assert result.numbers["replicates_candidate"] == 8
    assert result.numbers["negative_values"] == 0


def test_a_single_picture_is_in_order() -> None:
    assert input_rung(picture(), picture()).status == "agree"
    assert input_rung(noisy(0, 1)[0], picture(), np.ones((HEIGHT, WIDTH))).status == "agree"


@pytest.mark.parametrize(
    ("candidate", "message"),
    [
        (np.ones((48, 64)), "2 dimensions"),
        (np.ones((48, 64, 4)), "the candidate has 4 channels"),
        (np.ones((0, 64, 3)), "the candidate is empty"),
        (np.ones((48, 60, 3)), "60 x 48 pixels; expected 64 x 48, as the reference"),
        (np.ones((64, 48, 3)), "width and height are exchanged"),
        (np.ones((96, 128, 3)), "the same view, 2 times as large"),
        (np.ones((24, 32, 3)), "the same view, 1/2 as large"),
    ],
)
def test_shapes_and_sizes(candidate: FloatArray, message: str) -> None:
    result = input_rung(candidate, picture())
    assert result.status == "invalid"
    assert message in result.reason
    assert "expected" in result.reason


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_one_number_that_is_not_finite(value: float) -> None:
    candidate = noisy(0)
    candidate[3, 7, 9, 1] = value
    result = input_rung(candidate, noisy(1))
    assert result.status == "invalid"
    assert f"1 pixel of the candidate not finite, the first {value}" in result.reason
    assert "column 9, row 7 of replicate 3" in result.reason
    result = input_rung(noisy(1), candidate)
    assert "of the reference not finite" in result.reason


def test_opacity() -> None:
    candidate, reference = picture(), picture()
    alpha = np.ones((HEIGHT, WIDTH))
    for bad, message in (
        (np.zeros_like(alpha), "transparent throughout"),
        (alpha[:3], "the opacity's shape is"),
        (np.where(np.arange(WIDTH) == 5, np.nan, alpha), "not finite at column 5, row 0"),
    ):
        result = input_rung(candidate, reference, bad)
        assert result.status == "invalid"
        assert message in result.reason
    alpha[20, 30] = 0.0
    # A background that a camera sees is transparent, yet has its colour.
    assert input_rung(candidate, reference, alpha).status == "agree"
    candidate[20, 30] = 0.0
    result = input_rung(candidate, reference, alpha)
    assert result.status == "invalid"
    assert "1 pixel of the candidate transparent and black" in result.reason
    assert "column 30, row 20" in result.reason


def test_black_and_constant() -> None:
    reference = noisy(1)
    result = input_rung(np.zeros_like(reference), reference)
    assert result.status == "invalid"
    assert "black throughout (all replicates)" in result.reason
    candidate = noisy(0)
    candidate[5] = 0.0
    assert "(replicate 5 of 8)" in input_rung(candidate, reference).reason
    candidate[5] = 0.25
    result = input_rung(candidate, reference)
    assert result.status == "invalid"
    assert "(0.25, 0.25, 0.25) (replicate 5 of 8)" in result.reason
    black = np.zeros((HEIGHT, WIDTH, 3))
    assert input_rung(black, black).status == "agree"
    assert input_rung(black + 0.5, black + 0.4).status == "agree"


def test_replicates_that_are_the_same() -> None:
    candidate = noisy(0)
    candidate[6] = candidate[2]
    result = input_rung(candidate, noisy(1))
    assert result.status == "invalid"
    assert "replicates 2, 6 of 8 of the candidate are the same bit for bit" in result.reason
    same = np.repeat(noisy(0, 1), 8, axis=0)
    assert "all replicates of the candidate" in input_rung(same, noisy(1)).reason
    assert "of the reference are the same" in input_rung(noisy(1), same).reason
    # Where the reference has no noise either there is none to expect.
    assert input_rung(same, same).status == "agree"
    # Known by its mean alone it says nothing of noise, but several candidates do.
    assert input_rung(same, picture()).status == "invalid"


@pytest.mark.cases(2)
@pytest.mark.parametrize("background", [0.0, 1.0])
@pytest.mark.parametrize("pixels", [1, 2, 4, 8, 64, 512])
@pytest.mark.parametrize("pairs", [10, pytest.param(50, marks=pytest.mark.slow)])
def test_pictures_with_few_noisy_pixels(pairs: int, pixels: int, background: float) -> None:
    """Of which each has two values, half of the time: pictures are flat, black or the same again
    by chance."""
    rng = np.random.default_rng(pixels)

    def pictures() -> FloatArray:
        flat = np.full((16, 32, 32, 3), background)
        noise = rng.integers(2, size=(16, pixels, 1))
        flat.reshape(16, -1, 3)[:, 7 : 7 + pixels] += noise
        return flat

    for _ in range(pairs):
        candidate, reference = pictures(), pictures()
        assert input_rung(candidate, reference).status == "agree"
    for wrong in (candidate[2], np.full_like(candidate[2], background)):
        candidate[6] = wrong
        seen = input_rung(candidate, reference).status == "invalid"
        assert seen == (pixels >= 64)
        everywhere = np.repeat(wrong[None], 16, axis=0)
        seen = input_rung(everywhere, reference).status == "invalid"
        assert seen if pixels >= 8 else (not seen or pixels > 1)


@pytest.mark.parametrize("share", [0.3, 0.5])
def test_noise_in_common(share: float) -> None:
    own = noisy(0, 16)
    candidate = (1.0 - share) * own + share * own[:1]
    result = input_rung(candidate, noisy(1, 16))
    assert result.status == "invalid"
    assert "share noise" in result.reason


def test_two_replicates_with_overlapping_seeds() -> None:
    candidate = noisy(0, 16)
    candidate[9] = 0.5 * candidate[9] + 0.5 * candidate[4]
    result = input_rung(candidate, noisy(1, 16))
    assert result.status == "invalid"
    assert "replicates 4 and 9 of the candidate share noise" in result.reason


@cache
def wrong_pictures() -> dict[str, FloatArray]:
    candidate = noisy(0, 16)
    wrong = {
        "gain": candidate * 1.02,
        "offset": candidate + 0.01,
        "gamma": np.maximum(candidate, 0.0) ** 0.97,
        "tile": candidate.copy(),
    }
    wrong["tile"][:, 16:32, 16:32] *= 0.9
    for pixels in (0.1, 0.5, 1.0):
        wrong[f"shift {pixels}"] = ndimage.shift(
            candidate, (0, 0, pixels, 0), order=1, mode="nearest"
        )
    wrong["blur"] = ndimage.gaussian_filter(candidate, (0, 0.5, 0.5, 0))
    wrong["mirrored"] = candidate[:, :, ::-1]
    return wrong


@cache
def right_pictures() -> FloatArray:
    return noisy(1, 16)


@pytest.mark.parametrize("name", wrong_pictures())
def test_a_wrong_picture_is_not_taken_for_noise(name: str) -> None:
    result = input_rung(wrong_pictures()[name], right_pictures())
    assert result.status == "agree", result.reason


@pytest.mark.parametrize("encoding", ["sRGB", "linear"])
def test_eight_bits(encoding: str) -> None:
    def rounded(x: FloatArray) -> FloatArray:
        if encoding == "linear":
            return np.round(255.0 * np.clip(x, 0.0, 1.0)) / 255.0
        return np.asarray(linear(np.round(255.0 * np.clip(srgb(x), 0.0, 1.0)) / 255.0))

    for candidate, reference in ((noisy(0), noisy(1)), (picture(), picture())):
        result = input_rung(rounded(candidate), reference)
        assert result.status == "invalid"
        assert f"8-bit {encoding} codes" in result.reason
        # Half floats of 8-bit values are still of 8 bits.
        half = rounded(candidate).astype(np.float16)
        assert f"8-bit {encoding} codes" in input_rung(half, reference).reason
    # A reference of 8 bits too makes such a candidate the right one.
    assert input_rung(rounded(picture()), rounded(picture())).status == "agree"


def test_flat_colours_are_not_eight_bits() -> None:
    numbers = np.arange(HEIGHT * WIDTH).reshape(HEIGHT, WIDTH) // 200
    flat = np.repeat((numbers / 17.0)[..., None], 3, axis=-1)
    assert input_rung(flat, flat * 0.999).status == "agree"


def test_clamped_highlights() -> None:
    result = input_rung(np.minimum(noisy(0), 1.0), noisy(1))
    assert result.status == "differ"
    assert "highlights are clamped" in result.reason
    assert "exactly 1, its maximum" in result.reason
    # A lamp that is dimmer but as flat as the reference's is no clamped one.
    dim, bright = noisy(0), noisy(1)
    dim[:, 4:12, 8:24], bright[:, 4:12, 8:24] = 1.5, 5.0
    assert input_rung(dim, bright).status == "agree"


def test_negative_values_are_counted() -> None:
    candidate = picture()
    candidate[3, 4, 1] = -1e-3
    result = input_rung(candidate, picture())
    assert result.status == "agree"
    assert result.numbers["negative_values"] == 1
    assert "1 negative value" in result.reason


@pytest.mark.parametrize(
    "change",
    [
        lambda p: p[..., ::-1],
        lambda p: p[..., [1, 2, 0]],
        lambda p: p.mean(axis=-1, keepdims=True) * np.ones(3),
        lambda p: p * [1.2, 1.0, 0.8],
    ],
    ids=["two channels", "three channels", "grey", "tinted"],
)
@pytest.mark.parametrize("texture", ["smooth", "fine"])
def test_wrong_colours_of_a_tinted_picture_are_no_shared_noise(change, texture: str) -> None:
    """Their errors cancel in the sum over the channels, which left only noise to judge. Of a fine
    texture they are independent between pixels, as noise is, but like the picture."""
    rng = np.random.default_rng(0)
    y, x = np.mgrid[0:48, 0:48] / 48
    shade = (0.5 + 0.3 * np.sin(5.0 * x) * np.cos(7.0 * y))[..., None] * [1.0, 0.9, 0.7]
    if texture == "fine":
        shade = rng.uniform(0.4, 0.6, shade.shape)
    sides = [shade * (1.0 + 0.1 * rng.normal(size=(8, *shade.shape))) for _ in range(2)]
    assert input_rung(change(sides[0]), sides[1]).status == "agree"
