"""NumPy in descriptions: conversion of arrays to numbers and lists, and fields that keep arrays.

Scene files contain plain data.  Python code may pass arrays: NumPy's, and those of any library
whose objects have the method `__array__`.
"""

import hashlib
import os
from collections.abc import Callable
from functools import cache
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt
from pydantic import PlainSerializer, PlainValidator, SerializationInfo, WithJsonSchema

AS_DIGEST = {"arrays": "digest"}
"""The context of `model_dump_json` that writes an array as a digest of its content: descriptions
are compared without writing millions of numbers."""


def plain(value: Any) -> Any:
    """`value` with arrays and NumPy scalars replaced by Python's numbers and lists, and paths by
    strings, at any depth in lists, tuples and dictionaries.

    Arrays of anything but numbers, booleans and strings stay as they are: strict validation then
    reports them with their keys.
    """
    convert = _converter(type(value))  # type: ignore[arg-type]
    return value if convert is None else convert(value)


@cache
def _converter(kind: type) -> Callable[[Any], Any] | None:
    """The function that makes values of a type plain; None for types that need no conversion."""
    if kind is list or kind is tuple:
        return lambda value: kind([plain(item) for item in value])
    if kind is dict:
        return lambda value: {key: plain(item) for key, item in value.items()}
    if issubclass(kind, os.PathLike):
        return os.fspath
    if issubclass(kind, np.ndarray | np.generic):
        return _listed
    if hasattr(kind, "__array__"):
        return lambda value: _listed(np.asarray(value))
    return None


def _listed(array: Any) -> Any:
    if array.dtype.kind not in "biufU":
        return array
    if array.dtype.kind == "f" and array.dtype.itemsize > 8:  # longdouble has no Python number
        array = array.astype(np.float64)
    return array.tolist()


def _rows(width: int, integers: bool) -> Callable[[Any], npt.NDArray[Any]]:
    kinds, dtype = ("iu", np.int64) if integers else ("iuf", np.float64)
    numbers = "integers" if integers else "finite numbers"
    expected = f"expected an (n, {width}) array, or a list of n rows, of {numbers}"

    def check(value: Any) -> npt.NDArray[Any]:
        try:
            found = value if isinstance(value, np.ndarray) else np.asarray(value)
        except (ValueError, TypeError):  # rows of different lengths
            raise ValueError(expected) from None
        if found.ndim != 2 or found.shape[1] != width or found.dtype.kind not in kinds:
            raise ValueError(f"{expected}, got {found.dtype} of shape {found.shape}")
        if isinstance(found, np.ma.MaskedArray) and np.ma.is_masked(found):
            raise ValueError(f"{expected}, got a masked array")
        array = np.array(found, dtype, order="C", subok=False)
        finite = np.isfinite(array).all(axis=1)
        if not finite.all():
            raise ValueError(f"{expected}; row {int(np.argmin(finite))} is not finite")
        array.flags.writeable = False
        return array

    return check


def _written(array: npt.NDArray[Any], info: SerializationInfo) -> Any:
    if info.context == AS_DIGEST:
        content = hashlib.sha256(array.tobytes()).hexdigest()
        return f"{array.dtype} {array.shape} {content}"
    return array.tolist()


def _schema(width: int, item: str) -> WithJsonSchema:
    row = {"type": "array", "items": {"type": item}, "minItems": width, "maxItems": width}
    return WithJsonSchema({"type": "array", "items": row})


_AS_LISTS = PlainSerializer(_written, when_used="json")

Floats2 = Annotated[
    npt.NDArray[np.float64], PlainValidator(_rows(2, False)), _AS_LISTS, _schema(2, "number")
]
"""(n, 2) finite float64, copied and read-only; lists in scene files."""

Floats3 = Annotated[
    npt.NDArray[np.float64], PlainValidator(_rows(3, False)), _AS_LISTS, _schema(3, "number")
]
"""(n, 3) finite float64, as `Floats2`."""

Integers3 = Annotated[
    npt.NDArray[np.int64], PlainValidator(_rows(3, True)), _AS_LISTS, _schema(3, "integer")
]
"""(n, 3) int64, as `Floats2`."""
