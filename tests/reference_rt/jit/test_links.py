"""Operations through links: the results of the operations on tables; how they are declared."""

import gc
import itertools
import weakref
from typing import Any

import numba
import numpy as np
import pytest
from linked_tables import (
    ADDER,
    CODES,
    OTHER,
    SCALER,
    Adders,
    Tables,
    blocks,
    blocks_of,
    by_code,
    linked,
    of_pair,
    pairs,
    tables_of,
    use_pair,
    values,
    values_of,
)

from reference_rt.jit.kernel import entry_kernel, kernel
from reference_rt.jit.links import STRIDE, Link, Linkable, Linker, is_absent
from reference_rt.jit.table_words import type_of_table

needs_jit = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")


@pytest.mark.cases(4)
@needs_jit
@pytest.mark.parametrize("present", list(itertools.product((True, False), repeat=3)), ids=str)
def test_all_codes_give_what_they_give_on_tables(present):
    """Of present types, absent ones, those without the kernel, and codes of no type."""
    tables = tables_of(*present)
    through, direct, plain = (np.full((2, len(CODES)), 0.125) for _ in range(3))
    _, link = linked(by_code, tables)
    values(link, CODES, through)
    values(tables, CODES, direct)
    values_of(tables, [int(code) for code in CODES], plain)
    assert through.tolist() == direct.tolist() == plain.tolist()
    assert through[0, 0] == (0.75 if present[0] else -0.25)
    assert through[0, 1] == (-0.75 if present[1] else -100.25)
    assert through[1, :3].tolist() == [2 if present[0] else -1, 2 if present[1] else -1,
                                       1 if present[2] else -1]  # fmt: skip


@needs_jit
def test_one_table_is_inlined_or_linked():
    table, out = (0.5, 3.0), [np.zeros(4) for _ in range(3)]
    _, link = linked(pairs, table)
    of_pair(link, out[0])
    of_pair(table, out[1])
    use_pair(table, out[2])
    assert out[0].tolist() == out[1].tolist() == out[2].tolist() == [4.5, 3.5, 7.0, 15.0]


@needs_jit
def test_kernels_do_not_depend_on_what_is_linked():
    """One compilation of the caller for all scenes."""
    before = set(values.signatures)
    for present in ((True, False, False), (False, True, True)):
        _, link = linked(by_code, tables_of(*present))
        values(link, CODES, np.zeros((2, len(CODES))))
    assert len(set(values.signatures) - before) <= 1


@needs_jit
def test_only_what_is_asked_for_is_compiled():
    linker = Linker()
    tables = tables_of(True, True, True)
    linker.link(by_code, ["count"], tables)
    assert len(linker.calls) == 3
    linker.link(by_code, ["value"], tables_of(False, False, True))  # which has no value
    assert len(linker.calls) == 3
    linker.link(by_code, ["count"], tables)  # two lists, one kernel
    assert len(linker.calls) == 3
    assert sum(len(places) for places in linker.callees.values()) == 6


@needs_jit
def test_what_was_linked_before_is_not_compiled_again():
    """Other tables of the same types have the same kernels, and links that give the same."""
    first, _ = linked(by_code, tables_of(True, True, True))
    again, tables = Linker(), tables_of(True, True, True)
    link = again.link(by_code, by_code.operations, tables)
    assert again.calls == first.calls != []
    assert again.missing == []
    again.resolve()
    through, plain = (np.zeros((2, len(CODES))) for _ in range(2))
    values(link, CODES, through)
    values_of(tables, [int(code) for code in CODES], plain)
    assert through.tolist() == plain.tolist()


OF_ONE_KIND = np.zeros((2, 3))
_READ_ONLY = np.zeros((2, 3))
_READ_ONLY.flags.writeable = False
PARTS = {
    "floats": OF_ONE_KIND,
    "of another size": np.zeros((5, 1)),
    "one index": np.zeros(2),
    "float32": np.zeros((2, 3), np.float32),
    "integers": np.zeros((2, 3), np.int64),
    "columns": np.zeros((3, 2)).T,
    "spaced": np.zeros((4, 3))[::2],
    "read only": _READ_ONLY,
    "none": None,
    "int": 3,
    "large": 2**63,
    "bool": True,
    "float": 0.5,
    "scalar": np.float64(1),
    "scalar integer": np.int64(1),
    "tuple": (1, 0.5),
    "record": Adders(np.zeros(2)),
    "its tuple": (np.zeros(2),),
}


@needs_jit
@pytest.mark.parametrize("first", PARTS)
def test_the_type_of_a_table_is_that_of_numba(first):
    """Whatever was asked for before."""
    for part in (PARTS[first], *PARTS.values()):
        for table in ((part,), Adders(part), ((part, 1), part)):
            assert type_of_table(table) == numba.typeof(table)


@needs_jit
def test_a_block_is_one_text_for_all_types():
    """But for those with a kernel of their own, and those that have none; through a link to all
    tables, and in plain Python."""
    tables = tables_of(True, True, True)
    _, link = linked(by_code, tables)
    for kind, expected in ((ADDER, [1.25, 0.75]), (SCALER, [-175.0, -75.0]), (OTHER, [0.0, 0.0])):
        found, plain = np.zeros(2), np.zeros(2)
        blocks(link, kind, found)
        blocks_of(tables, kind, plain)
        assert found.tolist() == plain.tolist() == expected


def test_plain_python_takes_the_tables_themselves():
    linker, tables = Linker(is_plain=True), tables_of(True, False, True)
    assert linker.link(by_code, by_code.operations, tables) is tables
    assert (linker.nothing, linker.calls) == (None, [])
    assert is_absent(linker.nothing)


# ---- how long -----------------------------------------------------------------------------------


@pytest.mark.slow
@needs_jit
def test_tables_live_as_long_as_the_linker():
    numbers = np.array([1.0, 2.0])
    gone = weakref.ref(numbers)
    linker, link = linked(by_code, Tables(Adders(numbers), None, None))
    del numbers
    gc.collect()
    assert gone() is not None
    out = np.zeros((2, 1))
    values(link, np.array([ADDER]), out)
    assert out.tolist() == [[2.25], [2.0]]
    del linker
    gc.collect()
    assert gone() is None


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


@pytest.mark.parametrize("name", ["code", "pointer", "table", "call"])
def test_parameters_with_names_of_the_generated_text_are_refused(name):
    """`code = kind` would change the argument."""
    names: dict[str, Any] = {}
    exec(f"def operation(first, kind, {name}): return 0.0", names)
    with pytest.raises(TypeError, match=rf"parameters \{{'{name}'\}} have names of the"):
        Linkable().operation(names["operation"])


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
