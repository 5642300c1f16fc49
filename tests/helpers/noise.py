"""Laws of noise, and what is made of noisy pictures, for the tests of verdicts.

Each law is a function (rng, count, side) that makes `count` independent pictures (side, side, 3) of
one mean.
"""

import numpy as np

from comparisons.results.case import FloatArray, Images, RungResult
from comparisons.rungs.images import images_rung
from comparisons.statistics import Known
from comparisons.statistics.metrics import image_metrics


def known(pictures: FloatArray) -> Known:
    """The mean of replicates, and the variance of that mean."""
    return Known(pictures.mean(axis=0), pictures.var(axis=0, ddof=1) / len(pictures))


def as_wholes(candidate: FloatArray, reference: FloatArray) -> RungResult:
    """The rung `images` of replicates."""
    means = Images(candidate.mean(axis=0), reference.mean(axis=0))
    return images_rung(means, image_metrics(means), (candidate, reference))


CHANCES = np.random.default_rng(6).random((64, 64, 3)) ** 6
BRIGHTNESS = 10.0 ** np.random.default_rng(5).uniform(-2.0, 2.0, (64, 64, 1))


def normal(rng, count, side=32):
    return 1.0 + 0.3 * rng.standard_normal((count, side, side, 3))


def lognormal(rng, count, side=32):
    """Sigma 2: skewness 414."""
    return np.exp(2.0 * rng.standard_normal((count, side, side, 3)) - 2.0)


def fireflies(rng, count, side=32):
    """One sample in 1e4 carries half of the energy."""
    smooth = 0.5 * rng.gamma(4.0, 0.25, (count, side, side, 3))
    return smooth + (rng.random((count, side, side, 1)) < 1e-4) * 5000.0


def pareto(rng, count, side=32):
    """Without a variance: the tail's exponent is 1.2."""
    return 0.5 + 0.1 * rng.pareto(1.2, (count, side, side, 3))


def on_and_off(rng, count, side=32):
    """One sample a pixel that meets a light or not, seldom in a quarter of the picture."""
    chance = np.full((side, side, 3), 0.5)
    chance[: side // 2] = 0.05
    chance[: side // 2, : side // 2] = 0.003
    return (rng.random((count, side, side, 3)) < chance).astype(float)


def texture(rng, count, side=32):
    """Two values a pixel, and next to a dark pixel one that is up to 1e4 times as bright."""
    return BRIGHTNESS[:side, :side] * (rng.random((count, side, side, 3)) < CHANCES[:side, :side])


def caustic(rng, count, side=32):
    """Little noise, rare bright paths in a sixteenth of the picture, and a black border."""
    pictures = 0.5 + 0.05 * rng.standard_normal((count, side, side, 3))
    n = side // 4
    bright = (rng.random((count, n, n, 1)) < 0.02) * rng.pareto(1.5, (count, n, n, 1)) * 10.0
    pictures[:, n : 2 * n, n : 2 * n] += bright
    pictures[:, : n // 2] = 0.0
    return pictures


def filtered(rng, count, side=32):
    """Grey noise that a reconstruction filter spreads over neighbours."""
    x = rng.gamma(0.5, 2.0, (count, side + 2, side + 2, 1))
    around = x[:, :-2, 1:-1] + x[:, 2:, 1:-1] + x[:, 1:-1, 2:] + x[:, 1:-1, :-2]
    return (2.0 * x[:, 1:-1, 1:-1] + around) / 6.0 * np.ones(3)


LAWS = {
    law.__name__: law
    for law in (normal, lognormal, fireflies, pareto, on_and_off, texture, caustic, filtered)
}
