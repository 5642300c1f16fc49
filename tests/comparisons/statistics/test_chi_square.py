"""The chi-square test itself: its quadrature, and that it notices what is wrong."""

import math

import numpy as np
import pytest

from comparisons.statistics.chi_square import SPHERE, UNIT_SQUARE, chi_square, integrate


def lobe(width):
    """Density about the x axis, exponential in the cosine, and 40 000 samples of it."""
    rng = np.random.default_rng(1)
    cosine = 1 + np.log(rng.uniform(math.exp(-2 / width), 1, 40_000)) * width
    sine, phi = np.sqrt(np.maximum(0, 1 - cosine**2)), rng.uniform(0, 2 * math.pi, 40_000)
    norm = 2 * math.pi * width * -math.expm1(-2 / width)
    return (
        lambda v: np.exp((v[:, 0] - 1) / width) / norm,
        np.stack([cosine, sine * np.cos(phi), sine * np.sin(phi)], axis=1),
    )


@pytest.mark.parametrize("width", [1.0, 1e-3, 1e-6])
def test_right_and_wrong_densities(width):
    density, samples = lobe(width)
    fit = chi_square(density, samples)
    assert fit.p_value > 1e-6
    assert fit.integral == pytest.approx(1.0, abs=1e-4)
    wrong, _ = lobe(1.2 * width)
    assert chi_square(wrong, samples).p_value < 1e-6
    assert integrate(density, samples) == pytest.approx(1.0, abs=1e-4)


def test_failed_samples_are_those_the_density_lacks():
    density, samples = lobe(0.5)
    samples[::4] = math.nan
    assert chi_square(lambda v: 0.75 * density(v), samples).p_value > 1e-6
    assert chi_square(density, samples).p_value < 1e-6


def test_a_sample_where_there_is_no_density():
    samples = np.random.default_rng(2).uniform(0, 1, (20_000, 2))
    half = chi_square(lambda x: np.where(x[:, 0] < 0.999, 1 / 0.999, 0.0), samples, UNIT_SQUARE)
    assert half.p_value == 0.0
    assert half.outside > 0
    assert chi_square(lambda x: np.ones(len(x)), samples, UNIT_SQUARE).p_value > 1e-6


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_density_that_is_not_finite_is_told(value):
    density, samples = lobe(0.5)
    wrong = with_values(density, value)
    with pytest.raises(ArithmeticError, match=f"the density is {value} at "):
        chi_square(wrong, samples)
    with pytest.raises(ArithmeticError, match=f"the density is {value} at "):
        integrate(wrong, samples[samples[:, 0] > 0.0])


def with_values(density, value):
    """The density, with another value where hardly any sample is."""
    return lambda v: np.where(v[:, 0] < -0.999, value, density(v))


def test_a_density_that_is_another_each_time_ends():
    density, samples = lobe(0.5)
    rng = np.random.default_rng(4)
    with pytest.raises(ArithmeticError, match="the same each time"):
        chi_square(lambda v: density(v) * rng.uniform(0.5, 1.5, len(v)), samples, points=4)


def test_directions_and_coordinates():
    at = np.random.default_rng(3).uniform(SPHERE.low, SPHERE.high, (100, 2))
    assert SPHERE.coordinates(SPHERE.points(at)) == pytest.approx(at, abs=1e-12)
