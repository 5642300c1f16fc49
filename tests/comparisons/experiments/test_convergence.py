"""Error against time: estimators of known error, slope, bias and speed are measured as such."""

import math

import numpy as np
import pytest

from comparisons.experiments.convergence.estimates import (
    Accumulator,
    against,
    bias_of,
    common_error,
    effective_number,
    errors,
    mean_of,
)
from comparisons.experiments.convergence.findings import findings_of, ratio
from comparisons.experiments.convergence.store import Reference, Rung, weights
from reference_rt.core.arrays import FloatArray

SHAPE = (24, 32, 3)


def truth(rng: np.random.Generator) -> FloatArray:
    """A picture without noise, of mean about 1, dark in places."""
    return np.asarray(rng.uniform(0.0, 2.0, SHAPE))


def reference(true: FloatArray, noise: float, rng: np.random.Generator, count: int = 16):
    """As ours is made: the mean of independent pictures, and its variance from their scatter."""
    pictures = true + noise * rng.standard_normal((count, *true.shape))
    return Reference(pictures.mean(axis=0), pictures.var(axis=0, ddof=1) / count, count, 64)


def rung(asked: int, pictures: FloatArray, against_: Reference, seconds: float = 0.1) -> Rung:
    gathered = Accumulator(asked, against_)
    for k, picture in enumerate(pictures):
        gathered.add(picture, asked, seconds * (1.0 + 0.01 * k))
    return gathered.rung()


# ---- errors -------------------------------------------------------------------------------------


def test_reference_noise_is_subtracted_exactly_in_expectation():
    """With a reference as noisy as the pictures, the mean over many pairs is the pictures' error
    alone; without the subtraction it would be a quarter more."""
    rng = np.random.default_rng(1)
    true, bias, noise = truth(rng), 0.1, 0.4
    found = np.array(
        [
            errors(true + bias + noise * rng.standard_normal(SHAPE), reference(true, 0.8, rng))
            for _ in range(400)
        ]
    )[:, 0]
    expected = bias**2 + noise**2
    off = (found.mean() - expected) / (found.std(ddof=1) / math.sqrt(len(found)))
    assert abs(off) < 4.0
    assert 10.0 * found.std() / math.sqrt(len(found)) < 0.8**2 / 16  # it would have been seen


def test_relative_error_is_the_metric_s():
    from comparisons.results.case import Images
    from comparisons.statistics.metrics import image_metrics

    rng = np.random.default_rng(2)
    true = truth(rng)
    exact = Reference(true, np.zeros(SHAPE), 16, 64)
    picture = true + 0.1 * rng.standard_normal(SHAPE)
    mse, relmse = errors(picture, exact)
    metrics = image_metrics(Images(picture, true))
    assert relmse == pytest.approx(metrics.relmse, rel=1e-12)
    assert math.sqrt(mse) == pytest.approx(metrics.rmse, rel=1e-12)


def test_bands_hold_the_expectation():
    """Student's band of eight replicates: in 95 % of 400 runs; 4 standard deviations of a binomial
    are 4.4 %."""
    rng = np.random.default_rng(3)
    held = 0
    for _ in range(400):
        band = mean_of(rng.gamma(4.0, 0.25, 8))
        held += band.low <= 1.0 <= band.high
    assert abs(held / 400 - 0.95) < 0.044


def test_common_error_is_that_of_the_reference():
    """The errors of one good picture against many references scatter by what is foretold."""
    rng = np.random.default_rng(4)
    true = truth(rng)
    weight = weights(true)
    references = [reference(true, 0.3, rng) for _ in range(300)]
    found = [float((weight * ((true - r.mean) ** 2 - r.variance)).mean()) for r in references]
    foretold = np.mean([common_error(r, weight) for r in references])
    # Channels are independent here, and foretold as if they erred together: up to sqrt(3) more.
    assert np.std(found, ddof=1) < foretold < 2.0 * np.std(found, ddof=1)


def test_accumulated_is_the_same_as_at_once():
    rng = np.random.default_rng(5)
    true = truth(rng)
    ours = reference(true, 0.1, rng)
    pictures = true + rng.standard_normal((8, *SHAPE))
    found = rung(16, pictures, ours)
    np.testing.assert_allclose(found.mean, pictures.mean(axis=0), rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(found.variance, pictures.var(axis=0, ddof=1), rtol=1e-11)
    resumed = Accumulator(16, ours, rung(16, pictures[:3], ours))
    for k in range(3, 8):
        resumed.add(pictures[k], 16, 0.1 * (1.0 + 0.01 * k))
    for name in ("seconds", "mse", "relmse", "mean", "variance"):
        np.testing.assert_allclose(
            getattr(resumed.rung(), name), getattr(found, name), rtol=1e-10, atol=1e-13
        )


def test_another_reference_changes_errors_as_if_it_had_been_used():
    rng = np.random.default_rng(6)
    true = truth(rng)
    old, new = reference(true, 0.3, rng), reference(true, 0.05, rng)
    pictures = true + rng.standard_normal((8, *SHAPE))
    moved, direct = against(rung(16, pictures, old), new), rung(16, pictures, new)
    assert moved.mse.mean() == pytest.approx(direct.mse.mean(), rel=1e-12)
    assert moved.relmse.mean() == pytest.approx(direct.relmse.mean(), rel=1e-12)


# ---- bias ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("bias", [0.0, 0.1])
def test_bias_is_found_where_there_is_one(bias):
    """The estimate is unbiased; the upper bound holds in 99 % of the runs, the lower in 99.99 %, so
    that without bias none is seen.  Binomials of 300 runs exceed 3.6 % with a chance of 1e-4, and
    one in 300 with 4e-4."""
    rng = np.random.default_rng(7)
    true = truth(rng)
    found = []
    for _ in range(300):
        ours = reference(true, 0.3, rng)
        pictures = true + bias + 0.5 * rng.standard_normal((8, *SHAPE))
        found.append(bias_of(rung(16, pictures, ours), ours))
    squared = np.array([one.squared for one in found])
    off = (squared.mean() - bias**2) / (squared.std(ddof=1) / math.sqrt(300))
    assert abs(off) < 4.0
    assert np.mean([one.high < bias**2 for one in found]) < 0.036
    assert sum(one.low > bias**2 for one in found) <= 1
    seen = np.mean([one.is_seen for one in found])
    assert seen < 0.004 if bias == 0.0 else seen > 0.9


def test_few_bright_pixels_are_few():
    values = np.zeros(1000)
    values[:4] = 1.0
    assert effective_number(values) == pytest.approx(4.0)
    assert effective_number(np.ones(1000)) == pytest.approx(1000.0)
    assert effective_number(np.zeros(10)) == 10.0


def test_a_planted_bias_is_a_plateau():
    """Errors stop falling, the bias is seen, and targets below it are never reached."""
    rng = np.random.default_rng(8)
    true = truth(rng) + 0.5
    ours = reference(true, 0.02, rng)
    biased, fair = [], []
    for spp in (4, 16, 64, 256, 1024):
        noise = rng.standard_normal((8, *SHAPE)) / math.sqrt(spp)
        biased.append(rung(spp, true * 1.05 + noise, ours, 0.01 * spp))
        fair.append(rung(spp, true + noise, ours, 0.01 * spp))
    targets = (0.2, 0.03, 0.01)
    plateau, falling = (findings_of(r, ours, targets, False) for r in (biased, fair))
    assert plateau.relative_bias.is_seen
    assert not falling.relative_bias.is_seen
    # A picture 5 % too bright has a relative error a little below 5 %, for epsilon.
    assert 0.04 < math.sqrt(plateau.relative_bias.squared) < 0.05
    assert [target.how for target in plateau.targets] == ["interpolated", "bias", "bias"]
    assert math.isinf(plateau.targets[1].seconds.value)
    assert falling.targets[1].how == "interpolated"
    assert plateau.slopes["relmse"]["spp"].slope > falling.slopes["relmse"]["spp"].slope + 0.1
    assert ratio(falling.targets[1], plateau.targets[1]) == (0.0, 0.0, 0.0)
