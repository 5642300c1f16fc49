"""Path tracing: Mitsuba's `path`, and its `volpath` and `volpathmis`, which follow media."""

from comparisons.integrators.integrator import Data, IntegratorType, hiding
from comparisons.mitsuba.node import Node, Reading
from reference_rt.integrators import Path
from reference_rt.materials import Mask, ThinDielectric

MOST_ROULETTE = 4096
"""Our largest `rr_depth`."""


def translate_path(integrator: Path) -> Data:
    """The sampling strategy of ours does not change the mean."""
    depth = -1 if integrator.max_depth is None else integrator.max_depth
    found = {"type": "path", "max_depth": depth, "rr_depth": integrator.rr_depth}
    return found | hiding(integrator)


def _of_solids(integrator: Path) -> Data:
    return {**translate_path(integrator), "type": "path_of_solids"}


def _from_mitsuba(reading: Reading, node: Node) -> Path:
    depth = node.integer("max_depth", -1)
    if depth < -1:
        raise node.error(f"'max_depth' is {depth}; expected -1 (no end), 0 or more")
    roulette = node.integer("rr_depth", 5)
    if roulette < 1:
        raise node.error(f"'rr_depth' is {roulette}; expected 1 or more")
    # Where the roulette begins does not change the expected picture.
    return Path(max_depth=None if depth < 0 else depth, rr_depth=min(roulette, MOST_ROULETTE))


def _through_media(reading: Reading, node: Node) -> Path:
    """`volpath` and `volpathmis`: without media they are `path`, but that their shadow rays pass
    surfaces that bend none."""
    node.ignore("use_spectral_mis")
    found = _from_mitsuba(reading, node)
    for name, material in reading.materials.items():
        if isinstance(material, Mask | ThinDielectric):
            raise node.error(
                f"its shadow rays pass the material '{name}', ours do not; expected the integrator "
                "path, or a scene without mask and thindielectric"
            )
    return found


NO_ROULETTE = 1 << 30
"""In place of `rr_depth`: of no path."""


def through_media(integrator: Path) -> Data:
    """Russian roulette of `volpathmis` takes light away (findings/), so that it has none; paths
    without a limit need it, and are `volpath`'s."""
    found = translate_path(integrator)
    if integrator.max_depth is None:
        return {**found, "type": "volpath"}
    return {**found, "type": "volpathmis", "rr_depth": NO_ROULETTE}


PATH = IntegratorType(
    description=Path,
    to_mitsuba=translate_path,
    of_solids=_of_solids,
    from_mitsuba={
        "path": _from_mitsuba,
        "volpath": _through_media,
        "volpathmis": _through_media,
    },
    through_media=through_media,
    media_of_solids=lambda integrator: {**translate_path(integrator), "type": "media_of_solids"},
    edges=lambda integrator: integrator.max_depth,
)
