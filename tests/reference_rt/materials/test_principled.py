"""The principled material: closed forms of its lobes, samples against densities and integrals,
reciprocity and energy where the law has them, and by how much it does not; bad input."""

import math

import numpy as np
import pytest
from builders import U, unit_vectors
from leaf_checks import albedo, evaluate, random_direction, rows, sample, towards
from random_bsdfs import NUMBERS, random_principled

from comparisons.statistics.chi_square import UNIT_SQUARE, integrate
from reference_rt.core.vec3 import Vec3
from reference_rt.materials.bsdfs import principled, principled_lobes, rough_dielectric
from reference_rt.materials.bsdfs.principled import Principled
from reference_rt.materials.bsdfs.rough_dielectric import RoughDielectric
from reference_rt.textures import NO_TEXTURES, At
from reference_rt.util.errors import SceneError

AT = At(None, 0.0, 0.0, Vec3(-1.0, -1.0, -1.0))


def surface(side=1.0, **fields):
    table = Principled(**fields).tabulate(NO_TEXTURES)
    return principled._surface(table, 0, AT, side)


def test_reciprocity():
    """f(wo, wi) = f(wi, wo); through the surface f(wo, wi) eta² = f(wi, wo), eta the index on wi's
    side over that on wo's."""
    rng = np.random.default_rng(85)
    wo, wi = unit_vectors(rng, 800), unit_vectors(rng, 800)
    for material, _ in random_principled(24, 86):
        # Fresnel's equations are steep beyond the critical angle of a thinner inside.
        if material.eta is not None and material.eta < 1:
            continue
        n = np.where(wo[:, 2] > 0, material.relative_ior, 1 / material.relative_ior)
        n[wo[:, 2] * wi[:, 2] > 0] = 1
        table = material.tabulate(NO_TEXTURES)
        there = evaluate(table, wo, wi)[0] / np.abs(wi[:, 2:]) * (n * n)[:, None]
        back = evaluate(table, wi, wo)[0] / np.abs(wo[:, 2:])
        error = np.abs(there - back) / np.maximum(there, 1e-300)
        above = (wo[:, 2] > 0) & (wi[:, 2] > 0)
        assert (there[above] > 0).all()
        assert error[above].max() < 1e-12
        # Half vectors of refraction are off by u / |wo + n wi|, and from within Fresnel's equations
        # have the root of the critical angle.
        assert error[~above].max() < 1e-8


def test_glass_is_the_rough_dielectric():
    """White, spec_trans = 1, nothing else: from both sides."""
    rng = np.random.default_rng(87)
    wo, wi = unit_vectors(rng, 1000), unit_vectors(rng, 1000)
    glass = Principled(base_colour=1.0, spec_trans=1.0, roughness=0.6, eta=1.5, anisotropic=0.5)
    aspect = math.sqrt(1 - 0.9 * 0.5)
    twin = RoughDielectric(alpha=[0.36 / aspect, 0.36 * aspect], interior_ior=1.5)
    found = evaluate(glass.tabulate(NO_TEXTURES), wo, wi)[0]
    table = twin.tabulate(NO_TEXTURES)
    for k in range(len(wo)):
        expected = rough_dielectric.eval_pdf(table, 0, AT, Vec3(*wo[k]), Vec3(*wi[k])).value
        assert found[k] == pytest.approx(np.array(expected), rel=1e-11)


def test_metal_mirrors_its_colour():
    """At normal incidence F = base colour; at alpha = 0.001 nothing is lost."""
    colour = (0.9, 0.5, 0.1)
    table = Principled(base_colour=colour, metallic=1, roughness=0).tabulate(NO_TEXTURES)
    total, error = albedo(table, towards(1.0, 0.0), np.random.default_rng(88))
    assert total == pytest.approx(np.array(colour), abs=1e-5 + 5 * error.max())


def test_no_main_lobe_at_eta_1():
    for fields in ({"eta": 1.0}, {"specular": 0.0}):
        table = Principled(base_colour=0.8, metallic=1, **fields).tabulate(NO_TEXTURES)
        value, density = evaluate(table, towards(0.5, 0.0), towards(0.5, 3.0))
        assert not value.any()
        assert not density.any()
        assert not sample(table, towards(0.5, 0.0), np.full((1, 3), 0.5))[2].any()


def test_index_of_refraction():
    for specular in (0.01, 0.5, 1.0):
        eta = Principled(specular=specular).relative_ior
        assert ((eta - 1) / (eta + 1)) ** 2 == pytest.approx(0.08 * specular)
    assert Principled().relative_ior == Principled(specular=0.5).relative_ior
    assert Principled(eta=1.0).relative_ior == Principled(specular=0.0).relative_ior == 1.0
    assert Principled(eta=1.0, spec_trans=0.1).relative_ior == 1.001
    thin = Principled(specular=0.0, spec_trans=0.1).relative_ior
    assert thin == Principled(specular=1e-3).relative_ior


@pytest.mark.parametrize("gloss", [0.0, 0.5, 1.0])
def test_the_coats_normals_project_to_one(gloss):
    """The integral of D cos over the hemisphere is 1, in u = log(sin² + a² cos²), where D cos
    dcos is even: D du is constant."""
    s = surface(clearcoat=1.0, clearcoat_gloss=gloss)
    a2 = s.coat_alpha**2
    assert s.coat_alpha == pytest.approx(0.1 - 0.099 * gloss)

    def integrand(points):
        grown = np.exp(np.log(a2) * (1 - points[:, 0]))  # sin² + a² cos²
        cos2 = (1 - grown) / (1 - a2)
        h = np.stack([np.sqrt(1 - cos2), np.zeros(len(cos2)), np.sqrt(cos2)], axis=1)
        d = np.array([principled_lobes.coat_normals(s, Vec3(*row)) for row in h])
        return 2 * math.pi * d * 0.5 * grown * -math.log(a2) / (1 - a2)

    hints = np.full((1, 2), 0.5)
    assert integrate(integrand, hints, UNIT_SQUARE) == pytest.approx(1, abs=1e-5)


def test_the_diffuse_parts_closed_forms():
    """The diffuse part with its retro-reflection apart is the product of 2012's section 5.3."""
    rng = np.random.default_rng(89)
    assert principled_lobes.schlick_weight(1.0) == 0.0
    assert principled_lobes.schlick_weight(0.0) == 1.0
    for rough in (0.0, 0.3, 1.0):
        s = surface(base_colour=1.0, roughness=rough)
        for k in range(50):
            wo, wi = (random_direction(rng, k + j) for j in (0, 1))
            cos_d = 0.5 * float(np.linalg.norm(wo + wi))
            f90 = 0.5 + 2 * rough * cos_d**2
            fall_o, fall_i = (1 + (f90 - 1) * (1 - v[2]) ** 5 for v in (wo, wi))
            expected = fall_o * fall_i / math.pi * wi[2]
            found = principled_lobes.diffuse(s, Vec3(*wo), Vec3(*wi), cos_d).x
            assert found == pytest.approx(expected, rel=32 * U, abs=32 * U)


GRID = (1.0, 0.5, 0.1, 0.01)


@pytest.mark.parametrize("roughness", [0.0, 0.3, 0.6, 1.0])
def test_energy_of_metal_and_glass(roughness):
    """The main lobe alone never gives back more than there is."""
    rng = np.random.default_rng(90)
    white = {"base_colour": 1.0, "roughness": roughness}
    for fields in ({"metallic": 1.0}, {"spec_trans": 1.0}, {"metallic": 0.5, "spec_trans": 1.0}):
        for anisotropic in (0.0, 0.9):
            material = Principled(**white, **fields, anisotropic=anisotropic)
            table = material.tabulate(NO_TEXTURES)
            for cosine in GRID:
                for side in (1, -1) if material.spec_trans else (1,):
                    wo = towards(cosine, 0.4) * (1, 1, side)
                    total, error = albedo(table, wo, rng, n=4000)
                    assert (total <= 1 + 5 * error + 1e-9).all()


@pytest.mark.parametrize(
    ("fields", "least", "most"),
    [
        ({"base_colour": 1.0}, 1.3, 1.7),
        ({"base_colour": 1.0, "flatness": 1.0}, 1.4, 1.8),
        ({"base_colour": 1.0, "sheen": 1.0}, 1.4, 1.8),
        ({"base_colour": (0, 0, 1), "spec_tint": 1.0, "sheen": 1.0, "sheen_tint": 1.0}, 2.5, 3.3),
        ({"base_colour": 0.5}, 1.1, 1.3),
    ],
)
def test_the_law_creates_energy_at_grazing_angles(fields, least, most):
    """By as much as the description says, and no more: the greatest of a grid."""
    rng = np.random.default_rng(91)
    greatest = 0.0
    for roughness in (0.0, 0.3, 1.0):
        table = Principled(roughness=roughness, **fields).tabulate(NO_TEXTURES)
        for cosine in GRID:
            greatest = max(greatest, albedo(table, towards(cosine, 0.0), rng)[0].max())
    assert least < greatest < most


def test_orientation():
    assert not Principled().oriented
    assert Principled(anisotropic=0.5).oriented
    turned = rows(towards(0.6, 0.0), 2) * ((1, 1, 1), (0, 0, 1)) + ((0, 0, 0), (0, 0.8, 0))
    table = Principled(metallic=1, anisotropic=0.8).tabulate(NO_TEXTURES)
    along, across = evaluate(table, towards(1.0, 0.0), turned)[0]
    assert along[0] > 2 * across[0]  # the highlight is longer along u


@pytest.mark.parametrize(
    "fields",
    [{name: value} for name in NUMBERS for value in (-0.1, 1.1)]
    + [{"base_colour": 1.2}, {"eta": 0}, {"eta": float("nan")}, {"specular": 2}]
    + [{"specular": 0.5, "eta": 1.5}],
)
def test_bad_input(fields):
    with pytest.raises(SceneError):
        Principled(**fields)
