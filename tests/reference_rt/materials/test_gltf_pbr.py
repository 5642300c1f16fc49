"""glTF's metallic-roughness material: the specification's formula, in NumPy, and its energy."""

import math

import numpy as np
import pytest
from builders import U
from leaf_checks import albedo, evaluate, random_direction, sample, towards
from random_bsdfs import random_gltf

from reference_rt.materials.bsdfs.gltf_pbr import GltfPbr
from reference_rt.textures import NO_TEXTURES


def appendix_b(material, v, light):
    """The BRDF (n, 3) for directions (n, 3), line by line from appendix B of glTF 2.0, and from
    KHR_materials_ior and KHR_materials_specular; (1 - N·H²) as sin², for short roots."""
    base_color, specular_color = np.array(material.base_color), np.array(material.specular_color)
    alpha2 = max(material.roughness**2, 1e-4) ** 2
    h = (v + light) / np.linalg.norm(v + light, axis=1, keepdims=True)
    n_v, n_l, n_h = v[:, 2:], light[:, 2:], h[:, 2:]
    v_dot_h = np.sum(v * h, axis=1, keepdims=True)
    sin2 = h[:, :1] ** 2 + h[:, 1:2] ** 2
    d = alpha2 / (np.pi * (n_h**2 * alpha2 + sin2) ** 2)
    shadowed = n_v * np.sqrt(alpha2 + (1 - alpha2) * n_l**2)
    masked = n_l * np.sqrt(alpha2 + (1 - alpha2) * n_v**2)
    g = 2 * n_l * n_v / (shadowed + masked)
    specular_brdf = d * g / (4 * n_l * n_v)
    fresnel_w = (1 - v_dot_h) ** 5
    dielectric_f0 = ((1 - material.ior) / (1 + material.ior)) ** 2 * specular_color
    fr = dielectric_f0 + (1 - dielectric_f0) * fresnel_w
    kept = 1 - material.specular * fr.max(axis=1, keepdims=True)
    dielectric_brdf = kept * base_color / np.pi + material.specular * fr * specular_brdf
    metal_brdf = specular_brdf * (base_color + (1 - base_color) * fresnel_w)
    return (1 - material.metallic) * dielectric_brdf + material.metallic * metal_brdf


def test_appendix_b():
    """Half of the directions are near the mirrored one, a third of all grazing."""
    rng = np.random.default_rng(101)
    materials = [material for material, _ in random_gltf(40, 102)]
    for material in (*materials, GltfPbr(), GltfPbr(metallic=0.0), GltfPbr(metallic=0.0, ior=0.0)):
        wo = np.array([random_direction(rng, k) for k in range(300)])
        wi = np.array([random_direction(rng, k // 3) for k in range(300)])
        wi[::2] = wo[::2] * (-1, -1, 1) + material.roughness**2 * rng.normal(size=(150, 3))
        wi[:, 2] = abs(wi[:, 2])
        wi /= np.linalg.norm(wi, axis=1, keepdims=True)
        found = evaluate(material.tabulate(NO_TEXTURES), wo, wi)[0]
        expected = appendix_b(material, wo, wi) * wi[:, 2:]
        # Half vectors are off by a few u, and densities by a few u / alpha, alpha from 0.01.
        assert (np.abs(found - expected) <= 1e-12 * expected).all()


def test_the_specification_without_extensions_has_an_f0_of_4_percent():
    """Head-on, where light, eye and normal coincide, a black dielectric is F0 / (4 pi alpha²)."""
    up = towards(1.0, 0.0)
    black = GltfPbr(base_color=0.0, metallic=0.0, roughness=0.5)
    value = evaluate(black.tabulate(NO_TEXTURES), up, up)[0][0]
    assert value == pytest.approx([0.04 / (4 * math.pi * 0.5**4)] * 3, rel=16 * U)


@pytest.mark.parametrize("metallic", [0.0, 0.5, 1.0])
def test_lobes_are_drawn_as_often_as_they_shine(metallic):
    """No weight is above 2.  The largest of 7.5 million is 1.96 (measured), of a smooth white
    dielectric at grazing angles, which gives back 1.92 of the light."""
    u = np.random.default_rng(109).uniform(0, 1, (20_000, 3))
    for roughness in (0.0, 0.1, 0.3, 0.6, 1.0):
        table = GltfPbr(metallic=metallic, roughness=roughness).tabulate(NO_TEXTURES)
        for cosine in (1.0, 0.5, 0.1, 0.01, 1e-4):
            assert sample(table, towards(cosine, 0.4), u)[1].max() < 2


@pytest.mark.parametrize("roughness", [0.0, 0.3, 0.6, 1.0])
def test_a_white_metal_gives_back_at_most_all(roughness):
    """At roughness 1 head-on 1 - log 2: there no facet hides another from the eye."""
    rng = np.random.default_rng(103)
    table = GltfPbr(roughness=roughness).tabulate(NO_TEXTURES)
    for cosine in (1.0, 0.5, 0.1, 1e-3):
        total, error = albedo(table, towards(cosine, 0.4), rng)
        assert (total <= 1 + 5 * error + 1e-12).all()
        if roughness == 1 and cosine == 1:
            assert total == pytest.approx(np.full(3, 1 - math.log(2)), abs=5 * error.max())


@pytest.mark.parametrize(("roughness", "power"), [(0.0, 1.9222), (0.5, 1.1575), (1.0, 1.0178)])
def test_a_white_dielectric_gives_back_more_at_grazing_angles(roughness, power):
    """The law's own excess, by a product rule of 400 x 400 nodes for each lobe at a cosine of 1e-3;
    head-on it gives back at most all."""
    rng = np.random.default_rng(104)
    table = GltfPbr(metallic=0.0, roughness=roughness).tabulate(NO_TEXTURES)
    total, error = albedo(table, towards(1e-3, 0.4), rng)
    # The last digit shown, and that at roughness 0 alpha is 1e-4.
    assert total == pytest.approx(np.full(3, power), abs=1e-4 + 5 * error.max())
    total, error = albedo(table, towards(1.0, 0.4), rng)
    assert (total <= 1 + 5 * error + 1e-12).all()
