"""Which operations on tables a kernel calls through links: found by following names in its code.

A kernel that is given links compiles whatever it names, and an operation that it calls must be
there (`links.Linker`).
"""

import types
from collections.abc import Callable
from functools import cache
from typing import Any

from reference_rt.jit.kernel import ByClass
from reference_rt.jit.links import Group, Linkable, Operation


@cache
def called(
    root: Callable[..., Any], classes: frozenset[type], within: Group | None = None
) -> frozenset[Operation]:
    """The operations that a kernel calls through links, and those that these call.

    classes: of first arguments: where a choice by class (`ByClass`) has one of these, it is made;
    within: the group of the operation of which `root` is the kernel for one table: the others of
    the group are called on the table itself.
    """
    found: set[Operation] = set()
    seen, left = set(), [(root, within)]
    while left:
        function, inside = left.pop()
        function = getattr(function, "py_func", function)  # of an entry kernel
        if isinstance(function, ByClass):
            chosen = function.kernels.keys() & classes or function.kernels
            left += [(function.kernels[cls], inside) for cls in chosen]
        if not isinstance(function, types.FunctionType) or (function, inside) in seen:
            continue
        if not function.__module__.startswith("reference_rt."):
            continue
        seen.add((function, inside))
        operation = Operation.of.get(function)
        if operation is None:
            left += [(one, inside) for one in _named(function)]
            continue
        if operation.group is not inside:
            found.add(operation)
        left += [(row, operation.group) for row in operation.rows.values()]
        if not isinstance(operation.group, Linkable):  # the body is for codes without a kernel
            left.append((operation.function, inside))
    return frozenset(found)


@cache
def _named(function: types.FunctionType) -> tuple[Any, ...]:
    """What the code of a function may name: globals, what it takes of modules, what it closes over.

    Names of attributes are taken for globals and for names in modules, too, where there are such.
    To tell them apart (`dis`) takes five times as long (measured: 30 ms for an integrator), and
    finds no operation less for any kernel, as a test checks.
    """
    names, known = function.__code__.co_names, function.__globals__
    found = [known[name] for name in names if name in known]
    for module in [value for value in found if isinstance(value, types.ModuleType)]:
        found += [vars(module)[name] for name in names if name in vars(module)]
    return (*found, *(cell.cell_contents for cell in function.__closure__ or ()))
