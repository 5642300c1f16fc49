"""Source faults of the self-test, planted in this process, which compiles nothing for that."""

from collections.abc import Iterator
from importlib import import_module
from types import CodeType, FunctionType
from typing import Any

import pytest

from comparisons.experiments.selftest import FAULTS, SourceFault
from comparisons.experiments.selftest.fault import PACKAGE
from comparisons.experiments.selftest.sensitivity import patched_text

SOURCE_FAULTS = {fault.name: fault for fault in FAULTS if isinstance(fault, SourceFault)}


def plant(patch: pytest.MonkeyPatch, fault: SourceFault) -> None:
    """Gives the functions that the fault changes the code of its source.  Whoever has imported them
    calls that, too; compiled kernels stay as they are."""
    module = import_module("reference_rt." + fault.file.removesuffix(".py").replace("/", "."))
    right = dict(_codes((PACKAGE / fault.file).read_text(encoding="utf-8"), module))
    changed = [(f, code) for f, code in _codes(patched_text(fault), module) if code != right[f]]
    assert changed, fault.name
    for function, code in changed:
        patch.setattr(function, "__code__", code)


def _codes(text: str, module: Any) -> Iterator[tuple[FunctionType, CodeType]]:
    """The functions of a module, in classes too, with the code that a source has for each."""
    yield from _within(compile(text, module.__file__, "exec"), module)


def _within(scope: CodeType, owner: Any) -> Iterator[tuple[FunctionType, CodeType]]:
    for code in scope.co_consts:
        if isinstance(code, CodeType) and code.co_name in vars(owner):
            there = vars(owner)[code.co_name]
            if isinstance(there, type):
                yield from _within(code, there)
            elif isinstance(function := _plain(there), FunctionType):
                yield function, code


def _plain(there: Any) -> Any:
    """The function of a property, a method, or what remembers answers."""
    for name in ("fget", "func", "__func__", "__wrapped__"):
        there = getattr(there, name, None) or there
    return there
