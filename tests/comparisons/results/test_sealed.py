"""Files that later runs continue from: every changed bit and lost byte is noticed."""

import json

import numpy as np
import pytest
from test_stored_case import case

from comparisons.experiments.convergence import store as convergence_reference
from comparisons.experiments.convergence.store import Rung, Store
from comparisons.gate import reference_cache as gate_reference
from comparisons.results.files import sealed, unsealed
from comparisons.results.stored_case import StoredCaseError, read_case, write_case

PICTURES = np.random.default_rng(1).random((2, 1, 2, 3))
RUNG = Rung(4, 4, *(np.arange(2.0),) * 3, np.ones((1, 2, 3)), np.zeros((1, 2, 3)))


def rung(folder, write):
    store = Store(folder, "key")
    if write:
        store.keep("ours", RUNG)
    return as_lists(store.rung("ours", 4))


def picture(folder, write):
    store = Store(folder, "key")
    if write:
        store.keep_picture("grid", PICTURES[0])
    return as_lists(store.picture("grid"))


def fact(folder, write):
    store = Store(folder, "key")
    if write:
        store.keep_fact("fact", {"seconds": 1.25}, [1, "a"])
    return store.fact("fact", [1, "a"])


def reference_of_gate(folder, write):
    path = folder / "reference.npz"
    if write:
        gate_reference._save(path, PICTURES, 3)
    pictures, rounds = gate_reference._load(path, PICTURES.shape)
    return (pictures.tolist(), rounds) if rounds else None


def reference_of_converge(folder, write):
    path = folder / "reference.npz"
    if write:
        convergence_reference._save(path, PICTURES, 3, 2)
    pictures, *counts = convergence_reference._load(path, PICTURES.shape)
    return (pictures.tolist(), counts) if counts[0] else None


def record(folder, write):
    if write:
        write_case(folder, case(rungs=(), metrics=None), "key", 1.25)
    try:
        return read_case(folder)
    except StoredCaseError:
        return None


def as_lists(found):
    if isinstance(found, Rung):
        return [np.asarray(value).tolist() for value in vars(found).values()]
    return None if found is None else found.tolist()


KEEPERS = (rung, picture, fact, reference_of_gate, reference_of_converge, record)


@pytest.mark.cases(3)
@pytest.mark.parametrize("keeper", KEEPERS, ids=lambda k: k.__name__)
def test_damage_is_not_believed(tmp_path, keeper):
    """Every length that a file could be cut to, and 1,000 changed bits, or all if it has fewer."""
    whole = keeper(tmp_path, True)
    assert whole is not None
    (path,) = (p for p in tmp_path.iterdir() if p.name != "key.json")
    content = path.read_bytes()
    bits = np.random.default_rng(2).permutation(8 * len(content))[:1000]
    damaged = [content[:size] for size in range(len(content))]
    for bit in bits.tolist():
        data = bytearray(content)
        data[bit // 8] ^= 1 << bit % 8
        damaged.append(bytes(data))
    believed = 0
    for one in damaged:
        path.write_bytes(one)
        found = keeper(tmp_path, False)
        assert found is None or found == whole
        believed += found is not None
    # Bits that mean nothing, such as a time in an archive, or the case of an escape's digits.
    assert believed < len(damaged) / 4


@pytest.mark.parametrize("data", [[], "text", None, {}, {"seal": "1"}, {"a": 1}])
def test_what_was_never_sealed(data):
    with pytest.raises(ValueError, match=r"seal|object"):
        unsealed(data)


def test_a_seal_outlives_the_file():
    data = {"numbers": [1.5, None, "é\udc80"], "nested": {"b": 1, "a": [True]}}
    assert unsealed(json.loads(json.dumps(sealed(data)))) == data
