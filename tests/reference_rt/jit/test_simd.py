"""SIMD kernels: the vector code that is emitted gives NumPy's bits, whatever the numbers."""

import math

import numpy as np
import pytest

from reference_rt.core.ray import Ray
from reference_rt.core.vec3 import row
from reference_rt.jit.kernel import entry_kernel, local_floats
from reference_rt.jit.simd import VECTOR_WIDTH, larger, plain, simd_kernel, smaller
from reference_rt.shapes.meshes import watertight
from reference_rt.shapes.meshes.watertight import shear_of

SPECIAL = [0.0, -0.0, math.inf, -math.inf, math.nan, 5e-324, 1.7e308, -1.7e308, 1.0, -1.0]


def _text(doubles, singles, start, factor, out):
    a = doubles.load(start)
    b = singles.load(2 * start + 1) * factor - a
    c = 1.0 - smaller(a, larger(0.5, b)) + a * b
    out.store(0, c)
    return (c <= a) | ((b > 0.0) & ~(c >= factor))


_emitted = simd_kernel(_text)


@entry_kernel
def _run(doubles, singles, start, factor, out):
    return _emitted(doubles, singles, start, factor, out)


@pytest.mark.parametrize("seed", range(20))
def test_emitted_code_gives_the_bits_of_numpy(seed):
    rng = np.random.default_rng(seed)
    for _ in range(50):
        doubles = np.where(
            rng.random(40) < 0.3,
            rng.choice(SPECIAL, 40),
            rng.normal(size=40) * 10.0 ** rng.integers(-9, 9, 40),
        )
        with np.errstate(over="ignore"):
            singles = rng.permutation(np.resize(doubles, 80)).astype(np.float32)
        factor = float(rng.choice([*SPECIAL, rng.normal()]))
        start = int(rng.integers(0, 32))
        there, here = np.empty(VECTOR_WIDTH), np.empty(VECTOR_WIDTH)
        with np.errstate(all="ignore"):
            assert _run(doubles, singles, start, factor, there) == plain(_text)(
                doubles, singles, start, factor, here
            )
        assert np.array_equal(np.isnan(there), np.isnan(here))
        numbers = ~np.isnan(here)
        assert there[numbers].tobytes() == here[numbers].tobytes()


@entry_kernel
def _met(corners, size, origins, directions, maybe, met, seen_now, seen_again):
    seen = local_floats(watertight.PROJECTION_FLOATS)
    for i in range(len(origins)):
        shear = shear_of(Ray(row(origins, i), row(directions, i), math.inf))
        maybe[i] = watertight.project_leaf(corners, 0, size, shear, seen)
        for lane in range(size):
            alone = watertight._project(
                corners, lane, lane + 3 * size, lane + 6 * size, size, shear
            )
            if alone.side != 0:
                met[i] |= 1 << lane
            if maybe[i] >> lane & 1 != 0:
                again = watertight.load_projection(corners, 0, size, lane, shear, seen)
                for now, found in ((seen_now, alone), (seen_again, again)):
                    now[i, lane, 0], now[i, lane, 1], now[i, lane, 2] = found.e0, found.e1, found.e2
                    now[i, lane, 3], now[i, lane, 4] = found.a_z, found.b_z
                    now[i, lane, 5], now[i, lane, 6] = found.c_z, found.side


@pytest.mark.parametrize("size", [1, 5, 8])
@pytest.mark.parametrize("kind", ["any", "lattice", "slivers"])
def test_a_leaf_is_seen_as_its_triangles_are(size, kind):
    """No triangle that is met is passed by, and of those that may be all numbers are the same.  On
    a lattice half the rays go through vertices and edges; on slivers edge functions cancel."""
    rng = np.random.default_rng(size)
    n = 20000
    vertices = rng.normal(size=(size, 9))
    targets, o = rng.normal(size=(n, 3)), 3.0 * rng.normal(size=(n, 3))
    if kind == "lattice":
        vertices = rng.integers(-2, 3, (size, 9)).astype(float)
        targets = rng.integers(-4, 5, (n, 3)) / 2.0
        o = rng.integers(-6, 7, (n, 3)).astype(float)
    if kind == "slivers":
        vertices[:, 6:] = vertices[:, :3] + 1e-4 * rng.normal(size=(size, 3))
        share = rng.random((n, 1))
        of = vertices[rng.integers(0, size, n)]
        targets = of[:, :3] * share + of[:, 3:6] * (1.0 - share) + 1e-5 * targets
    d = targets - o
    d[~d.any(axis=1)] = 1.0
    corners = np.zeros(9 * size + VECTOR_WIDTH)
    corners[: 9 * size] = vertices.T.reshape(-1)
    maybe, met = np.zeros((2, n), np.int64)
    seen = np.zeros((2, n, size, 7))
    _met(corners, size, o, d, maybe, met, *seen)
    assert np.array_equal(met & ~maybe, np.zeros(n))
    assert np.count_nonzero(met) > n / 100
    assert seen[0].tobytes() == seen[1].tobytes()
    # Only rays through an edge are sent on in vain.
    assert kind == "lattice" or np.array_equal(met, maybe)
