"""Generated choices: what is refused, and what tracebacks show.  Their values: `test_links`."""

import traceback
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest

from reference_rt.jit.by_code import ByCode
from reference_rt.jit.kernel import kernel


class Tables(NamedTuple):
    adders: Any


@kernel
def _add(adders: Any, x: float) -> float:
    return adders[0] + x


@kernel
def _fail(table: Any, x: float) -> float:
    raise ValueError("no value")


by_code = ByCode([(4, "adders", SimpleNamespace(value=_add))])


@by_code("value")
def value(tables: Tables, kind: int, x: float) -> float:
    """The value of x."""
    return -x


def test_a_parameter_that_cannot_be_given_is_an_error():
    with pytest.raises(TypeError, match=r"_add, for adders: parameters \{'x'\} are none of those"):

        @by_code("value")
        def choice(tables: Tables, kind: int) -> float:
            return 0.0


def test_tracebacks_show_the_generated_line():
    failing = ByCode([(0, "adders", SimpleNamespace(value=_fail))])

    @failing("value")
    def choice(tables: Tables, kind: int, x: float) -> float:
        return -x

    try:
        choice(Tables(np.array([0.5])), 0, 2.0)
    except ValueError:
        text = traceback.format_exc()
    assert "return adders(tables.adders, x)" in text
    assert "test_by_code.choice for adders>" in text


def test_names_and_docstrings_are_kept():
    assert (value.__name__, value.__module__) == ("value", __name__)
    assert value.__doc__ == "The value of x."
