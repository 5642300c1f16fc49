"""Values in the types of strict JSON (RFC 8259)."""

import dataclasses
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np


def plain(value: Any, not_finite: Callable[[float], Any] = lambda value: None) -> Any:
    """`value` in JSON's types: NumPy types become Python's, dataclasses objects, and numbers that
    are not finite what `not_finite` makes of them."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = dataclasses.fields(value)
        return {field.name: plain(getattr(value, field.name), not_finite) for field in fields}
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist(), not_finite)
    if isinstance(value, Mapping):
        return {str(key): plain(item, not_finite) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item, not_finite) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return not_finite(value)
    return value
