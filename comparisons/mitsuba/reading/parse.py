"""Parsing Mitsuba scenes with Mitsuba's own parser; its errors as `SceneError`s."""

import re
import warnings
import xml.parsers.expat
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from comparisons.mitsuba.backend import imported
from comparisons.mitsuba.reading.written import Transforms, transforms_of
from reference_rt.util.errors import ReferenceUnavailableError, SceneError
from reference_rt.util.files import read_input

VARIANT = "scalar_rgb"
"""The variant whose conversions of colours we take over: those of all rgb variants are the same."""

MOST_NESTED = 200
"""Most elements within each other, in a file and in the files that it includes: Mitsuba's parser
calls itself for each, and a file of a million ends the process."""

MOST_BYTES = 1 << 28
"""The largest file that is read."""


class Parsed(NamedTuple):
    """Mitsuba's description of a scene, in which nothing is instantiated.

    state: `mitsuba.parser.ParserState`, upgraded to Mitsuba 3 and its references resolved;  file:
    the name for messages;  folder: where relative file names count from, first;  resolve: the
    file that Mitsuba finds for a name;  defaults: values for <default> elements;  written: see
    `transforms`.
    """

    state: Any
    file: str
    folder: Path
    paths: tuple[Path, ...]
    defaults: Mapping[str, str]
    written: dict[str, Transforms]

    def transforms(self, file: str) -> Transforms:
        """The transforms of a file as they are written."""
        if file not in self.written:
            self.written[file] = transforms_of(Path(file), self.defaults)
        return self.written[file]

    def resolve(self, name: str) -> Path:
        """The file that Mitsuba finds under this name: below the scene's folder, those of its
        <path> elements, and the current one."""
        if Path(name).is_absolute():
            return Path(name)
        for folder in (*self.paths, self.folder):
            if (folder / name).exists():
                return folder / name
        return self.folder / name


def module() -> Any:
    """The module `mitsuba` with any variant.  Raises ReferenceUnavailableError."""
    try:
        mi = imported()
    except ReferenceUnavailableError as error:
        raise ReferenceUnavailableError(
            f"reading Mitsuba's scenes needs Mitsuba: {error}"
        ) from None
    if mi.variant() is None:
        mi.set_variant(VARIANT)
        mi.set_log_level(mi.LogLevel.Error)
    return mi


@contextmanager
def scalar() -> Iterator[Any]:
    """The module in the variant VARIANT."""
    mi = module()
    old = mi.variant()
    with warnings.catch_warnings():
        # Dr.Jit warns after many changes that defining plugins again is slow.
        warnings.simplefilter("ignore", RuntimeWarning)
        if old != VARIANT:
            mi.set_variant(VARIANT)
        try:
            yield mi
        finally:
            if old != VARIANT:
                mi.set_variant(old)


def parse_file(path: Path, defaults: Mapping[str, str]) -> Parsed:
    """Parse an .xml file;  defaults: values for its <default> elements.  Raises SceneError."""
    mi = module()
    folder = path.parent
    check_nesting(path, folder)
    old = mi.file_resolver()
    resolver = mi.FileResolver(old)
    resolver.prepend(str(folder))
    before = len(resolver)
    mi.set_file_resolver(resolver)
    try:
        state = _upgraded(
            mi, path, lambda config: mi.parser.parse_file(config, str(path), **defaults)
        )
        added = len(resolver) - before
        paths = tuple(Path(str(resolver[k])) for k in range(added))
    finally:
        mi.set_file_resolver(old)
    return Parsed(state, str(path), folder, paths, defaults, {})


def parse_dict(scene: Mapping[str, Any], folder: Path) -> Parsed:
    """Parse a dictionary for `mitsuba.load_dict`.  Raises SceneError."""
    mi = module()
    state = _upgraded(mi, None, lambda config: mi.parser.parse_dict(config, dict(scene)))
    return Parsed(state, "<dict>", folder, (), {}, {})


def _upgraded(mi: Any, path: Path | None, parse: Any) -> Any:
    config = mi.parser.ParserConfig(VARIANT)
    try:
        state = parse(config)
        mi.parser.transform_upgrade(config, state)
        mi.parser.transform_resolve_references(config, state)
    except (RuntimeError, TypeError, ValueError) as error:
        raise _scene_error(str(error), path) from None
    return state


_PLACE = re.compile(r"Error while loading (?P<file>.*?) \(line (?P<line>\d+), col (?P<col>\d+)\): ")
_FIRST = re.compile(
    r'^\[\w+\.cpp:\d+\] (Parsing of XML file ".*" failed|XML parsing failed): |'
    r"^\[\w+\.cpp:\d+\] "
)
_LAST = re.compile(r" \(line (?P<line>\d+), col (?P<col>\d+)\)$")


def _scene_error(message: str, path: Path | None) -> SceneError:
    """The error of Mitsuba's parser, its place in our form; of nested includes the innermost."""
    file, line, column = None if path is None else str(path), None, ""
    places = list(_PLACE.finditer(message))
    if places:
        found = places[-1]
        if path is not None:
            file = found["file"].strip('"')
        line, column = int(found["line"]), found["col"]
        message = message[found.end() :]
    elif last := _LAST.search(message):
        line, column = int(last["line"]), last["col"]
        message = message[: last.start()]
    text = " ".join(_FIRST.sub("", message, count=1).split())
    return SceneError((f"column {column}: " if column else "") + text, file=file, line=line)


class _TooDeepError(Exception):
    pass


def check_nesting(path: Path, folder: Path, depth: int = 0, files: int = 0) -> None:
    """Check that a file and its includes are regular files and nest less deep than MOST_NESTED.

    Everything else that is wrong with them, Mitsuba's parser says better.  Raises SceneError.
    """
    try:
        content = read_input(path, MOST_BYTES)
    except OSError as error:
        if depth == 0:
            raise SceneError(
                f"cannot be read: {error.strerror}; expected a scene file", file=str(path)
            ) from None
        return
    parser = xml.parsers.expat.ParserCreate()
    level, deepest, includes = 0, 0, list[str]()

    def start(name: str, attributes: dict[str, str]) -> None:
        nonlocal level, deepest
        level += 1
        deepest = max(deepest, level)
        if depth + level > MOST_NESTED:
            raise _TooDeepError
        if name == "include" and "filename" in attributes:
            includes.append(attributes["filename"])

    def end(name: str) -> None:
        nonlocal level
        level -= 1

    parser.StartElementHandler, parser.EndElementHandler = start, end
    try:
        parser.Parse(content, True)
    except _TooDeepError:
        raise SceneError(
            f"column {parser.CurrentColumnNumber + 1}: elements nest deeper than {MOST_NESTED}; "
            "expected fewer levels",
            file=str(path),
            line=parser.CurrentLineNumber,
        ) from None
    except (xml.parsers.expat.ExpatError, ValueError):
        pass
    for name in includes if files < 15 else ():  # Mitsuba's own limit of includes in each other
        for place in (path.parent / name, folder / name):
            if place.is_file():
                check_nesting(place, folder, depth + deepest, files + 1)
                break
