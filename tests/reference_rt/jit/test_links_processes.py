"""Links in several processes: what is not linked ends one; another loads what one has compiled."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest
from builders import HELPERS
from linked_tables import (
    ADDER,
    OTHER,
    Adders,
    Tables,
    by_code,
    linked,
    of_pair,
    pairs,
    tables_of,
    values,
)

from reference_rt.jit.links import Linker

pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")


def call(case):
    """In a process of its own."""
    tables, codes = tables_of(True, True, True), np.array([ADDER])
    linker = Linker()
    if case == "not resolved":
        link = linker.link(by_code, ["value", "count"], tables)
    elif case == "one table":
        linker, link = linked(pairs, (1.0, 2.0), "product")
    elif case == "out of bounds":
        linker, link = linked(by_code, Tables(Adders(np.zeros(1)), None, None))
    else:
        linker, link = linked(by_code, tables, "count")
    if case == "a type without the kernel":  # whose call is the function's own body
        codes[0] = OTHER
    print("before", flush=True)
    if case == "one table":
        of_pair(link, np.zeros(4))
    else:
        values(link, codes, np.zeros((2, 1)))
    print("after")


def process_that_calls(case, **environment):
    folders = os.pathsep.join((str(Path(__file__).parent), str(HELPERS)))
    return subprocess.run(
        [sys.executable, "-c", f"import test_links_processes as t; t.call({case!r})"],
        env=os.environ | {"PYTHONPATH": folders} | environment,
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.cases(1)
@pytest.mark.skipif(sys.platform == "win32", reason="no signals")
@pytest.mark.parametrize("case", ["one of several tables", "one table", "not resolved"])
def test_an_operation_that_is_not_linked_stops_the_process(case):
    done = process_that_calls(case)
    # x86's trap is an illegal instruction, ARM's a breakpoint.
    assert done.returncode in (-signal.SIGILL, -signal.SIGTRAP), done.stderr
    assert done.stdout == "before\n"


@pytest.mark.slow
def test_a_type_without_the_kernel_needs_no_link():
    done = process_that_calls("a type without the kernel")
    assert (done.returncode, done.stdout) == (0, "before\nafter\n")


def test_errors_come_back_through_links():
    """Kernels raise none, except with Numba's check of indices."""
    done = process_that_calls("out of bounds", NUMBA_BOUNDSCHECK="1")
    assert (done.returncode, done.stdout) == (1, "before\n")
    assert done.stderr.splitlines()[-1] == "IndexError: index is out of bounds"


# Two types whose tables have one class, as glass and thin glass have.
_TWINS = """
from types import SimpleNamespace
from typing import Annotated, NamedTuple
import numpy as np
from reference_rt.core.arrays import FloatArray
from reference_rt.jit.by_code import ByCode
from reference_rt.jit.kernel import entry_kernel, is_compiled, kernel, precompile
from reference_rt.jit.links import Linker

class Table(NamedTuple):
    numbers: FloatArray

@kernel
def add(table: Table, x: float) -> float:
    return table.numbers[0] + x

@kernel
def scale(table: Table, x: float) -> float:
    return table.numbers[0] * x

class Tables(NamedTuple):
    adders: Annotated[Table | None, SimpleNamespace(value=add)]
    scalers: Annotated[Table | None, SimpleNamespace(value=scale)]

by_code = ByCode(Tables)

@by_code("value")
def value(tables: Tables, kind: int, x: float) -> float:
    return -x

@entry_kernel
def run(link, kind, x, out):
    out[0] = value(link, kind, x)

def main(*codes):
    linker, table, out = Linker(), Table(np.array([3.0])), np.zeros(1)
    tables = Tables(*(table if code in codes else None for code in range(2)))
    link = linker.link(by_code, ["value"], tables)
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


@pytest.mark.slow
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
