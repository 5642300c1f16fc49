"""`-D name=value`: values for a scene of another program, whose format has such defaults."""

from collections.abc import Sequence
from typing import Annotated

import typer

from reference_rt.util.errors import UsageError

Defaults = Annotated[
    list[str] | None,
    typer.Option(
        "-D", metavar="NAME=VALUE", help="A value for a <default> of a Mitsuba scene; repeatable."
    ),
]


def by_name(given: Sequence[str] | None) -> dict[str, str]:
    """The values by name.  Raises UsageError."""
    found: dict[str, str] = {}
    for text in given or ():
        name, equals, value = text.partition("=")
        if not name or not equals:
            raise UsageError(f"-D: expected NAME=VALUE, such as spp=64, got '{text}'")
        if name in found:
            raise UsageError(f"-D: '{name}' is given twice; expected one value")
        found[name] = value
    return found
