"""The content of tables: what is written in Python is what compiled code reads, to the bit."""

import math
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest

from reference_rt.core.arrays import FloatArray
from reference_rt.core.vec3 import Vec3
from reference_rt.jit import kernel
from reference_rt.jit.links import Linkable, Linker, words_of

needs_jit = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")


class Table(NamedTuple):
    """A value between two numbers, which are wrong if the value takes too many words or too few."""

    before: int
    value: Any
    after: float


class Nested(NamedTuple):
    vector: Vec3
    nothing: None
    inner: Any


@kernel.kernel
def _number(value: Any, out: FloatArray) -> int:
    out[0] = value
    return 1


@kernel.kernel
def _none(value: Any, out: FloatArray) -> int:
    return 0 if value is None else 1


@kernel.kernel
def _vector(value: Any, out: FloatArray) -> int:
    for i in range(len(value)):
        out[i] = value[i]
    return value.shape[0]


@kernel.kernel
def _matrix(value: Any, out: FloatArray) -> int:
    k = 0
    for i in range(value.shape[0]):
        for j in range(value.shape[1]):
            out[k] = value[i, j]
            k += 1
    return 100 * value.shape[0] + value.shape[1]


@kernel.kernel
def _cube(value: Any, out: FloatArray) -> int:
    k = 0
    for i in range(value.shape[0]):
        for j in range(value.shape[1]):
            for m in range(value.shape[2]):
                out[k] = value[i, j, m]
                k += 1
    return 10000 * value.shape[0] + 100 * value.shape[1] + value.shape[2]


@kernel.kernel
def _nested(value: Any, out: FloatArray) -> int:
    out[0], out[1], out[2] = value.vector
    out[3], out[4] = value.inner[0][1], value.inner[1]
    return int(value.inner[2])


NAN = np.array([0x7FF8_0000_0000_0123], np.uint64).view(np.float64)[0]
"""A NaN with a payload."""

NUMBERS = (0.1, -0.0, math.inf, -math.inf, 5e-324, float(NAN), 3, -1, 2**62, True, False)
NUMPY_NUMBERS = (np.float64(0.1), np.int64(-7), np.bool_(True))
TYPES = (np.float64, np.float32, np.int64, np.int32, np.uint32, np.uint8, np.bool_)


def _array(*shape, dtype=np.float64):
    return (np.arange(math.prod(shape)) % 5).astype(dtype).reshape(shape)


CASES = {
    **{f"number {type(x).__name__} {x}": (x, _number) for x in (*NUMBERS, *NUMPY_NUMBERS)},
    "none": (None, _none),
    **{f"array of {t.__name__}": (_array(7, dtype=t), _vector) for t in TYPES},
    **{f"matrix of {t.__name__}": (_array(3, 4, dtype=t), _matrix) for t in TYPES},
    **{f"cube of {t.__name__}": (_array(2, 3, 4, dtype=t), _cube) for t in TYPES},
    "empty array": (_array(0), _vector),
    "empty matrix": (_array(0, 3), _matrix),
    "no columns": (_array(3, 0), _matrix),
    "empty cube": (_array(2, 0, 3), _cube),
    "one column": (_array(3, 1), _matrix),
    "part of an array": (_array(6, 4)[2:4], _matrix),
    "nested": (Nested(Vec3(1.5, -0.0, 2.5), None, ((1, 3.5), 4.5, True)), _nested),
}


def read(value, put):
    """Call put(value, out) on a table that holds the value, through a link and in plain Python, and
    compare."""
    table, group = Table(-3, value, 0.7), Linkable()

    @group.operation
    def content(table: Any, out: FloatArray, ends: FloatArray) -> int:
        ends[0], ends[1] = table.before, table.after
        return put(table.value, out)

    @kernel.entry_kernel
    def run(link, out, ends):
        return content(link, out, ends)

    linker = Linker()
    link = linker.link(group.operations, group.operations, {0: table})
    for call in linker.calls:
        kernel.precompile(*call)
    linker.resolve()
    out, ends = np.zeros(30), np.zeros(2)
    result = run(link, out, ends)
    expected = np.zeros(30)
    assert result == put(table.value, expected)
    assert out.tobytes() == expected.tobytes()
    assert ends.tolist() == [table.before, table.after]


@pytest.mark.cases(4)
@needs_jit
@pytest.mark.parametrize("case", CASES)
def test_what_is_written_is_read(case, monkeypatch):
    monkeypatch.setattr(kernel, "CACHE_FOLDER", None)
    read(*CASES[case])


def test_words_of_numbers():
    assert words_of((1, True, None, (-1, np.int64(2)), 0.0, -0.0)) == [1, 1, -1, 2, 0, -(2**63)]
    assert words_of(None) == words_of(()) == []
    (bits,) = words_of(float(NAN))
    assert bits == 0x7FF8_0000_0000_0123


def test_words_of_an_array_are_its_address_and_shape():
    array = _array(2, 3)
    assert words_of((array,)) == [array.ctypes.data, 2, 3]


@pytest.mark.parametrize(
    "array", [_array(3, 4).T, _array(3, 4)[:, 1], _array(8)[::2], np.asfortranarray(_array(3, 4))]
)
def test_arrays_with_gaps_are_refused(array):
    with pytest.raises(TypeError, match="not C-contiguous"):
        words_of(Table(1, array, 2.0))


@pytest.mark.parametrize("value", [np.float32(0.5), np.uint64(1), 1j, "text", [1.0], b"x"])
def test_what_has_no_words_is_refused(value):
    """Numbers of four bytes would be read as eight."""
    with pytest.raises(TypeError, match=f"holds a {type(value).__name__}; expected"):
        words_of(Table(1, value, 2.0))
