"""The words of tables.  That compiled code reads them back: `test_links`, and every query."""

import math

import numpy as np
import pytest

from reference_rt.jit.table_words import words_of

NAN = np.array([0x7FF8_0000_0000_0123], np.uint64).view(np.float64)[0]
"""A NaN with a payload."""


def _array(*shape, dtype=np.float64):
    return (np.arange(math.prod(shape)) % 5).astype(dtype).reshape(shape)


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
        words_of((1, array, 2.0))


@pytest.mark.parametrize("value", [np.float32(0.5), np.uint64(1), 1j, "text", [1.0], b"x"])
def test_what_has_no_words_is_refused(value):
    """Numbers of four bytes would be read as eight."""
    with pytest.raises(TypeError, match=f"holds a {type(value).__name__}; expected"):
        words_of((1, value, 2.0))
