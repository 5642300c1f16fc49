"""Errors of Mitsuba's integrators, the scenes that they concern, and what a comparison does about
them."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from comparisons.geometry import affine
from comparisons.integrators import translate_integrator, type_of
from comparisons.integrators.light import as_path
from comparisons.lights import type_of as type_of_light
from comparisons.shapes import type_of as type_of_shape
from comparisons.shapes.plane import RINGS
from comparisons.translator.endless import left_in
from reference_rt.integrators import Direct, Light, Path
from reference_rt.lights import Directional
from reference_rt.materials import Emissive, Mask, NoSurface, ThinDielectric
from reference_rt.rendering.scene import Scene
from reference_rt.scene.model import SceneModel
from reference_rt.shapes import Mesh, Plane, Rectangle, Shape, Solid


def in_place_of(scene: SceneModel, has_solids: bool = False) -> dict[str, Any] | None:
    """Our integrator, which runs in Mitsuba, for a scene for which Mitsuba's own is wrong, or that
    has solids; None for all others."""
    integrator = scene.integrator
    of_type = type_of(integrator)
    of_solids = of_type.media_of_solids if scene.has_media else of_type.of_solids
    wrong = has_solids or squares_opacity(scene) or misplaces(scene)
    wrong = wrong or passes_panes(scene) or loses_lamps(scene) or has_wrong_media(scene)
    wrong = wrong or forgets_far(scene)
    return of_solids(integrator) if of_solids is not None and wrong else None


def by_paths(scene: SceneModel) -> dict[str, Any] | None:
    """Mitsuba's integrator `path` in place of its `ptracer`, which has the expected picture of it
    where it is right: it finds no path that ends, at the camera, in a mirror or in glass, does not
    take orthographic cameras, and shows a room under an environment map 1.56 times as bright as
    `path` does (Mitsuba 3.9.1)."""
    integrator = scene.integrator
    return translate_integrator(as_path(integrator)) if isinstance(integrator, Light) else None


def misplaces(scene: SceneModel) -> bool:
    """What Mitsuba's integrators see behind a hidden lamp is placed by the new ray's distance from
    the old ray's origin, unless it is a mesh, as rectangles and cubes are to Mitsuba (3.9.1,
    `SamplingIntegrator::skip_area_emitters`)."""
    return isinstance(scene.integrator, Path | Direct) and scene.integrator.hide_emitters


def counts_lights_often(scene: SceneModel) -> bool:
    """Mitsuba's integrator `direct` adds up its samples of lights without extent, which it should
    average (src/integrators/direct.cpp: their weight is 1 whatever `emitter_samples` is), so that
    they are as many times too bright.  The mean does not depend on the number, and the counterpart
    has one."""
    integrator = scene.integrator
    points = any(type_of_light(light).has_no_extent for light in scene.lights)
    return points and isinstance(integrator, Direct) and integrator.light_samples > 1


def squares_opacity(scene: SceneModel) -> bool:
    """On masks that are neither opaque nor absent Mitsuba's integrator `path` multiplies samples of
    lights by the opacity twice.  A diffuse plane under a point light then has a quarter of its
    light at an opacity of a half, where Mitsuba's BSDF and its integrator `direct` give half of it
    (Mitsuba 3.9.1)."""
    masks = [m for m in scene.materials.values() if isinstance(m, Mask)]
    if scene.has_media:
        return False  # see `passes_panes`
    return isinstance(scene.integrator, Path) and any(m.opacity not in (0.0, 1.0) for m in masks)


def passes_panes(scene: SceneModel) -> bool:
    """Shadow rays of Mitsuba's `volpathmis` pass masks and thin panes, as those of its `path` and
    ours do not, and its paths do not count them as edges."""
    kinds = {type(material) for material in scene.materials.values()}
    return scene.has_media and not kinds.isdisjoint((ThinDielectric, Mask))


def loses_lamps(scene: SceneModel) -> bool:
    """Shadow rays of Mitsuba's `volpath` and `volpathmis` go on behind what is no surface, its ray
    epsilon further, and still as far as before: behind some they end not before the lamp but
    behind its surface, which hides its light.  Of a lamp at a distance of 1, behind three sheets,
    nothing is left where |p| is 3, and 2.6 % of the picture of `scenes/nested_media.yaml` was
    missing (Mitsuba 3.9.1; findings/)."""
    kinds = {type(material) for material in scene.materials.values()}
    return isinstance(scene.integrator, Path) and {NoSurface, Emissive} <= kinds


def forgets_far(scene: SceneModel) -> bool:
    """Camera rays of Mitsuba's `volpath` and `volpathmis` forget the far clipping plane behind what
    is no surface (Mitsuba 3.9.1; findings/)."""
    no_surface = any(isinstance(m, NoSurface) for m in scene.materials.values())
    return isinstance(scene.integrator, Path) and scene.camera.far is not None and no_surface


def has_wrong_media(scene: SceneModel) -> bool:
    """A medium that is clear in one colour scatters none by `volpathmis`, and is no number by
    `volpath`; a medium without end is lit by what is infinitely far away (Mitsuba 3.9.1;
    findings/)."""
    clear = any(0.0 in m.sigma_t and any(m.sigma_t) for m in scene.media.values())
    far = any(type_of_light(light).surrounds for light in scene.lights)
    far |= any(isinstance(light, Directional) for light in scene.lights)
    return clear or (far and has_endless_media(scene))


def has_endless_media(scene: SceneModel) -> bool:
    """Whether rays may leave the scene in a medium, and not far away: it is around the camera, no
    closed shape has it within, or lines through the shapes leave the scene in it.  Meshes with a
    medium in them are taken for closed ones.

    A medium is dark in Mitsuba, too, where it takes all light on the way to the edge of the scene,
    which is at least as far as that of its largest rectangle, or of the mesh of a plane; copies may
    have another size.
    """
    closed: set[str | None] = {None}
    others: set[str | None] = set()
    rectangles = [
        affine.of_steps(one.transform) for one in scene.shapes if isinstance(one, Rectangle)
    ]
    edges = [float(np.linalg.norm(m[:, :2], axis=0).max()) for m in rectangles]
    edges += [2.0 ** RINGS[1] for one in scene.shapes if isinstance(one, Plane)]
    reach = max(edges, default=0.0)
    for shape in (*scene.shapes, *(one for group in scene.groups.values() for one in group)):
        if shape.interior is not None:
            (closed if _holds(shape) else others).add(shape.interior)
        others.add(shape.exterior)
    endless = others - closed
    if others & closed - {None} and isinstance(scene, Scene):
        endless |= left_in(scene)
    media = [scene.media[name] for name in endless if name is not None]
    lit = any(min(m.sigma_t) * m.scale * reach < DARK for m in media)
    return scene.camera.medium is not None or lit


DARK = 24.0 * math.log(2.0)
"""The optical thickness behind which light is below float32's rounding."""


def _holds(shape: Shape) -> bool:
    """Whether a shape is closed, or a plane: its mesh in Mitsuba is so large that the scene's edge,
    at which a medium ends, is far away."""
    return isinstance(shape, Mesh | Solid) or type_of_shape(shape).encloses(shape)


BLACK: dict[str, Any] = {
    "type": "constant",
    "radiance": {"type": "rgb", "value": [0.0, 0.0, 0.0]},
    "sampling_weight": 0.0,
}
"""An environment without light, which is never sampled."""


def drops_light(scene: SceneModel) -> bool:
    """Where there is no environment Mitsuba's integrator `path` returns black for a path that only
    passes straight through surfaces, and so drops the emission of a lamp that lets light pass so.
    A thin pane that shines shows 8 % of its radiance, with BLACK all of it, as with `volpath`
    (Mitsuba 3.9.1)."""
    environments = any(type_of_light(light).surrounds for light in scene.lights)
    kinds = {type(material) for material in scene.materials.values()}
    passing = not kinds.isdisjoint((ThinDielectric, Mask))
    if scene.has_media:
        return False  # that is followed by another integrator, which has the light
    return isinstance(scene.integrator, Path) and not environments and passing and Emissive in kinds


ROULETTE = (
    "Russian roulette of Mitsuba's volpathmis takes light away: it has none here, and paths "
    "without a limit are volpath's"
)
"""A note on scenes with media, and on files with that integrator."""


class Mistake(NamedTuple):
    """concerns: whether it would make Mitsuba's picture of a scene wrong;  note: for the report."""

    concerns: Callable[[SceneModel], bool]
    note: Callable[[SceneModel], str]


MISTAKES = (
    Mistake(
        counts_lights_often,
        lambda scene: (
            "Mitsuba's direct illumination adds up its samples of lights without extent, which it "
            f"should average: with {getattr(scene.integrator, 'light_samples', 1)} of them these "
            "lights are as many times too bright; compared with one sample, for which it is right"
        ),
    ),
    Mistake(
        squares_opacity,
        lambda scene: (
            "Mitsuba's path tracer multiplies samples of lights by the opacity of a mask twice; "
            "our own, which runs in Mitsuba, takes its place"
        ),
    ),
    Mistake(
        drops_light,
        lambda scene: (
            "without an environment Mitsuba's path tracer drops the light of lamps that let light "
            "pass straight through: its scene has a black environment"
        ),
    ),
    Mistake(
        passes_panes,
        lambda scene: (
            "in media Mitsuba's shadow rays pass masks and thin panes, which ours do not, and its "
            "paths do not count them; our own integrator, which runs in Mitsuba, takes its place"
        ),
    ),
    Mistake(
        has_wrong_media,
        lambda scene: (
            "Mitsuba is wrong for media that are clear in one colour, and for those without end "
            "under a sun or a sky; our own integrator, which runs in Mitsuba, takes the place of "
            "its own"
        ),
    ),
    Mistake(
        forgets_far,
        lambda scene: (
            "Mitsuba's camera rays forget the far clipping plane behind boundaries without a "
            "surface; our own integrator, which runs in Mitsuba, takes the place of its own"
        ),
    ),
    Mistake(
        loses_lamps,
        lambda scene: (
            "Mitsuba's shadow rays that pass boundaries without a surface may end behind the "
            "lamp's surface, which then hides its light; our own integrator, which runs in "
            "Mitsuba, takes the place of its own"
        ),
    ),
    Mistake(
        lambda scene: isinstance(scene.integrator, Light),
        lambda scene: (
            "Mitsuba's particle tracer lacks what mirrors and glass show, orthographic cameras and "
            "skies of maps; its path tracer, of the same mean, takes its place"
        ),
    ),
    Mistake(
        misplaces,
        lambda scene: (
            "Mitsuba misplaces what lies behind hidden lamps unless it is a mesh or a rectangle; "
            "our own integrator, which runs in Mitsuba, takes the place of its own"
        ),
    ),
)


def notes_of_integrator(scene: SceneModel) -> list[str]:
    """The notes on the errors that concern a scene."""
    return [mistake.note(scene) for mistake in MISTAKES if mistake.concerns(scene)]
