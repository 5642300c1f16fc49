"""Parameters of materials written in Python: Mitsuba hands them textures as objects, colours and
numbers as they are."""

from collections.abc import Callable
from typing import Any

Parameter = Callable[[Any, Any], Any]
"""(interaction, mask) -> its value there."""


def colour(mi: Any, value: Any) -> Parameter:
    """A colour's value at an interaction."""
    if hasattr(value, "eval"):
        return lambda si, active: value.eval(si, active)
    constant = mi.Color3f(value)
    return lambda si, active: constant


def number(mi: Any, value: Any) -> Parameter:
    """A number's."""
    if hasattr(value, "eval_1"):
        return lambda si, active: value.eval_1(si, active)
    constant = mi.Float(float(value))
    return lambda si, active: constant


def is_wide(mi: Any) -> bool:
    """Whether the variant takes many rays at once."""
    return not str(mi.variant()).startswith("scalar")
