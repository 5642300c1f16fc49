"""What every description in a scene file is made of: the frozen base model and the field types."""

import ast
import inspect
import math
import textwrap
from itertools import pairwise
from typing import Annotated, Any, ClassVar

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetJsonSchemaHandler,
    Strict,
    WithJsonSchema,
)


class Description(BaseModel):
    """A frozen part of a scene.  Unknown keys, wrong types, NaN and infinity are errors."""

    model_config: ClassVar[ConfigDict] = ConfigDict(
        frozen=True, extra="forbid", strict=True, allow_inf_nan=False
    )

    @classmethod
    def __get_pydantic_json_schema__(
        cls, core_schema: Any, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """The schema, with the strings below the fields as their descriptions.

        `use_attribute_docstrings` would parse all sources whenever they are imported: 0.13 s of
        every start.
        """
        schema = handler(core_schema)
        properties = handler.resolve_ref_schema(schema).get("properties", {})
        for model in reversed(cls.__mro__):
            if issubclass(model, Description):
                for field, text in _strings_below(model).items():
                    if field in properties:
                        properties[field]["description"] = text
        return schema


def _strings_below(cls: type) -> dict[str, str]:
    """The string that stands below each annotated name in the body of a class."""
    (tree,) = ast.parse(textwrap.dedent(inspect.getsource(cls))).body
    assert isinstance(tree, ast.ClassDef)
    return {
        line.target.id: inspect.cleandoc(below.value.value)
        for line, below in pairwise(tree.body)
        if isinstance(line, ast.AnnAssign)
        and isinstance(line.target, ast.Name)
        and isinstance(below, ast.Expr)
        and isinstance(below.value, ast.Constant)
        and isinstance(below.value.value, str)
    }


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
