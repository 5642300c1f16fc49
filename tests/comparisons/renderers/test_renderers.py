"""The contract of `comparisons.renderers`, kept by every renderer that is installed."""

import os
from typing import get_args

import numpy as np
import pytest

import reference_rt as rt
from comparisons.commands.options import Witness
from comparisons.cycles.backend import PYTHON
from comparisons.mitsuba.backend import LLVM, mitsuba
from comparisons.renderers import PLACES, NoCounterpartError, NoiseFree, WitnessName, other
from comparisons.translator.native import Native

ALL = {
    name: pytest.param(
        renderer,
        marks=pytest.mark.skipif(
            name == "cycles" and not os.environ.get(PYTHON), reason="no Cycles"
        ),
    )
    for name, renderer in [*((n, other(n)) for n in PLACES), ("llvm", Native(LLVM, "multijitter"))]
    if not isinstance(renderer, NoiseFree)  # see tests/comparisons/povray
}

RADIANCE = (0.25, 0.5, 1.0)

SCENE = rt.Scene(
    film=rt.Film(width=24, height=16),
    integrator=rt.Path(max_depth=2),
    materials={"grey": rt.Diffuse(reflectance=0.5)},
    shapes=(rt.Sphere(center=(0, 0, -4), material="grey"),),
    lights=(rt.Constant(radiance=RADIANCE),),
)


@pytest.mark.parametrize("renderer", ALL.values(), ids=ALL)
def test_replicates(renderer):
    before = mitsuba().variant()
    assert "." in renderer.version()
    with renderer.load(SCENE, threads=1) as loaded:
        found = loaded.render(3, 16, seed=5)
        again = loaded.render(1, 16, seed=6)
    assert mitsuba().variant() == before
    assert found.pictures.shape == (3, 16, 24, 3)
    assert found.pictures.dtype == np.float64
    assert found.seconds.shape == (3,)
    assert (found.seconds > 0.0).all()
    assert found.spp >= 16
    assert np.array_equal(found.pictures[1], again.pictures[0]), "seeds count up"
    assert not np.array_equal(found.pictures[0], found.pictures[1])
    # Linear radiance as red, green and blue.  Rounding of 16 sums in float32: below 1e-6.
    np.testing.assert_allclose(found.pictures[:, 0, 0], [RADIANCE] * 3, rtol=1e-6)


@pytest.mark.parametrize("renderer", ALL.values(), ids=ALL)
def test_what_has_no_counterpart(renderer):
    solid = SCENE.changed(shapes=(*SCENE.shapes, rt.Sphere() - rt.Box()))
    before = mitsuba().variant()
    with pytest.raises(NoCounterpartError, match=r"set operations|CSG"), renderer.load(solid):
        pass
    assert mitsuba().variant() == before


def test_witnesses_are_renderers():
    """The option repeats the names of `WitnessName`, whose module imports NumPy: the command line
    starts without it."""
    assert set(get_args(WitnessName)) < set(PLACES)
    assert " or ".join(get_args(WitnessName)) in Witness.__metadata__[0].help
