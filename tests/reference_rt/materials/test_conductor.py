"""Conductors: Fresnel's equations with complex numbers of 40 digits, one-sidedness."""

import numpy as np
import pytest
from builders import U
from flint import acb, arb, ctx
from leaf_checks import NOWHERE

from reference_rt.core.vec3 import Vec3
from reference_rt.materials.bsdfs import conductor
from reference_rt.materials.bsdfs.conductor import Conductor
from reference_rt.materials.material import sample_branch
from reference_rt.materials.microfacet.fresnel import conductor_colour, conductor_reflectance
from reference_rt.textures import NO_TEXTURES

GOLD = {"eta": (0.143, 0.375, 1.442), "k": (3.983, 2.386, 1.603)}


def square(z):
    return z.real * z.real + z.imag * z.imag


def by_normal_components(c, eta, k, shift=0):
    """Fresnel's amplitudes from q = n cos t, the root of n² - sin²; `shift` is added to that."""
    c, n2 = acb(c), acb(eta, k) * acb(eta, k)
    q = (n2 - (1 - c * c) + shift).sqrt()
    s, p = (c - q) / (c + q), (n2 * c - q) / (n2 * c + q)
    if shift:  # p over s of the same q, which is what is computed
        sin2 = 1 - c * c
        p = s * (q * c - sin2) / (q * c + sin2)
    return (square(s) + square(p)) / 2


def by_snell(c, eta, k):
    """The same from the complex angle of refraction (Born & Wolf, 1.5.2)."""
    c, n = acb(c), acb(eta, k)
    t = (1 - (1 - c * c) / (n * n)).sqrt()
    return (square((c - n * t) / (c + n * t)) + square((n * c - t) / (n * c + t))) / 2


def cases():
    rng = np.random.default_rng(21)
    for _ in range(1500):
        eta = rng.choice([10.0 ** rng.uniform(-2, 1), 1 + 10.0 ** rng.uniform(-12, -1)])
        k = rng.choice([0.0, 10.0 ** rng.uniform(-6, 1), rng.uniform(0, 10)])
        c = rng.choice([rng.uniform(0, 1), 10.0 ** rng.uniform(-15, 0), 1.0])
        yield float(c), float(eta), float(k)


def test_reflectance_against_complex_arithmetic():
    ctx.dps = 60
    for c, eta, k in cases():
        exact = by_normal_components(c, eta, k)
        assert abs(float(exact - by_snell(c, eta, k))) < 1e-25
        # Re n² - sin² is a sum of two roundings of its terms.  Where it is near 0 (total
        # reflection without absorption) that shows in the root; elsewhere a few roundings remain.
        off = arb(2 * U) * (abs(arb(eta) ** 2 - arb(k) ** 2) + 1 - arb(c) ** 2)
        moved = max(
            abs(float(by_normal_components(c, eta, k, shift) - exact)) for shift in (off, -off)
        )
        found = conductor_reflectance(c, eta, k)
        assert abs(float(exact - arb(found))) <= 8 * (moved + U), (c, eta, k)
        assert 0.0 <= found <= 1.0


@pytest.mark.parametrize(("eta", "k"), [(0.2, 3.9), (1.5, 0.0), (1.0, 1.0), (1e-2, 10.0)])
def test_reflectance_at_the_ends(eta, k):
    straight = ((eta - 1) ** 2 + k * k) / ((eta + 1) ** 2 + k * k)
    assert conductor_reflectance(1.0, eta, k) == pytest.approx(straight, rel=64 * U)
    assert conductor_reflectance(0.0, eta, k) == 1.0


def test_faint_reflections_keep_their_digits():
    """Of the very floats, where hardly anything differs from what is outside."""
    ctx.dps = 60
    rng = np.random.default_rng(41)
    for _ in range(300):
        c, off, k = (10.0 ** rng.uniform(low, 0 if low > -9 else -1) for low in (-6, -10, -10))
        eta = float(1 + off * rng.choice([-1, 1]))
        exact = by_normal_components(float(c), eta, float(k))
        found = conductor_reflectance(float(c), eta, float(k))
        assert abs(float((arb(found) - exact) / exact)) <= 64 * U, (c, eta, k)


def test_nothing_is_there_where_nothing_refracts():
    assert conductor_reflectance(0.3, 1.0, 0.0) == pytest.approx(0.0, abs=4 * U)


def test_branches():
    table = Conductor(**GOLD, reflectance=(0.5, 1.0, 1.0)).tabulate(NO_TEXTURES)
    wo = Vec3(0.6, 0.0, 0.8)
    found = conductor.branches(table, 0, NOWHERE, wo)
    expected = conductor_colour(0.8, Vec3(*GOLD["eta"]), Vec3(*GOLD["k"])) * Vec3(0.5, 1.0, 1.0)
    assert found.reflected == (-0.6, 0.0, 0.8)
    assert found.reflectance == expected
    assert found.share == 1.0
    assert found.transmittance == (0.0, 0.0, 0.0)
    assert sample_branch(found, 0.999).weight == expected
    behind = conductor.branches(table, 0, NOWHERE, -wo)
    assert sample_branch(behind, 0.5).pdf == 0.0
    grazing = conductor.branches(table, 0, NOWHERE, Vec3(1.0, 0.0, 0.0))
    assert sample_branch(grazing, 0.5).pdf == 0.0


def test_colour():
    assert Conductor(**GOLD).colour == pytest.approx((0.966, 0.805, 0.322), abs=0.05)
    assert Conductor(**GOLD, reflectance="worn").colour == "worn"
