"""F14 sees a renderer that lacks the same bits."""

import numpy as np
import pytest
import stability_runs

from comparisons.experiments.stability import determinism
from comparisons.experiments.stability.harness import bits
from comparisons.experiments.stability.harness.core import OURS, Outcome


def measured(series, x, folder):
    return stability_runs.measured("F14", series, x, folder)[OURS]


@pytest.mark.slow
def test_sums_in_another_order_are_seen(tmp_path, monkeypatch):
    """A band that leaves the last bits to chance."""
    honest = determinism._band

    def careless(*arguments):
        honest(*arguments)
        sums = arguments[6]  # of the band's pixels
        sums[0] = np.nextafter(sums[0], np.inf)

    monkeypatch.setattr(determinism, "_band", careless)
    assert measured("bands", 64.0, tmp_path).failures > 20


def test_same_bits():
    one = np.ones((2, 3, 3))
    other = one.copy()
    other[1, 2, 0] = np.nextafter(1.0, 2.0)
    assert bits.same_bits(one, one) == Outcome(6, 0, 0.0)
    found = bits.same_bits(one, other)
    assert (found.failures, found.examples[0]["pixel"]) == (1, [2, 1])
