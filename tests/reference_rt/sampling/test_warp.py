"""Warps: the circle against 40 digits, directions against their densities."""

import math
from decimal import Decimal, getcontext

import numpy as np
import pytest
from builders import U
from scipy.special import ndtri

from comparisons.statistics.chi_square import SPHERE, Chart, chi_square, sidak
from reference_rt.jit.kernel import entry_kernel
from reference_rt.sampling.warp import (
    about_normal,
    concentric_disk,
    cosine_hemisphere,
    on_circle,
    turns,
    uniform_sphere,
)

PI = Decimal("3.14159265358979323846264338327950288419716939937510")


@entry_kernel
def _warp_all(u, circle, hemisphere, sphere, disk):
    for i in range(len(u)):
        circle[i, 0], circle[i, 1] = on_circle(u[i, 1])
        hemisphere[i, 0], hemisphere[i, 1], hemisphere[i, 2] = cosine_hemisphere(u[i, 0], u[i, 1])
        sphere[i, 0], sphere[i, 1], sphere[i, 2] = uniform_sphere(u[i, 0], u[i, 1])
        disk[i, 0], disk[i, 1] = concentric_disk(u[i, 0], u[i, 1])


def warp(u):
    out = tuple(np.empty((len(u), k)) for k in (2, 3, 3, 2))
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
    circle, _, _, _ = warp(np.column_stack([turns, turns]))
    worst = max(
        abs(float(Decimal(float(found)) - exact))
        for t, pair in zip(turns, circle, strict=True)
        for found, exact in zip(pair, exact_circle(float(t)), strict=True)
    )
    assert worst <= 4 * U  # what its docstring promises


@entry_kernel
def _turns(points, out):
    for i in range(len(points)):
        out[i] = turns(points[i, 0], points[i, 1])


def test_turns():
    """Against the library's atan2 in long double, over all octants and near their borders.

    The error is largest just beyond pi/8, where the angle is an eighth of a turn less half of it.
    To first order, that of difference and sum is at most 1.9 u there, of the quotient 0.6 u, of the
    series 3.4 u and its polynomial 0.6 u, of the product 0.5 u, and of the last sum 1 u.
    """
    rng = np.random.default_rng(73)
    worst = rng.uniform(1, 1.06, 500_000) * rng.choice([-1, 1], 500_000)
    eighths = np.concatenate([rng.uniform(-8, 8, 500_000), worst, np.arange(1, 9)])
    angles = eighths * (math.pi / 8)
    sizes = 10.0 ** rng.uniform(-150, 150, len(angles))
    near_axes = rng.normal(size=(10_000, 2)) * [1.0, 1e-9]
    around = np.column_stack([np.sin(angles), np.cos(angles)]) * sizes[:, None]
    points = np.concatenate([around, near_axes, near_axes[:, ::-1]])
    found = np.empty(len(points))
    _turns(points, found)
    y, x = points.T.astype(np.longdouble)
    exact = np.arctan2(y, x) / (2 * np.longdouble("3.14159265358979323846264338327950288"))
    assert np.abs(found / exact - 1).max() <= 8 * U  # what its docstring promises
    corners = [(0, 0), (0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0), (-0.0, -1)]
    at_corners = [turns(float(a), float(b)) for a, b in corners]
    assert at_corners == [0, 0, 0.125, 0.25, 0.375, 0.5, -0.375, -0.25, -0.5]


def test_quarter_turns_are_exact():
    circle, _, _, _ = warp(np.array([[0, 0], [0, 0.25], [0, 0.5], [0, 0.75]]))
    assert circle.tolist() == [[1, 0], [0, 1], [-1, 0], [0, -1]]


def uniform(n, seed):
    return np.random.default_rng(seed).uniform(0, 1, (n, 2))


def _polar(v):
    return np.stack([np.sum(v * v, axis=1), np.arctan2(v[:, 1], v[:, 0]) % (2 * math.pi)], axis=1)


def _from_polar(x):
    r = np.sqrt(x[:, 0])
    return np.stack([r * np.cos(x[:, 1]), r * np.sin(x[:, 1])], axis=1)


DISK = Chart((0.0, 0.0), (1.0, 2 * math.pi), _from_polar, _polar)
"""By (r², phi), whose area is twice that of the disk."""


def _angle(v):
    phi = np.arctan2(v[:, 1], v[:, 0]) % (2 * math.pi)
    return np.stack([phi, v[:, 2]], axis=1)


CIRCLE = Chart(
    (0.0, 0.0),
    (2 * math.pi, 1.0),
    lambda x: np.stack([np.cos(x[:, 0]), np.sin(x[:, 0]), x[:, 1]], axis=1),
    _angle,
)
"""By (phi, the number that it does not use)."""

# name -> (number in what `warp` returns, density, chart)
WARPS = {
    "on_circle": (0, lambda v: np.full(len(v), 0.5 / math.pi), CIRCLE),
    "cosine_hemisphere": (1, lambda v: np.maximum(v[:, 2], 0) / math.pi, SPHERE),
    "uniform_sphere": (2, lambda v: np.full(len(v), 0.25 / math.pi), SPHERE),
    "concentric_disk": (3, lambda v: np.full(len(v), 0.5 / math.pi), DISK),
}


@pytest.mark.parametrize("name", WARPS)
def test_densities(name):
    """Cosine / pi, 1 / (4 pi), 1 / pi, 1 / (2 pi)."""
    k, density, chart = WARPS[name]
    u = uniform(200_000, 72 + k)
    v = warp(u)[k]
    if name != "concentric_disk":
        # Three squares and a root, each of a number rounded a few times.
        assert np.abs(np.linalg.norm(v, axis=1) - 1).max() < 8 * U
    if name == "on_circle":
        v = np.column_stack([v, u[:, 0]])
    fit = chi_square(density, v, chart)
    assert fit.cells >= 64
    assert fit.integral == pytest.approx(1, abs=1e-5)
    assert fit.p_value > sidak(len(WARPS))


@pytest.mark.parametrize("name", WARPS)
def test_jacobians(name):
    """A small square becomes an area of its own over the density: to second order in its side,
    measured by central differences, the third derivatives of the maps being some 100."""
    k, density, _ = WARPS[name]
    u = uniform(2000, 80 + k) * 0.9 + 0.05
    h = 1e-5
    if name == "concentric_disk":  # not across the diagonals, where its derivatives jump
        x = np.abs(2 * u - 1)
        u = u[np.abs(x[:, 0] - x[:, 1]) > 8 * h]
    along = [
        (warp(u + step)[k] - warp(u - step)[k]) / (2 * h)
        for step in (h * np.eye(2)[i] for i in (0, 1))
    ]
    if name == "on_circle":
        area = np.linalg.norm(along[1], axis=1)
    elif name == "concentric_disk":
        area = 2 * np.abs(along[0][:, 0] * along[1][:, 1] - along[0][:, 1] * along[1][:, 0])
    else:
        area = np.linalg.norm(np.cross(*along), axis=1)
    assert np.allclose(area * density(warp(u)[k]), 1, rtol=1e-6, atol=0)


@pytest.mark.parametrize("name", WARPS)
def test_strata_stay_apart(name):
    """256 points, one in each of 16 x 16 squares: one in each of as many cells of equal measure."""
    k, _, chart = WARPS[name]
    ticks = (np.arange(16) + 0.5) / 16
    u = np.stack(np.meshgrid(ticks, ticks, indexing="ij"), axis=-1).reshape(-1, 2)
    v = warp(u)[k]
    if name == "on_circle":
        v = np.column_stack([v, u[:, 0]])
    if name == "concentric_disk":  # rings of one width in r, their parts of one in angle
        r = np.linalg.norm(v, axis=1)
        rings = np.round(8 * r + 0.5).astype(int)
        assert np.bincount(rings)[1:].tolist() == [4 * (2 * k - 1) for k in range(1, 9)]
        return
    a, b = np.array(chart.coordinates(v)).T
    if name == "cosine_hemisphere":
        a = 2 * a * a - 1  # height squared is uniform
    low, high = chart.low, chart.high
    i = np.floor((a - low[0]) / (high[0] - low[0]) * 16).astype(int)
    j = np.floor((b - low[1]) / (high[1] - low[1]) * 16).astype(int)
    assert np.bincount(16 * i + j).tolist() == [1] * 256


def test_the_ends_of_the_unit_square():
    """The least and the largest numbers that samplers draw."""
    ends = np.array([2.0**-33, 1 - 2.0**-33])
    _, hemisphere, sphere, disk = warp(np.array([(a, b) for a in ends for b in ends]))
    assert np.isfinite(hemisphere).all()
    assert np.isfinite(sphere).all()
    assert (np.linalg.norm(disk, axis=1) < 1).all()
    assert (hemisphere[:, 2] > 0).all()


def test_about_normal():
    """Against SciPy's quantiles, in the middle and in both tails."""
    rng = np.random.default_rng(35)
    tails = 10.0 ** rng.uniform(-18, -1, 500)
    for u in (*rng.uniform(0, 1, 500), *tails, *(1.0 - tails[tails > 1e-8])):
        # SciPy's are off by 4 u (measured).
        expected = ndtri(u) / math.sqrt(2)
        assert about_normal(float(u)) == pytest.approx(expected, rel=12 * U)
    assert about_normal(0.5) == 0.0
