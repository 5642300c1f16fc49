"""Rough conductors and dielectrics: energy that is lost, the smooth laws as their limit, sides.

F10 and F11 of the stability suites have reciprocity, weights, densities and energy."""

import math

import numpy as np
import pytest
from leaf_checks import evaluate, sample, towards

from comparisons.statistics.chi_square import integrate
from reference_rt.core.vec3 import Vec3
from reference_rt.materials.bsdfs.rough_conductor import RoughConductor
from reference_rt.materials.bsdfs.rough_dielectric import RoughDielectric
from reference_rt.materials.microfacet.fresnel import conductor_colour, fresnel
from reference_rt.textures import NO_TEXTURES

GOLD = {"eta": (0.143, 0.375, 1.442), "k": (3.983, 2.386, 1.603)}
LOSSLESS = {"eta": 1, "k": 1e9}
"""A metal whose reflectance is 1 to within 4e-18."""


def albedo(table, wo, eta=1.0, seed=37):
    """The power that leaves for a unit of power along wo: through the boundary, where f carries a
    1 / eta², times eta²."""
    u = np.random.default_rng(seed).uniform(0, 1, (20_000, 3))
    wi, _, densities, _, _ = sample(table, wo, u)

    def power(d):
        through = np.where(d[:, 2] * wo[2] < 0, eta * eta, 1.0)
        return evaluate(table, wo, d)[0][:, 0] * through

    return integrate(power, wi[densities > 0])


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


def test_sides():
    metal, glass = RoughConductor(**GOLD, alpha=0.5), RoughDielectric(alpha=0.5)
    up, down = towards(0.8, 0.1), towards(0.6, 0.2) * (1, 1, -1)
    for wo, wi in ((up, -up), (-up, up), (up, up), (down, down)):
        assert evaluate(glass.tabulate(NO_TEXTURES), wo, wi)[1] > 0
    assert (metal.smooth, metal.delta, metal.transmits) == (True, False, False)
    assert (glass.smooth, glass.delta, glass.transmits) == (True, False, True)
    assert not metal.oriented
    assert RoughDielectric(alpha=(0.1, 0.2)).oriented
