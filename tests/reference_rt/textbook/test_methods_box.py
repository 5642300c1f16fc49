"""The methods for boxes against rational arithmetic, and each where it fails as it says."""

import itertools
import math

import numpy as np
import pytest
from builders import U, unit_vectors
from method_checks import CUBE, DIRECTIONS, first, mixed_lengths, off
from rational import q

import reference_rt as rt
from reference_rt import textbook

LOWER, UPPER = np.array([-1.1, -0.7, 0.3]), np.array([0.9, 1.3, 1.7])
BOX = textbook.BoxParameters(LOWER, UPPER)
ROUNDINGS = {
    "box.six_planes": 2,
    "box.slabs_parallel_test": 2,
    "box.slabs_ieee": 3,
    "box.slabs_unrolled": 3,
}


def exact_box(lower, upper, o, d):
    near, far = -math.inf, math.inf
    for low, high, x, y in zip(q(lower), q(upper), q(o), q(d), strict=True):
        if y == 0:
            if not low <= x <= high:
                return math.inf
            continue
        t0, t1 = sorted(((low - x) / y, (high - x) / y))
        near, far = max(near, t0), min(far, t1)
    return first(near, far) if near <= far else math.inf


def box_rays(rng, n):
    """From outside and inside to points in and around the box; a third parallel to a side."""
    o = np.where(
        rng.uniform(size=(n, 1)) < 0.3, rng.uniform(LOWER, UPPER, (n, 3)), 4 * unit_vectors(rng, n)
    )
    target = rng.uniform(LOWER - 0.3, UPPER + 0.3, (n, 3))
    axis = rng.integers(0, 9, n)
    rows = np.flatnonzero(axis < 3)
    o[rows, axis[rows]] = target[rows, axis[rows]]
    return o, mixed_lengths(rng, target - o)


@pytest.mark.parametrize("name", textbook.names("box"))
def test_box_is_exact_to_its_roundings(name):
    """One each for the difference and the quotient, or for the reciprocal and the product."""
    o, d = box_rays(np.random.default_rng(6), 500)
    t = textbook.intersect(name, BOX, o, d)
    assert 100 < np.isfinite(t).sum() < 500
    for i in range(len(o)):
        exact = exact_box(LOWER, UPPER, o[i], d[i])
        # 1.001 for the products of roundings.
        assert off(t[i], exact) <= 1.001 * ROUNDINGS[name] * U * (0 if exact == math.inf else exact)


@pytest.mark.parametrize("name", textbook.names("box"))
def test_box_on_a_lattice(name):
    """Parallel rays with ±0, origins inside, on faces, on edges, rays along faces: all exact."""
    o, d = zip(
        *itertools.product(itertools.product((-2, -1, 0, 1, 2), repeat=3), DIRECTIONS), strict=True
    )
    t = textbook.intersect(name, CUBE, o, d)
    expected = np.array([float(exact_box(*CUBE, *ray)) for ray in zip(o, d, strict=True)])
    assert np.array_equal(t, expected)
    inside = np.all(np.abs(o) < 1, axis=1)
    assert np.all(t[inside] == 1)


def test_six_planes_let_rays_through_edges():
    """Aimed at a ridge seen from both of its faces: some get the far side.  Slabs never do."""
    n = 4000
    rng = np.random.default_rng(7)
    o = UPPER + rng.uniform(1, 3, (n, 3))
    target = np.tile(UPPER, (n, 1))
    target[:, 2] = rng.uniform(LOWER[2], UPPER[2], n)
    scale = rng.uniform(0.5, 2, n)
    d = (target - o) * scale[:, None]
    t = {name: textbook.intersect(name, BOX, o, d) * scale for name in textbook.names("box")}
    # The ridge is at t = 1, to a few roundings; the far side is at least 0.1 behind.
    assert all(np.isfinite(found).all() for found in t.values())
    through = {name: np.mean(found > 1 + 1e-12) for name, found in t.items()}
    assert through.pop("box.six_planes") > 0.002
    assert set(through.values()) == {0}


def test_grazed_edges_are_decided_within_two_roundings():
    """Rays that graze an edge: slabs differ among themselves, on misses by a few u of t only."""
    n = 4000
    rng = np.random.default_rng(8)
    o = np.stack([np.full(n, 3.0), rng.uniform(-0.6, 1.0, n), rng.uniform(0.4, 1.6, n)], axis=1)
    target = np.stack(
        [np.full(n, UPPER[0]), np.full(n, UPPER[1]), rng.uniform(0.4, 1.6, n)], axis=1
    )
    a, b = (
        textbook.intersect(f"box.{m}", BOX, o, target - o)
        for m in ("slabs_parallel_test", "slabs_ieee")
    )
    assert 0 < np.sum(np.isinf(a) != np.isinf(b)) < 0.5 * n
    both = np.isfinite(a) & np.isfinite(b)
    assert np.max(np.abs(a - b)[both]) <= 5.01 * U * np.max(a[both])


def with_lattice(o, d):
    """And all that a lattice has of rays along faces, edges and axes, with either zero."""
    lattice = itertools.product(itertools.product((-2, -1, 0, 1, 2), repeat=3), DIRECTIONS)
    pairs = zip((o, d), zip(*lattice, strict=True), strict=True)
    return (np.concatenate(pair) for pair in pairs)


@pytest.mark.parametrize("scale", [1e-310, 1e-160, 1.0, 1e160, 1e300])
def test_the_unrolled_slabs_have_the_same_bits(scale):
    """Also of flat boxes, points, boxes beyond the origin, and where reciprocals overflow."""
    rng = np.random.default_rng(16)
    for flat, offset in itertools.product(itertools.product((0.0, 1.0), repeat=3), (0.0, 5.0)):
        lower = offset - np.array(flat)
        shape = textbook.BoxParameters(lower * scale, (offset + np.array(flat)) * scale)
        o, d = with_lattice(*box_rays(rng, 500))
        looped, unrolled = (
            textbook.intersect(f"box.slabs_{m}", shape, o * scale, d * scale)
            for m in ("ieee", "unrolled")
        )
        assert np.array_equal(looped, unrolled)
        assert np.isfinite(looped).any() or scale < 1e-300  # where 1 / d is infinite


def test_slabs_ieee_is_what_renders():
    """Bit for bit, where the box's own coordinates are the world's."""
    o, d = with_lattice(*box_rays(np.random.default_rng(15), 4000))
    t = textbook.intersect("box.slabs_ieee", CUBE, o, d)
    assert np.array_equal(rt.Scene(shapes=(rt.Box(),)).intersect(o, d).t, t)
    assert 1000 < np.isfinite(t).sum() < len(t)
