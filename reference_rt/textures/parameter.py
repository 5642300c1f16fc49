"""Material parameters: a colour or a number, or the name of one of the scene's textures."""

from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import BeforeValidator, Strict, WithJsonSchema

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.model import Description, colour, colour_schema, reflectance
from reference_rt.core.vec3 import Vec3, luminance, row
from reference_rt.jit.kernel import kernel
from reference_rt.textures.lookup import At, lookup
from reference_rt.textures.texture import MayBeTexture


def _or_name(value_of: Callable[[Any], Any]) -> BeforeValidator:
    return BeforeValidator(lambda value: value if isinstance(value, str) else value_of(value))


def _number(least: float, most: float) -> Callable[[Any], float]:
    def check(value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ValueError("expected a number, or the name of a texture")
        if not least <= value <= most:
            raise ValueError(f"expected a number from {least:g} to {most:g}")
        return float(value)

    return check


def _schema(value: dict[str, Any]) -> WithJsonSchema:
    name = {"type": "string", "description": "the name of a texture"}
    return WithJsonSchema({"anyOf": [value, name]})


_Colour = Annotated[tuple[float, float, float], Strict(False)]

ReflectanceParameter = Annotated[
    _Colour | str, MayBeTexture(), _or_name(reflectance), _schema(colour_schema(1.0))
]
"""Linear sRGB, each from 0 to 1; a single number stands for grey, a string names a texture."""

ColourParameter = Annotated[
    _Colour | str, MayBeTexture(), _or_name(colour), _schema(colour_schema(None))
]
"""Linear sRGB, each at least 0; or the name of a texture."""

UnitParameter = Annotated[
    float | str,
    MayBeTexture(),
    _or_name(_number(0.0, 1.0)),
    _schema({"type": "number", "minimum": 0, "maximum": 1}),
]
"""A number from 0 to 1, or the name of a texture, of which the luminance is used."""

DoubleUnitParameter = Annotated[
    float | str,
    MayBeTexture(),
    _or_name(_number(0.0, 2.0)),
    _schema({"type": "number", "minimum": 0, "maximum": 2}),
]
"""The same from 0 to 2."""

TextureName = Annotated[str, MayBeTexture()]
"""The name of a texture."""


def texture_names(description: Description) -> dict[tuple[str | int, ...], str]:
    """The names of the textures that a description's fields refer to, by key path: the field, and
    for one of several values its number."""
    found: dict[tuple[str | int, ...], str] = {}
    for field, info in type(description).__pydantic_fields__.items():
        value = getattr(description, field)
        if not any(isinstance(m, MayBeTexture) for m in info.metadata):
            continue
        if isinstance(value, str):
            found[(field,)] = value
        elif isinstance(value, tuple):
            found |= {(field, k): x for k, x in enumerate(value) if isinstance(x, str)}
    return found


class Colours(NamedTuple):
    """A column of colours for n materials: value (n, 3);  texture (n,): index of the texture that
    replaces the value, -1 for none."""

    value: FloatArray
    texture: IntArray


class Numbers(NamedTuple):
    """A column of numbers, as `Colours`: value (n,)."""

    value: FloatArray
    texture: IntArray


class Palette:
    """The scene's textures by name: turns parameters into rows of `Colours` and `Numbers`."""

    def __init__(self, numbers: Mapping[str, int], greatest: Sequence[float]) -> None:
        """numbers: each texture's index, by name;  greatest: the largest value of each texture."""
        self.numbers_of, self.greatest = numbers, greatest

    def colours(self, value: tuple[float, float, float] | str, most: float = 1.0) -> Colours:
        """One row.  Raises ValueError for a texture with values above `most`."""
        if isinstance(value, str):
            return Colours(np.zeros((1, 3)), np.array([self.number(value, most)]))
        return Colours(np.array([value], dtype=np.float64), np.array([-1]))

    def numbers(self, value: float | str, most: float = 1.0) -> Numbers:
        """One row.  Raises ValueError for a texture with values above `most`."""
        if isinstance(value, str):
            return Numbers(np.zeros(1), np.array([self.number(value, most)]))
        return Numbers(np.array([value], dtype=np.float64), np.array([-1]))

    def brightest(self, value: tuple[float, float, float] | str) -> float:
        """A colour's luminance; of a texture an upper bound, its largest value."""
        if isinstance(value, str):
            return float(self.greatest[self.numbers_of[value]])
        return float(luminance(Vec3(*value)))

    def number(self, name: str, most: float) -> int:
        """The index of the texture `name`.  Raises ValueError if it has values above `most`."""
        k = self.numbers_of[name]
        if self.greatest[k] > most:
            raise ValueError(
                f"the texture '{name}' has values up to {self.greatest[k]:.6g}; "
                f"expected at most {most:g}"
            )
        return k


NO_TEXTURES = Palette({}, ())


def join(parts: Sequence[Any]) -> Any:
    """Concatenates tables of one class, nested tables too."""
    first = parts[0]
    if not isinstance(first, tuple):
        return np.ascontiguousarray(np.concatenate(parts))
    return type(first)(*(join(column) for column in zip(*parts, strict=True)))


def joined(module: Any, tables: Sequence[Any]) -> Any:
    """One table of several of a type: by the `join` of the type's module, if it has one."""
    return getattr(module, "join", join)(tables)


@kernel
def colour_at(colours: Colours, i: int, at: At) -> Vec3:
    """The colour of row i at a point of a surface."""
    if colours.texture[i] < 0:
        return row(colours.value, i)
    return lookup(colours.texture[i], at)


@kernel
def number_at(numbers: Numbers, i: int, at: At) -> float:
    """The number of row i at a point of a surface: for a texture its luminance."""
    if numbers.texture[i] < 0:
        return float(numbers.value[i])
    return luminance(lookup(numbers.texture[i], at))
