"""Light tracing: Mitsuba's `ptracer`, which has the caustics of points."""

from comparisons.integrators.integrator import Data, IntegratorType
from comparisons.integrators.path import PATH, translate_path
from comparisons.mitsuba.node import Node, Reading
from reference_rt.integrators import Light, Path


def _to_mitsuba(integrator: Light) -> Data:
    if not integrator.caustics_of_points:
        return translate_path(as_path(integrator))
    depth = -1 if integrator.max_depth is None else integrator.max_depth
    return {"type": "ptracer", "max_depth": depth, "rr_depth": integrator.rr_depth}


def _from_mitsuba(reading: Reading, node: Node) -> Light:
    if node.flag("hide_emitters"):
        raise node.error("'hide_emitters' is not supported here; expected the integrator path")
    found = PATH.from_mitsuba["path"](reading, node)
    assert isinstance(found, Path)
    return Light(max_depth=found.max_depth, rr_depth=found.rr_depth)


def as_path(integrator: Light) -> Path:
    """The integrator with the same expected picture."""
    return Path(max_depth=integrator.max_depth, rr_depth=integrator.rr_depth)


LIGHT = IntegratorType(
    description=Light,
    to_mitsuba=_to_mitsuba,
    of_solids=lambda integrator: PATH.of_solids(as_path(integrator)) if PATH.of_solids else {},
    from_mitsuba={"ptracer": _from_mitsuba},
    edges=lambda integrator: integrator.max_depth,
)
