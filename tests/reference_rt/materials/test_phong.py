"""Phong: the textbook's formula, its lobes' integrals, samples against densities and integrals,
the bound of its energy."""

import math

import numpy as np
import pytest
from builders import U, unit_vectors
from leaf_checks import NOWHERE, albedo, evaluate, sample
from random_bsdfs import random_phong

from comparisons.statistics.chi_square import integrate
from reference_rt.core.vec3 import Vec3
from reference_rt.materials.bsdfs import phong
from reference_rt.materials.bsdfs.phong import Phong, power
from reference_rt.textures import NO_TEXTURES, Palette


def test_the_formula():
    """T16, term by term, with NumPy's vectors."""
    rng = np.random.default_rng(61)
    n = np.array([0, 0, 1])
    for material, _ in random_phong(20, 62):
        table = material.tabulate(NO_TEXTURES)
        e, light = unit_vectors(rng, 300), unit_vectors(rng, 300)
        e[:, 2], light[:, 2] = abs(e[:, 2]), abs(light[:, 2])
        cosine = light @ n
        mirrored = 2 * cosine[:, None] * n - light
        h = (light + e) / np.linalg.norm(light + e, axis=1)[:, None]
        base = np.maximum(0, h @ n if material.half_vector else (e * mirrored).sum(axis=1))
        p = material.exponent
        expected = np.array(material.diffuse) * cosine[:, None]
        expected = expected + np.array(material.specular) * (base**p)[:, None]
        found = evaluate(table, e, light)[0]
        # A base x that is rounded, to some u of 1, changes x^p by p u / x; where that is not small
        # x^p itself is: below p u (p x^(p - 1) <= p).
        assert (np.abs(found - expected) <= 16 * U * (1 + p) * (1 + np.max(expected))).all()


def test_powers():
    assert power(0.0, 3.0) == power(-0.5, 2.0) == 0.0
    assert power(1.0, 1e6) == 1.0
    for p in (0.5, 1.0, 32.0, 1e4):
        for x in (1e-3, 0.3, 0.999, 1 - 1e-9):
            tolerance = 4 * U * (1 + p * abs(math.log(x)))
            assert power(x, p) == pytest.approx(x**p, rel=tolerance, abs=1e-300)


def test_ambient_and_mirror():
    material = Phong(ambient=(0.1, 0.2, 0.3), diffuse=0.1, mirror=(0.4, 0.5, 0.6))
    table = material.tabulate(NO_TEXTURES)
    assert phong.ambient(table, 0, NOWHERE) == (0.1, 0.2, 0.3)
    branch = phong.branches(table, 0, NOWHERE, Vec3(0.6, 0, 0.8))
    assert branch.reflected == (-0.6, 0, 0.8)
    assert branch.reflectance == (0.4, 0.5, 0.6)
    assert branch.transmittance == (0, 0, 0)
    assert phong.branches(table, 0, NOWHERE, Vec3(0.6, 0.0, -0.8)).reflectance == (0, 0, 0)


@pytest.mark.parametrize("p", [1.0, 7.5, 100.0])
def test_integral_of_the_highlight_at_normal_incidence(p):
    """Mirrored: cos^p over the hemisphere is 2 pi / (p + 1).  Half vectors: h within 45 degrees,
    8 pi / (p + 2) (1 - 2^(-(p + 2) / 2)), by dwi = 4 cos dh."""
    up = np.array([0.0, 0.0, 1.0])
    for half_vector, expected in (
        (False, 2 * math.pi / (p + 1)),
        (True, 8 * math.pi / (p + 2) * (1 - 2 ** (-0.5 * (p + 2)))),
    ):
        material = Phong(diffuse=0, specular=1, exponent=p, half_vector=half_vector)
        table = material.tabulate(NO_TEXTURES)
        found = integrate(lambda d, t=table: evaluate(t, up, d)[0][:, 0], up[None])
        assert found == pytest.approx(expected, abs=1e-4)
        total, error = albedo(table, up, np.random.default_rng(64))
        assert abs(total[0] - expected) <= 5 * error[0] + 1e-9
        assert expected <= material.energy_bound(NO_TEXTURES)


def test_the_mirrored_direction_is_drawn_for_its_share():
    rng = np.random.default_rng(69)
    for material, wo in random_phong(16, 70):
        table = material.tabulate(NO_TEXTURES)
        wi, weights, probability, _, is_delta = sample(table, wo, rng.uniform(0, 1, (2000, 3)))
        assert is_delta.any() == any(material.mirror)
        assert (wi[is_delta] == wo * (-1, -1, 1)).all()
        product = weights[is_delta] * probability[is_delta, None]
        assert np.abs(product - material.mirror).max(initial=0) < 4 * U


def test_symmetry():
    """f cos of the highlight, and f of the diffuse part, are the same there and back."""
    rng = np.random.default_rng(71)
    wo, wi = unit_vectors(rng, 500), unit_vectors(rng, 500)
    wo[:, 2], wi[:, 2] = abs(wo[:, 2]), abs(wi[:, 2])
    for half_vector in (False, True):
        fields = {"half_vector": half_vector, "exponent": 20.0}
        shiny = Phong(diffuse=0, specular=0.5, **fields).tabulate(NO_TEXTURES)
        there, back = evaluate(shiny, wo, wi)[0], evaluate(shiny, wi, wo)[0]
        assert np.abs(there - back).max() <= 1e-12
        matt = Phong(diffuse=0.3, **fields).tabulate(NO_TEXTURES)
        there, back = (evaluate(matt, a, b)[0] / b[:, 2:] for a, b in ((wo, wi), (wi, wo)))
        assert (np.abs(there - back) <= 4 * U * there).all()


def test_energy_is_within_its_bound():
    rng = np.random.default_rng(72)
    for material, wo in random_phong(24, 73):
        bound = material.energy_bound(NO_TEXTURES)
        total, error = albedo(material.tabulate(NO_TEXTURES), wo, rng, n=5000)
        assert total.max() <= bound + 5 * error.max()


def test_energy_bound():
    assert Phong(diffuse=0.2).energy_bound(NO_TEXTURES) == pytest.approx(0.2 * math.pi)
    fields = {"diffuse": (0.1, 0, 0), "specular": (0, 2, 0), "mirror": (0.1, 0.1, 0.9)}
    mirrored = Phong(exponent=39, **fields).energy_bound(NO_TEXTURES)
    assert mirrored == pytest.approx(0.9)
    halves = Phong(exponent=39, half_vector=True, **fields).energy_bound(NO_TEXTURES)
    assert halves == pytest.approx(0.1 + 2 * 8 * math.pi / 40)
    palette = Palette({"wood": 0}, [0.3])
    assert Phong(diffuse="wood").energy_bound(palette) == pytest.approx(0.3 * math.pi)
