"""What every description in a scene file is made of: the frozen base model and the field types."""

import math
from typing import Annotated, Any, ClassVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, Strict, WithJsonSchema


class Description(BaseModel):
    """A frozen part of a scene.  Unknown keys, wrong types, NaN and infinity are errors."""

    model_config: ClassVar[ConfigDict] = ConfigDict(
        frozen=True, extra="forbid", strict=True, allow_inf_nan=False, use_attribute_docstrings=True
    )


def _three_numbers(value: Any) -> Any:
    is_number = [isinstance(x, int | float) and not isinstance(x, bool) for x in _items(value)]
    if len(is_number) != 3 or not all(is_number):
        raise ValueError("expected three numbers [x, y, z]")
    try:
        return tuple(float(x) for x in value)
    except OverflowError:
        raise ValueError("expected finite numbers") from None


def colour(value: Any) -> Any:
    """Linear sRGB of at least 0 from one number or three.  Raises ValueError."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        value = (value, value, value)
    try:
        rgb = _three_numbers(value)
    except ValueError:
        raise ValueError("expected one number or three [r, g, b] (linear sRGB)") from None
    if not all(x >= 0.0 for x in rgb):  # also refuses NaN
        raise ValueError("expected numbers of at least 0")
    return rgb


def reflectance(value: Any) -> Any:
    """The same, of at most 1."""
    rgb = colour(value)
    if max(rgb) > 1.0:
        raise ValueError("expected numbers from 0 to 1: more would create energy")
    return rgb


def _unit_free_direction(value: Any) -> Any:
    v = _three_numbers(value)
    if not 0.0 < math.hypot(*v) < math.inf:
        raise ValueError("expected a direction, which is not zero and of a finite length")
    return v


def _items(value: Any) -> list[Any]:
    return list(value) if isinstance(value, list | tuple) else []


_Triple = Annotated[tuple[float, float, float], Strict(False)]
_VECTOR = {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3}


def colour_schema(maximum: float | None) -> dict[str, Any]:
    """The JSON Schema of a colour of at most `maximum`."""
    number: dict[str, Any] = {"type": "number", "minimum": 0}
    if maximum is not None:
        number["maximum"] = maximum
    return {"anyOf": [number, {**_VECTOR, "items": number}]}


Vector = Annotated[_Triple, BeforeValidator(_three_numbers), WithJsonSchema(_VECTOR)]
"""[x, y, z] in scene units."""

Direction = Annotated[_Triple, BeforeValidator(_unit_free_direction), WithJsonSchema(_VECTOR)]
"""[x, y, z], not zero, of any length."""

Colour = Annotated[_Triple, BeforeValidator(colour), WithJsonSchema(colour_schema(None))]
"""Linear sRGB, each at least 0; a single number stands for grey."""

Reflectance = Annotated[_Triple, BeforeValidator(reflectance), WithJsonSchema(colour_schema(1.0))]
"""Linear sRGB, each from 0 to 1; a single number stands for grey."""

Positive = Annotated[float, Field(gt=0)]
