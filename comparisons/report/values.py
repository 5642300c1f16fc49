"""Values as text for people."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

SHOWN_ITEMS = 8
"""Of a list of numbers; `results.json` has them all."""


def shown(value: Any, name: str = "") -> str:
    """A value for people: four digits, powers of ten, percent where `name` ends in `_bias`."""
    match value:
        case None:
            return "–"
        case bool() | np.bool_():
            return "yes" if value else "no"
        case int() | np.integer():
            return f"{int(value):,}"
        case float() | np.floating():
            return percent(float(value)) if name.endswith("_bias") else _real(float(value))
        case Mapping():
            return ", ".join(f"{label(key)} {shown(item, name)}" for key, item in value.items())
        case np.ndarray():
            return shown(value.tolist(), name)
        case list() | tuple():
            rest = f", … ({len(value)} in all)" if len(value) > SHOWN_ITEMS else ""
            return ", ".join(shown(item, name) for item in value[:SHOWN_ITEMS]) + rest
        case _:
            return str(value)


def percent(fraction: float) -> str:
    """Three digits of a percentage."""
    return f"{_real(100.0 * fraction, '.3g')} %" if math.isfinite(fraction) else _real(fraction)


def label(name: object) -> str:
    """`worst_tile_x` -> `worst tile x`"""
    return str(name).replace("_", " ")


def _real(value: float, format_: str = ".4g") -> str:
    if math.isnan(value):
        return "undefined"
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    mantissa, _, exponent = f"{value:{format_}}".replace("-", "−").partition("e")
    if not exponent:
        return mantissa
    digits = str(int(exponent.replace("−", "-")))
    return f"{mantissa} × 10{digits.translate(str.maketrans('-0123456789', '⁻⁰¹²³⁴⁵⁶⁷⁸⁹'))}"
