"""The methods for spheres against rational arithmetic, and each where it fails as it says."""

import itertools
import math

import numpy as np
import pytest
from builders import U, unit_vectors
from method_checks import DIRECTIONS, first, mixed_lengths, off
from rational import Q, dot, q, root, sub

from reference_rt import textbook

CENTER, RADIUS = np.array([0.3, -0.2, 0.1]), 1.3


def exact_sphere(o, d):
    """(t, half the chord) of a ray and the sphere above."""
    f, d = sub(q(o), q(CENTER)), q(d)
    a, b, c = dot(d, d), dot(f, d), dot(f, f) - Q(RADIUS) ** 2
    discriminant = b * b - a * c
    if discriminant < 0:
        return math.inf, 0.0
    s = root(discriminant)
    return first((-b - s) / a, (-b + s) / a), math.sqrt(discriminant / a)


def sphere_rays(rng, n, distance, aim):
    """Origins at this many radii; rays that pass the centre at `aim` (n,) radii, from inside
    roughly so, and half of them away from it."""
    if distance > 1:
        aim = distance * np.tan(np.arcsin(aim / distance))
    o = CENTER + distance * RADIUS * unit_vectors(rng, n)
    side = np.cross(o - CENTER, unit_vectors(rng, n))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    d = mixed_lengths(rng, CENTER + side * aim[:, None] * RADIUS - o)
    return o, d if distance > 1 else d * rng.choice([-1, 1], (n, 1))


@pytest.mark.parametrize("distance", [0.5, 2, 1e3, 1e6])
@pytest.mark.parametrize("name", textbook.names("sphere"))
def test_sphere_is_exact_to_its_bound(name, distance):
    """Hits are right; t |d| is off by 8 u |f|² / h, robust 8 u |f| r / h.

    Adding up all roundings gives 34 in place of 8; measured over 4000 rays: 4.  Aims keep 5 % of
    the radius from the rim: there r² - m² is above 0.09 r², and 34 u |f|² at 1e6 is 0.004 r².
    """
    n = 150
    rng = np.random.default_rng(1)
    aim = rng.choice([-1, 1], n) * np.where(
        rng.uniform(size=n) < 0.7, rng.uniform(0, 0.95, n), 1.06
    )
    o, d = sphere_rays(rng, n, distance, aim)
    t = textbook.intersect(name, textbook.SphereParameters(CENTER, RADIUS), o, d)
    far = max(distance, 1.0) * RADIUS
    for i in range(n):
        exact, h = exact_sphere(o[i], d[i])
        scale = far * (RADIUS if name == "sphere.robust" else far) / h if h else 0.0
        assert off(t[i], exact) * np.linalg.norm(d[i]) <= 8 * U * scale
    assert 0 < np.isfinite(t).sum() <= n
    if distance > 1:
        assert np.array_equal(np.isfinite(t), np.abs(aim) < 1)


def test_sphere_far_away():
    """At 1e7 radii t of the naive forms is off by a tenth of a radius; at 1e8 they lose hits."""
    shape = textbook.SphereParameters(CENTER, RADIUS)
    rng = np.random.default_rng(2)
    o, d = sphere_rays(rng, 300, 1e7, rng.uniform(0, 0.95, 300))
    exact = np.array([float(exact_sphere(*ray)[0]) for ray in zip(o, d, strict=True)])
    worst = {
        name: np.max(
            np.abs(textbook.intersect(name, shape, o, d) - exact) * np.linalg.norm(d, axis=1)
        )
        for name in textbook.names("sphere")
    }
    assert worst["sphere.algebraic"] > 0.05 * RADIUS
    assert worst["sphere.geometric"] > 0.05 * RADIUS
    assert worst["sphere.robust"] < 1e-7 * RADIUS
    o, d = sphere_rays(rng, 2000, 1e8, rng.uniform(0, 0.95, 2000))
    lost = {n: np.mean(np.isinf(textbook.intersect(n, shape, o, d))) for n in worst}
    assert 0.1 < lost["sphere.algebraic"] < 0.3
    assert 0.3 < lost["sphere.geometric"] < 0.6
    assert lost["sphere.robust"] == 0


def test_sphere_near_its_surface_no_form_helps():
    """1e-12 radii outside, rays inwards: the root near zero is off by parts of a thousand."""
    rng = np.random.default_rng(3)
    out = unit_vectors(rng, 300)
    o = CENTER + RADIUS * (1 + 1e-12) * out
    d = -out + 0.5 * unit_vectors(rng, 300)
    exact = np.array([float(exact_sphere(*ray)[0]) for ray in zip(o, d, strict=True)])
    for name in textbook.names("sphere"):
        t = textbook.intersect(name, textbook.SphereParameters(CENTER, RADIUS), o, d)
        near = (exact < 1e-6) & (t < 1e-6)
        assert near.sum() > 250
        worst = np.max(np.abs(t / exact - 1)[near])
        assert 2e-5 < worst < 2e-2


@pytest.mark.parametrize("name", textbook.names("sphere"))
def test_sphere_on_a_lattice(name):
    """Sums and products of these integers are exact, tangents (D = 0) included; origins lie at the
    centre and on the sphere too.  The same rays hit by all methods.  Roots and quotients round."""
    lattice = list(itertools.product((-5, -3, 0, 1, 3, 4), repeat=3))
    o, d = map(np.array, zip(*itertools.product(lattice, DIRECTIONS), strict=True))
    t = textbook.intersect(name, textbook.SphereParameters((0, 0, 0), 3), o, d)
    f2, b, a = np.sum(o * o, axis=1), np.sum(o * d, axis=1), np.sum(d * d, axis=1)
    discriminant = b * b - a * (f2 - 9)
    s = np.sqrt(np.maximum(discriminant, 0))
    near, far = (-b - s) / a, (-b + s) / a
    expected = np.where(near > 0, near, np.where(far > 0, far, np.inf))
    expected[discriminant < 0] = np.inf
    # For a = 3 the quotient t_ca = b / a rounds, so D = 0 may become a rounding of either sign.
    exact = a != 3
    assert np.sum(exact & (discriminant == 0)) > 100
    assert np.sum(exact & (f2 == 9)) > 100
    finite = np.isfinite(expected) & exact
    assert np.array_equal(np.isfinite(t)[exact], finite[exact])
    # A difference of -b and s is off by roundings of their sizes: two each.
    error = np.abs(t[finite] - expected[finite])
    assert np.all(error <= 4 * U * ((np.abs(b) + s) / a)[finite])
