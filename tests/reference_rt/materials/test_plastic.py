"""Plastics: the hemispherical integral of Fresnel's reflectance, samples against densities and
integrals, reciprocity, energy, limits."""

import math

import mpmath
import numpy as np
import pytest
from builders import U, unit_vectors
from leaf_checks import NOWHERE, albedo, evaluate, sample, towards
from random_bsdfs import random_plastic

from comparisons.statistics.chi_square import integrate
from reference_rt.core.vec3 import Vec3
from reference_rt.materials.bsdfs import plastic, rough_plastic
from reference_rt.materials.bsdfs.plastic import Plastic, hemispherical_fresnel
from reference_rt.materials.bsdfs.rough_plastic import (
    RoughPlastic,
    internal_reflectance,
    transmittances,
)
from reference_rt.materials.microfacet.fresnel import fresnel
from reference_rt.materials.microfacet.ggx_and_smith import Microfacets
from reference_rt.textures import NO_TEXTURES


def exact_hemispherical(n):
    """In 30 digits, for n > 1, over w where cos = k sinh w: no root is left."""
    with mpmath.workdps(30):
        n = mpmath.mpf(n)
        k = mpmath.sqrt(n * n - 1)

        def integrand(w):
            c, n_cos_t = k * mpmath.sinh(w), k * mpmath.cosh(w)
            perpendicular = (c - n_cos_t) / (c + n_cos_t)
            parallel = (n * n * c - n_cos_t) / (n * n * c + n_cos_t)
            return (perpendicular**2 + parallel**2) * c * n_cos_t

        end = mpmath.asinh(1 / k)
        return mpmath.quad(integrand, [0, end / 2, end])


@pytest.mark.parametrize("n", [1 + 1e-9, 1.0003, 1.01, 1.33, 1.5, 2.4, 10.0, 100.0])
def test_hemispherical_fresnel(n):
    exact = exact_hemispherical(n)
    # The nodes and weights of the rule, 128 of them, are right to some 1e-14.
    assert hemispherical_fresnel(n) == pytest.approx(float(exact), rel=2e-14)
    inside = 1 - (1 - exact) / mpmath.mpf(n) ** 2
    # 1/n rounds: within, the reflectance changes with it by a factor of up to 2.
    assert hemispherical_fresnel(1 / n) == pytest.approx(float(inside), abs=8 * U)


def test_hemispherical_fresnel_within_by_quadrature():
    """The integral from within itself, not by reciprocity: total reflection beyond the critical
    angle, the rest by Simpson's rule in cos² = 1 - (1 - x²) / n²."""
    n = 1.5
    x = np.linspace(0, 1, 20001)  # the cosine outside
    inside = np.sqrt(1 - (1 - x * x) / n**2)
    f = np.array([fresnel(-c, n).reflectance for c in inside])
    weights = np.full(len(x), 2.0)
    weights[1::2] = 4
    weights[[0, -1]] = 1
    total = (1 - 1 / n**2) + np.sum(weights * f * 2 * x / n**2) / (3 * (len(x) - 1))
    # The integrand's root at 0 (rounded cosines near the critical angle: sqrt(u) of 1e-4 each).
    assert hemispherical_fresnel(1 / n) == pytest.approx(total, abs=1e-8)


def test_the_mirrored_direction_is_drawn_for_its_share():
    rng = np.random.default_rng(45)
    for material, wo in list(random_plastic(20, 46))[::2]:
        table = material.tabulate(NO_TEXTURES)
        _, weights, probabilities, _, is_delta = sample(table, wo, rng.uniform(0, 1, (4000, 3)))
        branch = plastic.branches(table, 0, NOWHERE, Vec3(*wo))
        assert branch.reflected == (-wo[0], -wo[1], wo[2])
        f = fresnel(wo[2], material.interior_ior).reflectance
        for k in range(3):
            assert branch.reflectance[k] == pytest.approx(f * material.specular[k], rel=2 * U)
        product = weights[is_delta] * probabilities[is_delta, None]
        assert np.abs(product - branch.reflectance).max() < 4 * U
        p = probabilities[is_delta][0]
        # Five standard errors of a binomial, ten materials: 6e-6.
        assert abs(is_delta.mean() - p) < 5 * math.sqrt(p * (1 - p) / len(is_delta))
        # What is left belongs to the smooth part.
        wi = towards(0.7, 1.0)
        assert evaluate(table, wo, wi)[1][0] == pytest.approx((1 - p) * wi[2] / math.pi, rel=8 * U)


def test_reciprocity():
    rng = np.random.default_rng(47)
    for material, _ in random_plastic(16, 48):
        wo, wi = unit_vectors(rng, 500), unit_vectors(rng, 500)
        wo[:, 2], wi[:, 2] = abs(wo[:, 2]), abs(wi[:, 2])
        table = material.tabulate(NO_TEXTURES)
        there = evaluate(table, wo, wi)[0] / wi[:, 2:]
        back = evaluate(table, wi, wo)[0] / wo[:, 2:]
        assert (np.abs(there - back) <= 1e-12 * there).all()
        assert (there > 0).all()


@pytest.mark.parametrize("eta", [1.2, 1.5, 2.4, 0.8])
def test_the_linear_base_sends_back_its_reflectance(eta):
    """rho (1 - F(wo)) exactly: the mean of 1 - F over wi is (1 - F_int) eta²."""
    table = Plastic(reflectance=(0.2, 0.5, 1), interior_ior=eta).tabulate(NO_TEXTURES)
    for cosine in (1.0, 0.5, 0.02):
        wo = towards(cosine, 0.3)
        passed = 1 - fresnel(cosine, eta).reflectance
        for k, rho in enumerate((0.2, 0.5, 1.0)):
            found = integrate(
                lambda d, k=k, wo=wo: evaluate(table, wo, d)[0][:, k], wo[None], tolerance=1e-8
            )
            # A few hundred boxes of that tolerance.
            assert found == pytest.approx(rho * passed, abs=4e-6)


@pytest.mark.parametrize("nonlinear", [False, True])
@pytest.mark.parametrize("eta", [1.05, 1.5, 2.5])
def test_energy(eta, nonlinear):
    """A white plastic gives back all, smooth; a rough one at most all, but for the table's error
    (4e-4 in T, 4e-4 in R_int over 1 - R_int)."""
    rng = np.random.default_rng(50)
    white = {"reflectance": 1.0, "interior_ior": eta, "nonlinear": nonlinear}
    for cosine in (1.0, 0.5, 0.1, 1e-3):
        wo = towards(cosine, 0.0)
        total, error = albedo(Plastic(**white).tabulate(NO_TEXTURES), wo, rng)
        assert (np.abs(total - 1) <= 5 * error + 1e-12).all()
        for alpha in (1e-4, 0.03, 0.3, 1.0):
            rough = RoughPlastic(**white, alpha=alpha)
            total, error = albedo(rough.tabulate(NO_TEXTURES), wo, rng)
            assert (total <= 1 + 2e-3 + 5 * error).all()


SLOW_TABLES = [
    pytest.param(kind, alpha, eta, marks=pytest.mark.slow)
    for kind in (0, 1)
    for alpha in (1e-4, 0.05, 0.2, 1.0)
    for eta in (1.1, 2.0, 3.0)
]


@pytest.mark.parametrize(
    ("kind", "alpha", "eta"),
    [(0, 1e-4, 1.5), (0, 0.1, 3.0), (0, 0.5, 1.5), (0, 1.0, 1.3), (1, 0.5, 2.0), *SLOW_TABLES],
)
def test_the_tables_are_as_right_as_they_say(kind, alpha, eta):
    m = Microfacets(kind, alpha, alpha)
    name = ("ggx", "beckmann")[kind]
    table = RoughPlastic(interior_ior=eta, alpha=alpha, distribution=name).tabulate(NO_TEXTURES)
    cosines = np.linspace(0.003, 1, 11)
    exact = transmittances(m, eta, cosines, rule=96)
    found = [rough_plastic._passing(table, 0, c) for c in cosines]
    assert np.abs(np.array(found) - exact).max() < 4e-4
    exact = internal_reflectance(m, eta, rule=96)
    assert table.r_int[0] == pytest.approx(exact, abs=4e-4)


def test_a_smooth_rough_plastic_is_plastic():
    """Away from grazing angles; the lobe is the mirror's to all but itself."""
    fields = {"reflectance": (0.2, 0.5, 0.9), "interior_ior": 1.5}
    rng = np.random.default_rng(51)
    wi = unit_vectors(rng, 300)
    wi = wi[wi[:, 2] > 0.1]
    smooth = Plastic(**fields).tabulate(NO_TEXTURES)
    rough = RoughPlastic(**fields, alpha=1e-4).tabulate(NO_TEXTURES)
    wo = towards(0.7, 0.0)
    expected, found = evaluate(smooth, wo, wi)[0], evaluate(rough, wo, wi)[0]
    is_far = np.linalg.norm(wi - wo * (-1, -1, 1), axis=1) > 0.3  # GGX's tail: alpha² / 0.1^4
    # 4e-4 over T, 4e-4 over 1 - R_int.
    assert np.abs(found / expected - 1)[is_far].max() < 2e-3


def test_without_a_coat_it_is_diffuse():
    table = Plastic(reflectance=(0.2, 0.5, 0.9), interior_ior=1.0).tabulate(NO_TEXTURES)
    wo, wi = towards(0.3, 0.1), towards(0.8, 2.0)
    value, density = evaluate(table, wo, wi)
    assert value[0] == pytest.approx(np.array([0.2, 0.5, 0.9]) * 0.8 / math.pi, rel=8 * U)
    assert density[0] == pytest.approx(0.8 / math.pi, rel=8 * U)


def test_nonlinear_is_more_saturated():
    wo, wi = towards(0.3, 0.1), towards(0.8, 2.0)
    for material in (Plastic, RoughPlastic):
        fields = {"reflectance": (0.9, 0.5, 0.1)}
        linear = evaluate(material(**fields).tabulate(NO_TEXTURES), wo, wi)[0][0]
        deep = evaluate(material(nonlinear=True, **fields).tabulate(NO_TEXTURES), wo, wi)[0][0]
        assert deep[0] / deep[2] > 1.4 * linear[0] / linear[2]
        assert (deep < linear).all()
