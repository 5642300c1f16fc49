"""Scenes as plain data: walks, copies, and YAML of one line for each part."""

import json
import re
from collections.abc import Iterator
from typing import Any

Data = dict[str, Any]
"""A scene, or a part of one, as its file's data."""

NAMED = ("textures", "materials", "media", "groups")
"""The keys of a scene whose parts have names."""

_PLAIN = re.compile(r"[A-Za-z_][A-Za-z0-9_./-]*")
_WORDS = {"true", "false", "null", "yes", "no", "on", "off", "y", "n"}


def shapes_of(scene: Data) -> Iterator[Data]:
    """All shapes of a scene's data: operands of solids and members of groups too."""
    for shape in scene.get("shapes", ()):
        yield from _with_operands(shape)
    for members in scene.get("groups", {}).values():
        for shape in members:
            yield from _with_operands(shape)


def _with_operands(shape: Data) -> Iterator[Data]:
    yield shape
    for operand in shape.get("of", ()):
        yield from _with_operands(operand)


def named_in(part: Any) -> Iterator[tuple[Data, str]]:
    """Every field of a part that is a text but for its type, at any depth, with the data that it
    belongs to: some are names of materials and textures."""
    if isinstance(part, dict):
        for key, value in part.items():
            if isinstance(value, str) and key != "type":
                yield part, key
            else:
                yield from named_in(value)
    elif isinstance(part, list):
        for value in part:
            yield from named_in(value)


def text_of(scene: Data) -> str:
    """YAML, one line for each shape, material, light and so on."""
    lines: list[str] = []
    for key, value in scene.items():
        if isinstance(value, dict) and key in NAMED:
            if value:
                lines.append(f"{key}:")
                lines += [f"  {_flow(name)}: {_flow(part)}" for name, part in value.items()]
        elif isinstance(value, list):
            if value:
                lines.append(f"{key}:")
                lines += [f"  - {_flow(part)}" for part in value]
        else:
            lines.append(f"{key}: {_flow(value)}")
    return "\n".join(lines) + "\n"


def _flow(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_flow(k)}: {_flow(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_flow, value)) + "]"
    if isinstance(value, str):
        bare = _PLAIN.fullmatch(value) and value.lower() not in _WORDS
        return value if bare else json.dumps(value, ensure_ascii=False)
    if isinstance(value, float) and value == int(value) and abs(value) < 1e15:
        return str(int(value))
    return json.dumps(value)


def copy_of(data: Any) -> Any:
    """A deep copy of plain data."""
    if isinstance(data, dict):
        return {key: copy_of(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [copy_of(value) for value in data]
    return data


Way = tuple[str | int, ...]
"""Keys and numbers that lead to a part of data."""


def numbers_in(data: Any, way: Way = (), but: frozenset[str] = frozenset()) -> Iterator[Way]:
    """The ways to all numbers but those at or below some keys."""
    if isinstance(data, dict | list):
        items: Any = data.items() if isinstance(data, dict) else enumerate(data)
        for key, value in items:
            if key not in but:
                yield from numbers_in(value, (*way, key), but)
    elif isinstance(data, int | float) and not isinstance(data, bool):
        yield way


def at(data: Any, way: Way) -> Any:
    """What a way leads to."""
    for key in way:
        data = data[key]
    return data
