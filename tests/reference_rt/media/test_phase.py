"""Phase functions: densities of directions, and the directions that are drawn from them."""

import math

import mpmath
import numpy as np
import pytest
from scipy import integrate, stats

import reference_rt as rt
from reference_rt.core.vec3 import Vec3
from reference_rt.media import AnyPhase
from reference_rt.media.phase import phase, turned
from reference_rt.media.tables import media_table
from reference_rt.scene.examples import examples

PHASES = {
    **{f"{of.type} {k}": of for k, of in enumerate(examples(AnyPhase))},
    "narrow": rt.HenyeyGreenstein(g=0.98),
    "back": rt.HenyeyGreenstein(g=-0.95),
    "first alone": rt.BlendPhase(first=rt.Rayleigh(), second=rt.HenyeyGreenstein(g=0.9), weight=0),
    "second alone": rt.BlendPhase(
        first=rt.Rayleigh(), second=rt.HenyeyGreenstein(g=-0.9), weight=1
    ),
}


def lobes_of(*of):
    """The lobes of media with these phase functions."""
    media = [rt.Homogeneous(sigma_t=1.0, albedo=0.5, phase=one) for one in of]
    return media_table(media, [], []).lobes


def textbook(of, cosine):
    """The phase function as its author writes it (PBR 4ed, 11.3; Frisvad 2011, eq. 1)."""
    if of.type == "blend":
        w = of.weight
        return (1.0 - w) * textbook(of.first, cosine) + w * textbook(of.second, cosine)
    if of.type == "rayleigh":
        return 3.0 * (1.0 + cosine**2) / (16.0 * math.pi)
    g = getattr(of, "g", 0.0)
    return (1.0 - g**2) / (4.0 * math.pi * (1.0 + g**2 - 2.0 * g * cosine) ** 1.5)


@pytest.mark.parametrize("name", PHASES)
def test_the_value_is_the_textbooks(name):
    of, lobes = PHASES[name], lobes_of(rt.Isotropic(), PHASES[name])
    for cosine in np.linspace(-1.0, 1.0, 41).tolist():
        # 1 + g² - 2 g cosine loses at most 1 / (1 - |g|)² of some 4 roundings to cancellation.
        assert phase(lobes, 1, cosine) == pytest.approx(textbook(of, cosine), rel=2e-12)


@pytest.mark.parametrize("name", PHASES)
def test_it_is_a_density(name):
    """Its integral over all directions is 1, and the mean cosine is g."""
    lobes, of = lobes_of(PHASES[name]), PHASES[name]
    points = [-1.0, -0.99, -0.9, 0.0, 0.9, 0.99, 1.0]
    whole, _ = integrate.quad(lambda c: phase(lobes, 0, c), -1.0, 1.0, points=points, epsrel=1e-11)
    assert 2.0 * math.pi * whole == pytest.approx(1.0, rel=1e-9)
    if of.type == "hg":
        mean, _ = integrate.quad(
            lambda c: c * phase(lobes, 0, c), -1.0, 1.0, points=points, epsrel=1e-11
        )
        assert 2.0 * math.pi * mean == pytest.approx(of.g, abs=1e-9)


@pytest.mark.parametrize("name", PHASES)
def test_directions_have_the_density(name):
    """By the distribution function of the textbook's density, and evenly around the axis."""
    of, rng = PHASES[name], np.random.default_rng(7)
    lobes = lobes_of(rt.Rayleigh(), rt.HenyeyGreenstein(g=0.4), of)
    axis = np.array([0.3, -0.8, 0.52])
    axis /= np.linalg.norm(axis)
    drawn = [turned(lobes, 2, Vec3(*axis.tolist()), *u) for u in rng.random((4000, 2)).tolist()]
    w = np.array(drawn)
    # Three squares, whose rounding and that of the frame are some ten roundings.
    assert np.abs(np.linalg.norm(w, axis=1) - 1.0).max() < 2e-15
    grid = np.tanh(np.linspace(-12.0, 12.0, 40001))
    middle = 0.5 * (grid[1:] + grid[:-1])
    steps = textbook(of, middle) * np.diff(grid) * 2.0 * math.pi
    below = np.concatenate([[0.0], np.cumsum(steps)])
    # 1e-4: twenty tests of a right density fall below it once in 500 seeds.
    assert stats.kstest(w @ axis, lambda c: np.interp(c, grid, below)).pvalue > 1e-4
    side = np.cross(axis, [1.0, 0.0, 0.0])
    side /= np.linalg.norm(side)
    around = np.arctan2(w @ np.cross(axis, side), w @ side)
    assert stats.kstest(around / (2.0 * np.pi) + 0.5, "uniform").pvalue > 1e-4


@pytest.mark.parametrize("g", [0.9999, -0.9999, 1.0 - 2.0**-40, -0.5, 0.01])
def test_narrow_peaks_keep_their_digits(g):
    """Against 60 digits: the angle, and the density there."""
    lobes, d = lobes_of(rt.HenyeyGreenstein(g=g)), Vec3(0.0, 0.0, 1.0)
    with mpmath.workdps(60):
        exact = mpmath.mpf(g)
        near = 1 - exact**2
        for u in (0.0, 2.0**-40, 0.01, 0.5, 0.99, 1.0 - 2.0**-53):
            w = turned(lobes, 0, d, u, 0.125)
            cosine = (1 + exact**2 - (near / (1 - exact + 2 * exact * u)) ** 2) / (2 * exact)
            # Some 20 roundings; 1 - |g| is exact here, as is 1 - u.
            sine = mpmath.sqrt(max(0, 1 - cosine**2))
            assert math.hypot(w.x, w.y) == pytest.approx(float(sine), rel=4e-15)
            span = 1 + exact**2 - 2 * exact * mpmath.mpf(w.z)
            value = near / (4 * mpmath.pi * span**1.5)
            assert phase(lobes, 0, w.z) == pytest.approx(float(value), rel=4e-15)
