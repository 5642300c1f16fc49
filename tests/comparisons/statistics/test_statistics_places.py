"""Where noisy pictures differ: maps and places."""

import math

import numpy as np
import pytest
from planted import TILE, patched, replicates, scene

from comparisons.statistics import standard_error, worst_regions


def worst_places_of(changed):
    rng = np.random.default_rng(1)
    return worst_regions(replicates(rng, changed), replicates(rng, scene()))


def test_standard_error_is_that_of_the_pixels():
    rng = np.random.default_rng(0)
    a = 1.0 + 0.1 * rng.standard_normal((32, 32, 32, 3))
    b = 1.0 + 0.3 * rng.standard_normal((32, 32, 32, 3))
    expected = math.sqrt((0.1**2 + 0.3**2) / 32)
    error = standard_error(a, b)
    assert error.mean() == pytest.approx(expected, rel=0.1)
    assert error.min() > 0.7 * expected
    single = standard_error(a[:1], b)
    assert single.mean() == pytest.approx(math.sqrt(0.1**2 + 0.3**2 / 32), rel=0.1)


def test_worst_places_are_ranked():
    changed = patched(TILE, 1.2)
    changed[32:48, :16] *= 0.9
    found = worst_places_of(changed)
    assert [(p.x, p.y, p.width, p.height) for p in found[:2]] == [(32, 16, 16, 16), (0, 32, 16, 16)]
    assert found[0].what.startswith("+20 % in ")
    assert found[0].what.endswith(" standard errors")
    assert worst_places_of(scene()) == ()


def test_worst_places_name_a_pixel():
    changed = patched((30, 41), 3.0)
    changed[2, 50] = 0.01
    places = worst_places_of(changed)
    words = {(p.x, p.y): p.what for p in places}
    assert set(words) == {(32, 16), (48, 0)}
    assert words[32, 16].startswith("pixel 41, 30: +")
    assert words[48, 0].startswith("pixel 50, 2: +")
    assert words[48, 0].endswith("where there is no noise")


def test_worst_places_at_the_edge_are_cut_and_limited():
    rng = np.random.default_rng(0)
    a, b = 1.0 + 0.1 * rng.standard_normal((2, 16, 40, 40, 3))
    places = worst_regions(a * 1.5, b)
    assert len(places) == 6
    assert len(worst_regions(a * 1.5, b, most=2)) == 2
    assert all(p.x + p.width <= 40 and p.y + p.height <= 40 for p in places)


def test_worst_places_of_two_single_pictures():
    changed = patched((30, 41), 3.0)
    (place,) = worst_regions(changed[None], scene()[None])
    assert (place.x, place.y) == (32, 16)
    assert "RMS" in place.what
    assert worst_regions(scene()[None], scene()[None]) == ()
