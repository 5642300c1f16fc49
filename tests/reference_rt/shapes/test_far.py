"""Shapes from far away: rounding errors are corrected, and the nearest hit stays the nearest."""

import math
from fractions import Fraction

import numpy as np
import pytest
from builders import U, unit_vectors

import reference_rt as rt
from reference_rt.core.vec3 import row
from reference_rt.jit.kernel import entry_kernel
from reference_rt.jit.simd import VECTOR_WIDTH, product_error, simd_kernel
from reference_rt.shapes.rounding import along_from, difference_error

SPECIAL = [0.0, -0.0, math.inf, -math.inf, math.nan, 5e-324, 1e-160, 1.7e308, -1.7e308, 1.0, 3.0]


@entry_kernel
def _products(x, y, out):
    for i in range(len(x)):
        out[i] = product_error(x[i], y[i], x[i] * y[i])


def _side_by_side(x, y, out):
    a, b = x.load(0), y.load(0)
    out.store(0, product_error(a, b, a * b))
    return a <= a


_emitted = simd_kernel(_side_by_side)


@entry_kernel
def _lanes(x, y, out):
    return _emitted(x, y, out)


def test_product_error_is_the_same_bits_compiled_in_lanes_and_plainly():
    rng = np.random.default_rng(1)
    numbers = np.concatenate([SPECIAL, rng.normal(size=21) * 10.0 ** rng.integers(-9, 9, 21)])
    x, y = (a.ravel() for a in np.meshgrid(numbers, numbers))
    with np.errstate(all="ignore"):
        expected = np.array(
            [product_error(a, b, a * b) for a, b in zip(x.tolist(), y.tolist(), strict=True)]
        )
        compiled = np.empty(len(x))
        _products(x, y, compiled)
        assert np.array_equal(compiled, expected, equal_nan=True)
        for k in range(0, len(x) - VECTOR_WIDTH, VECTOR_WIDTH):
            out = np.empty(VECTOR_WIDTH)
            _lanes(x[k : k + VECTOR_WIDTH].copy(), y[k : k + VECTOR_WIDTH].copy(), out)
            assert np.array_equal(out, expected[k : k + VECTOR_WIDTH], equal_nan=True)
    with np.errstate(all="ignore"):
        both = np.isfinite(expected) & (np.abs(x * y) > 1e-290)
    for a, b, e in zip(x[both].tolist(), y[both].tolist(), expected[both].tolist(), strict=True):
        assert Fraction(a) * Fraction(b) == Fraction(a * b) + Fraction(e)


def test_difference_error_is_exact():
    rng = np.random.default_rng(2)
    a, b = rng.normal(size=(2, 500)) * 10.0 ** rng.integers(-12, 12, (2, 500))
    for x, y in zip(a.tolist(), b.tolist(), strict=True):
        assert Fraction(x) - Fraction(y) == Fraction(x - y) + Fraction(
            difference_error(x, y, x - y)
        )


@pytest.mark.parametrize("far", [1.0, 1e6, 1e12])
def test_along_from_rounds_at_its_own_size(far):
    """2 u of the result and 2 u² of the way there; the plain sum is off by u times the way."""
    rng = np.random.default_rng(3)
    n = 300
    c, d = rng.uniform(-1, 1, (n, 3)), unit_vectors(rng, n) * rng.uniform(0.1, 10, (n, 1))
    t = far * rng.uniform(0.5, 2, n)
    o = c + rng.uniform(-1, 1, (n, 3)) - d * t[:, None]
    worst_plain = 0.0
    for i in range(n):
        found = along_from(row(o, i), row(d, i), row(c, i), float(t[i]))
        for k in range(3):
            exact = Fraction(o[i, k]) + Fraction(d[i, k]) * Fraction(t[i]) - Fraction(c[i, k])
            bound = 2.0 * U * abs(float(exact)) + 4.0 * U * U * 20.0 * far
            assert abs(Fraction(found[k]) - exact) <= bound
            plainly = o[i, k] + d[i, k] * t[i] - c[i, k]
            worst_plain = max(worst_plain, abs(float(Fraction(plainly) - exact)))
    assert worst_plain > 0.5 * U * far


@pytest.mark.parametrize("far", [1e3, 1e8, 1e12])
def test_a_line_that_leaves_an_open_cylinder_by_its_rim_is_not_met_there(far):
    """It enters through the open bottom and meets the wall just before or after the top: the
    world's t at the rim, the bottom and the wall are the same float, or nearly, from so far."""
    rng = np.random.default_rng(4)
    n = 2000
    slope = 10.0 ** rng.uniform(-4.0, -1.0, n)
    above = rng.choice([-1.0, 1.0], n) * 10.0 ** rng.uniform(-5.0, -0.5, n)
    # Powers of two throughout: the point where the wall is met is exact.
    d = np.column_stack([2.0 ** np.round(np.log2(slope)), np.zeros(n), np.ones(n)])
    step = 2.0 ** np.round(np.log2(far))
    height = np.round((1.0 + above) * 2.0**12) / 2.0**12
    o = np.column_stack([np.ones(n), np.zeros(n), height]) - d * step
    exact = np.all(o + d * step == np.column_stack([np.ones(n), np.zeros(n), height]), axis=1)
    scene = rt.Scene(shapes=(rt.Cylinder(z_min=-1.0, capped=False),))
    hits = scene.intersect(o[exact], d[exact])
    expected = (height[exact] <= 1.0) & (height[exact] >= -1.0)
    # Where it enters, at x = -1, is far below.
    assert (2.0 / d[exact, 0] > 2.5).all()
    assert np.array_equal(np.isfinite(hits.t), expected)
    assert 0.2 * n < expected.sum()
    assert np.all(np.abs(hits.t[expected] - step) <= 4.0 * U * step)
