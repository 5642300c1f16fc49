"""Stages of a picture: their mean, their number of samples, their noise."""

import math
from itertools import pairwise

import numpy as np
import pytest
from builders import SCENES

import reference_rt as rt
from reference_rt.rendering.progressive import _noise, progressive

BOX = SCENES / "cornell_box.yaml"


def scene(**parts):
    found = rt.Scene.load(BOX)
    return found.changed(film=found.film.model_copy(update={"width": 12, "height": 9}), **parts)


def test_the_last_stage_has_all_samples():
    stages = list(progressive(scene(), spp=16, threads=1))
    counts = [stage.spp for stage in stages]
    assert counts[0] == 1
    assert counts[-1] == 16
    assert all(a < b <= 2 * a for a, b in pairwise(counts))
    assert [stage.finished for stage in stages] == [False] * (len(stages) - 1) + [True]
    assert stages[0].noise == math.inf
    assert all(0.0 < stage.noise < math.inf for stage in stages[1:])


def test_a_stage_is_the_mean_of_its_passes():
    """Of two passes with one sample each, whose pictures `render` gives too."""
    first, second = list(progressive(scene(), spp=2, threads=1))
    seed = scene().resolved_sampler.seed
    passes = [rt.render(scene(), spp=1, seed=seed + k).colour for k in range(2)]
    assert (first.picture.colour == passes[0]).all()
    np.testing.assert_allclose(
        second.picture.colour, np.mean(passes, axis=0), rtol=4.0 * np.finfo(float).eps
    )


def test_without_random_numbers_there_is_one_stage():
    whitted = scene(integrator=rt.Whitted(), sampler=None)
    (stage,) = progressive(whitted, spp=64)
    assert (stage.noise, stage.finished) == (0.0, True)
    assert (stage.picture.colour == rt.render(whitted).colour).all()


def test_further_layers_are_left_out():
    described = scene()
    layered = described.film.model_copy(update={"layers": ("albedo", "variance")})
    for stage in progressive(described.changed(film=layered), spp=2):
        assert set(stage.picture.layers) == {"colour"}


@pytest.mark.parametrize(("n", "m"), [(1, 1), (16, 16), (64, 5), (3, 200)])
def test_the_noise_is_the_standard_error(n, m):
    """Of normal numbers with mean 1 and a relative deviation of 0.3 per sample.  The median of 1e5
    absolute deviations has a relative standard error of 0.4 %: here four of them."""
    rng = np.random.default_rng(n + 1000 * m)
    size = (1, 100_000, 1)
    a, b = (np.repeat(1.0 + rng.normal(0.0, 0.3 / math.sqrt(k), size), 3, axis=2) for k in (n, m))
    # Weights of luminance add to 1.  Means of few samples spread, which the quotient feels: in
    # the second order, of the square of the spread.
    spread = 0.3 / math.sqrt(n + m)
    assert _noise(a, n, b, m) == pytest.approx(spread, rel=0.016 + 2.0 * spread**2)


def test_a_black_picture_has_no_known_noise():
    black = np.zeros((2, 2, 3))
    assert _noise(black, 1, black, 1) == math.inf
