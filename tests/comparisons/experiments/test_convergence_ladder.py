"""The ladder: methods take turns, and what is done is not done again."""

import numpy as np
import pytest
from convergence_fakes import EXACT, TRUE, Fake, climbs

from comparisons.experiments.convergence import best_sampler, methods
from comparisons.experiments.convergence.methods import Climb, Shot, climb
from comparisons.experiments.convergence.store import Store, weights


def test_methods_take_turns_and_numbers_are_used_once():
    asked = []

    class Told(Fake):
        def __call__(self, spp: int, replicate: int) -> Shot:
            asked.append((self, spp))
            return super().__call__(spp, replicate)

    a, b = Told(), Told()
    climb(climbs(a=a, b=b), EXACT, 8, Store(None, ""))
    assert asked[:6] == [(a, 4), (b, 4), (a, 8), (b, 8), (a, 16), (b, 16)]
    assert len(asked) == 2 * 3 * 8
    numbers = [replicate for _, replicate in a.asked]
    assert len(set(numbers)) == len(numbers)


def test_the_variance_of_pictures_is_their_error_without_a_reference(monkeypatch):
    fakes = {"a": Fake(), "b": Fake(noise=0.2, speed=1e-2)}
    order = []

    class Ready(methods.Stable):
        def ready(self, method, progress=None):
            return lambda spp, k: order.append((method, k)) or fakes[method](spp, k)

    monkeypatch.setattr(best_sampler, "Stable", Ready)
    found = best_sampler.in_turn(None, {name: name for name in fakes}, 64, 6)
    assert [name for name, _ in order] == [*"abba" * 3]
    for name, fake in fakes.items():
        # 5 degrees of freedom in each of 576 numbers: a standard error of 2.6 %.
        true = float((weights(TRUE) * fake.noise**2 / 64).mean())
        assert found[name].relmse.mean() == pytest.approx(true, rel=0.1)
        assert found[name].work == pytest.approx(fake.speed * 64 * found[name].relmse.mean())


def test_what_is_done_is_not_done_again(tmp_path):
    first = climbs(a=Fake())
    climb(first, EXACT, 8, Store(tmp_path / "s", "key"))
    again, fake = climbs(a=Fake()), Fake()
    again["a"].renderer = lambda: fake
    climb(again, EXACT, 8, Store(tmp_path / "s", "key"))
    assert fake.asked == []
    for one, other in zip(first["a"].rungs, again["a"].rungs, strict=True):
        np.testing.assert_array_equal(one.seconds, other.seconds)
        np.testing.assert_array_equal(one.relmse, other.relmse)
    for store in (Store(tmp_path / "s", "other key"), Store(tmp_path / "s", "key", fresh=True)):
        assert store.rung("a", 4) is None


def test_an_interruption_loses_no_picture(tmp_path):
    """Stopped in the third sweep: the second run does the rest, with the same result."""
    broken = climbs(a=Fake(breaks_after=7))
    with pytest.raises(KeyboardInterrupt):
        climb(broken, EXACT, 8, Store(tmp_path / "s", "key"))
    rest = Fake()
    resumed = climbs(a=rest)
    climb(resumed, EXACT, 8, Store(tmp_path / "s", "key"))
    assert len(rest.asked) == 3 * 8 - 7
    whole = climbs(a=Fake())
    climb(whole, EXACT, 8, Store(None, ""))
    for one, other in zip(whole["a"].rungs, resumed["a"].rungs, strict=True):
        np.testing.assert_array_equal(one.relmse, other.relmse)
        np.testing.assert_array_equal(one.mean, other.mean)
        np.testing.assert_array_equal(one.variance, other.variance)


def test_a_damaged_record_is_done_again(tmp_path):
    store = Store(tmp_path / "s", "key")
    climb(climbs(a=Fake()), EXACT, 8, store)
    path = tmp_path / "s" / "a-8.npz"
    path.write_bytes(path.read_bytes()[:100])
    fake = Fake()
    climb(climbs(a=fake), EXACT, 8, store)
    assert {spp for spp, _ in fake.asked} == {8}


def test_slower_than_promised_climbs_less():
    fake = Fake(speed=1.0)
    one = Climb(lambda: fake, (4, 8, 16, 32), 100.0)
    climb({"a": one}, EXACT, 8, Store(None, ""))
    # 8 pictures of 4 and 8 samples take 96 s; those of 16, another 128 s.
    assert [rung.asked for rung in one.rungs] == [4, 8]
    assert "rungs from 16 samples per pixel" in one.stopped


def test_long_runs_are_stored_on_the_way(tmp_path, monkeypatch):
    monkeypatch.setattr(methods, "STORED_EVERY", -1.0)
    kept = []
    store = Store(tmp_path / "s", "key")
    monkeypatch.setattr(store, "keep", lambda name, rung: kept.append(rung.replicates))
    climb(climbs(a=Fake()), EXACT, 4, store)
    assert kept == [1] * 3 + [2] * 3 + [3] * 3 + [4] * 3
