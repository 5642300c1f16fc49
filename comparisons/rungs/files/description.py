"""The numbers of a description against a second reading of it, which shares nothing with ours.

Both renderers are given what our descriptions hold: a validator that exchanges y and z, or a
default that is not the documented one, would be the same in both.  Here another library reads the
text (ruamel.yaml), and a table written from the documentation (documented.toml) says what each
field is, and what it is where the text has none.  Each value of the scene that is rendered is
compared with that, in its place.  Of scenes without a text of ours, those of Python and of other
programs, the fields that nobody has set are compared with the documented defaults.
"""

import json
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cache
from importlib.resources import files
from itertools import islice
from typing import Any

import numpy as np
from ruamel.yaml import YAML
from ruamel.yaml.constructor import SafeConstructor
from ruamel.yaml.error import YAMLError

MOST_TEXT = 1 << 16
"""Characters of the longest YAML text that is read again: ruamel.yaml, which is written in Python,
takes a second of a core for as many."""

MOST_PARTS = 1000
"""Parts of a list, or of a key that has names, that are compared, evenly chosen."""

SPREAD = {"colour": 3, "factors": 3, "pair": 2}
"""How many values one stands for, by kind."""

_UNKNOWN: Any = object()
"""In place of what a text says, where there is none."""

_ABSENT = object()

Table = Mapping[str, Sequence[Any]]
"""Of each field its kind, and its default if it has one."""


@cache
def documented() -> dict[str, Any]:
    """What the documentation says of each type's fields: see the head of the file."""
    file = files("comparisons.rungs.files") / "documented.toml"
    return tomllib.loads(file.read_text(encoding="utf-8"))


def fields_of(section: str, name: str) -> Table | None:
    """The fields of a type, such as `torus` of `shapes`; None for an unknown one."""
    table = documented()[section].get(name)
    return None if table is None else {**documented()["all"].get(section, {}), **table}


class _Core(SafeConstructor):
    """YAML 1.2's core schema, which scene files have: ruamel.yaml makes dates of `2001-09-09`,
    refuses `=`, and takes `.5e3` for text."""

    def text(self, node: Any) -> Any:
        word = self.construct_scalar(node)
        is_number = node.style is None and re.fullmatch(r"[-+]?\.[0-9]+[eE][0-9]+", word)
        return float(word) if is_number else word


for _tag in ("str", "timestamp", "value"):
    _Core.add_constructor(f"tag:yaml.org,2002:{_tag}", _Core.text)


def second_reading(written: str) -> Any:
    """The data of a text in YAML or JSON.  Raises ValueError, in words, where it cannot be read."""
    if written.lstrip().startswith("{"):
        with suppress(ValueError, RecursionError):
            return json.loads(written)
    if len(written) > MOST_TEXT:
        raise ValueError(f"descriptions of more than {MOST_TEXT:,} characters")
    if re.search("^%YAML", written, re.MULTILINE):  # which may ask for other rules
        raise ValueError("descriptions with a directive %YAML")
    reader = YAML(typ="safe", pure=True)
    reader.Constructor = _Core
    try:
        found = reader.load(written)
    except (YAMLError, ValueError, RecursionError):
        found = None
    if not isinstance(found, dict):
        raise ValueError("descriptions that ruamel.yaml does not read")
    return found


class Description:
    """A second reading of a scene's text, or of none.

    differences: what the scene has otherwise, with its place, in the order of the table;  values:
    how many were compared.
    """

    def __init__(self, scene: Any, said: Any = None) -> None:
        """said: the data of the text; None if there is none."""
        self.differences: list[str] = []
        self.values = 0
        said = _UNKNOWN if said is None else said
        fields = dict(documented()["scene"])
        sampler, _ = fields.pop("sampler")
        self._fields("", fields, said, scene, ("sampler",))
        own = scene.resolved_sampler
        if said is _UNKNOWN and "sampler" in scene.model_fields_set:
            self._value("sampler", sampler, _UNKNOWN, own, False)
        elif said is not _UNKNOWN and said.get("sampler") is not None:
            self._value("sampler", sampler, said["sampler"], own, False)
        elif (default := documented()["sampler_of"].get(scene.integrator.type)) is not None:
            self._value("sampler", sampler, default, own, True)

    def _differ(self, place: str, said: Any, ours: Any, by_default: bool = False) -> None:
        by = "the documented default is" if by_default else "the description says"
        self.differences.append(
            f"{place}: {by} {_words(said)}, the rendered scene has {_words(ours)}"
        )

    def _fields(
        self, place: str, fields: Table, said: Any, ours: Any, others: Sequence[str] = ("type",)
    ) -> None:
        """The fields of one description;  others: keys that are compared elsewhere."""
        for name, (kind, *default) in fields.items():
            where, value = f"{place}.{name}" if place else name, getattr(ours, name, _ABSENT)
            if value is _ABSENT:
                self.differences.append(f"{where}: is documented, the rendered scene has none")
            elif said is _UNKNOWN:
                is_set = name in ours.model_fields_set
                self._value(where, kind, _UNKNOWN if is_set else default[0], value, not is_set)
            elif name in said:
                self._value(where, kind, said[name], value, False)
            elif default:
                self._value(where, kind, default[0], value, True)
            else:
                self.differences.append(f"{where}: is required, the description has none")
        for name in [] if said is _UNKNOWN else said:
            if name not in fields and name not in others:
                self.differences.append(f"{place}.{name}: is not documented")

    def _value(self, place: str, kind: str, said: Any, ours: Any, by_default: bool) -> None:
        """One value;  kind: as in the table;  by_default: whether `said` is the table's."""
        try:
            self._compare(place, kind, said, ours, by_default)
        except (AttributeError, IndexError, KeyError, StopIteration, TypeError, ValueError):
            self.differences.append(f"{place}: the description has another form than ours, {kind}")

    def _compare(self, place: str, kind: str, said: Any, ours: Any, by_default: bool) -> None:
        nothing = said is not _UNKNOWN and _is_nothing(said)
        match kind.split():
            case ["one", "of", section]:
                of = {"type": said} if by_default else said
                self._typed(place, section, of, ours)
            case ["list", "of", section]:
                self._list(place, section, () if nothing else said, ours)
            case [*which, "by", "name"]:
                self._names(place, which, {} if nothing else said, ours)
            case ["film" | "uv" | "turn"]:
                self._fields(place, documented()[kind], {} if nothing else said, ours)
            case ["transform"]:
                self._steps(place, () if nothing else said, ours)
            case _ if said is not _UNKNOWN:
                self._leaf(place, kind, said, ours, by_default)

    def _typed(self, place: str, section: str, said: Any, ours: Any) -> None:
        """A description that names its type."""
        if said is not _UNKNOWN and said.get("type") != ours.type:
            self._differ(f"{place}.type", said.get("type"), ours.type)
            return
        fields = fields_of(section, ours.type)
        if fields is None:
            self.differences.append(f"{place}.type: '{ours.type}' is not documented")
        else:
            self._fields(place, fields, said, ours)

    def _list(self, place: str, section: str, said: Any, ours: Any) -> None:
        if said is _UNKNOWN:
            said = [_UNKNOWN] * len(ours)
        if len(said) != len(ours):
            self._differ(place, f"{len(said)} parts", len(ours))
            return
        for k in _some(range(len(said))):
            self._typed(f"{place}[{k}]", section, said[k], ours[k])

    def _names(self, place: str, which: Sequence[str], said: Any, ours: Any) -> None:
        if said is _UNKNOWN:
            said = dict.fromkeys(ours, _UNKNOWN)
        if [*said] != [*ours]:
            self._differ(place, ", ".join(said), ", ".join(ours))
            return
        for name in _some([*said]):
            inner = self._list if which[0] == "lists" else self._typed
            inner(f"{place}.{name}", which[-1], said[name], ours[name])

    def _steps(self, place: str, said: Any, ours: Any) -> None:
        """The steps of a transform, or one matrix."""
        if said is _UNKNOWN:
            return
        if said and all(isinstance(row, list) for row in said):
            said = [{"matrix": said}]
        if len(said) != len(ours):
            self._differ(place, f"{len(said)} steps", len(ours))
            return
        for k, (step, one) in enumerate(zip(said, ours, strict=True)):
            name = next(iter(step))
            if name == "matrix":
                step = {name: step[name][:3]}  # the last row of an affine matrix is 0 0 0 1
            self._fields(f"{place}[{k}]", documented()["transforms"][name], step, one)

    def _leaf(self, place: str, kind: str, said: Any, ours: Any, by_default: bool) -> None:
        self.values += 1
        if _is_nothing(said):
            if not _is_nothing(ours):
                self._differ(place, "nothing", ours, by_default)
            return
        if kind == "rows":
            a, b = np.asarray(said, np.float64), np.asarray(ours)
            if a.shape != b.shape:
                self._differ(place, f"{len(a)} rows", len(b) if b.ndim else "none", by_default)
            elif (wrong := np.flatnonzero((a != b).any(axis=1))).size:
                self._differ(f"{place}[{wrong[0]}]", a[wrong[0]], b[wrong[0]], by_default)
            return
        if kind == "rings":
            said = [[(*point, *[0.0] * (3 - len(point))) for point in ring] for ring in said]
        spread = SPREAD.get(kind.split()[0])
        is_one = not isinstance(said, str | list)
        expected, found = _normal([said] * spread if spread and is_one else said), _normal(ours)
        if expected != found or isinstance(expected, bool) != isinstance(found, bool):
            self._differ(place, said if is_one and not spread else expected, found, by_default)


def _some(parts: Sequence[Any]) -> Iterable[Any]:
    return islice(parts, 0, None, max(1, -(-len(parts) // MOST_PARTS)))


def _is_nothing(value: Any) -> bool:
    return value is None or (not isinstance(value, np.ndarray) and value in ("", [], {}, ()))


def _normal(value: Any) -> Any:
    """Numbers as floats, lists as tuples, at any depth."""
    if isinstance(value, list | tuple):
        return tuple(map(_normal, value))
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return float(value) if is_number else value


def _words(value: Any) -> str:
    return " ".join(_flat(value))


def _flat(value: Any) -> Iterator[str]:
    if isinstance(value, list | tuple | np.ndarray):
        for one in value:
            yield from _flat(one)
    elif isinstance(value, bool) or value is None:
        yield str(value).lower()
    else:
        short = f"{value:g}" if not isinstance(value, str) else value
        yield short if isinstance(value, str) or float(short) == value else repr(float(value))
