"""What the comparison knows of a type of integrators: `IntegratorType`, one per type, in the type's
file."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from comparisons.mitsuba.node import Node, Reading
from reference_rt.core.model import Description
from reference_rt.integrators import AnyIntegrator

I = TypeVar("I", bound=Description)

Data = dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class IntegratorType(Generic[I]):
    """A type of integrators.  None stands where a type has none.

    A test holds that `INTEGRATORS` has a row for each member of our `AnyIntegrator`.
    """

    description: type[I]
    to_mitsuba: Callable[[I], Data] | None
    """An integrator's dictionary; None if there is no picture to compare.  Raises
    UntranslatableError."""
    of_solids: Callable[[I], Data] | None
    """That of our plugin `comparisons.mitsuba.plugins.path_of_solids`, which takes its place for
    scenes with solids, with masks, and with hidden lamps.  Raises as `to_mitsuba` does."""
    from_mitsuba: Mapping[str, Callable[[Reading, Node], AnyIntegrator]]
    """By Mitsuba's plugin: the integrator of an element.  Raises SceneError."""
    through_media: Callable[[I], Data] | None = None
    """Its dictionary for a scene with media.  None: our description refuses them."""
    media_of_solids: Callable[[I], Data] | None = None
    """The same where `of_solids` would take its place: that of our plugin
    `comparisons.mitsuba.plugins.media_of_solids`."""
    edges: Callable[[I], int | None] | None
    """The most edges of a path that it takes, None for no end: for renderers that know path tracing
    alone.  Raises NoCounterpartError for what they lack."""
    to_povray: Callable[[I], str] | None = None
    """POV-Ray's global settings, where it computes the same."""


def hiding(integrator: Any) -> Data:
    """`hide_emitters`, where it is not Mitsuba's default."""
    return {"hide_emitters": True} if integrator.hide_emitters else {}
