"""Precision at dielectric boundaries: matched indices, grazing angles, either side."""

import math

import numpy as np
import pytest
from builders import U
from flint import arb, ctx
from hypothesis import given
from hypothesis import strategies as st
from leaf_checks import vec_towards as towards

from reference_rt.core.vec3 import Vec3, dot
from reference_rt.materials.bsdfs.rough_dielectric import RoughDielectric, eval_pdf, sample
from reference_rt.materials.microfacet.fresnel import MOST_INDEX, fresnel, relative_index
from reference_rt.materials.microfacet.ggx_and_smith import half_vector, refract, refraction_half
from reference_rt.sampling.warp import uniform_sphere
from reference_rt.textures import NO_TEXTURES, At

AT = At(None, 0.0, 0.0, Vec3(-1.0, -1.0, -1.0))

offsets = st.floats(-12.0, -0.2).map(lambda e: 10.0**e)
signs = st.sampled_from([-1.0, 1.0])
indices = st.one_of(
    st.floats(0.25, 4.0).filter(lambda n: abs(n - 1.0) > 0.01),
    st.builds(lambda off, sign: 1.0 + sign * off, offsets, signs),
)
cosines = st.builds(lambda e, sign: sign * 10.0**e, st.floats(-12.0, 0.0), signs)
heights = st.floats(-12.0, 0.0).map(lambda e: 10.0**e)
angles = st.floats(0.0, 6.28)


@given(cosines, indices)
def test_reflectance_and_transmittance_to_the_last_digits(cosine, n):
    """Of the very floats, by the definitions in 60 digits; for indices above 1 from outside, and
    below 1 from inside, where nothing is totally reflected."""
    if (cosine > 0.0) != (n > 1.0):
        cosine = -cosine
    ctx.dps = 60
    eta = arb(n) if cosine > 0.0 else 1 / arb(n)
    c = abs(arb(cosine))
    t = (1 - (1 - c * c) / (eta * eta)).sqrt()
    s, p = (c - eta * t) / (c + eta * t), (eta * c - t) / (eta * c + t)
    r = (s * s + p * p) / 2
    found = fresnel(cosine, n)
    assert abs(float((arb(found.reflectance) - r) / r)) <= 32 * U
    assert abs(float((arb(found.transmittance) - (1 - r)) / (1 - r))) <= 64 * U
    assert abs(float((arb(found.gap) - (c / eta - t)) / (c / eta - t))) <= 16 * U
    assert abs(float((arb(found.cos_t) - t) / t)) <= 8 * U


@given(cosines, indices)
def test_nothing_is_lost_and_nothing_gained(cosine, n):
    found = fresnel(cosine, n)
    assert 0.0 <= found.reflectance <= 1.0
    assert found.reflectance + found.transmittance == pytest.approx(1.0, abs=64 * U)


@pytest.mark.parametrize("n", [1e-300, 1e-80, 1.0, 1e80, 1e300])
@pytest.mark.parametrize("cosine", [-1.0, -1e-200, 0.0, 1e-200, 1.0])
def test_no_index_breaks_it(n, cosine):
    clipped = relative_index(n, 1.0)
    assert 1.0 / MOST_INDEX <= clipped <= MOST_INDEX
    assert all(math.isfinite(x) for x in fresnel(cosine, clipped))


@given(heights, angles, heights, angles, indices)
def test_bending_is_the_same_from_either_side(up, phi, down, psi, n):
    """The same bits; of the spread, which counts solid angle, n² more from inside."""
    a, b = towards(up, phi), -towards(down, psi)
    there = refraction_half(a, b, n, True)
    back = refraction_half(-b, -a, n, False)  # upside down, so that wo is above
    assert there.refraction == back.refraction
    assert (there.h == back.h) or (there.h == -back.h)
    assert back.spread == pytest.approx(there.spread * n * n, rel=4 * U)


@given(heights, angles, heights, angles)
def test_half_vectors_are_symmetric(a_up, phi, b_up, psi):
    a, b = towards(a_up, phi), towards(b_up, psi)
    assert half_vector(a, b) == half_vector(b, a)
    half = half_vector(a, b)
    # The products' roundings, and those of unit vectors, seen against the length of their sum.
    assert half.cosine == pytest.approx(dot(a, half.h), abs=8 * U / half.cosine)


@given(heights, angles, indices, signs)
def test_refracted_directions_are_unit_and_obey_snell(up, phi, n, side):
    wo = towards(up, phi)
    found = fresnel(math.copysign(up, side), n)
    if found.transmittance == 0.0:
        return
    wi = refract(wo, Vec3(0.0, 0.0, 1.0), found)
    assert dot(wi, wi) == pytest.approx(1.0, abs=8 * U)
    assert wi.x * found.eta == pytest.approx(-wo.x, abs=64 * U)
    assert wi.y * found.eta == pytest.approx(-wo.y, abs=64 * U)


@pytest.mark.parametrize("index", [1.0 + 1e-8, 1.0 - 1e-8, 1.0 + 1e-5])
@pytest.mark.parametrize("distribution", ["ggx", "beckmann"])
def test_glass_that_hardly_bends(index, distribution):
    """Directions pass as good as straight, with a weight that only the masking takes from; and
    samples are found again by `eval_pdf`."""
    material = RoughDielectric.model_validate(
        {
            "type": "rough_dielectric",
            "interior_ior": index,
            "alpha": 0.2,
            "distribution": distribution,
        }
    )
    table = material.tabulate(NO_TEXTURES)
    rng = np.random.default_rng(70)
    for u_lobe, u0, u1 in rng.uniform(0.0, 1.0, (200, 3)).tolist():
        for side in (1.0, -1.0):
            wo = towards(0.7, 0.3)
            wo = Vec3(wo.x, wo.y, side * wo.z)
            found = sample(table, 0, AT, wo, u_lobe, u0, u1)
            assert found.pdf > 0.0
            assert dot(found.wi, -wo) > 1.0 - 1e-7
            assert 0.9 < found.weight.x <= 1.0 + abs(index - 1.0) * 4.0
            value = eval_pdf(table, 0, AT, wo, found.wi).value.x
            # A direction tells the half vector's slope to u / |n - 1|, D to 14 / alpha of it.
            off = 4 * 14.0 / 0.2 * U / abs(index - 1.0)
            assert value == pytest.approx(found.weight.x * found.pdf, rel=32 * U + off)


@pytest.mark.parametrize("u0", [0.0, 2.0**-53, 1e-12, 0.3, 1.0 - 2.0**-53])
def test_directions_near_the_poles_are_unit(u0):
    x, y, z = uniform_sphere(u0, 0.2)
    assert math.hypot(x, y) == pytest.approx(
        2.0 * math.sqrt(u0 * (1.0 - u0)), rel=8 * U, abs=1e-300
    )
    assert x * x + y * y + z * z == pytest.approx(1.0, abs=8 * U)
