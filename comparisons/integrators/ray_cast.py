"""Ray casting, and the layers of a film: Mitsuba's `depth`, and the values (AOVs) of its `aov`."""

from comparisons.integrators.integrator import Data, IntegratorType
from comparisons.mitsuba.node import Node, Reading
from reference_rt.integrators import RayCast

LAYERS = {
    "depth": "depth", "normal": "sh_normal", "albedo": "albedo", "position": "position",
    "id": "shape_index",
}  # fmt: skip
"""Mitsuba's AOV for a layer of our film."""

CAST = {"colour": "albedo", "normal": "geo_normal", "id": "shape_index", "uv": "uv"}
"""Mitsuba's AOV for what ray casting shows, but for distances."""

LAYER_OF = {aov: layer for layer, aov in LAYERS.items()}

SHOWN = {"depth": "distance", **{aov: show for show, aov in CAST.items()}}
"""What ray casting shows for an AOV without another integrator."""


def shown_by(integrator: RayCast) -> Data:
    """The dictionary of a scene file's integrator that shows the same."""
    if integrator.show == "distance":
        return {"type": "depth"}
    return {"type": "aov", "aovs": f"{integrator.show}:{CAST[integrator.show]}"}


def _from_mitsuba(reading: Reading, node: Node) -> RayCast:
    reading.note(node, "Mitsuba has 0 where nothing is hit, ours infinity")
    return RayCast(show="distance")


RAY_CAST = IntegratorType(
    description=RayCast,
    to_mitsuba=None,  # the rung of geometry compares ray casting ray by ray
    of_solids=None,
    from_mitsuba={"depth": _from_mitsuba},
    edges=None,
)
