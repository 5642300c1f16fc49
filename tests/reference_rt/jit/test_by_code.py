"""Generated choices: the same in compiled code and in plain Python, whatever tables are absent."""

import itertools
import traceback
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest

from reference_rt.jit.by_code import ByCode
from reference_rt.jit.kernel import entry_kernel, kernel


class Tables(NamedTuple):
    adders: Any
    scalers: Any
    others: Any


@kernel
def _add(adders: Any, x: float) -> float:
    return adders[0] + x


@kernel
def _scale(scalers: Any, x: float) -> float:
    return scalers[0] * x


@kernel
def _fail(table: Any, x: float) -> float:
    raise ValueError("no value")


ADDER, SCALER, OTHER = 4, 1, 2
ROWS = [
    (ADDER, "adders", SimpleNamespace(value=_add)),
    (SCALER, "scalers", SimpleNamespace(value=_scale)),
    (OTHER, "others", SimpleNamespace()),
]
by_code = ByCode(ROWS)


@by_code("value")
def value(tables: Tables, kind: int, x: float) -> float:
    """The value of x."""
    return -x


@kernel
def _digit(code: int, table: Any, more: int, found: int) -> int:
    return 10 * found + code + more


digits = by_code.in_turn(_digit)

A, B, C = np.array([0.5]), np.array([3.0]), np.array([7.0, 9.0])
PRESENT = list(itertools.product((A, None), (B, None), (C, None)))


def _run(tables: Any, code: int, out: Any) -> None:
    out[0] = value(tables, code, 2.0)
    out[1] = digits(tables, 0, 0)


compiled = entry_kernel(_run)


def expected(tables, code):
    if code == ADDER and tables.adders is not None:
        return 2.5
    if code == SCALER and tables.scalers is not None:
        return 6.0
    return -2.0


@pytest.mark.parametrize("tables", [Tables(*present) for present in PRESENT])
def test_absent_tables_and_missing_kernels(tables):
    number = 0
    for code, table in zip((ADDER, SCALER, OTHER), tables, strict=True):
        number = number if table is None else 10 * number + code
    for code in (ADDER, SCALER, OTHER, -1, 100):
        for run in (compiled, _run):
            out = np.empty(2)
            run(tables, code, out)
            assert out.tolist() == [expected(tables, code), number]


def test_codes_are_compared_in_the_order_of_the_rows():
    """Of two rows with one code, the first that is present."""
    alike = ByCode((7, field, module) for _, field, module in ROWS)

    @alike("value")
    def choice(tables: Tables, kind: int, x: float) -> float:
        return -x

    values = [choice(Tables(*present), 7, 2.0) for present in PRESENT]
    assert values == [2.5] * 4 + [6.0] * 2 + [-2.0] * 2


def test_the_code_may_be_an_expression():
    fields = Tables(A, None, None)
    other = ByCode([(OTHER, "adders", SimpleNamespace(value=lambda table, first, x: first + x))])

    @other("value", code="first.real")
    def choice(tables: Tables, first: complex, x: float) -> complex:
        return x

    assert choice(fields, 2 + 5j, 1.0) == 3 + 5j
    assert choice(fields, 3 + 5j, 1.0) == 1.0


def test_kernels_take_the_parameters_that_they_name():
    some = SimpleNamespace(value=lambda table, z, x: 10 * z + x)
    other = SimpleNamespace(value=lambda table: 7)

    @ByCode([(0, "adders", some), (1, "scalers", other)])("value")
    def choice(tables: Tables, kind: int, x: float, y: float, z: float) -> float:
        return y

    assert [choice(Tables(A, B, C), kind, 1.0, 2.0, 3.0) for kind in range(3)] == [31.0, 7, 2.0]


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
        choice(Tables(A, B, C), 0, 2.0)
    except ValueError:
        text = traceback.format_exc()
    assert "return adders(tables.adders, x)" in text
    assert "test_by_code.choice for adders>" in text


def test_names_and_docstrings_are_kept():
    assert (value.__name__, value.__module__) == ("value", __name__)
    assert value.__doc__ == "The value of x."
