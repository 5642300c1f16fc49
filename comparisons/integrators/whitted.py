"""Whitted's ray tracing: our plugin `comparisons.mitsuba.plugins.whitted`, to which the rung and
scene files add the parameters of lights."""

from comparisons.integrators.integrator import Data, IntegratorType
from comparisons.mitsuba.node import Node, Reading
from reference_rt.integrators import Whitted
from reference_rt.lights import Ambient

AMBIENT = ("ambient_r", "ambient_g", "ambient_b")
"""The parameters for ambient light."""


def _to_mitsuba(integrator: Whitted) -> Data:
    return {
        "type": "whitted",
        "max_depth": integrator.max_depth,
        "min_contribution": integrator.min_contribution,
    }


def _from_mitsuba(reading: Reading, node: Node) -> Whitted:
    """In files that we have written."""
    node.ignore("components", "unlit")
    r, g, b = (node.number(name, 0.0) for name in AMBIENT)
    if any((r, g, b)):
        reading.lights.append(Ambient(radiance=(r, g, b)))
    default = Whitted()
    return Whitted(
        max_depth=node.integer("max_depth", default.max_depth),
        min_contribution=node.number("min_contribution", default.min_contribution),
    )


WHITTED = IntegratorType(
    of=Whitted,
    to_mitsuba=_to_mitsuba,
    of_solids=None,
    from_mitsuba={"whitted": _from_mitsuba},
    edges=None,
)
