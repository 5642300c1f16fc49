"""Queries for lights: what is sampled, and that its densities are right."""

import math

import numpy as np
import pytest
from builders import U, unit_vectors
from query_scene import LIT

import reference_rt as rt


@pytest.fixture(scope="module")
def scene():
    return rt.Scene.parse(LIT)


def test_light_numbers_say_what_they_are_of(scene):
    found = scene.light_sources()
    assert found.shape.tolist() == [2, -1, -1, -1]
    assert found.light.tolist() == [-1, 3, 2, 1]  # areas, points, directions, the environment
    assert found.probability.sum() == pytest.approx(1.0)


def test_samples_of_lights_are_where_they_say(scene):
    rng = np.random.default_rng(5)
    p, u = np.array([0.5, 1.0, 2.0]), rng.uniform(size=(4000, 3))
    found, sources = scene.sample_lights(p, u), scene.light_sources()
    there = found.pdf > 0.0
    for k in range(4):
        mine = found.light == k
        share = (mine | ~there).mean() if k == 0 else mine.mean()
        assert share == pytest.approx(sources.probability[k], abs=5 * 0.5 / math.sqrt(4000))
        one = np.flatnonzero(mine)[0]
        assert bool(found.is_delta[one]) == (k in (1, 2))
    chance = sources.probability[np.maximum(found.light, 0)]
    points = found.light == 1
    r = np.array([2.0, 3.0, 3.0]) - p
    np.testing.assert_allclose(
        found.radiance[points], np.tile([9.0, 8.0, 7.0] / (r @ r), (points.sum(), 1)), rtol=8 * U
    )
    np.testing.assert_allclose(found.pdf[points], chance[points], rtol=4 * U)
    sun = found.light == 2
    np.testing.assert_allclose(found.wi[sun], np.tile([0, 0.5**0.5, 0.5**0.5], (sun.sum(), 1)))
    assert np.isinf(found.distance[sun]).all()
    # What `light_pdf` says of directions that nothing stands in the way of.
    soft = there & ~found.is_delta
    free = soft & ~scene.occluded(p, found.target - p, t_max=1.0) | (found.light == 3)
    hits = scene.intersect(p, found.wi)
    free &= np.where(found.light == 0, hits.shape == 2, ~hits.hit)
    assert free.sum() > 1000
    pdf = scene.light_pdf(p, found.wi[free])
    np.testing.assert_allclose(pdf, found.pdf[free], rtol=1e-12)


def test_light_densities_integrate_to_their_chance(scene):
    """Over all directions from a point in the open, where the lamp and the sky are all there is."""
    lit = scene.changed(shapes=scene.shapes[2:])
    rng = np.random.default_rng(6)
    n = 400_000
    pdf = lit.light_pdf((-1.0, 0.3, 1.5), unit_vectors(rng, n))
    sources = lit.light_sources()
    soft = sources.probability[[0, 3]].sum()
    # The lamp covers some of the sky, whose density is missing there.
    sky = sources.probability[3] / (4 * math.pi)
    covered = np.mean(lit.first_hits((-1.0, 0.3, 1.5), unit_vectors(rng, n)).hit) * 4 * math.pi
    mean, error = 4 * math.pi * pdf.mean(), 4 * math.pi * pdf.std() / math.sqrt(n)
    assert mean == pytest.approx(soft - sky * covered, abs=5 * error)
