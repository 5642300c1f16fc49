"""Rough conductors and dielectrics: samples against densities and integrals, reciprocity, energy,
the smooth laws as their limit, the same bits with and without the compiler."""

import math

import numpy as np
import pytest
from builders import U, unit_vectors
from chi_square import integrate, sidak
from leaf_checks import PLAIN, evaluate, p_values, sample, towards

from reference_rt.core.vec3 import Vec3
from reference_rt.materials.bsdfs.rough_conductor import RoughConductor
from reference_rt.materials.bsdfs.rough_dielectric import RoughDielectric
from reference_rt.materials.microfacet.fresnel import conductor_colour, fresnel
from reference_rt.textures import NO_TEXTURES

GOLD = {"eta": (0.143, 0.375, 1.442), "k": (3.983, 2.386, 1.603)}
LOSSLESS = {"eta": 1, "k": 1e9}
"""A metal whose reflectance is 1 to within 4e-18."""


def random_cases(n, seed, least=0.01):
    """(description, wo): both distributions, alpha from `least` to 1, a third isotropic; metals
    and glasses, these from both sides; a third of the directions grazing."""
    rng = np.random.default_rng(seed)
    for k in range(n):
        alpha = 10.0 ** rng.uniform(math.log10(least), 0, 2)
        rough = {
            "distribution": ("ggx", "beckmann")[k // 2 % 2],
            "alpha": float(alpha[0]) if k % 3 == 0 else alpha.tolist(),
        }
        cosine = rng.uniform(0.05, 1) if k % 5 > 1 else 10.0 ** rng.uniform(-4, -1)
        wo = towards(cosine, rng.uniform(0, 2 * math.pi))
        if k % 2 == 0:
            eta, absorption = rng.uniform(0.05, 3, 3), rng.uniform(0, 5, 3)
            yield RoughConductor(eta=eta.tolist(), k=absorption.tolist(), **rough), wo
            continue
        wo[2] *= 1 - 2 * (k // 4 % 2)
        yield (
            RoughDielectric(
                interior_ior=float(rng.uniform(1.1, 3)),
                exterior_ior=float(rng.uniform(0.8, 1.05)),
                reflectance=rng.uniform(0.2, 1, 3).tolist(),
                transmittance=rng.uniform(0.2, 1, 3).tolist(),
                **rough,
            ),
            wo,
        )


@pytest.mark.slow
@pytest.mark.parametrize("cases", [20, pytest.param(300, marks=pytest.mark.slow)])
def test_samples_have_their_density_and_the_weights_their_mean(cases):
    rng = np.random.default_rng(31)
    # The quadrature may be off by the share of a few samples: 20 of the 40 000 here.
    found = [
        p for case in random_cases(cases, 32) for p in p_values(*case, rng, 40_000, 5e-4, 5e-4)
    ]
    assert min(found) > sidak(len(found))


def conditions(material, wo, wi):
    """How much a rounding of a half vector shows in f: D changes by a factor of 1 + 4 / alpha or,
    within the seven alpha where there are samples, 14 / alpha (Beckmann); refraction divides by
    cosines with the half vector, whose unnormalised length is |wo + eta wi|; Fresnel's equations
    have a root, infinitely steep at the critical angle.  And eta of wi's side over wo's."""
    eta = np.ones(len(wi))
    h = wo + wi
    steep = 1.0
    if isinstance(material, RoughDielectric):
        ratio = material.interior_ior / material.exterior_ior
        ratio = ratio if wo[2] > 0 else 1 / ratio
        eta = np.where(wo[2] * wi[:, 2] > 0, 1.0, ratio)
        h = wo + eta[:, None] * wi
        sin2 = 1 - (h @ wo) ** 2 / (h * h).sum(axis=1)
        steep = np.sqrt(np.abs(1 - sin2 / ratio**2))
    length = np.linalg.norm(h, axis=1)
    cosine = np.minimum(np.abs(h @ wo), np.abs((h * wi).sum(axis=1))) / length
    least = np.minimum(np.minimum(min(material.alpha), cosine), steep)
    return 14.0 / (length * least), eta


def test_weight_times_density_is_the_value():
    rng = np.random.default_rng(33)
    for material, wo in random_cases(48, 34):
        table = material.tabulate(NO_TEXTURES)
        wi, weights, densities, eta, _ = sample(table, wo, rng.uniform(0, 1, (2000, 3)))
        kept = densities > 0
        wi, weights, densities, eta = wi[kept], weights[kept], densities[kept], eta[kept]
        values, found = evaluate(table, wo, wi)
        condition, expected_eta = conditions(material, wo, wi)
        assert (eta == expected_eta).all()
        assert np.abs(np.linalg.norm(wi, axis=1) - 1).max() < 32 * U
        relative = 16 * U * condition
        assert (np.abs(found - densities) <= relative * densities).all()
        product = weights * densities[:, None]
        assert (np.abs(values - product) <= relative[:, None] * product).all()


def test_reciprocity():
    """f(wo, wi) = f(wi, wo); through the boundary f(wo, wi) eta² = f(wi, wo), eta the index on wi's
    side over that on wo's: radiance over the index squared is what is carried."""
    rng = np.random.default_rng(35)
    for material, wo in random_cases(48, 36, least=0.1):
        if abs(wo[2]) < 0.05:
            continue
        table = material.tabulate(NO_TEXTURES)
        wi, _, densities, eta, _ = sample(table, wo, rng.uniform(0, 1, (500, 3)))
        good = densities > 0
        condition, _ = conditions(material, wo, wi[good])
        wi, eta = wi[good][condition < 500], eta[good][condition < 500]
        there = evaluate(table, wo, wi)[0] / np.abs(wi[:, 2:])
        back = evaluate(table, wi, wo)[0] / abs(wo[2])
        # 16 u times a condition of 500 is 0.9e-12.
        assert np.allclose(there * eta[:, None] ** 2, back, rtol=1e-12, atol=0)


def albedo(table, wo, eta=1.0, seed=37):
    """The power that leaves for a unit of power along wo: through the boundary, where f carries a
    1 / eta², times eta²."""
    u = np.random.default_rng(seed).uniform(0, 1, (20_000, 3))
    wi, _, densities, _, _ = sample(table, wo, u)

    def power(d):
        through = np.where(d[:, 2] * wo[2] < 0, eta * eta, 1.0)
        return evaluate(table, wo, d)[0][:, 0] * through

    return integrate(power, wi[densities > 0])


COSINES = (1.0, 0.4, 1e-3)


@pytest.mark.cases(1)
@pytest.mark.parametrize("distribution", ["ggx", "beckmann"])
@pytest.mark.parametrize("alpha", [1e-3, 0.4, 10.0, (0.05, 0.8)])
def test_no_energy_is_created(distribution, alpha):
    rough = {"distribution": distribution, "alpha": alpha}
    metal = RoughConductor(**LOSSLESS, **rough).tabulate(NO_TEXTURES)
    glasses = [(eta, RoughDielectric(interior_ior=eta, **rough)) for eta in (0.4, 1.5)]
    for cosine in COSINES:
        wo = towards(cosine, 0.5)
        # By the quadrature's share of a few of 20 000 samples.
        assert albedo(metal, wo) < 1 + 5e-4
        for eta, glass in glasses:
            assert albedo(glass.tabulate(NO_TEXTURES), wo, eta) < 1 + 5e-4
            assert albedo(glass.tabulate(NO_TEXTURES), -wo, 1 / eta) < 1 + 5e-4


LOST = {0.1: (1.2, 0.1, 1.1), 0.3: (12.3, 1.2, 10.1), 1.0: (69.3, 10.7, 58.3)}
"""Per cent at normal incidence with GGX, by alpha: metal, glass from outside, from inside."""


@pytest.mark.parametrize("alpha", LOST)
def test_energy_lost_to_second_bounces_is_what_the_files_say(alpha):
    wo = towards(1.0, 0.0)
    metal = RoughConductor(**LOSSLESS, alpha=alpha).tabulate(NO_TEXTURES)
    glass = RoughDielectric(alpha=alpha).tabulate(NO_TEXTURES)
    kept = albedo(metal, wo), albedo(glass, wo, 1.5), albedo(glass, -wo, 1 / 1.5)
    assert 100 * (1 - np.array(kept)) == pytest.approx(LOST[alpha], abs=0.06)


def test_albedo_of_the_roughest_metal():
    """GGX of alpha 1 has D = 1 / pi.  Straight on, normals up to 45 degrees mirror upwards, with
    c = cos wi uniform in [0, 1] for half of all, and weigh G1 = 2 c / (1 + c): 1 - log 2."""
    metal = RoughConductor(**LOSSLESS, alpha=1).tabulate(NO_TEXTURES)
    assert albedo(metal, towards(1.0, 0.0)) == pytest.approx(1 - math.log(2), abs=1e-6)


@pytest.mark.parametrize("distribution", ["ggx", "beckmann"])
@pytest.mark.parametrize("cosine", [1.0, 0.8, 0.3])
def test_the_smooth_laws_are_the_limit(distribution, cosine):
    """At the least alpha, wi is the mirrored or the refracted direction but for slopes of some
    alpha, and weights are Fresnel's: with a relative error of alpha over the cosine, squared
    on average, and more for GGX, whose mean square slope diverges."""
    rng = np.random.default_rng(38)
    u = rng.uniform(0, 1, (20_000, 3))
    wo = towards(cosine, 0.7)
    rough = {"distribution": distribution, "alpha": 1e-12}  # counts as 1e-4
    metal = RoughConductor(**GOLD, **rough).tabulate(NO_TEXTURES)
    _, weights, densities, _, _ = sample(metal, wo, u)
    exact = conductor_colour(cosine, Vec3(*GOLD["eta"]), Vec3(*GOLD["k"]))
    assert weights[densities > 0].mean(axis=0) == pytest.approx(exact, rel=1e-4)
    assert (densities > 0).mean() > 0.9999

    for side in (1.0, -1.0):
        table = RoughDielectric(**rough).tabulate(NO_TEXTURES)
        v = wo * (1, 1, side)
        wi, weights, _, eta, _ = sample(table, v, u)
        smooth = fresnel(side * cosine, 1.5)
        through = wi[:, 2] * side < 0
        p = smooth.reflectance
        # Five deviations of the count.
        assert abs(through.mean() - (1 - p)) <= 5 * math.sqrt(p * (1 - p) / len(u)) + 1e-4
        mirrored = wi[~through] - v * (-1, -1, 1)
        assert np.median(np.linalg.norm(mirrored, axis=1)) < 4e-4
        if p < 1:
            bent = np.append(-v[:2] / smooth.eta, -side * smooth.cos_t)
            assert np.median(np.linalg.norm(wi[through] - bent, axis=1)) < 4e-4 / smooth.cos_t
            assert weights[through].mean() == pytest.approx(1 / smooth.eta**2, rel=1e-3)
            assert (eta[through] == smooth.eta).all()


def everything():
    for distribution in ("ggx", "beckmann"):
        for alpha in (1e-4, (1e-4, 10.0), 0.2, 10.0):
            rough = {"distribution": distribution, "alpha": alpha}
            yield RoughConductor(**GOLD, **rough)
            for eta in (0.5, 1.00001, 1.5):
                yield RoughDielectric(interior_ior=eta, **rough)
            yield RoughDielectric(reflectance=0, transmittance=0, **rough)


@pytest.mark.slow
def test_never_nan_and_the_same_bits_as_plain_python():
    rng = np.random.default_rng(39)
    ends = [towards(z, phi) for z in (0.0, 1e-300, 1e-150, 1e-9, 0.5, 1.0) for phi in (0.0, 2.0)]
    directions = np.concatenate([unit_vectors(rng, 8), ends, -np.array(ends)])
    wo, wi = (x.reshape(-1, 3) for x in np.broadcast_arrays(directions[:, None], directions))
    wo, wi = np.ascontiguousarray(wo), np.ascontiguousarray(wi)
    u = rng.choice([0.0, 2.0**-33, 0.2, 0.5, 0.9, 1 - 2.0**-53], (len(wo), 3))
    for material in everything():
        table = material.tabulate(NO_TEXTURES)
        found = *evaluate(table, wo, wi), *sample(table, wo, u)
        for x in found:
            assert np.isfinite(x).all()
        assert (found[0] >= 0).all()
        assert (found[1] >= 0).all()
        few = slice(None, None, 29)
        plain = *evaluate(table, wo[few], wi[few], PLAIN), *sample(table, wo[few], u[few], PLAIN)
        for x, y in zip(found, plain, strict=True):
            assert np.array_equal(x[few], y)


def test_sides():
    metal, glass = RoughConductor(**GOLD, alpha=0.5), RoughDielectric(alpha=0.5)
    up, down = towards(0.8, 0.1), towards(0.6, 0.2) * (1, 1, -1)
    for wo, wi in ((up, down), (down, up), (down, down)):
        values, densities = evaluate(metal.tabulate(NO_TEXTURES), wo, wi)
        assert not values.any()
        assert not densities.any()
    for wo, wi in ((up, -up), (-up, up), (up, up), (down, down)):
        assert evaluate(glass.tabulate(NO_TEXTURES), wo, wi)[1] > 0
    assert (metal.smooth, metal.delta, metal.transmits) == (True, False, False)
    assert (glass.smooth, glass.delta, glass.transmits) == (True, False, True)
    assert not metal.oriented
    assert RoughDielectric(alpha=(0.1, 0.2)).oriented
