"""What every BSDF with a law of its own must pass: samples have their density, and weights times
densities are values.  Rough conductors and dielectrics, with bounds of their own: `test_rough`."""

import numpy as np
import pytest
from chi_square import sidak
from leaf_checks import check_weights, p_values
from random_bsdfs import random_phong, random_plastic, random_principled, random_thin

FEW_AND_MANY = (
    (random_phong, 65, (10, 200)),
    (random_plastic, 41, (10, 200)),
    (random_principled, 81, (14, 300)),
    (random_thin, 91, (14, 300)),
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
        # Both are of the same direction: it is rounded once.
        (list(random_phong(16, 68)), 67, 1.0),
        (list(random_plastic(16, 44)), 43, 1.0),
        # Refracted directions are as long as their half vector is exact.
        (list(random_principled(24, 84, least=0.0)), 83, 16.0),
        (list(random_thin(24, 94, least=0.0)), 93, 16.0),
    ],
    ids=["phong", "plastic", "principled", "thin"],
)
def test_weight_times_density_is_the_value(materials, seed, condition):
    rng = np.random.default_rng(seed)
    for material, wo in materials:
        check_weights(material, wo, rng, condition, bends=material.type != "principled_thin")
