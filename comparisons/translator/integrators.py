"""Integrators of Mitsuba scenes."""

from typing import Any

from comparisons.mitsuba.node import Node, Reading
from reference_rt.integrators import AnyIntegrator, Direct, Path, RayCast, Whitted
from reference_rt.lights import Ambient
from reference_rt.materials import Mask, ThinDielectric

LAYERS = {
    "depth": "depth", "sh_normal": "normal", "albedo": "albedo", "position": "position",
    "shape_index": "id",
}  # fmt: skip
"""Which of our film's layers shows an AOV."""

SHOWN = {
    "albedo": "colour", "depth": "distance", "geo_normal": "normal", "shape_index": "id",
    "uv": "uv",
}  # fmt: skip
"""What ray casting shows for an AOV without another integrator."""

MOST_ROULETTE = 4096
"""Our largest `rr_depth`."""


def read_integrator(reading: Reading, node: Node | None) -> tuple[AnyIntegrator, tuple[str, ...]]:
    """An integrator, and the layers of the film that it asks for.  Raises SceneError."""
    if node is None:
        return Path(), ()
    hides = node.flag("hide_emitters")
    node.ignore("timeout", "block_size", "samples_per_pass")  # of how it runs
    layers: tuple[str, ...] = ()
    with node.checking():
        match node.plugin:
            case "path":
                found: Any = _path(node)
            case "volpath" | "volpathmis":
                node.ignore("use_spectral_mis")
                found = _path(node)
                _check_surfaces(reading, node)
            case "direct":
                found = _direct(node)
            case "depth":
                found = RayCast(show="distance")
                reading.note(node, "Mitsuba has 0 where nothing is hit, ours infinity")
            case "whitted":
                found = _whitted(reading, node)
            case "moment":
                found, layers = _inside(reading, node)
                reading.note(node, "its moments are left out: ours is the picture inside it")
            case "aov":
                found, layers = _aov(reading, node)
            case _:
                raise node.unsupported("expected one of: path, direct, volpath, depth, aov, moment")
    if hides and isinstance(found, Path | Direct):
        found = found.model_copy(update={"hide_emitters": True})
    node.finish()
    return found, layers


def _path(node: Node) -> Path:
    depth = node.integer("max_depth", -1)
    if depth < -1:
        raise node.error(f"'max_depth' is {depth}; expected -1 (no end), 0 or more")
    roulette = node.integer("rr_depth", 5)
    if roulette < 1:
        raise node.error(f"'rr_depth' is {roulette}; expected 1 or more")
    # Where the roulette begins does not change the expected picture.
    return Path(max_depth=None if depth < 0 else depth, rr_depth=min(roulette, MOST_ROULETTE))


def _whitted(reading: Reading, node: Node) -> Whitted:
    """Of our plugin, in files that we have written."""
    node.ignore("components", "unlit")
    ambient = tuple(node.number(f"ambient_{c}", 0.0) for c in "rgb")
    if any(ambient):
        reading.lights.append(Ambient(radiance=ambient))  # type: ignore[arg-type]
    default = Whitted()
    return Whitted(
        max_depth=node.integer("max_depth", default.max_depth),
        min_contribution=node.number("min_contribution", default.min_contribution),
    )


def _check_surfaces(reading: Reading, node: Node) -> None:
    """Without media `volpath` is `path`, but that its shadow rays pass surfaces that bend none."""
    for name, material in reading.materials.items():
        if isinstance(material, Mask | ThinDielectric):
            raise node.error(
                f"its shadow rays pass the material '{name}', ours do not; expected the integrator "
                "path, or a scene without mask, null and thindielectric"
            )


def _direct(node: Node) -> Direct:
    both = node.integer("shading_samples", 1)
    lights, bsdfs = node.integer("emitter_samples", both), node.integer("bsdf_samples", both)
    return Direct(light_samples=lights, bsdf_samples=bsdfs)


def _aov(reading: Reading, node: Node) -> tuple[AnyIntegrator, tuple[str, ...]]:
    """The integrator inside, or ray casting, and the layers for AOVs."""
    layers: list[str] = []
    kinds: list[str] = []
    for token in node.text("aovs", "").replace(",", " ").split():
        kind = token.partition(":")[2]
        kinds.append(kind)
        if kind in SHOWN and kind not in LAYERS and not node.has_children("Integrator"):
            continue
        if kind not in LAYERS:
            raise node.error(
                f"'aovs' has '{token}', which is not supported; expected of: {', '.join(LAYERS)}"
            )
        if LAYERS[kind] not in layers:
            layers.append(LAYERS[kind])
    found, _ = _inside(reading, node)
    if isinstance(found, RayCast) and len(kinds) == 1:
        found = RayCast(show=SHOWN.get(kinds[0], "colour"))  # type: ignore[arg-type]
    return found, tuple(layers) if not isinstance(found, RayCast) else ()


def _inside(reading: Reading, node: Node) -> tuple[AnyIntegrator, tuple[str, ...]]:
    """The integrator inside another one; ray casting for none."""
    inside = node.only("Integrator")
    return (RayCast(), ()) if inside is None else read_integrator(reading, inside)
