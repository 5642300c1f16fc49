"""Float pictures on the page: packing loses nothing, and what is too large is made smaller."""

import json
import math

import numpy as np
import pytest
from report_page import noise

from comparisons.report.page import fitted
from comparisons.report.pictures_data import EXACT, as_json, pack, reduced, reduced_images, unpack
from comparisons.results.case import Images


def test_what_is_packed_comes_back_within_the_stated_bounds():
    rng = np.random.default_rng(1)
    reference = rng.lognormal(sigma=3.0, size=(40, 50, 3)) * rng.choice([-1, 0, 1], (40, 50, 3))
    relative = 10.0 ** rng.uniform(-9, 1, reference.shape) * rng.choice([-1, 0, 1], reference.shape)
    candidate = reference * (1.0 + relative)
    error = rng.lognormal(sigma=3.0, size=reference.shape)
    back = unpack(pack(Images(candidate, reference, error)))
    np.testing.assert_allclose(back.reference, reference, rtol=2**-11)
    np.testing.assert_allclose(back.candidate, candidate, rtol=2**-10)
    np.testing.assert_allclose(back.error, error, rtol=2**-4)
    difference = candidate - reference
    np.testing.assert_allclose(back.difference, difference, rtol=2**-6)
    assert (back.difference[difference == 0.0] == 0.0).all()
    assert (np.sign(back.reference) == np.sign(reference)).all()


def test_exact_pictures_are_those_of_the_file():
    candidate, reference = (noise((20, 30), k).astype(np.float32).astype(float) for k in (0, 1))
    candidate[0, 0] = np.nextafter(reference[0, 0].astype(np.float32), np.float32(9.0))
    back = unpack(pack(Images(candidate, reference), bits=EXACT))
    np.testing.assert_array_equal(back.candidate, candidate)
    np.testing.assert_array_equal(back.reference, reference)
    np.testing.assert_array_equal(back.difference, candidate - reference)


def test_what_is_not_finite_or_far_too_bright_comes_back_as_it_is():
    reference, candidate = noise((20, 20)), noise((20, 20), 1)
    candidate[0, :4, 0] = np.nan, np.inf, -np.inf, 1e50
    reference[1, :3, 1] = 4e38, np.nan, -1e-300
    back = unpack(pack(Images(candidate, reference, np.zeros_like(reference))))
    np.testing.assert_array_equal(back.candidate[0, :4, 0], candidate[0, :4, 0])
    np.testing.assert_array_equal(back.reference[1, :3, 1], reference[1, :3, 1])
    # ... and the others keep their digits beside it.
    others = np.ones(reference.shape, dtype=bool)
    others[:2, :4] = False
    np.testing.assert_allclose(back.candidate[others], candidate[others], rtol=2**-10)
    np.testing.assert_allclose(back.reference[others], reference[others], rtol=2**-11)


def test_pictures_of_unlike_size_are_packed_alone():
    candidate, reference = noise((3, 7)), noise((5, 2))
    back = unpack(pack(Images(candidate, reference)))
    np.testing.assert_allclose(back.candidate, candidate, rtol=2**-11)
    np.testing.assert_allclose(back.reference, reference, rtol=2**-11)
    assert back.difference is None
    assert back.error is None


def test_pictures_alike_are_small():
    """Bytes a pixel of noisy pictures: what the page's size follows from."""
    picture = noise((64, 64))
    error = 0.01 * picture
    seeds = np.random.default_rng(5).normal(size=(2, *picture.shape))
    candidate, reference = picture + error * seeds / math.sqrt(2)
    noisy = len(pack(Images(candidate, reference, error))["bytes"]) / 64**2
    equal = len(pack(Images(picture, picture))["bytes"]) / 64**2
    assert noisy < 20.0
    assert equal < 8.0


def test_reduced_pictures_are_means():
    picture = np.arange(30.0).reshape(2, 5, 3)
    small = reduced(picture, 2)
    assert small.shape == (1, 3, 3)
    np.testing.assert_array_equal(small[0, 0], picture[:, :2].mean(axis=(0, 1)))
    np.testing.assert_array_equal(small[0, 2], picture[:, 4:].mean(axis=(0, 1)))
    picture[1, 1, 0] = np.nan
    assert np.isnan(reduced(picture, 2)[0, 0, 0])
    assert np.isfinite(reduced(picture, 2)[0, 1:]).all()
    images = Images(picture, picture, np.full((2, 5, 3), 2.0))
    np.testing.assert_array_equal(reduced_images(images, 2).error[0, :, 0], [1, 1, math.sqrt(2)])


def test_data_cannot_end_its_script_element():
    assert not set("<>&") & set(as_json({"x": "</script><!--&"}))
    assert json.loads(as_json({"x": "</script>&"})) == {"x": "</script>&"}
    with pytest.raises(ValueError, match="JSON"):
        as_json({"x": math.nan})


def test_passing_cases_lose_detail_first_and_the_largest_first():
    large, small = (Images(noise((n, n)), noise((n, n), 1)) for n in (32, 16))
    pictures, failed = [large, small, large, None], [True, False, False, False]
    sizes = [len(as_json(pack(images))) for images in (large, small, large)]
    assert [f and f.factor for f in fitted(pictures, failed, sum(sizes))] == [1, 1, 1, None]
    assert [f and f.factor for f in fitted(pictures, failed, sum(sizes) - 1)] == [1, 1, 2, None]
    only_failed = fitted(pictures, failed, sizes[0])
    assert [f.data == "" for f in only_failed[:3]] == [False, True, True]
    assert only_failed[0].factor == 1
    assert fitted(pictures, failed, 0)[0].data == ""
