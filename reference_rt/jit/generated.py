"""Kernels made of generated text: `by_code.py` and `links.py` write it, and tracebacks show it."""

import inspect
import linecache
from collections.abc import Callable, Mapping
from typing import Any


def parameters_of(function: Callable[..., Any]) -> list[str]:
    """The names of a function's parameters."""
    return [*inspect.signature(function).parameters]


def define(
    text: str, module: str, name: str, label: str, known: Mapping[str, Any]
) -> Callable[..., Any]:
    """The function `name` that a text defines.

    module: in which it is said to be;  label: what tells it apart, in tracebacks, from others of
    the same name;  known: the values of all other names in the text.
    """
    file = f"<{module}.{name} {label}>"
    linecache.cache[file] = len(text), None, text.splitlines(keepends=True), file
    names = {"__name__": module, **known}
    exec(compile(text, file, "exec"), names)
    made: Callable[..., Any] = names[name]
    return made
