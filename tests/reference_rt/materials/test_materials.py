"""Materials: total reflection, Snell, energy, one-sidedness; `test_boundary_digits` has Fresnel."""

import math

import numpy as np
import pytest
from builders import U
from hypothesis import given
from hypothesis import strategies as st
from leaf_checks import NOWHERE as AT
from leaf_checks import vec_towards as towards

import reference_rt as rt
from reference_rt.core.vec3 import Vec3, dot, length
from reference_rt.materials.bsdfs import dielectric, diffuse, mirror
from reference_rt.materials.bsdfs.tables import BLACK
from reference_rt.materials.material import sample_branch
from reference_rt.materials.microfacet.fresnel import fresnel
from reference_rt.textures import NO_TEXTURES

INDICES = (1.0003, 1.33, 1.5, 2.4)

etas = st.floats(0.25, 4.0).filter(lambda eta: abs(eta - 1) > 1e-3)
cosines = st.floats(1e-3, 1.0)
azimuths = st.floats(0.0, 2 * math.pi)


@pytest.mark.parametrize("n", INDICES)
def test_total_reflection_beyond_the_critical_angle(n):
    critical = math.sqrt(1 - 1 / n**2)  # its cosine
    for beyond in (0.999999 * critical, 0.5 * critical, 1e-9):
        assert fresnel(-beyond, n).reflectance == 1.0
        assert fresnel(-beyond, n).cos_t == 0.0
    assert fresnel(-1.000001 * critical, n).reflectance < 1.0


@given(cosines, etas)
def test_fresnel_is_reciprocal(cosine, eta):
    """The same fraction, there and back along the same path."""
    there = fresnel(cosine, eta)
    if there.reflectance < 1.0:
        back = fresnel(-there.cos_t, eta)
        # Each cosine is the root of a difference, whose rounding (up to 1 + eta² or 1 + 1/eta²
        # times u) it stretches by one over itself; the reflectance's slope is a few.
        tolerance = 64 * U * (1 + eta**2) * (1 + eta**-2) / (cosine * there.cos_t)
        assert back.reflectance == pytest.approx(there.reflectance, abs=tolerance)
        assert back.eta == pytest.approx(1 / there.eta)


@given(cosines, azimuths, etas, st.sampled_from([1.0, -1.0]))
def test_dielectric_branches(cosine, phi, eta, side):
    table = rt.Dielectric(interior_ior=eta).tabulate(NO_TEXTURES)
    wo = towards(cosine, phi)
    wo = Vec3(wo.x, wo.y, side * wo.z)
    found = dielectric.branches(table, 0, AT, wo)
    ratio = eta if side > 0 else 1 / eta
    # Energy: radiance is compressed by eta² where it enters.
    total = found.reflectance.x + found.transmittance.x * ratio**2
    assert total == pytest.approx(1.0, rel=8 * U)
    assert found.reflected == (-wo.x, -wo.y, wo.z)
    assert found.share == found.reflectance.x
    if found.share < 1.0:
        # Snell: the tangential part shrinks by the ratio; a unit vector on the other side.
        wi = found.refracted
        assert (wi.x, wi.y) == pytest.approx((-wo.x / ratio, -wo.y / ratio), rel=4 * U)
        assert wi.z * wo.z < 0
        assert length(wi) == pytest.approx(1.0, rel=16 * U)


@given(cosines, azimuths, etas, st.floats(0, 1, exclude_max=True))
def test_a_sampled_branch_weighs_what_it_must(cosine, phi, eta, u):
    """weight times probability is the branch's factor, whichever is drawn."""
    found = dielectric.branches(
        rt.Dielectric(interior_ior=eta).tabulate(NO_TEXTURES), 0, AT, towards(cosine, phi)
    )
    drawn = sample_branch(found, u)
    reflected = u < found.share
    assert drawn.is_delta
    assert drawn.wi == (found.reflected if reflected else found.refracted)
    factor = found.reflectance if reflected else found.transmittance
    assert drawn.weight.x * drawn.pdf == pytest.approx(factor.x, rel=4 * U)
    assert drawn.eta == (1.0 if reflected else found.eta)


def test_mirror_is_one_sided():
    table = rt.Mirror(reflectance=(0.2, 0.4, 0.6)).tabulate(NO_TEXTURES)
    front = mirror.branches(table, 0, AT, Vec3(0.6, 0.0, 0.8))
    assert front.reflected == (-0.6, 0.0, 0.8)
    assert front.reflectance == (0.2, 0.4, 0.6)
    assert sample_branch(front, 0.999).wi == front.reflected
    back = mirror.branches(table, 0, AT, Vec3(0.6, 0.0, -0.8))
    assert sample_branch(back, 0.5).pdf == 0.0


@given(cosines, st.floats(1e-9, 1 - 1e-9), st.floats(0, 1, exclude_max=True))
def test_diffuse_sample_evaluate_and_pdf_agree(cosine, u0, u1):
    table = rt.Diffuse(reflectance=(0.1, 0.5, 0.9)).tabulate(NO_TEXTURES)
    wo = towards(cosine, 0.3)
    drawn = diffuse.sample(table, 0, AT, wo, 0.5, u0, u1)
    value, density = diffuse.eval_pdf(table, 0, AT, wo, drawn.wi)
    assert drawn.pdf == density
    assert not drawn.is_delta
    for k in range(3):
        assert value[k] == pytest.approx(drawn.weight[k] * drawn.pdf, rel=4 * U)
    assert dot(drawn.wi, drawn.wi) == pytest.approx(1.0, rel=8 * U)


@given(cosines, cosines)
def test_diffuse_is_one_sided_and_reciprocal(a, b):
    table = rt.Diffuse().tabulate(NO_TEXTURES)
    wo, wi = towards(a, 0.3), towards(b, 2.0)
    below = Vec3(wi.x, wi.y, -wi.z)
    assert diffuse.eval_pdf(table, 0, AT, wo, below) == ((0.0, 0.0, 0.0), 0.0)
    assert diffuse.eval_pdf(table, 0, AT, below, wo) == ((0.0, 0.0, 0.0), 0.0)
    assert diffuse.sample(table, 0, AT, below, 0.5, 0.5, 0.5).pdf == 0.0
    there, back = (
        diffuse.eval_pdf(table, 0, AT, wo, wi).value.x,
        diffuse.eval_pdf(table, 0, AT, wi, wo).value.x,
    )
    assert there / wi.z == pytest.approx(back / wo.z, rel=4 * U)


def test_diffuse_reflects_its_reflectance():
    """The integral of f cos over the hemisphere, by the midpoint rule in cos and phi."""
    table = rt.Diffuse(reflectance=(0.1, 0.5, 0.9)).tabulate(NO_TEXTURES)
    ticks = (np.arange(64) + 0.5) / 64
    values = [diffuse.eval_pdf(table, 0, AT, Vec3(0, 0, 1), towards(c, 0.0)).value for c in ticks]
    # Linear in the cosine: the midpoint rule is exact.
    assert 2 * math.pi * np.mean(values, axis=0) == pytest.approx((0.1, 0.5, 0.9), rel=1e-14)


def tables_of(**materials):
    shapes = tuple(rt.Sphere(material=name) for name in materials)
    return rt.build_tables(rt.Scene(materials=materials, shapes=shapes)).materials


def test_what_materials_say_of_themselves():
    """By number, whatever the others are."""
    diffuse, mirror, lamp = rt.Diffuse(), rt.Mirror(), rt.Emissive(radiance=1.0)
    lit = tables_of(a=diffuse, lamp=lamp, mirror=mirror)
    assert lit.kind.tolist()[:2] == [0, BLACK]  # a lamp scatters nothing: it is of no table
    assert lit.smooth.tolist() == [1, 0, 0]
    assert lit.uses_u_lobe.tolist() == [0, 0, 1]
    assert lit.behind.tolist() == [0, 0, 0]
    mixed = tables_of(a=diffuse, b=rt.RoughDielectric(), c=rt.TwoSided(base="a"))
    assert mixed.smooth.tolist() == [1, 1, 1]
    assert mixed.uses_u_lobe.tolist() == [0, 1, 0]
    assert mixed.behind.tolist() == [0, 1, 1]


def test_who_asks_textures():
    """Surface coordinates are found for materials that ask a texture, for heights too."""
    materials = {
        "grey": rt.Diffuse(),
        "chequered": rt.Diffuse(reflectance="squares"),
        "dented": rt.Bump(base="grey", height="squares"),
        "both": rt.TwoSided(base="grey", back="chequered"),
        "lamp": rt.Emissive(radiance=1, base="chequered"),
        "plain lamp": rt.Emissive(radiance=1),
    }
    body = rt.Sphere(material="grey")
    scene = rt.Scene(textures={"squares": rt.Checker()}, materials=materials, shapes=(body,))
    assert scene.tables.materials.asks.tolist() == [0, 1, 1, 1, 1, 0]
