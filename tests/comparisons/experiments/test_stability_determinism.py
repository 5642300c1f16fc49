"""F14: the same bits, and a renderer that lacks them is seen."""

import numpy as np
import pytest

from comparisons.experiments.stability.determinism import parts
from comparisons.experiments.stability.harness import bits
from comparisons.experiments.stability.harness.families import family
from comparisons.experiments.stability.harness.family import OURS, Draw, Outcome, generator


def measured(series, x, folder):
    draw = Draw(np.random.default_rng(5), 1, False, folder)
    return family("F14").by_name[series].measure(draw, x)[OURS]


SAME = [("threads", 4.0), ("wide filter, scalar", 3.0), ("bands", 7.0)]
SAME += [pytest.param("interrupted", 1.0, marks=pytest.mark.slow)]


@pytest.mark.parametrize(("series", "x"), SAME)
def test_the_same_bits(series, x, tmp_path):
    found = measured(series, x, tmp_path)
    assert found.failures == 0, found.examples


@pytest.mark.slow
@pytest.mark.parametrize("x", [8.0, 256.0])
def test_the_same_bits_in_plain_python(x, tmp_path):
    found = measured("blocks in plain Python", x, tmp_path)
    assert found.cases == 2 * 48
    assert found.failures == 0, found.examples


def test_sums_in_another_order_are_seen(tmp_path, monkeypatch):
    """A band that leaves the last bits to chance."""
    honest = parts._band

    def careless(*arguments):
        honest(*arguments)
        out, begin = arguments[7], arguments[9]
        out[begin] = np.nextafter(out[begin], np.inf)

    monkeypatch.setattr(parts, "_band", careless)
    assert measured("bands", 64.0, tmp_path).failures > 20


def test_same_bits():
    one = np.ones((2, 3, 3))
    other = one.copy()
    other[1, 2, 0] = np.nextafter(1.0, 2.0)
    assert bits.same_bits(one, one) == Outcome(6, 0, 0.0)
    found = bits.same_bits(one, other)
    assert (found.failures, found.examples[0]["pixel"]) == (1, [2, 1])


@pytest.mark.slow
def test_everything(tmp_path):
    """All settings, without Mitsuba, within what each series holds to."""
    for series in family("F14").series:
        for x in series.values:
            rng = generator(0, "F14", series.name, x)
            folder = tmp_path / f"{series.name} {x:g}"
            folder.mkdir()
            cases = series.cases["quick"]
            found = series.measure(Draw(rng, cases, False, folder, "full"), x)[OURS]
            assert x > series.holds_to or found.failures == 0, (series.name, x, found.examples)
