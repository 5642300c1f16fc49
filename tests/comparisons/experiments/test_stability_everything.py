"""F5: a scene with every kind of shape looks the same through every hierarchy."""

import numpy as np
import pytest

from comparisons.experiments.stability.hierarchy import compare_all, everything, lattice_rays

# What the scene's mesh leaves out is no news here.
pytestmark = pytest.mark.filterwarnings("ignore::reference_rt.util.errors.SceneWarning")


def test_every_kind_of_shape(tmp_path):
    rng = np.random.default_rng(33)
    found = compare_all(everything(rng, tmp_path), *lattice_rays(rng, 5_000))
    assert found.cases == 4 * 5_000
    assert found.failures == 0, found.examples
