"""F14 sees a renderer that lacks the same bits."""

import numpy as np
import pytest
import stability_runs

from comparisons.experiments.stability import determinism
from comparisons.experiments.stability.harness import scenes
from comparisons.experiments.stability.harness.core import OURS, Outcome


def measured(series, x, folder):
    return stability_runs.measured("F14", series, x, folder)[OURS]


@pytest.mark.slow
def test_sums_in_another_order_are_seen(tmp_path, monkeypatch):
    """A band that leaves the last bits to chance."""
    honest = determinism._summed

    def careless(scene):
        add, sums = honest(scene)

        def adding(begin, end, *samples):
            add(begin, end, *samples)
            sums[begin] = np.nextafter(sums[begin], np.inf)

        return adding, sums

    monkeypatch.setattr(determinism, "_summed", careless)
    assert measured("bands", 64.0, tmp_path).failures > 20


def test_same_bits():
    one = np.ones((2, 3, 3))
    other = one.copy()
    other[1, 2, 0] = np.nextafter(1.0, 2.0)
    assert scenes.same_bits(one, one) == Outcome(6, 0, 0.0)
    found = scenes.same_bits(one, other)
    assert (found.failures, found.examples[0]["pixel"]) == (1, [2, 1])
