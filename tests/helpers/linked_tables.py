"""Two groups of operations, on several tables and on one, and kernels that call them."""

from types import SimpleNamespace
from typing import Annotated, Any, NamedTuple

import numpy as np

from reference_rt.core.arrays import FloatArray
from reference_rt.jit.by_code import ByCode
from reference_rt.jit.kernel import entry_kernel, kernel, precompile
from reference_rt.jit.links import Linkable, Linker


class Adders(NamedTuple):
    numbers: FloatArray


class Scalers(NamedTuple):
    numbers: FloatArray
    negative: bool


class Others(NamedTuple):
    numbers: FloatArray


@kernel
def _add(adders: Adders, x: float, i: int) -> float:
    return adders.numbers[i] + x


@kernel
def _scale(scalers: Scalers, i: int, x: float) -> float:
    scaled = scalers.numbers[i] * x
    return -scaled if scalers.negative else scaled


@kernel
def _own_block(scalers: Scalers, n: int, out: FloatArray) -> None:
    for k in range(n):
        out[k] = 100.0 * _scale(scalers, k, 0.25)


class Tables(NamedTuple):
    adders: Annotated[Adders | None, SimpleNamespace(value=_add)]
    scalers: Annotated[Scalers | None, SimpleNamespace(value=_scale, own_block=_own_block)]
    others: Annotated[Others | None, SimpleNamespace()]


@kernel
def _count(table: Any) -> int:
    return len(table.numbers)


ADDER, SCALER, OTHER = range(3)
by_code = ByCode(Tables)


@by_code("value")
def value(tables: Tables, kind: int, i: int, x: float) -> float:
    """The body counts the calls that come to it."""
    return -100.0 * kind - x


@by_code(lambda module: _count)
def count(tables: Tables, kind: int) -> int:
    return -1


@by_code.stage(own="own_block", only=(ADDER, SCALER))
def values_of_block(table: Any, kind: int, n: int, out: FloatArray) -> None:
    """One text for all types, which calls an operation on the table of one."""
    for k in range(n):
        out[k] = value(table, kind, k, 0.25)


pairs = Linkable()


@pairs.operation
def product(pair: Any, x: float) -> float:
    """The product."""
    return pair[0] * pair[1] * x


@pairs.operation
def total(pair: Any) -> tuple[float, int]:
    return pair[0] + pair[1], 7


@pairs.operation
def nested(pair: Any, x: float) -> float:
    """Given a table, an operation calls others of its own on the table."""
    found, seven = total(pair)
    return product(pair, x) + found + seven


def values_of(tables: Any, codes: Any, out: Any) -> None:
    for k in range(len(codes)):
        out[0, k] = value(tables, codes[k], 1, 0.25)
        out[1, k] = count(tables, codes[k])


def use_pair(pair: Any, out: Any) -> None:
    out[0] = product(pair, 3.0)
    out[1], out[2] = total(pair)
    out[3] = nested(pair, 3.0)


def blocks_of(tables: Any, kind: int, out: Any) -> None:
    values_of_block(tables, kind, 2, out)


blocks = entry_kernel(blocks_of)
values, of_pair = entry_kernel(values_of), entry_kernel(use_pair)

CODES = np.array([ADDER, SCALER, OTHER, -1, 3, 5, 1000, -(2**62), 2**62])


def tables_of(adders, scalers, others):
    return Tables(
        Adders(np.array([1.0, 0.5])) if adders else None,
        Scalers(np.array([7.0, 3.0]), True) if scalers else None,
        Others(np.array([9.0])) if others else None,
    )


def linked(group, tables, *wanted):
    """(linker, link) to tables, with all operations or with those `wanted`."""
    linker = Linker()
    link = linker.link(group, wanted or group.operations, tables)
    for call in linker.calls:
        precompile(*call)
    linker.resolve()
    return linker, link
