"""Direct light: Mitsuba's `direct`."""

from comparisons.integrators.integrator import Data, IntegratorType, hiding
from comparisons.mitsuba.context import UntranslatableError
from comparisons.mitsuba.node import Node, Reading
from comparisons.renderers import NoCounterpartError
from reference_rt.integrators import Direct


def _to_mitsuba(integrator: Direct) -> Data:
    if not integrator.shadows:
        raise UntranslatableError("direct without shadows", "integrator")
    lights, bsdfs = integrator.light_samples, integrator.bsdf_samples
    found = {"type": "direct", "emitter_samples": lights, "bsdf_samples": bsdfs}
    return found | hiding(integrator)


def _of_solids(integrator: Direct) -> Data:
    _to_mitsuba(integrator)  # refuses what has no counterpart
    return {
        "type": "path_of_solids",
        "max_depth": 2,
        "samples_lights": integrator.light_samples > 0,
        "samples_bsdfs": integrator.bsdf_samples > 0,
        **hiding(integrator),
    }


def _from_mitsuba(reading: Reading, node: Node) -> Direct:
    both = node.integer("shading_samples", 1)
    lights, bsdfs = node.integer("emitter_samples", both), node.integer("bsdf_samples", both)
    return Direct(light_samples=lights, bsdf_samples=bsdfs)


def _edges(integrator: Direct) -> int:
    if not integrator.shadows:
        raise NoCounterpartError("direct light without shadows")
    if not (integrator.light_samples and integrator.bsdf_samples):
        raise NoCounterpartError("direct light by one strategy alone")
    return 2


DIRECT = IntegratorType(
    description=Direct,
    to_mitsuba=_to_mitsuba,
    of_solids=_of_solids,
    from_mitsuba={"direct": _from_mitsuba},
    edges=_edges,
)
