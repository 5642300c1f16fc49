"""What the comparison knows of phase functions: a row per type.

Mitsuba's `wi` points back along the way of the light and `wo` onwards, and its `hg` has the sign of
g that ours has: the cosine of the angle by which light is turned, on average.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from comparisons.mitsuba.colours import colour, constant, luminance
from comparisons.mitsuba.context import UntranslatableError
from comparisons.mitsuba.node import Node, Reading
from comparisons.mitsuba.plugin_table import NUMBER, PluginTable, Row
from comparisons.renderers import NoCounterpartError
from reference_rt.media import AnyPhase, BlendPhase, HenyeyGreenstein, Isotropic, Rayleigh

Data = dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class PhaseType:
    """A type of phase functions.  None stands where a renderer has none.

    description: our class;  plugin: Mitsuba's;  to_mitsuba: its dictionary;  from_mitsuba: that of
    an element, which raises SceneError;  asymmetry: g of the Henyey-Greenstein function that it
    is, for renderers that know no other;  to_cycles: the parts of it, each with its share of the
    light.
    """

    description: type[Any]
    plugin: str
    to_mitsuba: Callable[[Any], Data]
    from_mitsuba: Callable[[Reading, Node], Any]
    asymmetry: Callable[[Any], float] | None
    to_cycles: Callable[[Any], list[tuple[float, Data]]] | None


HG = PluginTable("hg", (Row("g", "g", NUMBER, 0.8),))


def _blend_to_mitsuba(phase: BlendPhase) -> Data:
    first, second = translate_phase(phase.first), translate_phase(phase.second)
    return {"type": "blendphase", "weight": phase.weight, "0_first": first, "1_second": second}


MOST_IN_CYCLES = 0.99
"""|g| up to which Cycles' phase function in float32 is right to 0.1 %; it cuts g off at 0.999."""


def _cycles_hg(g: float) -> Data:
    if abs(g) > MOST_IN_CYCLES:
        raise NoCounterpartError(f"phase functions of |g| above {MOST_IN_CYCLES}")
    return {"phase": "HENYEY_GREENSTEIN", "g": float(g)}


def _blend_to_cycles(phase: BlendPhase) -> list[tuple[float, Data]]:
    found = []
    for share, part in ((1.0 - phase.weight, phase.first), (phase.weight, phase.second)):
        to_cycles = type_of(part).to_cycles
        assert to_cycles is not None
        found += [(share * own, function) for own, function in to_cycles(part)]
    return found


def _blend_from_mitsuba(reading: Reading, node: Node) -> BlendPhase:
    inside = node.children("PhaseFunction")
    if len(inside) != 2:
        raise node.error(f"has {len(inside)} phase functions; expected 2")
    for part in inside:
        if part.plugin == "blendphase":
            raise part.error("is inside another one, which is not supported; expected hg or such")
    first, second = (read_phase(reading, part) for part in inside)
    assert not isinstance(first, BlendPhase)
    assert not isinstance(second, BlendPhase)
    return BlendPhase(first=first, second=second, weight=_weight(node))


def _weight(node: Node) -> float:
    """A number, or a volume that is one."""
    if not node.has("weight"):
        raise node.error("has no 'weight'; expected a number from 0 to 1")
    if node.kind_of("weight") in ("Float", "Integer"):
        return node.number("weight", 0.5)
    return luminance(constant_volume(node, "weight", (0.5, 0.5, 0.5), "reflectance"))


def constant_volume(node: Node, key: str, default: Any, use: str) -> Any:
    """Linear sRGB of a parameter that is the same everywhere.  use: as of
    `comparisons.mitsuba.colours.colour`.  Raises SceneError for a grid."""
    value = None
    for name, inside in node.clone().named_children("Volume"):
        if name == key:
            value = inside
    if value is None:
        return colour(node, key, default, use)
    node.ignore(key)
    if value.plugin != "constvolume":
        raise value.unsupported("expected a medium that is the same everywhere: constvolume")
    value.ignore("to_world")
    textures = value.named_children("Texture")
    found = constant(textures[0][1]) if textures else colour(value, "value", 1.0, use)
    value.finish()
    return found


PHASES = (
    PhaseType(
        description=Isotropic,
        plugin="isotropic",
        to_mitsuba=lambda phase: {"type": "isotropic"},
        from_mitsuba=lambda reading, node: Isotropic(),
        asymmetry=lambda phase: 0.0,
        to_cycles=lambda phase: [(1.0, _cycles_hg(0.0))],
    ),
    PhaseType(
        description=HenyeyGreenstein,
        plugin="hg",
        to_mitsuba=HG.write,
        from_mitsuba=HG.reader(HenyeyGreenstein),
        asymmetry=lambda phase: float(phase.g),
        to_cycles=lambda phase: [(1.0, _cycles_hg(phase.g))],
    ),
    PhaseType(
        description=Rayleigh,
        plugin="rayleigh",
        to_mitsuba=lambda phase: {"type": "rayleigh"},
        from_mitsuba=lambda reading, node: Rayleigh(),
        asymmetry=None,
        to_cycles=lambda phase: [(1.0, {"phase": "RAYLEIGH", "g": None})],
    ),
    PhaseType(
        description=BlendPhase,
        plugin="blendphase",
        to_mitsuba=_blend_to_mitsuba,
        from_mitsuba=_blend_from_mitsuba,
        asymmetry=None,
        to_cycles=_blend_to_cycles,
    ),
)
"""All types of phase functions."""

_BY_TYPE = {one.description: one for one in PHASES}

_BY_PLUGIN = {one.plugin: one for one in PHASES}


def type_of(phase: Any) -> PhaseType:
    """What is known of a phase function's type.  Raises UntranslatableError for one not in
    PHASES."""
    if type(phase) not in _BY_TYPE:
        raise UntranslatableError(phase, "phase function")
    return _BY_TYPE[type(phase)]


def translate_phase(phase: Any) -> Data:
    """A phase function's dictionary."""
    return type_of(phase).to_mitsuba(phase)


def read_phase(reading: Reading, node: Node | None) -> AnyPhase:
    """The phase function of an element; without one, Mitsuba's default.  Raises SceneError."""
    if node is None:
        return Isotropic()
    if node.plugin not in _BY_PLUGIN:
        raise node.unsupported(f"expected one of: {', '.join(sorted(_BY_PLUGIN))}")
    with node.checking():
        found: AnyPhase = _BY_PLUGIN[node.plugin].from_mitsuba(reading, node)
    node.finish()
    return found
