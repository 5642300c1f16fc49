"""Numba's types of annotations.

An operation (`links.py`) is called through a function pointer, so its caller and the operation take
the types of arguments and result from its annotations: neither knows the other.
"""

import typing
from contextlib import suppress
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt
from numba import types

_TYPE_OF: dict[Any, Any] = {
    float: types.float64,
    int: types.int64,
    bool: types.boolean,
    None: types.none,
    type(None): types.none,
    npt.NDArray[np.float64]: types.Array(types.float64, 1, "C"),
    npt.NDArray[np.int64]: types.Array(types.int64, 1, "C"),
}


def declare(annotation: Any, numba_type: Any) -> None:
    """From now on, arguments with this annotation have this type in calls of operations."""
    _TYPE_OF[annotation] = numba_type


def type_of(annotation: Any) -> Any:
    """Numba's type of an operation's argument or result, by its annotation.

    Arrays have one dimension, or as many as they are `Annotated` with.  Raises TypeError for an
    annotation that means more than one type.
    """
    with suppress(TypeError):  # not hashable
        if annotation in _TYPE_OF:
            return _TYPE_OF[annotation]
    if typing.get_origin(annotation) is Annotated:
        of, dimensions = typing.get_args(annotation)
        if isinstance(array := type_of(of), types.Array):
            return array.copy(ndim=dimensions)
    if typing.get_origin(annotation) is tuple:
        parts = [type_of(part) for part in typing.get_args(annotation)]
        return types.BaseTuple.from_types(parts)
    if isinstance(annotation, type) and hasattr(annotation, "_fields"):
        hints = typing.get_type_hints(annotation, include_extras=True)
        parts = [type_of(hints[field]) for field in annotation._fields]
        return types.BaseTuple.from_types(parts, annotation)
    raise TypeError(
        f"{annotation}: not one type; expected float, int, bool, a NumPy array, a tuple or a "
        "NamedTuple of these, or what is declared"
    )
