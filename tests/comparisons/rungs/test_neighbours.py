"""Values of neighbouring rays: which colours lie between them."""

import numpy as np
import pytest

from comparisons.rungs.rays.neighbours import is_mixture

RNG = np.random.default_rng(5)


@pytest.mark.cases(13)
@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("count", [1, 2, 3, 4, 193])
def test_weighted_means_are_mixtures_and_what_lies_outside_is_none(count, scale):
    for _ in range(20):
        values = scale * RNG.uniform(size=(count, 3))
        weights = RNG.dirichlet(np.ones(count))
        slack = 1e-5 * scale
        inside = weights @ values
        assert is_mixture(inside, values, slack)
        off = RNG.uniform(-slack, slack, 3)
        assert is_mixture(inside + off, values, slack)
        # Beyond the value that is furthest along any direction nothing is a mean; a slack of one in
        # each channel reaches sqrt(3) at most.
        way = RNG.normal(size=3)
        way /= np.linalg.norm(way)
        furthest = values[np.argmax(values @ way)]
        assert not is_mixture(furthest + 1.8 * slack * way, values, slack)
        assert is_mixture(furthest + 0.9 * slack * way, values, slack)


def test_a_gradient_explains_no_change_of_one_channel():
    """Though each channel lies between those of the gradient."""
    gradient = np.linspace(0.2, 0.4, 50)[:, None] * [1.0, 0.5, 0.8]
    middle = np.array([0.3, 0.15, 0.24])
    assert is_mixture(middle, gradient, 1e-6)
    assert not is_mixture(middle * [1.0, 1.0, 1.1], gradient, 1e-3)
    assert not is_mixture(middle * [1.0, 1.0, 1.1], gradient[[0, -1]], 1e-3)


def test_values_that_are_not_finite_count_as_absent():
    values = np.array([[np.nan, 0.0, 0.0], [np.inf, 1.0, 1.0], [1.0, 1.0, 1.0]])
    assert is_mixture(np.ones(3), values, 0.0)
    assert not is_mixture(np.full(3, 1.1), values, 1e-3)
    assert not is_mixture(np.ones(3), values[:2], 1.0)
    assert not is_mixture(np.array([np.nan, 1.0, 1.0]), values, 1.0)
    assert not is_mixture(np.array([np.inf, 1.0, 1.0]), values, 1.0)
