"""Two black pictures are alike whatever the renderers do, so that they show no agreement; two of
one colour show little."""

import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from comparisons.results.case import Images, RungResult
from reference_rt.integrators import Path, RayCast, Whitted
from reference_rt.lights import (
    Ambient,
    Constant,
    Directional,
    EnvironmentMap,
    Goniometric,
    Point,
    Projector,
    Spot,
)
from reference_rt.materials import Emissive, Phong
from reference_rt.rendering.scene import Scene
from reference_rt.shapes.shape import Shape, Solid

Darkness = Callable[[], str]
"""Returns the likely reason why the pictures of a scene are black; empty if the scene has no light,
so that they must be."""

MOST_RAYS = 4096
"""Camera rays that tell what the camera sees."""


def lit(checked: RungResult, images: Images, darkness: Darkness | None) -> RungResult:
    """The result of the rung `input`: `inconclusive` where neither picture has any light, unless
    the scene has none.  darkness: None where the scene is not known."""
    if checked.status != "agree" or images.candidate.any() or images.reference.any():
        return checked
    why = "whether the scene has light is not known" if darkness is None else darkness()
    if not why:
        return replace(checked, reason=f"{checked.reason}, all black: the scene has no light")
    reason = (
        f"both pictures are black throughout, which would hide nearly every fault: {why}; expected "
        "a view in which something shines or is lit"
    )
    return replace(checked, status="inconclusive", reason=reason)


def plain(images: Images) -> tuple[str, ...]:
    """A note on two pictures of one colour each, such as those of a sky alone."""
    sides = images.candidate, images.reference
    if not all(x.any() and (x == x[0, 0]).all() and x[..., 0].size > 1 for x in sides):
        return ()
    colour = ", ".join(f"{v:.3g}" for v in images.candidate[0, 0])
    return (
        f"both pictures are of one colour throughout, ({colour}): they show no edge, no shading",
    )


def why_dark(scene: Scene) -> str:
    """The likely reason why pictures of a scene are black; empty if it has nothing that shines."""
    integrator = scene.integrator
    is_cast = isinstance(integrator, RayCast)
    if not (scene.shapes if is_cast else _has_light(scene)):
        return ""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the scene: they were issued when it was rendered
        rays = scene.camera_rays()
        o, d = (x.reshape(-1, 3) for x in rays)
        step = max(1, len(o) // MOST_RAYS)
        o, d = o[::step], d[::step]
        hits = scene.intersect(o, d)
    if not hits.hit.any():
        beyond = f" beyond the near plane, at {scene.camera.near:g}," if scene.camera.near else ""
        return f"no ray of the camera{beyond} meets a shape"
    if is_cast:
        return ""  # surfaces are seen, whose colour, or whose number, is 0
    if (np.einsum("ij,ij->i", hits.n[hits.hit], d[hits.hit]) > 0.0).all():
        return (
            "the camera sees surfaces from behind alone, as from within a shape, or where its near "
            "plane cuts one"
        )
    if isinstance(integrator, Path) and integrator.max_depth in (0, 1):
        return f"paths of max_depth {integrator.max_depth} show what shines by itself alone"
    return "no light reaches what the camera sees"


def _has_light(scene: Scene) -> bool:
    return any(_shines(scene)) or (
        isinstance(scene.integrator, Whitted)
        and any(isinstance(m, Phong) for m in scene.materials.values())
        and any(max(light.radiance) > 0.0 for light in scene.lights if isinstance(light, Ambient))
    )


def _shines(scene: Scene) -> Iterator[bool]:
    """Whether each light, and each lamp, has any radiance; images count as bright."""
    for light in scene.lights:
        match light:
            case Constant(radiance=colour) | Directional(irradiance=colour):
                yield max(colour) > 0.0
            case Point(intensity=colour) | Spot(intensity=colour) | Goniometric(intensity=colour):
                yield max(colour) > 0.0
            case Projector(irradiance=colour):
                yield isinstance(colour, str) or max(colour) > 0.0
            case EnvironmentMap():
                yield True
    used = {shape.material for shape in _parts(scene)}
    for name, material in scene.materials.items():
        if isinstance(material, Emissive) and name in used:
            radiance = material.radiance
            yield isinstance(radiance, str) or max(radiance) > 0.0


def _parts(scene: Scene) -> Iterator[Shape]:
    """Every shape, those of groups and the operands of solids, too."""
    waiting = [*scene.shapes, *(shape for group in scene.groups.values() for shape in group)]
    while waiting:
        shape = waiting.pop()
        yield shape
        if isinstance(shape, Solid):
            waiting += shape.of
