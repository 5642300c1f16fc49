"""The engine of experiments: what is stored under a key, and the order of requests."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from comparisons.runs import engine
from comparisons.runs.processes import Children, _Turns


@dataclass(frozen=True)
class Of:
    number: float
    parts: tuple[int, ...]


def test_what_is_stored_is_read_with_its_key_and_undamaged(tmp_path):
    file = tmp_path / "new" / "x.json"
    key = engine.key_of(sources="a", seed=1)
    assert engine.stored(file, key) is None
    engine.store(file, key, {"worst": math.inf, "of": Of(0.1, (1, 2)), "n": np.int64(3)})
    found = engine.stored(file, key)
    assert found == {"worst": math.inf, "of": {"number": 0.1, "parts": [1, 2]}, "n": 3}
    assert engine.stored(file, engine.key_of(sources="a", seed=2)) is None
    file.write_text(file.read_text().replace("0.1", "0.2"))
    assert engine.stored(file, key) is None


def order(requests, workers, ends_first):
    """Requests as `workers` processes begin them; of those that run `ends_first` picks who ends."""
    turns = _Turns(requests, lambda request: request[0])
    left, running, begun = iter(turns), [], []
    while True:
        while len(running) < workers and (task := next(left, None)) is not None:
            running.append(task[0])
            begun.append(task[0])
        if not running:
            return begun
        one = ends_first(running)
        running.remove(one)
        turns.ended(one)


def test_kin_follow_each_other_and_none_run_together_while_others_wait():
    requests = ["a1", "a2", "a3", "b1", "b2", "c1"]
    assert order(requests, 1, min) == requests
    # The second process begins b, and goes on with it; a and b never run twice at once.
    assert order(requests, 2, max) == ["a1", "b1", "b2", "c1", "a2", "a3"]
    assert order(requests, 4, min)[:4] == ["a1", "b1", "c1", "a2"]


OPEN_FILES = Path("/proc/self/fd")


def test_a_program_that_does_not_exist_leaves_no_file_open(tmp_path):
    """The log of a child that could not be started."""
    children, missing = Children(), str(tmp_path / "missing")
    before = {*OPEN_FILES.iterdir()}
    with pytest.raises(FileNotFoundError) as caught:
        children.carry_out((missing,), "", "{}", 5.0, lambda step: None)
    assert {*OPEN_FILES.iterdir()} == before, caught
