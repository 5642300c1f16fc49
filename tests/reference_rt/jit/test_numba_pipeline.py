"""How kernels become machine code: inlining leaves no call, and tuples are passed whole."""

import math
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest
from numba.core import event

from reference_rt.core.vec3 import Vec3
from reference_rt.jit.kernel import ByClass, entry_kernel, kernel


class Mixed(NamedTuple):
    """Of everything that a tuple may hold: nested, of one type, a flag, an array, None."""

    flag: bool
    v: Vec3
    i: int
    array: Any
    nothing: None
    pair: tuple[float, float]


class Other(NamedTuple):
    x: float


@kernel
def turned(m: Mixed, k: float) -> Mixed:
    v = Vec3(m.v.y, m.v.z, m.v.x) * k
    return Mixed(not m.flag, v, m.i + 1, m.array, m.nothing, (m.pair[1], m.pair[0]))


@kernel
def _of_mixed(m: Mixed, k: float) -> float:
    t = turned(turned(m, k), k)
    return t.v.x * t.pair[0] + t.array[t.i % 2] if t.flag else math.inf


@kernel
def _of_other(o: Other, k: float) -> float:
    return o.x - k


_choice = ByClass("value")
_choice.register(Mixed, _of_mixed)
_choice.register(Other, _of_other)
value = _choice.function


def _values(thing: Any, k: float, out: Any) -> None:
    for i in range(len(out)):
        out[i] = value(thing, k + i)


values = entry_kernel(_values)

MIXED = Mixed(True, Vec3(0.1, 0.2, 0.7), 4, np.array([3.0, 5.0]), None, (0.3, 0.9))


@pytest.mark.parametrize("thing", [MIXED, Other(0.25)])
def test_tuples_of_all_kinds_arrive_and_come_back(thing):
    out = np.empty(3)
    values(thing, 1.5, out)
    assert out.tolist() == [value(thing, 1.5 + i) for i in range(3)]


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")
def test_nothing_is_left_of_what_is_inlined(monkeypatch):
    monkeypatch.setattr("reference_rt.jit.kernel.CACHE_FOLDER", None)  # which keeps no text
    compiled = entry_kernel(_values)
    compiled(MIXED, 1.5, np.empty(1))
    for code in compiled.inspect_llvm().values():
        defined = [line for line in code.splitlines() if line.startswith("define")]
        assert defined
        assert not any(name in line for line in defined for name in ("turned", "_of_", "Vec3."))


@kernel
def _of_none(x: float) -> float:
    return -x


@kernel
def _of_some(array: Any, x: float) -> float:
    return array[0] + x


@kernel
def _either(array: Any, x: float) -> float:
    if array is None:
        return _of_none(x)
    return _of_some(array, x)


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")
@pytest.mark.parametrize(
    ("array", "expected", "needed", "spared"),
    [(np.array([3.0]), 5.0, _of_some, _of_none), (None, -2.0, _of_none, _of_some)],
)
def test_what_is_for_none_is_compiled_where_there_is_none_only(
    array, expected, needed, spared, monkeypatch
):
    """Numba compiles what stands below `if x is None:` for every x, with all that it calls."""
    monkeypatch.setattr("reference_rt.jit.kernel.CACHE_FOLDER", None)
    either = entry_kernel(_either)
    with event.install_recorder("numba:run_pass") as passes:
        assert either(array, 2.0) == expected
    compiled = {one.data["qualname"] for _, one in passes.buffer}
    assert needed.__qualname__ in compiled
    assert spared.__qualname__ not in compiled
