"""What each field of a description means: the docstrings below the fields, at run time.

Pydantic's `use_attribute_docstrings` parses the sources of all descriptions at import, which would
be 0.13 s of every start.  Here a source file is parsed when its first description is asked for.
"""

import ast
import inspect
import sys
from collections.abc import Iterator, Mapping
from functools import cache
from itertools import pairwise
from typing import Any, Literal, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo


def field_texts(cls: type[BaseModel]) -> dict[str, str]:
    """The meaning of each field, by its name; of a field that a class inherits, the class's own
    docstring if it has one.

    A field `type` that allows one word needs no docstring.  Fields without a text, and those of
    classes without a source file, are left out.
    """
    found = {}
    for name, field in cls.__pydantic_fields__.items():
        if name == "type" and get_origin(field.annotation) is Literal:
            found[name] = f"The name of this type: `{get_args(field.annotation)[0]}`."
    for base in reversed(cls.__mro__):
        texts = _docstrings(base.__module__).get(base.__qualname__, {})
        found |= {name: text for name, text in texts.items() if name in cls.__pydantic_fields__}
    return found


class DescribedFields:
    """The attribute `model_fields` of descriptions: pydantic's fields with `description` set."""

    def __get__(self, instance: Any, owner: type[BaseModel]) -> Mapping[str, FieldInfo]:
        fields = owner.__pydantic_fields__
        if any(field.description is None for field in fields.values()):
            for name, text in field_texts(owner).items():
                fields[name].description = text
        return fields


@cache
def _docstrings(module: str) -> dict[str, dict[str, str]]:
    """Of all classes of a module, by qualified name: the docstring below each annotated field."""
    try:
        tree = ast.parse(inspect.getsource(sys.modules[module]))
    except (OSError, TypeError, KeyError, SyntaxError):  # built in, or typed at a prompt
        return {}
    return dict(_classes(tree, ""))


def _classes(tree: ast.AST, prefix: str) -> Iterator[tuple[str, dict[str, str]]]:
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.ClassDef):
            yield prefix + node.name, _fields(node)
            yield from _classes(node, f"{prefix}{node.name}.")
        elif isinstance(node, ast.FunctionDef):
            yield from _classes(node, f"{prefix}{node.name}.<locals>.")


def _fields(cls: ast.ClassDef) -> dict[str, str]:
    return {
        line.target.id: inspect.cleandoc(below.value.value)
        for line, below in pairwise(cls.body)
        if isinstance(line, ast.AnnAssign)
        and isinstance(line.target, ast.Name)
        and isinstance(below, ast.Expr)
        and isinstance(below.value, ast.Constant)
        and isinstance(below.value.value, str)
    }
