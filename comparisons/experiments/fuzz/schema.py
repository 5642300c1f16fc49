"""The types of the scene schema by kind, and those that occur in a scene."""

from functools import cache
from itertools import combinations
from typing import Any

from comparisons.experiments.fuzz.data import Data, shapes_of
from reference_rt.cameras import AnyCamera
from reference_rt.cameras.film import AnyFilter
from reference_rt.core.model import Description, types_of
from reference_rt.core.transform import Step
from reference_rt.integrators import Direct, Path, RayCast, Whitted
from reference_rt.lights import AnyLight
from reference_rt.materials import AnyMaterial
from reference_rt.media import AnyMedium, AnyPhase
from reference_rt.sampling import AnySampler
from reference_rt.shapes.csg import AnyShape
from reference_rt.textures import AnyTexture
from reference_rt.util.errors import UsageError, meant

KINDS: dict[str, Any] = {
    "shape": AnyShape,
    "material": AnyMaterial,
    "texture": AnyTexture,
    "light": AnyLight,
    "camera": AnyCamera,
    "integrator": RayCast | Whitted | Direct | Path,  # `light` refuses many lamps and scenes
    "sampler": AnySampler,
    "filter": AnyFilter,
    "step": Step,
    "medium": AnyMedium,
    "phase": AnyPhase,
}
"""The unions of types in the schema, by kind."""

ONE_OF = ("camera", "integrator", "sampler", "filter")
"""Kinds of which a scene has one."""

GROUPS: dict[str, tuple[str, ...]] = {
    "csg": ("union", "intersection", "difference"),
    "glass": ("dielectric", "thin_dielectric", "rough_dielectric"),
    "metal": ("conductor", "rough_conductor", "mirror"),
    "lamps": ("emissive",),
    "meshes": ("mesh", "triangle"),
    "groups": ("instance",),
    "textures": ("bitmap", "checker", "vertex_colours", "product"),
    "nested": ("mask", "two_sided", "blend", "bump", "normal_map"),
    "sky": ("constant", "environment_map"),
    "media": ("homogeneous", "none", "hg", "rayleigh"),
}
"""Names for several types, which `--features` takes beside the names of types."""


def name_of(cls: type[Description]) -> str:
    """The word for a type in scene files: its `type`, or the only key of a transform step."""
    fields = cls.model_fields
    return str(fields["type"].default) if "type" in fields else next(iter(fields))


@cache
def types(kind: str) -> dict[str, type[Description]]:
    """The types of a kind by name."""
    # Steps of transforms are tagged.
    classes = (getattr(some, "__origin__", some) for some in types_of(KINDS[kind]))
    return {name_of(c): c for c in classes}


@cache
def all_types() -> tuple[tuple[str, str], ...]:
    """All (kind, name)."""
    return tuple((kind, name) for kind in KINDS for name in types(kind))


def features(names: tuple[str, ...]) -> tuple[tuple[str, str], ...]:
    """The (kind, name) of types and GROUPS; of a group one in turn is drawn for a scene, so a group
    stays a word.  Raises UsageError."""
    known = {name for _, name in all_types()} | GROUPS.keys()
    for name in names:
        if name not in known:
            listed = ", ".join(sorted(known))
            message = f"--features: there is no '{name}'; expected some of {listed}"
            raise UsageError(message + meant(name, sorted(known)))
    return tuple(("group" if n in GROUPS else kind_of(n), n) for n in names)


def kind_of(name: str) -> str:
    """The kind of the first type with this name; 'box' is a shape and a filter."""
    return next(kind for kind, other in all_types() if other == name)


def types_in(scene: Data) -> set[tuple[str, str]]:
    """The (kind, name) that occur in a scene's data, unused materials included."""
    found: set[tuple[str, str]] = set()
    for shape in shapes_of(scene):
        found.add(("shape", shape["type"]))
        found |= {("step", key) for step in shape.get("transform", ()) for key in step}
    for key, kind in (("materials", "material"), ("textures", "texture"), ("media", "medium")):
        found |= {(kind, one["type"]) for one in scene.get(key, {}).values()}
    for medium in scene.get("media", {}).values():
        phase = medium.get("phase", {"type": "isotropic"})
        phases = (phase, *(phase[key] for key in ("first", "second") if key in phase))
        found |= {("phase", one["type"]) for one in phases}
    for light in scene.get("lights", ()):
        found.add(("light", light["type"]))
        found |= {("step", key) for step in light.get("transform", ()) for key in step}
    for kind in ("camera", "integrator", "sampler"):
        if kind in scene:
            found.add((kind, scene[kind]["type"]))
    if "filter" in scene.get("film", {}):
        found.add(("filter", scene["film"]["filter"]["type"]))
    return found


def possible_pairs() -> list[tuple[tuple[str, str], tuple[str, str]]]:
    """Pairs of types that one scene can have."""
    return [pair for pair in combinations(all_types(), 2) if _together(*pair)]


OF_MEDIA = ("medium", "phase")
"""Kinds of which path tracing alone knows anything, as of NO_SURFACE."""

NO_SURFACE = ("material", "none")


def of_media(kind: str, name: str) -> bool:
    """Whether a type asks for path tracing through media."""
    return kind in OF_MEDIA or (kind, name) == NO_SURFACE


_SKIES = {("light", "constant"), ("light", "environment_map")}


def _together(a: tuple[str, str], b: tuple[str, str]) -> bool:
    if a[0] == b[0] and a[0] in ONE_OF:
        return False
    if {a, b} == _SKIES:
        return False
    pair = {a, b}
    if any(of_media(*one) for one in pair):
        others = [name for kind, name in pair if kind == "integrator"]
        return others in ([], ["path"]) and ("sampler", "grid") not in pair
    if ("sampler", "grid") in pair:
        (other,) = pair - {("sampler", "grid")}
        integrator = types("integrator").get(other[1])
        random = other[0] == "integrator" and not getattr(integrator, "deterministic", True)
        return not random
    return True
