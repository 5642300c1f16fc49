"""Integrators for the comparison: to and from Mitsuba; a file per type, whose contract is
`IntegratorType`.

To add a type: its file here, and a line in `INTEGRATORS`.
"""

from typing import Any

from comparisons.integrators.direct import DIRECT
from comparisons.integrators.integrator import Data, IntegratorType
from comparisons.integrators.light import LIGHT, as_path
from comparisons.integrators.path import PATH
from comparisons.integrators.ray_cast import LAYER_OF, RAY_CAST, SHOWN
from comparisons.integrators.whitted import WHITTED
from comparisons.lights import type_of as type_of_light
from comparisons.mitsuba.context import UntranslatableError
from comparisons.mitsuba.node import Node, Reading
from comparisons.renderers import NoCounterpartError
from reference_rt.integrators import AnyIntegrator, Direct, Light, Path, RayCast
from reference_rt.scene.model import SceneModel

INTEGRATORS: tuple[IntegratorType[Any], ...] = (PATH, LIGHT, DIRECT, WHITTED, RAY_CAST)
"""All integrators."""

_BY_TYPE = {one.description: one for one in INTEGRATORS}

_BY_PLUGIN = {plugin: read for one in INTEGRATORS for plugin, read in one.from_mitsuba.items()}


def type_of(integrator: Any) -> IntegratorType[Any]:
    """What is known of an integrator's type.  Raises UntranslatableError for one not in
    INTEGRATORS."""
    found = _BY_TYPE.get(type(integrator))
    if found is None:
        raise UntranslatableError(integrator, "integrator")
    return found


def translate_integrator(integrator: Any, has_media: bool = False) -> Data | None:
    """An integrator's dict; None if there is no picture to compare.  has_media: of the scene.

    Raises UntranslatableError.
    """
    of_type = type_of(integrator)
    to_mitsuba = of_type.through_media if has_media else of_type.to_mitsuba
    return None if to_mitsuba is None else to_mitsuba(integrator)


def particles_of(integrator: Any) -> Light:
    """Light tracing with an integrator's expected picture.  Raises NoCounterpartError."""
    edges = type_of(integrator).edges
    if edges is None:
        raise NoCounterpartError(f"'{integrator.type}' does not follow light between surfaces")
    if getattr(integrator, "hide_emitters", False):
        raise NoCounterpartError("particles do not hide lamps")
    roulette = getattr(integrator, "rr_depth", Light().rr_depth)
    return Light(max_depth=edges(integrator), rr_depth=roulette, caustics_of_points=False)


def from_other_end(scene: SceneModel) -> Light | Path:
    """The integrator with the expected picture of a scene's, whose paths begin at their other end.
    Raises NoCounterpartError."""
    integrator = scene.integrator
    if not isinstance(integrator, Light):
        return particles_of(integrator)
    if integrator.caustics_of_points and any(type_of_light(x).has_no_extent for x in scene.lights):
        raise NoCounterpartError("caustics of lamps without extent, which no path finds")
    return as_path(integrator)


FOLLOWING_MEDIA = ("volpath", "volpathmis")
"""Mitsuba's integrators that follow light through media."""


def follows_media(node: Node) -> bool:
    """Whether an integrator, or the one inside it, follows light through media."""
    inside = node.clone().children("Integrator")
    return node.plugin in FOLLOWING_MEDIA or any(map(follows_media, inside))


def read_integrator(reading: Reading, node: Node | None) -> tuple[AnyIntegrator, tuple[str, ...]]:
    """An integrator, and the layers of the film that it asks for.  Raises SceneError."""
    if node is None:
        return Path(), ()
    hides = node.flag("hide_emitters")
    node.ignore("timeout", "block_size", "samples_per_pass")  # of how it runs
    layers: tuple[str, ...] = ()
    with node.checking():
        if node.plugin in _BY_PLUGIN:
            found = _BY_PLUGIN[node.plugin](reading, node)
        elif node.plugin == "moment":
            found, layers = _inside(reading, node)
            reading.note(node, "its moments are left out: ours is the picture inside it")
        elif node.plugin == "aov":
            found, layers = _aov(reading, node)
        else:
            raise node.unsupported(
                "expected one of: path, ptracer, direct, volpath, depth, aov, moment"
            )
    if hides and isinstance(found, Path | Direct):
        found = found.model_copy(update={"hide_emitters": True})
    node.finish()
    return found, layers


def _aov(reading: Reading, node: Node) -> tuple[AnyIntegrator, tuple[str, ...]]:
    """The integrator inside, or ray casting, and the layers for AOVs."""
    layers: list[str] = []
    kinds: list[str] = []
    for token in node.text("aovs", "").replace(",", " ").split():
        kind = token.partition(":")[2]
        kinds.append(kind)
        if kind in SHOWN and kind not in LAYER_OF and not node.has_children("Integrator"):
            continue
        if kind not in LAYER_OF:
            raise node.error(
                f"'aovs' has '{token}', which is not supported; expected of: {', '.join(LAYER_OF)}"
            )
        if LAYER_OF[kind] not in layers:
            layers.append(LAYER_OF[kind])
    found, _ = _inside(reading, node)
    if isinstance(found, RayCast) and len(kinds) == 1:
        found = RayCast(show=SHOWN.get(kinds[0], "colour"))  # type: ignore[arg-type]
    return found, tuple(layers) if not isinstance(found, RayCast) else ()


def _inside(reading: Reading, node: Node) -> tuple[AnyIntegrator, tuple[str, ...]]:
    """The integrator inside another one; ray casting for none."""
    inside = node.only("Integrator")
    return (RayCast(), ()) if inside is None else read_integrator(reading, inside)
