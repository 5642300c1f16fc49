"""YAML 1.2 text to plain data, and back; and the line of a part of it, for messages.

libyaml, through PyYAML, parses the text into events.  This module converts scalars by the core
schema of YAML 1.2 (chapter 10.3), because PyYAML itself follows YAML 1.1, where `1e5` is text, `no`
is false, `010` is eight and `1:30` is ninety.  As in YAML 1.1, and beyond the core schema, numbers
may have underscores or be binary (0b101), and `<<` merges mappings.
"""

import json
import math
import re
from collections.abc import Callable, Hashable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import yaml
from yaml.events import (
    AliasEvent,
    DocumentStartEvent,
    Event,
    MappingStartEvent,
    ScalarEvent,
    SequenceStartEvent,
    StreamEndEvent,
)

MOST_REPEATED = 1 << 22
"""Most values that aliases may expand to, in all: a few lines of aliases of aliases can expand to
any number.  This many is 100,000 shapes of 40 values each, every one an alias, and takes about
0.4 GB once it is checked.  Values that are written out are bounded by the file's size."""

MOST_NESTED = 500
"""Nesting depth of lists and mappings.  Half of libyaml's own limit (since 0.2.6) and of Python's
recursion limit, which bounds JSON: every parser reads this depth, and the error is the same."""

_TOO_DEEP = f"nested too deeply; expected at most {MOST_NESTED} levels"

_NUMBER = re.compile(
    r"[-+]?(?:(?P<float>(?:[0-9][0-9_]*\.[0-9_]*|\.[0-9][0-9_]*)(?:[eE][-+]?[0-9]+)?"
    r"|[0-9][0-9_]*[eE][-+]?[0-9]+|\.(?:inf|Inf|INF))"
    r"|0b[01_]+|0o[0-7_]+|0x[0-9a-fA-F_]+|(?P<decimal>[0-9][0-9_]*))"
)
_NUMBERS_BEGIN = frozenset("+-.0123456789")
_NAMES: dict[str, Any] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL")),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
}
_NOT_A_NUMBER = (".nan", ".NaN", ".NAN")
_TAG = "tag:yaml.org,2002:"
_KINDS: dict[str, tuple[type, ...]] = {
    "int": (int,),
    "float": (float, int),
    "bool": (bool,),
    "null": (type(None),),
}

# If PyYAML was built without libyaml, its own parser has the same result, forty times slower.
Parser: Any = getattr(yaml, "CBaseLoader", yaml.BaseLoader)


class MalformedError(ValueError):
    """The text is not YAML, or is more than data.  line: from 1, None if unknown."""

    def __init__(self, message: str, line: int | None) -> None:
        super().__init__(message)
        self.line = line


@dataclass(slots=True)
class _Open:
    """A list or mapping whose end has not been read yet.

    begun: number of values read before it;  key: of a mapping, the key whose value comes next;
    merged: of a mapping, the mappings that `<<` merges into it.
    """

    content: Any
    start: Event
    begun: int
    key: Any = None
    has_key: bool = False
    merged: "list[dict[Any, Any]] | None" = None


class _Reader:
    """Builds data from events, with a stack of open lists and mappings, and the anchors' values."""

    def __init__(self) -> None:
        self.open: list[_Open] = []
        self.anchors: dict[str, tuple[Any, int]] = {}  # value, and its number of values
        self.read = self.repeated = 0
        self.words: dict[str, str] = {}  # interned keys

    def document(self, following: Callable[[], Event]) -> Any:
        """The value whose first event comes next."""
        while True:
            event = following()
            kind = type(event)
            if kind is ScalarEvent:
                self.read += 1
                value = _scalar(event)
                if event.anchor is not None:
                    self.anchors[event.anchor] = value, 1
            elif kind is SequenceStartEvent or kind is MappingStartEvent:
                self.begin(event, [] if kind is SequenceStartEvent else {})
                continue
            elif kind is AliasEvent:
                value = self.alias(event)
            else:
                value = self.end()
            if not self.open:
                return value
            into = self.open[-1]
            if type(into.content) is list:
                into.content.append(value)
            elif into.has_key:
                into.has_key = False
                if into.key is _MERGE:
                    into.merged = self.mergeable(value, event)
                else:
                    into.content[into.key] = value
            else:
                into.key = self.key(value, event, into)
                into.has_key = True

    def begin(self, event: Any, content: Any) -> None:
        expected = _TAG + ("seq" if isinstance(content, list) else "map")
        if event.tag not in (None, "!", expected):
            raise _unknown_tag(event)
        if len(self.open) >= MOST_NESTED:
            raise _malformed(_TOO_DEEP, event)
        self.open.append(_Open(content, event, self.read))
        self.read += 1
        self.anchors.pop(event.anchor, None)  # undefined until its end

    def end(self) -> Any:
        ended = self.open.pop()
        content = ended.content
        if ended.merged is not None:
            # The mapping's own keys take precedence, then those of the mappings listed first.
            content = {}
            for mapping in reversed(ended.merged):
                content.update(mapping)
            content.update(ended.content)
        if ended.start.anchor is not None:
            self.anchors[ended.start.anchor] = content, self.read - ended.begun
        return content

    def alias(self, event: Any) -> Any:
        if event.anchor not in self.anchors:
            if any(part.start.anchor == event.anchor for part in self.open):
                raise _malformed(f"the alias '{event.anchor}' is inside its own anchor", event)
            raise _malformed(f"found undefined alias '{event.anchor}'", event)
        value, size = self.anchors[event.anchor]
        self.read += size
        self.repeated += size
        if self.repeated > MOST_REPEATED:
            raise _malformed(f"aliases stand for more than {MOST_REPEATED} values", event)
        return value

    def key(self, value: Any, event: Any, into: _Open) -> Any:
        if type(value) is str:
            if value == "<<" and type(event) is ScalarEvent and event.implicit[0]:
                if into.merged is not None:
                    raise _malformed("found duplicate key '<<'", event)
                return _MERGE
            value = self.words.setdefault(value, value)
        elif not isinstance(value, Hashable):
            raise _malformed("found a list or mapping as a key; expected text", event)
        if value in into.content:
            raise _malformed(f"found duplicate key '{value}'", event)
        return value

    def mergeable(self, value: Any, event: Any) -> list[dict[Any, Any]]:
        mappings = value if isinstance(value, list) else [value]
        if not all(isinstance(mapping, dict) for mapping in mappings):
            raise _malformed("found '<<' with other values; expected mappings", event)
        return mappings


_MERGE = object()
"""Stands for the key `<<`."""


def _scalar(event: Any) -> Any:
    """The value of a scalar: by its tag; else text if it is quoted, or by the core schema."""
    word: str = event.value
    if event.implicit[0]:
        return _plain(word, event)
    tag = event.tag
    if tag is None or tag == "!" or tag == _TAG + "str":
        return word
    kind = tag.removeprefix(_TAG)
    if kind not in _KINDS:
        raise _unknown_tag(event)
    value = _plain(word, event)
    if type(value) not in _KINDS[kind]:
        raise _malformed(f"'{word}' is no '{kind}', as its tag says", event)
    return float(value) if kind == "float" else value


def _plain(word: str, event: Any) -> Any:
    if not word or word[0] not in _NUMBERS_BEGIN:
        return _NAMES.get(word, word)
    match = _NUMBER.fullmatch(word)
    if match is None:
        return math.nan if word in _NOT_A_NUMBER else word
    digits = word.replace("_", "") if "_" in word else word
    if match["float"] is not None:
        return float(digits.replace(".", "", 1) if digits[-1] in "fF" else digits)
    try:
        return int(digits, 10 if match["decimal"] is not None else 0)
    except ValueError as error:  # Python's limit is 4300 digits
        raise _malformed(str(error).partition(";")[0], event) from None


def _malformed(message: str, event: Any) -> MalformedError:
    return MalformedError(message, event.start_mark.line + 1)


def _unknown_tag(event: Any) -> MalformedError:
    tag = event.tag.replace(_TAG, "!!")
    return _malformed(f"unknown tag '{tag}'; expected data without tags", event)


def _indented_by_tab(text: str, line: int) -> bool:
    content = text.splitlines()[line - 1 : line]
    return bool(content) and "\t" in content[0][: len(content[0]) - len(content[0].lstrip())]


class Events:
    """The events of a text.  Raises MalformedError."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.parser = Parser(text)

    def following(self) -> Any:
        try:
            return self.parser.get_event()
        except yaml.MarkedYAMLError as error:
            line = None if error.problem_mark is None else error.problem_mark.line + 1
            problem = " ".join(str(error.problem or error.context).split())
            if "nesting depth" in problem:  # libyaml since 0.2.6, which reads ahead of its events
                problem = _TOO_DEEP
            elif line is not None and _indented_by_tab(self.text, line):
                problem = "a tab at the beginning of the line; YAML indents with spaces"
            elif "mapping values are not allowed" in problem:
                problem += "; expected the keys of one part below each other, and text in quotes"
            elif problem.startswith(("but ", "did not ")) and error.context:
                problem = f"{error.context}, {problem}"
            raise MalformedError(problem, line) from None
        except yaml.reader.ReaderError as error:
            before = self.text.encode("utf-8", "replace")[: error.position]
            raise MalformedError(error.reason, before.count(b"\n") + 1) from None

    def begin(self) -> bool:
        """Advance to the first value; whether there is one."""
        self.following()
        return isinstance(self.following(), DocumentStartEvent)


def load(text: str) -> Any:
    """The data of one document: None, bool, int, float, str, list, dict.  Tags create no objects.

    An alias is the same object as its anchor.  Raises MalformedError (reason and line).
    """
    try:
        events = Events(text)
    except (yaml.YAMLError, UnicodeError) as error:
        raise MalformedError(" ".join(str(error).split()), None) from None
    if not events.begin():
        return None
    data = _Reader().document(events.following)
    events.following()
    another = events.following()
    if not isinstance(another, StreamEndEvent):
        raise _malformed("expected a single document in the stream, but found another", another)
    return data


# ---- out ----------------------------------------------------------------------------------------


class _Dumper(yaml.SafeDumper):  # type: ignore[misc]
    """Quotes text that the rules above would read as another type, and, for other programs, text
    that YAML 1.1 would."""

    def ignore_aliases(self, data: Any) -> bool:
        return True  # repeated parts are written out, for readability


def _text(dumper: Any, text: str) -> Any:
    # Unprintable characters need escapes, which only double quotes have; YAML 1.1 takes U+0085 and
    # U+2028 for line ends.
    return dumper.represent_scalar(_TAG + "str", text, style=None if text.isprintable() else '"')


_Dumper.add_representer(str, _text)
_Dumper.add_implicit_resolver(
    _TAG + "float", re.compile(rf"(?:{_NUMBER.pattern})\Z"), sorted(_NUMBERS_BEGIN)
)


def dump(data: Any) -> str:
    """Data as YAML text; numbers keep all bits, keys their order."""
    text: str = yaml.dump(
        data, Dumper=_Dumper, default_flow_style=None, sort_keys=False, allow_unicode=True
    )
    return text


def load_any(text: str) -> Any:
    """Data from JSON or YAML 1.2.  Data only: tags create no objects."""
    if text.lstrip().startswith("{"):
        # Errors in either are reported by the YAML reader, with their line.  It cannot read all of
        # JSON: it lacks surrogate pairs and control characters.
        with suppress(ValueError, RecursionError):
            return json.loads(text, object_pairs_hook=_distinct)
    return load(text)


def _distinct(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    if len(dict(pairs)) < len(pairs):
        raise ValueError("the same key twice")
    return dict(pairs)


# ---- the line of a part --------------------------------------------------------------------------
# Found by reading the text again when an error is reported: recording the lines of all parts would
# make every text slower to read.


def line_of(text: str, keys: tuple[str | int, ...]) -> int | None:
    """The line, from 1, of the part at the key path, or of the closest part around it; None if the
    text is not YAML."""
    try:
        walk = _Walk(text)
        line, event = 1, walk.following() if walk.begin() else None
        for key in keys:
            event = walk.target(event)
            if isinstance(event, MappingStartEvent):
                place = walk.enter_key(str(key))
            elif isinstance(event, SequenceStartEvent) and isinstance(key, int):
                place = walk.enter_item(key)
            else:
                break
            if place is None:
                break
            line, event = place
        return line
    except (MalformedError, yaml.YAMLError, UnicodeError):
        return None


class _Walk(Events):
    """Walks the parser's events to one part of the text."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self.count = 0
        self.anchors: dict[str, int] = {}  # event number of each anchor

    def following(self) -> Any:
        event = super().following()
        anchor = getattr(event, "anchor", None)
        if anchor is not None and not isinstance(event, AliasEvent):
            self.anchors[anchor] = self.count
        self.count += 1
        return event

    def target(self, event: Any) -> Any:
        """The event that an alias refers to: the text is read again up to there."""
        if not isinstance(event, AliasEvent) or event.anchor not in self.anchors:
            return event
        wanted = self.anchors[event.anchor]
        self.parser, self.count, self.anchors = Parser(self.text), 0, {}
        while self.count < wanted:
            self.following()
        return self.following()

    def enter_key(self, wanted: str) -> tuple[int, Any] | None:
        """The line of a key in the current mapping, and the first event of its value."""
        while self.is_start(key := self.following()):
            if isinstance(key, ScalarEvent) and key.value == wanted:
                return key.start_mark.line + 1, self.following()
            self.skip(key)
            self.skip(self.following())
        return None

    def enter_item(self, wanted: int) -> tuple[int, Any] | None:
        """The line of an item in the current list, and its first event."""
        while self.is_start(item := self.following()):
            if wanted == 0:
                return item.start_mark.line + 1, item
            self.skip(item)
            wanted -= 1
        return None

    @staticmethod
    def is_start(event: Any) -> bool:
        return isinstance(event, yaml.NodeEvent)

    def skip(self, event: Any) -> None:
        """Skip to the end of the value that begins with `event`."""
        depth = 0
        while True:
            if isinstance(event, yaml.CollectionStartEvent):
                depth += 1
            elif isinstance(event, yaml.CollectionEndEvent):
                depth -= 1
            if depth == 0:
                return
            event = self.following()
