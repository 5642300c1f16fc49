"""Integrators -> Mitsuba."""

from functools import singledispatch
from typing import Any

from comparisons.mitsuba.translate.errors import UntranslatableError
from reference_rt.integrators import Direct, Path, RayCast, Whitted


@singledispatch
def translate_integrator(integrator: Any) -> dict[str, Any] | None:
    """An integrator's dict; None if there is no picture to compare.

    Raises UntranslatableError.
    """
    raise UntranslatableError(integrator, "integrator")


@translate_integrator.register
def _(integrator: Path) -> dict[str, Any]:
    """The sampling strategy of ours does not change the mean."""
    depth = -1 if integrator.max_depth is None else integrator.max_depth
    return {"type": "path", "max_depth": depth, "rr_depth": integrator.rr_depth}


@translate_integrator.register
def _(integrator: Direct) -> dict[str, Any]:
    lights, bsdfs = integrator.light_samples, integrator.bsdf_samples
    return {"type": "direct", "emitter_samples": lights, "bsdf_samples": bsdfs}


@translate_integrator.register
def _(integrator: Whitted) -> dict[str, Any]:
    """Our plugin `comparisons.mitsuba.plugins.whitted`; the rung adds the parameters of lights."""
    return {
        "type": "whitted",
        "max_depth": integrator.max_depth,
        "min_contribution": integrator.min_contribution,
    }


@translate_integrator.register
def _(integrator: RayCast) -> None:
    """None: the rung of geometry compares ray casting ray by ray."""
