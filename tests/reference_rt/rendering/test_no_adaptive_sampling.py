"""Why there is no adaptive sampling (docs/scale.md): a picture whose pixels stop when their own
noise seems small is biased; with a pilot of other samples it is not, but worse than without."""

import numpy as np
import pytest

import reference_rt as rt

SCENE = """
camera: {type: orthographic, eye: [0, 0, 1], target: [0, 0, 0], up: [0, 1, 0], width: 0.001}
film: {width: 64, height: 64}
integrator: {type: path, sampling: bsdf}
materials:
  white: {type: diffuse, reflectance: [1, 1, 1]}
  lamp: {type: emissive, radiance: [50, 50, 50]}
shapes:
  - {type: plane, material: white}
  - {type: sphere, center: [0, 0, 3], radius: 0.5, material: lamp}
"""
EXACT = 50.0 * (0.5 / 3.0) ** 2
"""Radiance of a white plane under a sphere: that of the sphere times (r / d)²."""

FEW, MANY, TARGET = 16, 64, 0.25


@pytest.fixture(scope="module")
def samples():
    """(2 MANY, pixels), independent and identically distributed but for 1e-7 of their mean."""
    scene = rt.Scene.parse(SCENE)
    tables = rt.build_tables(scene)
    seeded = (scene.changed(sampler=rt.Independent(spp=1, seed=k)) for k in range(2 * MANY))
    return np.stack([rt.render(s, tables=tables, threads=1).colour[..., 0].ravel() for s in seeded])


def counts_by(pilot):
    """The samples of each pixel: FEW where their relative standard error is at most TARGET."""
    mean, error = pilot[:FEW].mean(axis=0), pilot[:FEW].std(axis=0, ddof=1) / np.sqrt(FEW)
    return np.where(error <= TARGET * mean, FEW, MANY)


def means(samples, counts):
    sums = np.cumsum(samples, axis=0)
    return sums[counts - 1, np.arange(samples.shape[1])] / counts


def bias(values):
    """Relative, and its standard error."""
    return values.mean() / EXACT - 1.0, values.std(ddof=1) / EXACT / np.sqrt(len(values))


def test_stopping_by_the_same_samples_is_biased(samples):
    """Pixels that have not found the lamp see no noise."""
    found, error = bias(means(samples, counts_by(samples)))
    assert found < -0.3
    assert found < -20.0 * error


def test_all_samples_are_not(samples):
    found, error = bias(samples.mean(axis=0))
    assert abs(found) < 4.5 * error


def test_a_pilot_of_other_samples_is_unbiased_but_worse(samples):
    """Than the same number of samples, pilots included, shared out evenly."""
    pilot, others = samples[:MANY], samples[MANY:]
    counts = counts_by(pilot)
    values = means(others, counts)
    found, error = bias(values)
    assert abs(found) < 4.5 * error
    even = round(FEW + counts.mean())
    assert FEW < even < MANY
    assert values.std() > 1.1 * samples[:even].mean(axis=0).std()
