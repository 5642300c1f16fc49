"""Whitted's ray tracing: our plugin `comparisons.mitsuba.plugins.whitted`, to which the rung and
scene files add the parameters of lights."""

from comparisons.integrators.integrator import IntegratorType
from comparisons.mitsuba.node import Node, Reading
from comparisons.mitsuba.plugin_table import INTEGER, NUMBER, PluginTable, Row
from comparisons.renderers import NoCounterpartError
from reference_rt.integrators import Whitted
from reference_rt.lights import Ambient

AMBIENT = ("ambient_r", "ambient_g", "ambient_b")
"""The parameters for ambient light."""


_DEFAULT = Whitted()

TABLE = PluginTable(
    "whitted",
    (
        Row("max_depth", "max_depth", INTEGER, _DEFAULT.max_depth),
        Row("min_contribution", "min_contribution", NUMBER, _DEFAULT.min_contribution),
    ),
    ignored=("components", "unlit"),
)


def _from_mitsuba(reading: Reading, node: Node) -> Whitted:
    """In files that we have written."""
    r, g, b = (node.number(name, 0.0) for name in AMBIENT)
    if any((r, g, b)):
        reading.lights.append(Ambient(radiance=(r, g, b)))
    return Whitted(**TABLE.read(reading, node))


MOST_LEVELS = 256
"""Of rays in POV-Ray."""


def _to_povray(integrator: Whitted) -> str:
    levels = integrator.max_depth + 1
    if levels > MOST_LEVELS:
        raise NoCounterpartError(f"more than {MOST_LEVELS} levels of rays")
    return f"max_trace_level {levels} adc_bailout {integrator.min_contribution!r}"


WHITTED = IntegratorType(
    description=Whitted,
    to_mitsuba=TABLE.write,
    of_solids=None,
    from_mitsuba={"whitted": _from_mitsuba},
    edges=None,
    to_povray=_to_povray,
)
