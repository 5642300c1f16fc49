"""`translate_shape`: the translation of a shape by its type."""

from functools import singledispatch
from typing import Any

from comparisons.mitsuba.stand_ins import Plugin
from comparisons.mitsuba.translate.errors import UntranslatableError
from comparisons.mitsuba.translate.shapes.plugins import Site


@singledispatch
def translate_shape(shape: Any, site: Site) -> list[Plugin]:
    """The Mitsuba shapes that represent one of ours, in order.

    Raises UntranslatableError, and ValueError for a file that cannot be used.
    """
    raise UntranslatableError(shape, "shape")
