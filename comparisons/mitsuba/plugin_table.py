"""Plugins of Mitsuba as tables that are read both ways: `PluginTable.write` makes the dictionary of
one of our descriptions, `PluginTable.read` our fields of an element of Mitsuba's scenes.

What a row cannot say stands in a function beside the table.  Kinds of values that may be textures
are in `comparisons.textures`.
"""

from collections.abc import Callable, Container
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeVar

from comparisons.mitsuba.colours import colour, index_of_refraction
from comparisons.mitsuba.context import NO_CONTEXT, TranslationContext, rgb
from comparisons.mitsuba.node import Node, Reading

T = TypeVar("T")


class Kind(NamedTuple):
    """A kind of value.  write: ours in Mitsuba's dictionary;  read: an element's parameter by its
    name, or Mitsuba's default, the last argument;  expected: what an error says is missing.  Both
    raise what the functions that use them do."""

    write: Callable[[Any, TranslationContext], Any]
    read: Callable[[Reading, Node, str, Any], Any]
    expected: str = "one"


def _as_it_is(value: Any, context: TranslationContext) -> Any:
    return value


def _colour(use: str) -> Kind:
    return Kind(
        lambda value, context: rgb(value),
        lambda reading, node, name, default: colour(node, name, default, use),
    )


NUMBER = Kind(_as_it_is, lambda reading, node, name, default: node.number(name, default))
INTEGER = Kind(_as_it_is, lambda reading, node, name, default: node.integer(name, default))
FLAG = Kind(_as_it_is, lambda reading, node, name, default: node.flag(name, default))
VECTOR = Kind(
    lambda value, context: list(value),
    lambda reading, node, name, default: node.vector(name, default),
)
COLOUR, EMISSION, UNBOUNDED = map(_colour, ("reflectance", "emission", "unbounded"))
INDEX = Kind(
    _as_it_is, lambda reading, node, name, default: index_of_refraction(node, name, default)
)
"""An index of refraction: a number or the name of a substance, as the default is."""


def one_of(*words: str) -> Kind:
    """One of these words."""

    def read(reading: Reading, node: Node, name: str, default: str) -> Any:
        return node.choice(name, default, words)

    return Kind(_as_it_is, read)


class Row(NamedTuple):
    """field: of our description;  name: Mitsuba's;  default: Mitsuba's, None where it has none and
    a value must be given."""

    field: str
    name: str
    kind: Kind
    default: Any


@dataclass(frozen=True)
class PluginTable:
    """A plugin of Mitsuba.  ignored: its parameters that do not change the picture."""

    plugin: str
    rows: tuple[Row, ...] = ()
    ignored: tuple[str, ...] = ()

    def write(self, part: Any, context: TranslationContext = NO_CONTEXT) -> dict[str, Any]:
        """The dictionary of a description, in the order of the rows.  Raises UntranslatableError,
        ValueError for a file that cannot be used."""
        values = {row.name: row.kind.write(getattr(part, row.field), context) for row in self.rows}
        return {"type": self.plugin, **values}

    def read(self, reading: Reading, node: Node, but: Container[str] = ()) -> dict[str, Any]:
        """The fields of our description, without some.  Raises SceneError."""
        node.ignore(*self.ignored)
        return {
            row.field: self._value(row, reading, node) for row in self.rows if row.field not in but
        }

    def reader(self, description: Callable[..., T]) -> Callable[[Reading, Node], T]:
        """What reads an element that the rows alone describe."""
        return lambda reading, node: description(**self.read(reading, node))

    def _value(self, row: Row, reading: Reading, node: Node) -> Any:
        if row.default is None and not node.has(row.name):
            raise node.error(f"has no '{row.name}'; expected {row.kind.expected}")
        return row.kind.read(reading, node, row.name, row.default)


def inserted(values: dict[str, Any], after: str, more: dict[str, Any]) -> dict[str, Any]:
    """A dictionary with more values after the one with a name."""
    names = list(values)
    head = names[: names.index(after) + 1]
    return {**{name: values[name] for name in head}, **more, **values}
