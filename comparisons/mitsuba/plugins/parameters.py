"""Parameters of material plugins: Mitsuba passes textures as objects, colours and numbers as plain
values."""

from collections.abc import Callable
from typing import Any

Parameter = Callable[[Any, Any], Any]
"""(interaction, mask) -> the parameter's value there."""


def colour(mi: Any, value: Any) -> Parameter:
    """A parameter that is a colour."""
    if hasattr(value, "eval"):
        return lambda si, active: value.eval(si, active)
    constant = mi.Color3f(value)
    return lambda si, active: constant


def number(mi: Any, value: Any) -> Parameter:
    """A parameter that is a number."""
    if hasattr(value, "eval_1"):
        return lambda si, active: value.eval_1(si, active)
    constant = mi.Float(float(value))
    return lambda si, active: constant


def is_wide(mi: Any) -> bool:
    """Whether the current variant processes many rays at once."""
    return not str(mi.variant()).startswith("scalar")
