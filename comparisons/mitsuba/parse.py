"""Parsing Mitsuba scenes with Mitsuba's own parser; its errors as `SceneError`s; and transforms as
their author wrote them."""

import re
import xml.parsers.expat
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from comparisons.mitsuba.backend import imported, set_variant
from comparisons.mitsuba.included import OLD_ELEMENT, Included, Note, adapt, as_utf8
from reference_rt.core.transform import Affine, compose, rotate, scale, translate
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import ReferenceUnavailableError, SceneError
from reference_rt.util.files import temporary_folder

# ---- transforms as their author wrote them -------------------------------------------------------
# Mitsuba's parser multiplies scales, rotations, translations and points to look at. Our scenes keep
# the author's numbers where they say the same, so that what is converted stays legible, and what we
# have written is read to the same bits.


Triple = tuple[float, float, float]

TOLERANCE = 1e-12
"""Relative: Mitsuba's parser multiplies in float64.  Only what differs by its rounding is taken."""


class Step(NamedTuple):
    """kind: "translate", "scale", "rotate" or "matrix";  numbers: 3, for rotations axis and
    degrees, for matrices the first three rows."""

    kind: str
    numbers: tuple[float, ...]

    def affine(self) -> Affine:
        """(3, 4)."""
        x, y, z = self.numbers[:3]
        if self.kind == "translate":
            return translate((x, y, z))
        if self.kind == "scale":
            return scale((x, y, z))
        if self.kind == "rotate":
            return rotate((x, y, z), self.numbers[3])
        return np.array(self.numbers).reshape(3, 4)


class LookAt(NamedTuple):
    """Of a camera or a light."""

    origin: Triple
    target: Triple
    up: Triple


FLIP = (Step("scale", (1.0, -1.0, 1.0)), Step("translate", (0.0, 1.0, 0.0)))
"""(u, v) -> (u, 1 - v): Mitsuba's images begin with the top row, ours with the bottom one.  Our
scene files say so in these steps."""

Written = tuple["Step | LookAt", ...]

Transforms = Mapping[int, Mapping[str, Written]]
"""The transforms of a file's elements by the offset of the element's name in the file as UTF-8, as
Mitsuba's parser counts, and by their own name."""


def transforms_of(path: Path, defaults: Mapping[str, str]) -> Transforms:
    """The transforms of a file;  defaults: values for its <default> elements.  Empty for a file
    that is no XML, and without those that are written in any other way."""
    reader = _Reader(dict(defaults))
    parser = xml.parsers.expat.ParserCreate("utf-8")
    reader.place = lambda: parser.CurrentByteIndex + 1  # after "<"
    parser.StartElementHandler, parser.EndElementHandler = reader.start, reader.end
    try:
        parser.Parse(as_utf8(path.read_bytes()), True)
    except (OSError, ValueError, xml.parsers.expat.ExpatError):
        return {}
    return reader.written


def as_transform(steps: Written | None, m: Affine) -> tuple[dict[str, Any], ...]:
    """The map m (3, 4) as our transform: the author's steps if they make it, else a matrix."""
    if np.array_equal(m, np.eye(3, 4)) and not steps:
        return ()
    own = tuple(step for step in steps or () if isinstance(step, Step))
    if not own or len(own) < len(steps or ()) or not agrees(own, m):
        return ({"matrix": m.tolist()},)
    return tuple(_as_step(step) for step in own)


def _as_step(step: Step) -> dict[str, Any]:
    if step.kind == "rotate":
        return {"rotate": {"axis": step.numbers[:3], "degrees": step.numbers[3]}}
    if step.kind == "matrix":
        return {"matrix": np.array(step.numbers).reshape(3, 4).tolist()}
    return {step.kind: step.numbers}


def agrees(steps: tuple[Step, ...], m: Affine) -> bool:
    """Whether steps make the map m (3, 4), to rounding: not if a rotation's axis is no unit vector,
    which Mitsuba takes for one."""
    try:
        product = compose(*(step.affine() for step in steps))
    except (ValueError, ZeroDivisionError):
        return False
    return bool(np.abs(product - m).max() <= TOLERANCE * np.abs(m).max())


class _Reader:
    """Handlers of expat's parser."""

    def __init__(self, values: dict[str, str]) -> None:
        self.values = values
        self.written: dict[int, dict[str, Written]] = {}
        self.elements: list[int] = []
        self.name: str | None = None  # of the transform that is being read
        self.steps: list[Step | LookAt] = []
        self.is_known = True
        self.place: Callable[[], int] = lambda: 0

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        if self.name is not None:
            self._step(tag, attributes)
        elif tag == "transform":
            name = re.sub("(?<=[a-z])[A-Z]", r"_\g<0>", attributes.get("name", "")).lower()
            self.name, self.steps, self.is_known = name, [], True  # "toWorld" of Mitsuba 0.x, too
        elif tag == "default":
            self.values.setdefault(attributes.get("name", ""), attributes.get("value", ""))
        self.elements.append(self.place())

    def end(self, tag: str) -> None:
        self.elements.pop()
        if tag == "transform" and self.name is not None:
            if self.is_known and self.elements:
                self.written.setdefault(self.elements[-1], {})[self.name] = tuple(self.steps)
            self.name = None

    def _step(self, tag: str, attributes: dict[str, str]) -> None:
        try:
            self.steps.append(self._read(tag, attributes))
        except (KeyError, ValueError):
            self.is_known = False

    def _read(self, tag: str, attributes: dict[str, str]) -> Step | LookAt:
        """Raises KeyError, ValueError for what Mitsuba reads in a way that is not known here."""
        numbers = {key: self._numbers(value) for key, value in attributes.items()}

        def vector(default: float) -> Triple:
            if "value" in numbers:
                one = numbers.pop("value")
                x, y, z = one * 3 if len(one) == 1 else one
            else:
                (x,), (y,), (z,) = (numbers.pop(axis, [default]) for axis in "xyz")
            return x, y, z

        match tag:
            case "translate":
                step: Step | LookAt = Step(tag, vector(0.0))
            case "scale":
                step = Step(tag, vector(1.0))
            case "rotate":
                (angle,) = numbers.pop("angle")
                step = Step(tag, (*vector(0.0), angle))
            case "matrix":
                step = Step(tag, _rows(numbers.pop("value")))
            case "lookat" | "lookAt":
                origin, target, up = (numbers.pop(key) for key in ("origin", "target", "up"))
                step = LookAt(_triple(origin), _triple(target), _triple(up))
            case _:
                raise ValueError(tag)
        if numbers:
            raise ValueError("unknown attributes")
        return step

    def _numbers(self, text: str) -> list[float]:
        known = re.sub(r"\$(\w+)", lambda name: self.values[name[1]], text)
        return [float(word) for word in known.replace(",", " ").split()]


def _triple(numbers: list[float]) -> Triple:
    x, y, z = numbers
    return x, y, z


def _rows(numbers: list[float]) -> tuple[float, ...]:
    """The first three rows of an affine matrix (4, 4), or of (3, 3) with the origin fixed."""
    if len(numbers) == 9:
        rows = [[*numbers[k : k + 3], 0.0] for k in (0, 3, 6)]
        return tuple(x for row in rows for x in row)
    if len(numbers) != 16 or numbers[12:] != [0.0, 0.0, 0.0, 1.0]:
        raise ValueError("no affine matrix")
    return tuple(numbers[:12])


# ---- Mitsuba's parser ----------------------------------------------------------------------------


VARIANT = "scalar_rgb"
"""The variant whose conversions of colours we take over: those of all rgb variants are the same."""


class Parsed(NamedTuple):
    """Mitsuba's description of a scene, in which nothing is instantiated.

    state: `mitsuba.parser.ParserState`, upgraded to Mitsuba 3 and its references resolved;  file:
    the name for messages;  folder: where relative file names count from, first;  resolve: the
    file that Mitsuba finds for a name;  defaults: values for <default> elements;  written: see
    `transforms`;  notes: what `adapt` has changed;  left_out: a line for each kind of element
    that Mitsuba does not know.
    """

    state: Any
    file: str
    folder: Path
    paths: tuple[Path, ...]
    defaults: Mapping[str, str]
    written: dict[str, Transforms]
    notes: list[Note]
    left_out: Collection[str] = ()

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
    set_variant(mi, VARIANT)
    try:
        yield mi
    finally:
        set_variant(mi, old)


_UNKNOWN = re.compile(r"encountered an unsupported XML element: (<[\w.:-]+>)")
_LEFT_OUT = re.compile(r"<([\w.:-]+)>: is not supported$")


def file_of(scene: Scene) -> Path | None:
    """The .xml file that a scene was read from; None for our own scenes."""
    path = scene.source_file
    return path if path is not None and path.suffix.lower() == ".xml" else None


def parse_file(path: Path, defaults: Mapping[str, str], allow_missing: bool = False) -> Parsed:
    """Parse an .xml file;  defaults: values for its <default> elements;  allow_missing: whether to
    leave out elements that Mitsuba does not know, such as those of its forks.  Raises SceneError.
    """
    check = Included(path.parent, dict(defaults))
    check.read(path, path.name, (), 0)
    unknown: dict[str, str] = {}
    while True:
        try:
            parsed = _parse_file(path, defaults, check, unknown)
            return parsed._replace(left_out=list(unknown.values()))
        except SceneError as error:
            match = _LEFT_OUT.search(error.message)
            if not allow_missing or match is None or match[1] in unknown:
                raise
            unknown[match[1]] = f"{error}, and left out on both sides"


def _parse_file(
    path: Path, defaults: Mapping[str, str], check: Included, unknown: Collection[str]
) -> Parsed:
    """unknown: the names of elements that are left out."""
    mi = module()
    folder = path.parent
    old = mi.file_resolver()
    resolver = mi.FileResolver(old)
    resolver.prepend(str(folder))
    with temporary_folder() as copies:
        start = path
        if check.is_old or unknown:  # Mitsuba's parser finds the copies first
            resolver.prepend(str(copies))
            for name, (_, content) in check.copied.items():
                copy = Path(copies, name)
                copy.parent.mkdir(parents=True, exist_ok=True)
                copy.write_bytes(_without(unknown, OLD_ELEMENT.sub(rb"\1lookat", content)))
            start = Path(copies, path.name)
        before = len(resolver)
        mi.set_file_resolver(resolver)
        try:
            state, notes = _upgraded(
                mi, path, lambda config: mi.parser.parse_file(config, str(start), **defaults)
            )
            added = len(resolver) - before
            paths = tuple(Path(str(resolver[k])) for k in range(added))
        except SceneError as error:
            inside = error.file is not None and Path(error.file).is_relative_to(copies)
            name = str(Path(error.file or "").relative_to(copies)) if inside else ""
            file = str(check.copied[name][0]) if inside else error.file
            message = error.message.replace(str(copies), str(folder))
            raise SceneError(message, file=file, line=error.line) from None
        finally:
            mi.set_file_resolver(old)
        own = {str(Path(copies, name)): str(place) for name, (place, _) in check.copied.items()}
        state.files = [own.get(str(file), str(file)) for file in state.files]
    if check.is_old:
        notes.insert(0, (0, "<lookAt> of Mitsuba 0.x is read as <lookat>, on both sides"))
    return Parsed(state, str(path), folder, paths, defaults, {}, notes)


def _without(names: Collection[str], content: bytes) -> bytes:
    """A file without the elements of these names; its lines keep their numbers."""
    for name in names:
        word = re.escape(name.encode())
        element = rb"<%b(\s[^>]*)?/>|<%b(\s[^>]*)?>.*?</%b\s*>" % (word, word, word)
        lines = re.compile(element, re.DOTALL)
        content = lines.sub(lambda comment: b"\n" * comment[0].count(b"\n"), content)
    return content


def parse_dict(scene: Mapping[str, Any], folder: Path) -> Parsed:
    """Parse a dictionary for `mitsuba.load_dict`.  Raises SceneError."""
    mi = module()
    state, notes = _upgraded(mi, None, lambda config: mi.parser.parse_dict(config, dict(scene)))
    return Parsed(state, "<dict>", folder, (), {}, {}, notes)


def _upgraded(mi: Any, path: Path | None, parse: Any) -> tuple[Any, list[Note]]:
    config = mi.parser.ParserConfig(VARIANT)
    try:
        state = parse(config)
        mi.parser.transform_upgrade(config, state)
        mi.parser.transform_resolve_references(config, state)
    except (RuntimeError, TypeError, ValueError) as error:
        raise _scene_error(str(error), path) from None
    return state, adapt(mi, state)


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
        place = places[-1]
        if path is not None:
            file = place["file"].strip('"')
        line, column = int(place["line"]), place["col"]
        message = message[place.end() :]
    elif last := _LAST.search(message):
        line, column = int(last["line"]), last["col"]
        message = message[: last.start()]
    text = " ".join(_FIRST.sub("", message, count=1).split())
    text = _UNKNOWN.sub(r"\1: is not supported", text)
    return SceneError((f"column {column}: " if column else "") + text, file=file, line=line)
