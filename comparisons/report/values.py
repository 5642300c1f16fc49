"""Values as text for people."""

import math
import re
from collections.abc import Mapping
from typing import Any

import numpy as np
from markupsafe import Markup

SHOWN_ITEMS = 8
"""Numbers shown of a list; `results.json` has all of them."""


def shown(value: Any, name: str = "") -> str:
    """A value for people: four digits, powers of ten; percent if `name` ends in `_bias`."""
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


def rows_of(numbers: Mapping[str, Any], level: int = 0) -> list[tuple[int, str, list[str]]]:
    """Numbers as rows of a table: (indentation, label, cells); cells are one text, or three for
    red, green and blue; none for the heading of the rows below it, which are indented."""
    rows = []
    for name, value in numbers.items():
        if isinstance(value, Mapping) and set(value) == set("RGB"):
            rows.append((level, label(name), [shown(value[key], name) for key in "RGB"]))
        elif isinstance(value, Mapping) and value and level < _DEEPEST:
            rows.append((level, label(name), []))
            rows += rows_of(value, level + 1)
        else:
            rows.append((level, label(name), [shown(value, name)]))
    return rows


_DEEPEST = 2
"""Levels of indentation; numbers that are nested deeper are one text."""


def percent(fraction: float) -> str:
    """A fraction as a percentage with three digits."""
    return f"{_real(100.0 * fraction, '.3g')} %" if math.isfinite(fraction) else _real(fraction)


def flip(value: float) -> str:
    """A mean of FLIP, from 0 to 1, with three decimals."""
    return "< 0.001" if 0.0 < value < 0.0005 else f"{value:.3f}" if value == value else "undefined"


def soft(name: str) -> Markup:
    """A name or a command that may be broken behind its underscores and slashes."""
    return Markup("<wbr>").join(re.split("(?<=[_/])(?=[^_/])", name))


def label(name: object) -> str:
    """A key such as `p_value` in words: p value."""
    return str(name).replace("_", " ")


def typeset(text: str) -> str:
    """Formulas in plain text with the signs of print: 1e-6 -> 10⁻⁶, 2^40 -> 2⁴⁰, <= -> ≤."""
    text = re.sub(r"\b(\d+(?:\.\d+)?)e([+-]?\d+)\b", _printed_power, text)
    text = re.sub(r"\^(-?\d+)(?![\d.]*\w)", lambda found: _raised(int(found[1])), text)
    for plain, printed in (("<=", "≤"), (">=", "≥"), (" - ", " − ")):
        text = text.replace(plain, printed)
    return text


def _printed_power(found: re.Match[str]) -> str:
    mantissa = "" if found[1] == "1" else f"{found[1]} × "
    return f"{mantissa}10{_raised(int(found[2]))}"


def _real(value: float, format_: str = ".4g") -> str:
    if math.isnan(value):
        return "undefined"
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    mantissa, _, exponent = f"{value:{format_}}".replace("-", "−").partition("e")
    if not exponent:
        return mantissa
    return f"{mantissa} × 10{_raised(int(exponent.replace('−', '-')))}"


def _raised(exponent: int) -> str:
    return str(exponent).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def power_of_ten(value: float) -> str:
    """A positive tick of a logarithmic axis: 0.01, 200, 10⁵, 2 × 10⁻⁴."""
    if 1e-3 <= value < 1e4:
        return f"{value:g}"
    exponent = math.floor(math.log10(value) + 1e-9)  # a tick is a round number, to rounding
    mantissa = f"{value / 10.0**exponent:.2g}"
    return f"10{_raised(exponent)}" if mantissa == "1" else f"{mantissa} × 10{_raised(exponent)}"
