"""Every light that a ray can hit, an environment or a shape of any type: samples have the density
that `light_pdf` says."""

import itertools
import math

import numpy as np
import pytest
from builders import random_turn

import reference_rt as rt
from comparisons.statistics.chi_square import chi_square, sidak
from reference_rt.core.model import types_of
from reference_rt.core.transform import Matrix
from reference_rt.lights import AnyLight
from reference_rt.scene.examples import NAMED, examples, write_files
from reference_rt.shapes import TABLES, Primitive
from reference_rt.shapes.shape import TabulationContext

N = 30_000


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("files")
    write_files(folder)
    return folder


def scene_of(folder, **parts):
    scene = rt.Scene(**NAMED | {"materials": {"lamp": rt.Emissive(radiance=1.0)}}, **parts)
    scene._folder = folder
    return scene


def samples(scene, p, rng):
    """Directions (N, 3) from p, NaN for samples that fail; and whether rays can find the light."""
    found = scene.sample_lights(np.tile(p, (N, 1)), rng.random((N, 3)))
    wi = found.wi.copy()
    wi[found.pdf == 0.0] = np.nan
    return wi, not found.is_delta.any() and (found.pdf > 0.0).any()


def p_value(scene, p, directions):
    # The density ends at a shape's outline, in no smaller a box than this.
    fit = chi_square(
        lambda d: scene.light_pdf(np.tile(p, (len(d), 1)), d), directions, cells=64, tolerance=2e-5
    )
    share = np.isfinite(directions[:, 0]).mean()
    # Five standard errors of the share, and the quadrature's own: no box is smaller where a light
    # ends, of which all have some hundred.
    assert abs(fit.integral - share) <= 5 * math.sqrt(share * (1 - share) / N) + 1e-3
    return fit.p_value


@pytest.mark.parametrize("cls", types_of(Primitive), ids=lambda cls: cls.__name__)
def test_shapes(cls, folder):
    """Turned and moved; sheared, too; from several sides."""
    rng, found = np.random.default_rng(31), []
    for shape, is_sheared in itertools.product(examples(cls), (False, True)):
        turn, linear = random_turn(rng), np.eye(3) + np.triu(rng.uniform(-0.5, 0.5, (3, 3)), 1)
        m = np.column_stack([turn @ linear if is_sheared else turn, rng.normal(size=3)])
        changes = {"material": "lamp", "transform": (Matrix(matrix=tuple(map(tuple, m.tolist()))),)}
        scene = scene_of(folder, shapes=(shape.model_copy(update=changes),))
        # In the plane of no face, where rounding would decide which samples arrive.
        for side in ([0.1, 0.2, 1.0], [-0.2, 0.1, -1.0], [0.6, 0.5, 0.7]):
            p = m[:, 3] + 3.0 * (turn @ side)
            directions, is_found = samples(scene, p, rng)
            if is_found:
                found.append(p_value(scene, p, directions))
            else:  # from behind; or it cannot be sampled
                assert not np.isfinite(directions).any()
    assert not found or min(found) > sidak(len(found))
    table = type(examples(cls)[0].tabulate(TabulationContext()))
    (module,) = (module for _, _, of, module in TABLES if of is table)
    assert bool(found) == hasattr(module, "sample")


@pytest.mark.parametrize("cls", types_of(AnyLight), ids=lambda cls: cls.__name__)
def test_lights(cls, folder):
    rng, p = np.random.default_rng(32), np.array([0.3, 0.2, -0.1])
    for light in examples(cls):
        scene = scene_of(folder, lights=(light,))
        directions, is_found = samples(scene, p, rng)
        assert is_found == (cls in (rt.Constant, rt.EnvironmentMap))
        if is_found:
            assert p_value(scene, p, directions) > sidak(len(examples(cls)))
