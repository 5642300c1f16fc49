"""Warps: the circle against 40 digits, directions against their densities."""

import math
from decimal import Decimal, getcontext

import numpy as np
from builders import U

from reference_rt.kernel import entry_kernel
from reference_rt.sampling.warp import cosine_hemisphere, on_circle, uniform_sphere

CHI2_199 = 308.60
"""The quantile 1 - 1e-6 of chi-square with 199 degrees of freedom: scipy.stats.chi2.ppf."""

PI = Decimal("3.14159265358979323846264338327950288419716939937510")


@entry_kernel
def _warp_all(u, circle, hemisphere, sphere):
    for i in range(len(u)):
        circle[i, 0], circle[i, 1] = on_circle(u[i, 1])
        hemisphere[i, 0], hemisphere[i, 1], hemisphere[i, 2] = cosine_hemisphere(u[i, 0], u[i, 1])
        sphere[i, 0], sphere[i, 1], sphere[i, 2] = uniform_sphere(u[i, 0], u[i, 1])


def warp(u):
    out = np.empty((len(u), 2)), np.empty((len(u), 3)), np.empty((len(u), 3))
    _warp_all(u, *out)
    return out


def exact_circle(turns):
    """cos and sin of 2 pi turns to 40 digits: Taylor's series after splitting quarters off."""
    getcontext().prec = 45
    quarters = round(4 * turns)
    x = (4 * Decimal(turns) - quarters) * PI / 2
    term, sums = Decimal(1), [Decimal(0), Decimal(0)]
    for k in range(40):
        sums[k % 2] += term if k % 4 < 2 else -term
        term *= x / (k + 1)
    c, s = sums
    return [(c, s), (-s, c), (-c, -s), (s, -c)][quarters % 4]


def test_on_circle():
    rng = np.random.default_rng(71)
    eighths = np.arange(8) / 8
    turns = np.concatenate(
        [
            rng.uniform(0, 1, 3000),
            eighths,
            np.nextafter(eighths, 1),
            np.nextafter(eighths[1:], 0),
            10.0 ** rng.uniform(-12, -1, 200),
        ]
    )
    circle, _, _ = warp(np.column_stack([turns, turns]))
    worst = max(
        abs(float(Decimal(float(found)) - exact))
        for t, pair in zip(turns, circle, strict=True)
        for found, exact in zip(pair, exact_circle(float(t)), strict=True)
    )
    assert worst <= 4 * U  # what its docstring promises


def test_quarter_turns_are_exact():
    circle, _, _ = warp(np.array([[0, 0], [0, 0.25], [0, 0.5], [0, 0.75]]))
    assert circle.tolist() == [[1, 0], [0, 1], [-1, 0], [0, -1]]


def uniform(n, seed):
    return np.random.default_rng(seed).uniform(0, 1, (n, 2))


def chi_square(a, b):
    """Of two numbers that should be uniform on [0, 1], over 10 x 20 cells."""
    counts, _, _ = np.histogram2d(a, b, bins=(10, 20), range=[[0, 1], [0, 1]])
    expected = len(a) / 200
    return np.sum((counts - expected) ** 2) / expected


def azimuth(v):
    return np.arctan2(v[:, 1], v[:, 0]) / (2 * math.pi) % 1.0


def test_cosine_hemisphere():
    """Density cos / pi: the integral up to theta is sin² theta."""
    _, v, _ = warp(uniform(200_000, 72))
    # Three squares and a root, each of a number rounded a few times.
    assert np.abs(np.linalg.norm(v, axis=1) - 1).max() < 8 * U
    assert (v[:, 2] > 0).all()
    assert chi_square(1 - v[:, 2] ** 2, azimuth(v)) < CHI2_199


def test_uniform_sphere():
    """Density 1 / (4 pi): height is uniform."""
    _, _, v = warp(uniform(200_000, 73))
    assert np.abs(np.linalg.norm(v, axis=1) - 1).max() < 8 * U
    assert chi_square(0.5 * (v[:, 2] + 1), azimuth(v)) < CHI2_199


def test_the_ends_of_the_unit_square():
    """The least and the largest numbers that samplers draw."""
    ends = np.array([2.0**-33, 1 - 2.0**-33])
    _, hemisphere, sphere = warp(np.array([(a, b) for a in ends for b in ends]))
    assert np.isfinite(hemisphere).all()
    assert np.isfinite(sphere).all()
    assert (hemisphere[:, 2] > 0).all()
