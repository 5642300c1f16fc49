"""Elements of a Mitsuba scene file, and their XML with every bit of their numbers."""

from dataclasses import dataclass, field
from typing import Any, NamedTuple
from xml.sax.saxutils import quoteattr

from comparisons.mitsuba.reading.written import LookAt, Step
from reference_rt.core.transform import Affine


class Rgb(NamedTuple):
    """A colour, linear sRGB."""

    r: float
    g: float
    b: float


class Vector(NamedTuple):
    """A point or a direction."""

    x: float
    y: float
    z: float


class Reference(NamedTuple):
    """Another element, by its id."""

    id: str


@dataclass
class Element:
    """An element: its tag, such as "bsdf", its plugin, its parameters, its nested elements that
    have no name, and its id."""

    tag: str
    plugin: str
    values: dict[str, Any] = field(default_factory=dict)
    children: list["Element | Reference"] = field(default_factory=list)
    id: str = ""

    def lines(self, name: str = "", indent: str = "    ") -> list[str]:
        """The element as XML;  name: of the parameter that it is."""
        attributes = {"type": self.plugin, "id": self.id, "name": name}
        start = self.tag + _attributes({k: v for k, v in attributes.items() if v})
        inside = [line for key, value in self.values.items() for line in _lines(key, value)]
        for child in self.children:
            inside += [_reference(child, "")] if isinstance(child, Reference) else child.lines()
        if not inside:
            return [f"<{start}/>"]
        return [f"<{start}>", *(indent + line for line in inside), f"</{self.tag}>"]


def _lines(name: str, value: Any) -> list[str]:
    """A parameter as XML."""
    match value:
        case bool():
            return [_simple("boolean", name, str(value).lower())]
        case int():
            return [_simple("integer", name, str(value))]
        case float():
            return [_simple("float", name, repr(value))]
        case str():
            return [_simple("string", name, value)]
        case Rgb():
            return [_simple("rgb", name, _numbers(value))]
        case Vector():
            return [_simple("vector", name, _numbers(value))]
        case Reference():
            return [_reference(value, name)]
        case Element():
            return value.lines(name)
        case tuple():
            steps = ("    " + _step(step) for step in value)
            return [f"<transform{_attributes({'name': name})}>", *steps, "</transform>"]
    raise TypeError(f"no XML for {type(value).__name__}")


def _simple(tag: str, name: str, value: str) -> str:
    return f"<{tag}{_attributes({'name': name, 'value': value})}/>"


def _reference(value: Reference, name: str) -> str:
    return f"<ref{_attributes({'id': value.id, **({'name': name} if name else {})})}/>"


def _step(step: Step | LookAt) -> str:
    if isinstance(step, LookAt):
        vectors = {"origin": step.origin, "target": step.target, "up": step.up}
        return f"<lookat{_attributes({key: _numbers(v) for key, v in vectors.items()})}/>"
    if step.kind == "matrix":
        return f"<matrix{_attributes({'value': _numbers((*step.numbers, 0.0, 0.0, 0.0, 1.0))})}/>"
    named = zip("xyz", step.numbers, strict=False)
    values = {key: repr(float(value)) for key, value in named}
    if step.kind == "rotate":
        values["angle"] = repr(float(step.numbers[3]))
    return f"<{step.kind}{_attributes(values)}/>"


def _numbers(values: Any) -> str:
    return " ".join(repr(float(x)) for x in values)


def _attributes(values: dict[str, str]) -> str:
    return "".join(f" {key}={quoteattr(value)}" for key, value in values.items())


def matrix_step(m: Affine) -> Step:
    """A map (3, 4) as a step."""
    return Step("matrix", tuple(float(x) for x in m.ravel()))


__all__ = ["Element", "Reference", "Rgb", "Vector", "matrix_step"]
