"""Reconstruction filters: unbiased weights, and a step seen through each filter."""

import math

import numpy as np
import pytest

import reference_rt as rt
from reference_rt import transform
from reference_rt.film import film_offset

FILTERS = [rt.BoxFilter(), rt.TentFilter(), rt.TentFilter(radius=2.5), rt.GaussianFilter(),
           rt.GaussianFilter(stddev=1.5)]  # fmt: skip


def profile(description):
    """(the filter as a function of x, not normalised; the end of its support)."""
    if isinstance(description, rt.BoxFilter):
        return lambda x: np.ones_like(x), 0.5
    if isinstance(description, rt.TentFilter):
        r = description.radius
        return lambda x: 1 - np.abs(x) / r, r
    s = description.stddev
    return lambda x: np.exp(-(x**2) / (2 * s * s)) - math.exp(-8), 4 * s


def integral(description, g, to=None):
    """The integral of the normalised filter times g up to `to`, by the midpoint rule."""
    f, end = profile(description)
    x = (np.arange(400_000) + 0.5) / 400_000 * 2 * end - end
    values = f(x) / f(x).sum()
    return np.sum(values * g(x) * (1.0 if to is None else x < to))


@pytest.mark.parametrize("description", FILTERS, ids=str)
@pytest.mark.parametrize("power", [0, 1, 2, 3, 4])
def test_weights_are_unbiased(description, power):
    """E[weight x^k] is the filter's moment."""
    setup = description.setup()
    limits = getattr(setup, "cumulative", np.array([0.0, 0.5, 1.0]))  # where offset or weight jump
    per_cell = 20_000 // len(limits)
    inside = (np.arange(per_cell) + 0.5) / per_cell
    u = limits[:-1, None] + np.diff(limits)[:, None] * inside
    share = np.repeat(np.diff(limits) / per_cell, per_cell)
    drawn = np.array([film_offset(setup, float(x)) for x in u.ravel()])
    found = np.sum(share * drawn[:, 1] * drawn[:, 0] ** power)
    expected = integral(description, lambda x: x**power)
    # The midpoint rule inside cells: for the tent, whose slope is infinite at its ends, of order
    # 3/2 in 1/7000; for the Gaussian of order 2 in 1/32/77.
    scale = profile(description)[1] ** power
    assert found == pytest.approx(expected, abs=1e-6 * scale)


@pytest.mark.parametrize("description", FILTERS, ids=str)
def test_offsets_stay_inside_and_rise(description):
    setup = description.setup()
    u = np.array([2.0**-33, *np.linspace(0.001, 0.999, 999), 1 - 2.0**-33])
    drawn = np.array([film_offset(setup, float(x)) for x in u])
    end = profile(description)[1]
    assert (np.diff(drawn[:, 0]) > 0).all()
    assert np.abs(drawn[:, 0]).max() <= end
    assert (drawn[:, 1] >= 0).all()


@pytest.mark.parametrize("description", [FILTERS[0], FILTERS[1], FILTERS[3]], ids=str)
def test_a_step(description):
    """The emissive half-plane x < 0.3 pixels right of the picture's middle, under each pixel."""
    edge, width = 0.3, 8
    half = transform.Translate(translate=(-100 + edge * 2 / width, 0, 0))
    scene = rt.Scene(
        camera=rt.Orthographic(eye=(0, 0, 1), width=2),
        film=rt.Film(width=width, height=32, filter=description),
        sampler=rt.Independent(spp=4096, seed=6),
        integrator=rt.Whitted(),
        materials={"lamp": rt.Emissive(radiance=(1, 1, 1))},
        shapes=(
            rt.Rectangle(material="lamp", transform=(transform.Scale(scale=(100,) * 3), half)),
        ),
    )
    columns = rt.render(scene).colour[..., 0]
    mean, error = columns.mean(axis=0), columns.std(axis=0, ddof=1) / math.sqrt(32)
    for i in range(width):
        to = edge + width / 2 - (i + 0.5)  # the edge, counted from this pixel's centre
        expected = integral(description, np.ones_like, to)
        # 4 standard errors; 1e-5 is the quadrature's own cell at the step.
        assert abs(mean[i] - expected) <= 4 * error[i] + 1e-5
    assert mean[0] == pytest.approx(1.0, abs=0.01)
    assert 0.2 < mean[4] < 0.9
