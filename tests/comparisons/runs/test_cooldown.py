"""Measurements wait until the threads of earlier work are idle."""

import time

import pytest

from comparisons.runs.elsewhere import cool_down


class Clock:
    """Time that only sleeping passes, of a process whose threads are busy until `rests`."""

    def __init__(self, threads, rests):
        self.threads, self.rests, self.now, self.used = threads, rests, 0.0, 0.0

    def sleep(self, seconds):
        busy = max(0.0, min(self.rests - self.now, seconds))
        self.now += seconds
        self.used += self.threads * busy + 0.001 * seconds


@pytest.fixture
def clock(monkeypatch):
    def start(threads, rests):
        found = Clock(threads, rests)
        monkeypatch.setattr(time, "sleep", found.sleep)
        monkeypatch.setattr(time, "perf_counter", lambda: found.now)
        monkeypatch.setattr(time, "process_time", lambda: found.used)
        return found

    return start


@pytest.mark.parametrize("threads", [0.5, 1, 2])
def test_waits_until_all_threads_rest(clock, threads):
    now = clock(threads, rests=0.02)
    cool_down()
    assert 0.02 <= now.now < 0.04


def test_a_process_at_rest_hardly_waits(clock):
    now = clock(1, rests=0.0)
    cool_down()
    assert now.now < 0.01


def test_does_not_wait_for_ever(clock):
    now = clock(1, rests=1e9)
    cool_down(longest=0.5)
    assert 0.5 <= now.now < 0.52
