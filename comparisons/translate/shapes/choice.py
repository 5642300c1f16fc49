"""The choice of a translation by the type of a shape."""

from functools import singledispatch
from typing import Any

from comparisons.pieces import Plugin
from comparisons.translate.errors import UntranslatableError
from comparisons.translate.shapes.plugins import Site


@singledispatch
def translate_shape(shape: Any, site: Site) -> list[Plugin]:
    """The Mitsuba shapes that stand for one of ours, in order.

    Raises UntranslatableError, and ValueError for a file that cannot be used.
    """
    raise UntranslatableError(shape, "shape")
