"""Operations through links: the results of the operations on tables; what is not linked stops."""

import gc
import itertools
import linecache
import os
import signal
import subprocess
import sys
import weakref
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest

from reference_rt.core.arrays import FloatArray
from reference_rt.jit.by_code import ByCode
from reference_rt.jit.kernel import entry_kernel, kernel, precompile
from reference_rt.jit.links import STRIDE, Link, Linkable, Linker, is_absent

needs_jit = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")


class Adders(NamedTuple):
    numbers: FloatArray


class Scalers(NamedTuple):
    numbers: FloatArray
    negative: bool


class Tables(NamedTuple):
    adders: Adders | None
    scalers: Scalers | None
    others: Adders | None


@kernel
def _add(adders: Adders, x: float, i: int) -> float:
    return adders.numbers[i] + x


@kernel
def _scale(scalers: Scalers, i: int, x: float) -> float:
    scaled = scalers.numbers[i] * x
    return -scaled if scalers.negative else scaled


@kernel
def _count(table: Any) -> int:
    return len(table.numbers)


ADDER, SCALER, OTHER = 4, 1, 2
by_code = ByCode(
    [
        (ADDER, "adders", SimpleNamespace(value=_add)),
        (SCALER, "scalers", SimpleNamespace(value=_scale)),
        (OTHER, "others", SimpleNamespace()),
    ]
)


@by_code("value")
def value(tables: Tables, kind: int, i: int, x: float) -> float:
    """The body counts the calls that come to it."""
    return -100.0 * kind - x


@by_code(lambda module: _count)
def count(tables: Tables, kind: int) -> int:
    return -1


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


def _values(tables: Any, codes: Any, out: Any) -> None:
    for k in range(len(codes)):
        out[0, k] = value(tables, codes[k], 1, 0.25)
        out[1, k] = count(tables, codes[k])


def _pair(pair: Any, out: Any) -> None:
    out[0] = product(pair, 3.0)
    out[1], out[2] = total(pair)
    out[3] = nested(pair, 3.0)


values, of_pair = entry_kernel(_values), entry_kernel(_pair)

CODES = np.array([ADDER, SCALER, OTHER, -1, 0, 3, 5, 1000, -(2**62), 2**62])


def tables_of(adders, scalers, others):
    return Tables(
        Adders(np.array([1.0, 0.5])) if adders else None,
        Scalers(np.array([7.0, 3.0]), True) if scalers else None,
        Adders(np.array([9.0])) if others else None,
    )


def by_codes(tables):
    fields = {ADDER: "adders", SCALER: "scalers", OTHER: "others"}
    return {c: t for c, field in fields.items() if (t := getattr(tables, field)) is not None}


def linked(group, tables, *wanted):
    """(linker, link) to tables, with all operations or with those `wanted`."""
    linker = Linker()
    link = linker.link(group.operations, wanted or group.operations, tables)
    for call in linker.calls:
        precompile(*call)
    linker.resolve()
    return linker, link


@needs_jit
@pytest.mark.parametrize("present", list(itertools.product((True, False), repeat=3)), ids=str)
def test_all_codes_give_what_they_give_on_tables(present):
    """Of present types, absent ones, those without the kernel, and codes of no type."""
    tables = tables_of(*present)
    through, direct, plain = (np.full((2, len(CODES)), 0.125) for _ in range(3))
    _, link = linked(by_code, by_codes(tables))
    values(link, CODES, through)
    values(tables, CODES, direct)
    _values(tables, [int(code) for code in CODES], plain)
    assert through.tolist() == direct.tolist() == plain.tolist()
    assert through[0, 0] == (0.75 if present[0] else -400.25)
    assert through[0, 1] == (-0.75 if present[1] else -100.25)
    assert through[1, :3].tolist() == [2 if present[0] else -1, 2 if present[1] else -1,
                                       1 if present[2] else -1]  # fmt: skip


@needs_jit
def test_one_table_is_inlined_or_linked():
    table, out = (0.5, 3.0), [np.zeros(4) for _ in range(3)]
    _, link = linked(pairs, {0: table})
    of_pair(link, out[0])
    of_pair(table, out[1])
    _pair(table, out[2])
    assert out[0].tolist() == out[1].tolist() == out[2].tolist() == [4.5, 3.5, 7.0, 15.0]


@needs_jit
def test_kernels_do_not_depend_on_what_is_linked():
    """One compilation of the caller for all scenes."""
    before = set(values.signatures)
    for present in ((True, False, False), (False, True, True)):
        _, link = linked(by_code, by_codes(tables_of(*present)))
        values(link, CODES, np.zeros((2, len(CODES))))
    assert len(set(values.signatures) - before) <= 1


@needs_jit
def test_only_what_is_asked_for_is_compiled():
    linker = Linker()
    tables = by_codes(tables_of(True, True, True))
    linker.link(by_code.operations, ["count"], tables)
    assert len(linker.calls) == 3
    linker.link(by_code.operations, ["value"], {OTHER: tables[OTHER]})  # which has no value
    assert len(linker.calls) == 3
    linker.link(by_code.operations, ["count"], tables)  # two lists, one kernel
    assert len(linker.calls) == 3
    assert sum(len(places) for places in linker.calls.values()) == 6


# ---- what is not linked -------------------------------------------------------------------------


def call(case):
    """In a process of its own."""
    tables = by_codes(tables_of(True, True, True))
    out = np.zeros((2, 1))
    if case == "one of several tables":
        _, link = linked(by_code, tables, "count")
        code = ADDER
    elif case == "a type without the kernel":  # whose call is the function's own body
        _, link = linked(by_code, tables, "count")
        code = OTHER
    elif case == "not resolved":
        linker = Linker()
        link, code = linker.link(by_code.operations, ["value", "count"], tables), ADDER
    else:
        _, link = linked(pairs, {0: (1.0, 2.0)}, "product")
        print("before", flush=True)
        of_pair(link, out[:, 0])
        print("after")
        return
    precompile(values, (numba.typeof(link), numba.typeof(CODES), numba.typeof(out)))
    print("before", flush=True)
    values(link, np.array([code]), out)
    print("after")


def process_that_calls(case):
    run = f"import test_links; test_links.call({case!r})"
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parent)}
    return subprocess.run(
        [sys.executable, "-c", run], env=environment, capture_output=True, text=True, check=False
    )


@needs_jit
@pytest.mark.skipif(sys.platform == "win32", reason="no signals")
@pytest.mark.parametrize("case", ["one of several tables", "one table", "not resolved"])
def test_an_operation_that_is_not_linked_stops_the_process(case):
    done = process_that_calls(case)
    # x86's trap is an illegal instruction, ARM's a breakpoint.
    assert done.returncode in (-signal.SIGILL, -signal.SIGTRAP), done.stderr
    assert done.stdout == "before\n"


@needs_jit
def test_a_type_without_the_kernel_needs_no_link():
    done = process_that_calls("a type without the kernel")
    assert (done.returncode, done.stdout) == (0, "before\nafter\n")


# ---- how long -----------------------------------------------------------------------------------


@needs_jit
def test_tables_live_as_long_as_the_linker():
    numbers = np.array([1.0, 2.0])
    gone = weakref.ref(numbers)
    linker, link = linked(by_code, {ADDER: Adders(numbers)})
    del numbers
    gc.collect()
    assert gone() is not None
    out = np.zeros((2, 1))
    values(link, np.array([ADDER]), out)
    assert out.tolist() == [[2.25], [2.0]]
    del linker
    gc.collect()
    assert gone() is None


# ---- the cache ----------------------------------------------------------------------------------

# Two types whose tables have one class, as glass and thin glass have.
_TWINS = """
from types import SimpleNamespace
from typing import NamedTuple
import numpy as np
from reference_rt.core.arrays import FloatArray
from reference_rt.jit.by_code import ByCode
from reference_rt.jit.kernel import entry_kernel, is_compiled, kernel, precompile
from reference_rt.jit.links import Linker

class Table(NamedTuple):
    numbers: FloatArray

class Tables(NamedTuple):
    adders: Table | None
    scalers: Table | None

@kernel
def add(table: Table, x: float) -> float:
    return table.numbers[0] + x

@kernel
def scale(table: Table, x: float) -> float:
    return table.numbers[0] * x

by_code = ByCode(
    [(0, "adders", SimpleNamespace(value=add)), (1, "scalers", SimpleNamespace(value=scale))]
)

@by_code("value")
def value(tables: Tables, kind: int, x: float) -> float:
    return -x

@entry_kernel
def run(link, kind, x, out):
    out[0] = value(link, kind, x)

def main(*codes):
    linker, table, out = Linker(), Table(np.array([3.0])), np.zeros(1)
    link = linker.link(by_code.operations, ["value"], {code: table for code in codes})
    before = [is_compiled(*call) for call in linker.calls]
    for call in linker.calls:
        precompile(*call)
    linker.resolve()
    found = []
    for code in codes:
        run(link, code, 5.0, out)
        found.append(float(out[0]))
    print(before, found)
"""


@needs_jit
def test_operations_come_from_the_cache_each_as_itself(tmp_path):
    """All code of a process has one table of symbols.  Two processes number the functions that they
    compile from 1 on, so that the kernels of both types had the same symbol: a third process then
    ran one of them for both."""
    (tmp_path / "twins.py").write_text(_TWINS)
    expected = {
        "0": "[False] [8.0]",
        "1": "[False] [15.0]",
        "0, 1": "[True, True] [8.0, 15.0]",
        "1, 0": "[True, True] [15.0, 8.0]",
    }
    for codes, line in expected.items():
        done = subprocess.run(
            [sys.executable, "-c", f"import twins; twins.main({codes})"],
            env=os.environ | {"REFERENCE_RT_CACHE": str(tmp_path / "cache")},
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=True,
        )
        assert done.stdout.strip() == line


# ---- declarations -------------------------------------------------------------------------------


def test_two_operations_of_one_name_are_refused():
    group = Linkable()

    def twice(table: Any) -> float:
        return 0.0

    group.operation(twice)
    with pytest.raises(TypeError, match=r"test_links.twice: an operation of this name exists"):
        group.operation(twice)


def test_too_many_operations_are_refused():
    """They would be written over the next type's."""
    group, number = Linkable(), 0

    def add():
        def operation(table: Any) -> float:
            return 0.0

        operation.__name__ = f"operation_{number}"
        group.operation(operation)

    for number in range(STRIDE - 1):  # noqa: B007
        add()
    number = STRIDE
    with pytest.raises(TypeError, match=f"operation_{STRIDE}: too many .* at most {STRIDE - 1}"):
        add()


def test_names_and_docstrings_are_kept():
    assert (product.__name__, product.__module__) == ("product", __name__)
    assert product.__doc__ == "The product."


@kernel
def _one_if_absent(table: Any) -> int:
    return 1 if is_absent(table) else 0


@entry_kernel
def _absent(table: Any, out: Any) -> None:
    out[0] = _one_if_absent(table)


@pytest.mark.parametrize(
    ("table", "expected"), [(Link(0), True), (Link(8), False), (Adders(np.zeros(1)), False)]
)
@needs_jit
def test_a_link_to_nothing_is_absent(table, expected):
    out = np.full(1, -1, np.int64)
    _absent(table, out)
    assert bool(out[0]) == expected


@needs_jit
def test_tracebacks_name_the_operation_of_a_link():
    through = by_code.operations["value"].through_link("tables", "kind", kernel(_values))
    assert through.__code__.co_filename == "<test_links.value through a link>"
    shown = linecache.getlines(through.__code__.co_filename)
    assert shown[:2] == ["def value(tables, kind, i, x, ):\n", "    code = kind\n"]
