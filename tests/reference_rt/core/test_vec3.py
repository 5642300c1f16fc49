"""Vec3: the textbook's algebra, and bases around any normal."""

import math
import operator
from fractions import Fraction

import numpy as np
import pytest
from builders import U, unit_vectors
from hypothesis import given
from hypothesis import strategies as st

from reference_rt.core.vec3 import (
    Vec3,
    component,
    cross,
    dot,
    frame_from_normal,
    is_black,
    length,
    max_abs,
    max_component,
    normalize,
    reflect,
    row,
    to_local,
    to_world,
)
from reference_rt.jit.kernel import entry_kernel

numbers = st.floats(-1e6, 1e6)
vectors = st.builds(Vec3, numbers, numbers, numbers)
units = vectors.filter(lambda v: length(v) > 1e-3).map(normalize)


def exact_dot(a, b):
    return sum(Fraction(x) * Fraction(y) for x, y in zip(a, b, strict=True))


@given(vectors, vectors, numbers)
def test_operators_work_by_component(a, b, s):
    assert a + b == tuple(map(operator.add, a, b))
    assert a - b == tuple(map(operator.sub, a, b))
    assert a * b == tuple(map(operator.mul, a, b))
    assert a * s == tuple(x * s for x in a)
    assert -a == tuple(-x for x in a)
    if s != 0:
        assert a / s == tuple(x / s for x in a)


@given(vectors, vectors)
def test_products(a, b):
    # Three products and two sums: at most three roundings each.
    scale = sum(abs(x * y) for x, y in zip(a, b, strict=True))
    assert abs(float(exact_dot(a, b) - Fraction(dot(a, b)))) <= 3 * U * scale
    c = cross(a, b)
    assert cross(b, a) == -c
    of_a, of_b = math.hypot(*a), math.hypot(*b)  # squares of tiny components would be zero
    bound = 8 * U * of_a * of_b * max(of_a, of_b)
    # A cross product is off by 3 u |a| |b|; its product with a by as much times |a|.
    assert abs(float(exact_dot(a, c))) <= bound
    assert abs(float(exact_dot(b, c))) <= bound


@given(vectors)
def test_sizes(a):
    assert max_abs(a) == max(map(abs, a))
    assert max_component(a) == max(a)
    assert is_black(a) == (a == (0, 0, 0))
    assert [component(a, k) for k in range(3)] == list(a)


def test_handedness():
    x, y, z = Vec3(1.0, 0.0, 0.0), Vec3(0.0, 1.0, 0.0), Vec3(0.0, 0.0, 1.0)
    assert (cross(x, y), cross(y, z), cross(z, x)) == (z, x, y)


@given(units, units)
def test_reflection(wo, n):
    """In the plane of both, the same angle on the other side; twice is the identity."""
    wi = reflect(wo, n)
    # Each of some ten operations on numbers up to 2.
    assert dot(wi, n) == pytest.approx(dot(wo, n), abs=16 * U)
    assert length(wi) == pytest.approx(1.0, abs=16 * U)
    assert reflect(wi, n) == pytest.approx(wo, abs=32 * U)


@entry_kernel
def _frames(n, out):
    for i in range(len(n)):
        frame = frame_from_normal(row(n, i))
        out[i, 0, 0], out[i, 0, 1], out[i, 0, 2] = frame.s
        out[i, 1, 0], out[i, 1, 1], out[i, 1, 2] = frame.t
        out[i, 2, 0], out[i, 2, 1], out[i, 2, 2] = frame.n


def test_frames_are_orthonormal_and_right_handed():
    """Everywhere, at both poles, and as near to them as floats go, with either zero."""
    rng = np.random.default_rng(91)
    normals = unit_vectors(rng, 100_000)
    tiny = 10.0 ** rng.uniform(-320, -1, (20_000, 1)) * normals[:20_000]
    near_poles = tiny + np.sign(normals[:20_000, 2:]) * [0, 0, 1.0]
    near_poles /= np.linalg.norm(near_poles, axis=1, keepdims=True)
    exact = [[x, y, z] for z in (1.0, -1.0) for x in (0.0, -0.0) for y in (0.0, -0.0)]
    exact += [[1.0, 0, z] for z in (0.0, -0.0)] + [[0, -1.0, z] for z in (0.0, -0.0)]
    n = np.concatenate([normals, near_poles, exact])
    frames = np.empty((len(n), 3, 3))
    _frames(n, frames)
    products = frames @ frames.transpose(0, 2, 1)
    # About ten operations on numbers up to 2; the normals themselves are unit to 2 u.
    assert np.abs(products - np.eye(3)).max() < 16 * U
    assert np.abs(np.linalg.det(frames) - 1).max() < 32 * U
    assert np.array_equal(frames[:, 2], n)


@given(units, vectors)
def test_to_local_undoes_to_world(n, v):
    frame = frame_from_normal(n)
    back = to_local(frame, to_world(frame, v))
    # Two changes of basis, each some ten operations on numbers up to |v|.
    assert back == pytest.approx(v, abs=64 * U * (length(v) + 1e-300))
    assert to_local(frame, n) == pytest.approx((0, 0, 1), abs=8 * U)


def test_normalize():
    assert normalize(Vec3(0.0, -2.0, 0.0)) == (0.0, -1.0, 0.0)
    assert math.isclose(length(normalize(Vec3(1e-150, 1e-150, 0.0))), 1.0)
