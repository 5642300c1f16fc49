"""The thin dielectric: bounces between its faces summed one by one, energy, symmetry."""

import numpy as np
import pytest
from builders import U
from leaf_checks import NOWHERE, random_direction

from reference_rt.core.vec3 import Vec3
from reference_rt.materials.bsdfs import thin_dielectric
from reference_rt.materials.bsdfs.thin_dielectric import ThinDielectric
from reference_rt.materials.material import sample_branch
from reference_rt.materials.microfacet.fresnel import fresnel
from reference_rt.textures import NO_TEXTURES


def branches(wo, **fields):
    table = ThinDielectric(**fields).tabulate(NO_TEXTURES)
    return thin_dielectric.branches(table, 0, NOWHERE, Vec3(*wo))


def test_the_bounces_between_the_faces_add_up():
    rng = np.random.default_rng(1)
    for k in range(60):
        eta, wo = rng.uniform(1.01, 3), random_direction(rng, k, front=False)
        r = fresnel(abs(wo[2]), eta).reflectance
        mirrored, passed, inside = r, 0.0, 1 - r
        while inside > U:  # what is inside meets a face: r of it stays
            passed += inside * (1 - r)
            inside *= r
            mirrored += inside * (1 - r)
            inside *= r
        found = branches(wo, interior_ior=eta)
        # Some log(U) / (2 log r) <= 19 / (1 - r) rounded terms each.
        tolerance = 20 * U / (1 - r)
        assert found.reflectance.x == pytest.approx(mirrored, abs=tolerance)
        assert found.transmittance.x == pytest.approx(passed, abs=tolerance)


def test_energy_and_directions():
    rng = np.random.default_rng(2)
    for k in range(60):
        eta, wo = rng.uniform(0.4, 3), random_direction(rng, k, front=False)
        found = branches(wo, interior_ior=eta)
        assert found.reflectance.x + found.transmittance.x == pytest.approx(1, rel=2 * U)
        assert found.reflected == (-wo[0], -wo[1], wo[2])
        assert found.refracted == (-wo[0], -wo[1], -wo[2])
        assert found.eta == 1.0
        assert found.share == found.reflectance.x
        behind = branches(wo * (1, 1, -1), interior_ior=eta)
        assert behind.reflectance == found.reflectance
        for u in (0.0, 0.3, 1 - U):
            drawn = sample_branch(found, u)
            factor = found.reflectance if u < found.share else found.transmittance
            assert drawn.weight.x * drawn.pdf == pytest.approx(factor.x, rel=4 * U)


def test_colours_multiply():
    plain = branches((0.6, 0, 0.8))
    found = branches((0.6, 0, 0.8), reflectance=(0.1, 0.2, 0.3), transmittance=(0.4, 0.5, 0.6))
    for k in range(3):
        assert found.reflectance[k] == plain.reflectance.x * (0.1, 0.2, 0.3)[k]
        assert found.transmittance[k] == plain.transmittance.x * (0.4, 0.5, 0.6)[k]


def test_limits():
    """At normal incidence 2 (n - 1)² / (2 n² + 2); nothing where the indices are equal."""
    n = 1.5
    expected = (n - 1) ** 2 / (n * n + 1)
    assert branches((0, 0, 1), interior_ior=n).reflectance.x == pytest.approx(expected, rel=16 * U)
    assert branches((0.6, 0, 0.8), interior_ior=1.0).reflectance.x < U
    assert branches((1, 0, 0)).reflectance.x == 1.0  # grazing
    # A film of air in glass: beyond the critical angle nothing passes.
    assert branches((0.8, 0, 0.6), interior_ior=1.0, exterior_ior=1.5).reflectance.x == 1.0
