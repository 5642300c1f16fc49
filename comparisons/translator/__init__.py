"""Scene -> Mitsuba, by what `comparisons` knows of each public type of `reference_rt`.

Contract: a type's function takes the description and the `TranslationContext`, and returns the dict
of a Mitsuba plugin (shapes: a list of `Plugin`), with radiance and lengths unchanged.  None means
that Mitsuba has no place for it.  A type that no folder knows raises `UntranslatableError`, which
makes a scene `not-comparable`.
"""

from collections.abc import Mapping
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from comparisons.cameras import translate_camera
from comparisons.cameras.film import translate_film
from comparisons.cameras.samplers import translate_sampler
from comparisons.geometry import affine
from comparisons.geometry.flatten import Copy, Leaf, copies_of, place_of
from comparisons.geometry.frame import Frame
from comparisons.integrators import translate_integrator
from comparisons.lights import translate_light
from comparisons.materials.translate import (
    coloured_parts_of,
    is_oriented,
    is_textured,
    parts_of,
)
from comparisons.media import media_of_shape, translate_medium
from comparisons.mitsuba.backend import mitsuba, scalar
from comparisons.mitsuba.context import TranslationContext, UntranslatableError
from comparisons.mitsuba.counterpart import Counterpart, InstancedGroup
from comparisons.mitsuba.csg import Operand, SolidCounterpart
from comparisons.mitsuba.hits import MitsubaShape, Plugin
from comparisons.mitsuba.lit_scene import LitScene
from comparisons.mitsuba.scene import light_id, shape_id
from comparisons.renderers import ReferenceSampler
from comparisons.shapes import translate_shape, type_of
from comparisons.shapes.site import MOST_INSTANCES, Site
from comparisons.translator.mistakes import (
    BLACK,
    by_paths,
    counts_lights_often,
    drops_light,
    in_place_of,
)
from comparisons.translator.moved import frame_of, moved
from reference_rt.integrators import Direct
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import Grid
from reference_rt.shapes import Sphere
from reference_rt.shapes.shape import TabulationContext

# Without this Embree drops rays that hit a shared edge (Mitsuba issue 1149).
ROBUST = {"embree_use_robust_intersections": True}


class _Translated(NamedTuple):
    """drawn: of each light and lamp, whether its light is sampled."""

    plain: dict[str, Any]
    mi_shapes: dict[str, MitsubaShape]
    solids: list[SolidCounterpart]
    drawn: list[bool]


def to_mitsuba(scene: Scene, native: bool = False) -> dict[str, Any]:
    """The scene as a dict for `mitsuba.load_dict`, without its solids; our shape i has the id
    "shape_<i>", or several ids with suffixes.

    Meshes are Mitsuba objects already, of what a second reader reads.  Ray casting has no
    integrator in Mitsuba.  native: use Mitsuba's own materials even where our plugins are more
    exact, to measure Mitsuba's speed.  Raises UntranslatableError, SceneError for a file that
    cannot be used, ReferenceUnavailableError without Mitsuba.
    """
    found = _translated(scene, native)
    return {**_groups(found.mi_shapes), **found.plain}


def load(
    scene: Scene, frame: Frame | None = None, sampler: ReferenceSampler = "independent"
) -> Counterpart:
    """The scene's counterpart in Mitsuba, its shapes not merged, in the coordinates that suit
    float32 best, or in `frame`;  sampler: of samples that are not a grid.  Raises as `to_mitsuba`
    does."""
    frame = frame_of(scene) if frame is None else frame
    found = _translated(moved(scene, frame))
    instanced_group = _instanced_group(found)
    plain = {**_groups(found.mi_shapes), **found.plain}
    if not isinstance(scene.resolved_sampler, Grid):
        plain["sensor"]["sampler"]["type"] = sampler
    solids = tuple(found.solids)
    ours = in_place_of(scene, bool(solids))
    if (integrator := ours or by_paths(scene)) is not None:
        plain["integrator"] = integrator
    mi_scene = mitsuba().load_dict(plain, optimize=False)
    if ours is not None:
        mi_scene.integrator().lit = partial(LitScene, solids=solids)
    return Counterpart(mi_scene, found.mi_shapes, solids, instanced_group, frame, ours is not None)


def _instanced_group(found: _Translated) -> InstancedGroup | None:
    """Move the instances out of what is translated, if there are more than FEW."""
    names = [
        name for name, mi_shape in found.mi_shapes.items() if mi_shape.plugin.group is not None
    ]
    if len(names) <= MOST_INSTANCES or mitsuba().variant().startswith("scalar"):
        return None
    mi_shapes = {name: found.mi_shapes.pop(name) for name in names}
    instances = {name: found.plain.pop(name) for name in names}
    with scalar() as mi:
        groups = _groups(mi_shapes)
        mi_scene = mi.load_dict({"type": "scene", **ROBUST, **groups, **instances}, optimize=False)
    return InstancedGroup(mi_scene, mi_shapes)


def _groups(mi_shapes: Mapping[str, MitsubaShape]) -> dict[str, Any]:
    """The shape groups of these instances, in the current variant."""
    groups = {p.plugin.group.name: p.plugin.group for p in mi_shapes.values() if p.plugin.group}
    return {
        name: {"type": "shapegroup", "member": g.member() if callable(g.member) else g.member}
        for name, g in groups.items()
    }


def _translated(scene: Scene, native: bool = False) -> _Translated:
    context = TranslationContext.of(scene, native)
    sensor = translate_camera(scene.camera, scene.film, context)
    sensor["film"] = translate_film(scene.film)
    sensor["sampler"] = translate_sampler(scene.resolved_sampler)
    if scene.camera.medium is not None:
        sensor["medium"] = translate_medium(scene.media[scene.camera.medium])
    plain: dict[str, Any] = {"type": "scene", **ROBUST, "sensor": sensor}
    integrator = translate_integrator(scene.integrator, scene.has_media)
    if integrator is not None:
        plain["integrator"] = integrator
        if counts_lights_often(scene):
            integrator["emitter_samples"] = 1
    result = _Translated(plain, {}, [], [])
    copies = copies_of(scene)
    count = {group: sum(c.group == group for c in copies) for group in {c.group for c in copies}}
    shared: dict[Any, Any] = {}
    reach = _reach(scene, copies)
    for copy in copies:
        try:
            of_group = count[copy.group] if copy.group else 1
            _add(result, scene, copy, of_group, shared, context, reach)
        except ValueError as error:
            raise scene.error(str(error), "shapes", copy.shape) from None
    for i, light in enumerate(scene.lights):
        emitter = translate_light(light, context)
        if emitter is not None:
            plain[light_id(i)] = emitter
            result.drawn.append(True)
    if result.drawn and not any(result.drawn):  # Mitsuba refuses lights of which it may draw none
        plain["dark"] = BLACK | {"sampling_weight": 1.0}
    if drops_light(scene) and not native:
        plain["black"] = BLACK
    return result


def _reach(scene: Scene, copies: list[Copy]) -> float:
    """About the largest coordinate: of the eye, and of the transformed unit shapes."""
    found = float(np.abs([scene.camera.eye, scene.camera.target]).max())
    for copy in copies:
        for leaf in (leaf for member in copy.members for leaf in member.leaves):
            m = affine.map_in(leaf.shape, place_of(scene, leaf, copy.outer))
            found = max(found, float((np.abs(m[:, 3]) + np.abs(m[:, :3]).sum(axis=1)).max()))
    return found


def _never_samples(integrator: Any, copy: Copy, leaf: Leaf, place: TabulationContext) -> bool:
    """Whether a lamp lights nothing, because `reference_rt` samples lights alone and not this one:
    parts of groups, ellipsoids, and shapes that are not `is_sampled` shine where a ray of a BSDF's
    samples hits them.  Mitsuba samples the mesh that stands in for it."""
    if not isinstance(integrator, Direct) or integrator.bsdf_samples > 0:
        return False
    shape = leaf.shape
    if copy.instance >= 0 or not type_of(shape).is_sampled:
        return True
    return isinstance(shape, Sphere) and not affine.is_similarity(
        affine.map_in(shape, place)[:, :3]
    )


def _add(
    result: _Translated,
    scene: Scene,
    copy: Copy,
    count: int,
    shared: dict[Any, Any],
    context: TranslationContext,
    reach: float,
) -> None:
    """Add the shapes of one copy to the result;  count: how many copies its group has."""
    for number, member in enumerate(copy.members):
        name = shape_id(copy.shape)
        if copy.instance >= 0:
            name += f"_{copy.instance}_{number}"
        operands = []
        for leaf in member.leaves:
            place = place_of(scene, leaf, copy.outer)
            sides = media_of_shape(leaf, scene.media)
            parts = parts_of(leaf.material, context) | sides
            if "emitter" in parts and member.tree is None:
                drawn = not _never_samples(scene.integrator, copy, leaf, place)
                result.drawn.append(drawn)
                if not drawn:
                    parts["emitter"]["sampling_weight"] = 0.0
            coloured = coloured_parts_of(leaf.material, context)
            site = Site(
                place=place,
                parts=parts,
                coloured=parts if coloured is None else coloured | sides,
                textured=is_textured(leaf.material, context),
                oriented=is_oriented(leaf.material, context),
                material=leaf.material,
                copies=count,
                shared=shared,
                reach=reach,
                native=context.native,
                media=(leaf.interior, leaf.exterior),
            )
            plugins = translate_shape(leaf.shape, site)
            if site.textured and not all(plugin.has_our_uv for plugin in plugins):
                kind = type(leaf.shape).__name__
                raise UntranslatableError(f"{kind} under a texture, with other uv,", "shape")
            if member.tree is None:
                values, mi_shapes = _named(plugins, name, copy, leaf)
                result.plain.update(values)
                result.mi_shapes.update(mi_shapes)
            else:
                values, mi_shapes = _named(plugins, f"{name}_part{leaf.part}", copy, leaf)
                groups = _groups(mi_shapes)
                mi_scene = mitsuba().load_dict(
                    {"type": "scene", **ROBUST, **groups, **values}, optimize=False
                )
                operands.append(Operand(mi_scene, mi_shapes, leaf, place))
        if member.tree is not None:
            result.solids.append(SolidCounterpart(tuple(operands), member.tree))


def _named(
    plugins: list[Plugin], name: str, copy: Copy, leaf: Leaf
) -> tuple[dict[str, Any], dict[str, MitsubaShape]]:
    values, mi_shapes = {}, {}
    for plugin in plugins:
        key = name + plugin.suffix
        values[key] = plugin.value
        mi_shapes[key] = MitsubaShape(
            copy.shape, leaf.part, copy.instance, leaf.shape, plugin._replace(value=None)
        )
    return values, mi_shapes


__all__ = ["MOST_INSTANCES", "UntranslatableError", "load", "to_mitsuba"]
