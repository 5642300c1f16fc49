"""Transforms as their author wrote them: scales, rotations, translations and points to look at.

Mitsuba's parser multiplies them.  Our scenes keep the author's numbers where they say the same, so
that what is converted stays legible, and what we have written is read to the same bits.
"""

import codecs
import re
import xml.parsers.expat
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from reference_rt.core.transform import Affine, compose, rotate, scale, translate

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
        parser.Parse(_as_utf8(path.read_bytes()), True)
    except (OSError, ValueError, xml.parsers.expat.ExpatError):
        return {}
    return reader.found


_LATIN = re.compile(rb"<\?xml[^>]*encoding\s*=\s*[\"'](iso-8859-1|latin1)[\"']", re.IGNORECASE)


def _as_utf8(content: bytes) -> bytes:
    """A file as Mitsuba's parser converts it, with its byte order mark.  Raises ValueError."""
    for mark, encoding in (
        (codecs.BOM_UTF16_LE, "utf-16-le"),
        (codecs.BOM_UTF16_BE, "utf-16-be"),
    ):
        if content.startswith(mark):
            return content.decode(encoding).encode()
    return content.decode("latin-1").encode() if _LATIN.match(content) else content


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
        self.found: dict[int, dict[str, Written]] = {}
        self.elements: list[int] = []
        self.name: str | None = None  # of the transform that is being read
        self.steps: list[Step | LookAt] = []
        self.is_known = True
        self.place: Callable[[], int] = lambda: 0

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        if self.name is not None:
            self._step(tag, attributes)
        elif tag == "transform":
            self.name, self.steps, self.is_known = attributes.get("name", ""), [], True
        elif tag == "default":
            self.values.setdefault(attributes.get("name", ""), attributes.get("value", ""))
        self.elements.append(self.place())

    def end(self, tag: str) -> None:
        self.elements.pop()
        if tag == "transform" and self.name is not None:
            if self.is_known and self.elements:
                self.found.setdefault(self.elements[-1], {})[self.name] = tuple(self.steps)
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
                found: Step | LookAt = Step(tag, vector(0.0))
            case "scale":
                found = Step(tag, vector(1.0))
            case "rotate":
                (angle,) = numbers.pop("angle")
                found = Step(tag, (*vector(0.0), angle))
            case "matrix":
                found = Step(tag, _rows(numbers.pop("value")))
            case "lookat":
                origin, target, up = (numbers.pop(key) for key in ("origin", "target", "up"))
                found = LookAt(_triple(origin), _triple(target), _triple(up))
            case _:
                raise ValueError(tag)
        if numbers:
            raise ValueError("unknown attributes")
        return found

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
