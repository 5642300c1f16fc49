"""What every BSDF with a law of its own must pass: samples have their density, and weights times
densities are values.  Those of rough conductors and dielectrics: F11 of the stability suites."""

import numpy as np
import pytest
from leaf_checks import (
    check_same_bits,
    check_weights,
    evaluate,
    p_values,
    random_direction,
    sample,
    towards,
)
from random_bsdfs import (
    NUMBERS,
    random_gltf,
    random_phong,
    random_plastic,
    random_principled,
    random_thin,
)

from comparisons.statistics.chi_square import sidak
from reference_rt.core.model import name_of, types_of
from reference_rt.materials import Bsdf
from reference_rt.materials.bsdfs.gltf_pbr import GltfPbr
from reference_rt.materials.bsdfs.phong import Phong
from reference_rt.materials.bsdfs.plastic import Plastic
from reference_rt.materials.bsdfs.principled import Principled
from reference_rt.materials.bsdfs.rough_conductor import RoughConductor
from reference_rt.materials.bsdfs.rough_dielectric import RoughDielectric
from reference_rt.materials.bsdfs.rough_plastic import RoughPlastic
from reference_rt.scene.examples import examples
from reference_rt.textures import NO_TEXTURES, texture_names

FEW_AND_MANY = (
    (random_phong, 65, (10, 200)),
    (random_plastic, 41, (10, 200)),
    (random_principled, 81, (14, 300)),
    (random_thin, 91, (14, 300)),
    (random_gltf, 105, (10, 200)),
)


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("materials", "seed", "cases"),
    [
        pytest.param(materials, seed, count, marks=marks)
        for materials, seed, counts in FEW_AND_MANY
        for count, marks in zip(counts, ((), pytest.mark.slow), strict=True)
    ],
)
def test_samples_have_their_density_and_the_weights_their_mean(materials, seed, cases):
    rng = np.random.default_rng(seed)
    found = [p for case in materials(cases, seed + 1) for p in p_values(*case, rng)]
    assert min(found) > sidak(len(found))


@pytest.mark.parametrize(
    ("materials", "seed", "condition"),
    [
        # These are of the same direction: it is rounded once.
        (list(random_phong(16, 68)), 67, 1.0),
        (list(random_plastic(16, 44)), 43, 1.0),
        (list(random_gltf(16, 107, least=0.0)), 106, 1.0),
        # Refracted directions are as long as their half vector is exact.
        (list(random_principled(24, 84, least=0.0)), 83, 16.0),
        (list(random_thin(24, 94, least=0.0)), 93, 16.0),
    ],
    ids=["phong", "plastic", "gltf", "principled", "thin"],
)
def test_weight_times_density_is_the_value(materials, seed, condition):
    rng = np.random.default_rng(seed)
    for material, wo in materials:
        check_weights(material, wo, rng, condition, bends=material.type != "principled_thin")


SMOOTH = [of for of in types_of(Bsdf) if of.smooth]


def plain_examples(of):
    """Those without textures."""
    return [example for example in examples(of) if not texture_names(example)]


@pytest.mark.parametrize("of", SMOOTH, ids=name_of)
def test_examples_keep_the_contract(of):
    """Samples have their density, weights their mean; weight times density is the value; compiled
    code is plain Python, and finite."""
    rng, found = np.random.default_rng(110), plain_examples(of)
    for k, material in enumerate(found):
        wo = random_direction(rng, k, front=not material.transmits)
        check_weights(material, wo, rng, 16.0, bends=material.type != "principled_thin")
    p = [p for material in found[:2] for p in p_values(material, towards(0.6, 0.8), rng, n=10_000)]
    assert min(p) > sidak(len(p))
    check_same_bits(found, rng)


@pytest.mark.parametrize("of", SMOOTH, ids=name_of)
def test_what_lets_no_light_pass_is_black_behind(of):
    up, down = towards(0.5, 1.0), -towards(0.6, 5.0)
    for material in plain_examples(of):
        table = material.tabulate(NO_TEXTURES)
        assert evaluate(table, up, up)[0].any()
        for wo, wi in ((down, up), (up, down), (down, down)):
            value, density = evaluate(table, wo, wi)
            if not material.transmits:
                assert not value.any()
                assert not density.any()
        drawn = sample(table, down, np.full((1, 3), 0.5))[2]
        assert material.transmits or not drawn.any()


ONES = dict.fromkeys(NUMBERS, 1.0) | {"metallic": 0.0}
ROUGH = [
    {"distribution": kind, "alpha": alpha}
    for kind in ("ggx", "beckmann")
    for alpha in (1e-4, (1e-4, 10.0), 0.2, 10.0)
]
EXTREMES = {
    "phong": (
        *(material for material, _ in random_phong(4, 74)),
        Phong(diffuse=0),
        Phong(diffuse=0.1, specular=1e6, exponent=1e300),
        Phong(diffuse=0.1, specular=1, exponent=1e-6, half_vector=True),
    ),
    "plastic": (
        *(material for material, _ in random_plastic(3, 52)),
        Plastic(reflectance=0.0, specular=0.0),
        Plastic(reflectance=1.0, interior_ior=1e4, nonlinear=True),
        RoughPlastic(reflectance=1.0, interior_ior=1 + 1e-7, alpha=1e-6),
        RoughPlastic(reflectance=1.0, interior_ior=0.1, alpha=10.0),
    ),
    "principled": (
        *(material for material, _ in random_principled(8, 92, least=0.0)),
        Principled(),
        Principled(base_colour=0.0, metallic=1.0),
        Principled(base_colour=1.0, **ONES),
        Principled(base_colour=1.0, **ONES | {"roughness": 0.0, "eta": 1 + 1e-7}),
        Principled(base_colour=(0, 0, 1e-300), **ONES | {"spec_trans": 0.5, "eta": 1e-3}),
    ),
    "thin": tuple(material for material, _ in random_thin(8, 95, least=0.0)),
    "gltf": (
        *(material for material, _ in random_gltf(8, 108, least=0.0)),
        GltfPbr(base_color=0.0),
        GltfPbr(metallic=0.0, roughness=0.0, ior=0.0),
        GltfPbr(base_color=0.0, metallic=0.0, specular=0.0),
        GltfPbr(base_color=(0, 0, 1e-300), metallic=1e-300, specular=1e-300, ior=1e300),
    ),
    "rough conductor": tuple(RoughConductor(eta=0.2, k=3.9, **rough) for rough in ROUGH),
    "rough dielectric": tuple(
        RoughDielectric(interior_ior=eta, **rough) for eta in (0.5, 1.00001, 1.5) for rough in ROUGH
    ),
}


@pytest.mark.parametrize("name", EXTREMES)
def test_compiled_is_plain_and_finite(name):
    check_same_bits(EXTREMES[name], np.random.default_rng(75))
