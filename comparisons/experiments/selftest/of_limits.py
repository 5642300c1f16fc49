"""Gross faults in scenes beyond the reference's precision: a limit must not excuse them.

Each is a change of any scene, or of its pictures, that anybody would see.  It is left out of a
scene where there is nothing that it changes, and where it does not change our own picture: an
index-matched ball is not to be seen, whatever its colour is.

To add one: a row of `FAULTS`.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.compare.budget import Budget
from comparisons.compare.compare import Subject, budgeted, gather
from comparisons.compare.judge import Evidence, judge, of_replicates
from comparisons.experiments.selftest.fault import CAUGHT, compared
from comparisons.results.case import Case, FloatArray, Images
from comparisons.rungs.rays.camera import camera_rays, pixel_centres
from reference_rt.core.transform import Scale, Translate
from reference_rt.integrators import Path as PathTracing
from reference_rt.integrators import RayCast
from reference_rt.lights import Constant, Directional, Point
from reference_rt.materials import Dielectric, Emissive
from reference_rt.rendering import query
from reference_rt.rendering.image import display
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import Grid
from reference_rt.shapes import Disk, Rectangle

STRESS = (
    *("planet", "needle", "far_origin", "tiny", "slivers", "grazing", "nested_glass"),
    *("csg_coincident", "index_matched", "bright_and_dim", "deep_mirrors", "near_delta"),
    *("tiny_light", "white_corridor"),
)
"""The stress scenes: those that are `reference-limited` are among them."""

LEAST = 0.02
"""Change of our own picture, over its mean, below which a fault is not gross.  Of a fault of the
scene the mean of the change, with the same random numbers; of one of the picture see `_power`."""

FINER = 32
"""So many times the samples of the budget have the pictures of `_power`.  In the noisiest scene, a
corridor that is nearly symmetric, a mirror changes 0.019, and three pixels aside 0.032 (measured
with 1,024 times the samples); with 32 times, values about 0.02 are uncertain by some 0.015."""

Change = Callable[[Scene], Scene]

PictureChange = Callable[[FloatArray], FloatArray]
"""Of pictures (replicates, height, width, 3)."""


@dataclass(frozen=True)
class GrossFault:
    """needs: what a scene must have that it changes;  change: a new scene, equal to the old one
    where it has not;  of_picture: a change of pictures instead."""

    name: str
    needs: str
    change: Change | None = None
    of_picture: PictureChange | None = None


# ---- changes of scenes ---------------------------------------------------------------------------


def _each(section: str, kinds: type | tuple[type, ...], change: Callable[[Any], Any]) -> Change:
    """Change each part of a section that is of these kinds."""

    def changed(scene: Scene) -> Scene:
        parts = getattr(scene, section)
        if isinstance(parts, tuple | list):
            new: Any = tuple(change(p) if isinstance(p, kinds) else p for p in parts)
        else:
            new = {k: change(p) if isinstance(p, kinds) else p for k, p in parts.items()}
        return scene.changed(**{section: new})

    return changed


def _fields(of: Any, names: Iterable[str], change: Callable[[Any], Any]) -> Any:
    """A part with those of its fields changed that it has and that are numbers."""
    new = {
        name: change(getattr(of, name))
        for name in names
        if not isinstance(getattr(of, name, "none"), str | None)
    }
    return of.model_copy(update=new)


def _times(factor: float) -> Callable[[Any], Any]:
    def product(value: Any) -> Any:
        if isinstance(value, tuple):
            return tuple(factor * x for x in value)
        return factor * value

    return product


def _reversed(value: Any) -> Any:
    return value[::-1] if isinstance(value, tuple) else value


LIGHT = ("radiance", "irradiance", "intensity", "scale")
"""Fields by which a light is brighter; a lamp has only the first."""

ALL = (object,)


def _lights(change: Callable[[Any], Any], lamps: bool = True) -> Change:
    """Change the brightness of all lights, and of lamps."""
    of_lights = _each("lights", ALL, lambda light: _fields(light, LIGHT, change))
    of_lamps = _each("materials", Emissive, lambda lamp: _fields(lamp, LIGHT[:1], change))
    return lambda scene: of_lamps(of_lights(scene)) if lamps else of_lights(scene)


def _first_light(scene: Scene) -> Scene:
    if not scene.lights:
        return scene
    dim = _fields(scene.lights[0], LIGHT, _times(1e-3))
    return scene.changed(lights=(dim, *scene.lights[1:]))


def _nearer(scene: Scene) -> Scene:
    """Point lights four tenths of their way towards what the camera looks at."""

    def moved(light: Any) -> Any:
        p = np.array(light.position)
        to = p + 0.4 * (np.array(scene.camera.target) - p)
        return light.model_copy(update={"position": tuple(to.tolist())})

    return _each("lights", Point, moved)(scene)


def _turned_over(scene: Scene) -> Scene:
    """Flat lamps that shine to the other side."""
    lamps = {name for name, m in scene.materials.items() if isinstance(m, Emissive)}

    def over(shape: Any) -> Any:
        if shape.material not in lamps:
            return shape
        turn = Scale(scale=(1.0, 1.0, -1.0))
        return shape.model_copy(update={"transform": (turn, *shape.transform)})

    return _each("shapes", (Rectangle, Disk), over)(scene)


def _most_seen(scene: Scene) -> list[int]:
    """The shapes that the camera sees, those in most pixels first."""
    hits = query.intersect(scene.tables, *camera_rays(scene, *pixel_centres(scene.film, 1000)))
    seen, counts = np.unique(hits.shape[hits.shape >= 0], return_counts=True)
    return [int(k) for k in seen[np.argsort(-counts, kind="stable")]]


def _distance(scene: Scene) -> FloatArray:
    return np.asarray(np.array(scene.camera.target) - np.array(scene.camera.eye))


def _moved_shape(rank: int, share: float) -> Change:
    """The shape that is seen in the most pixels but `rank`, moved sideways by a share of the
    distance that the camera looks at."""

    def change(scene: Scene) -> Scene:
        ranked = _most_seen(scene)
        if rank >= len(ranked):
            return scene
        step = share * float(np.linalg.norm(_distance(scene)))
        aside = tuple((step * np.array(scene.camera.basis[0])).tolist())
        shapes = list(scene.shapes)
        old = shapes[ranked[rank]]
        steps = (*old.transform, Translate(translate=aside))
        shapes[ranked[rank]] = old.model_copy(update={"transform": steps})
        return scene.changed(shapes=tuple(shapes))

    return change


def _wider(scene: Scene) -> Scene:
    """A fifth more field of view."""
    fov = getattr(scene.camera, "fov", None)
    if fov is None:
        return scene
    return scene.changed(camera=scene.camera.model_copy(update={"fov": 1.2 * fov}))


def _aside(scene: Scene) -> Scene:
    """The eye moved to the right, by 0.15 of how far it looks."""
    right = np.array(scene.camera.basis[0]) * np.linalg.norm(_distance(scene))
    eye = tuple((np.array(scene.camera.eye) + 0.15 * right).tolist())
    return scene.changed(camera=scene.camera.model_copy(update={"eye": eye}))


def _short(scene: Scene) -> Scene:
    """Paths that end at the first surface that light reaches directly."""
    if not isinstance(scene.integrator, PathTracing):
        return scene  # the depth of a Whitted tree is the same description on both sides
    return scene.changed(integrator=scene.integrator.model_copy(update={"max_depth": 2}))


def _textures(scene: Scene) -> Scene:
    return _each(
        "textures",
        ALL,
        lambda t: t.model_copy(
            update={"uv": t.uv.model_copy(update={"scale": _times(1.5)(t.uv.scale)})}
        ),
    )(scene)


COLOURS = ("reflectance", "eta", "k")


# ---- changes of pictures -------------------------------------------------------------------------


def _a_corner_black(pictures: FloatArray) -> FloatArray:
    pictures = pictures.copy()
    height, width = pictures.shape[1:3]
    pictures[:, height // 2 :, width // 2 :] = 0.0
    return pictures


# ---- the faults ----------------------------------------------------------------------------------

FAULTS = (
    GrossFault("directional light reversed", "a directional light",
               _each("lights", Directional, lambda x: _fields(x, ("direction",), _times(-1.0)))),
    GrossFault("all light twice as bright", "light", _lights(_times(2.0))),
    GrossFault("lights blue for red", "light", _lights(_reversed)),
    GrossFault("the first light lost", "a light", _first_light),
    GrossFault("surroundings a tenth as bright", "a constant environment",
               _each("lights", Constant, lambda x: _fields(x, LIGHT, _times(0.1)))),
    GrossFault("light as if from twice as far", "a point light",
               _each("lights", Point, lambda x: _fields(x, LIGHT, _times(0.25)))),
    GrossFault("point lights moved", "a point light", _nearer),
    GrossFault("lamps shine to the other side", "a flat lamp", _turned_over),
    GrossFault("half of the reflectance", "a material with a reflectance",
               _each("materials", ALL, lambda x: _fields(x, COLOURS[:1], _times(0.5)))),
    GrossFault("materials blue for red", "a material with a colour",
               _each("materials", ALL, lambda x: _fields(x, COLOURS, _reversed))),
    GrossFault("glass of a third more index", "glass",
               _each("materials", Dielectric,
                     lambda x: _fields(x, ("interior_ior",), _times(4.0 / 3.0)))),
    GrossFault("ten times as rough", "a rough material",
               _each("materials", ALL, lambda x: _fields(x, ("alpha",), _times(10.0)))),
    GrossFault("textures half as much again", "a texture", _textures),
    GrossFault("paths of two edges", "a path tracer of longer paths", _short),
    GrossFault("a fifth more field of view", "a field of view", _wider),
    GrossFault("eye aside", "a camera that looks at a point", _aside),
    GrossFault("the largest shape lost", "a shape", _moved_shape(0, 1e7)),
    GrossFault("the second largest shape lost", "a second shape", _moved_shape(1, 1e3)),
    GrossFault("a shape aside", "a second shape", _moved_shape(1, 0.05)),
    GrossFault("picture mirrored", "", of_picture=lambda p: p[:, :, ::-1]),
    GrossFault("picture upside down", "", of_picture=lambda p: p[:, ::-1]),
    GrossFault("channels swapped", "", of_picture=lambda p: p[..., ::-1]),
    GrossFault("picture twice as bright", "", of_picture=lambda p: 2.0 * p),
    GrossFault("picture of another gamma", "", of_picture=lambda p: np.maximum(p, 0.0) ** 0.7),
    GrossFault("picture moved by three pixels", "", of_picture=lambda p: np.roll(p, 3, axis=2)),
    GrossFault("a corner black", "", of_picture=_a_corner_black),
)  # fmt: skip


# ---- what a comparison says to them --------------------------------------------------------------


@dataclass(frozen=True)
class Answer:
    """left_out: why the fault was not planted, or "";  verdict, rung, reason: otherwise."""

    scene: str
    fault: str
    left_out: str
    verdict: str = ""
    rung: str = ""
    reason: str = ""

    @property
    def is_caught(self) -> bool:
        return not self.left_out and self.verdict in CAUGHT


def answers(
    scene: Scene, budget: Budget, faults: Sequence[GrossFault] = FAULTS
) -> Iterator[Answer]:
    """What the comparison says to each fault in a scene."""
    small = budgeted(scene, budget)
    right: Evidence | None = None
    before = _own_picture(small)
    pair = _two_pictures(small) if any(fault.of_picture for fault in faults) else ()
    for fault in faults:
        if fault.of_picture is not None:
            change = _power(fault.of_picture, *pair)
        elif (faulty := fault.change(scene)).digest() != scene.digest():  # type: ignore[misc]
            after = _own_picture(budgeted(faulty, budget))
            change = float(np.abs(after - before).mean() / np.abs(before).mean())
        else:
            yield Answer(scene.name, fault.name, f"the scene does not have {fault.needs}")
            continue
        if change < LEAST:
            yield Answer(scene.name, fault.name, f"our picture changes by {change:.2g}")
            continue
        if fault.change is not None:
            case = compared(Subject(fault.change(scene), scene), budget, threads=1)
        else:
            right = right or gather(Subject(scene), budget, lambda step: None, 1)
            case = _with_pictures(right, fault, budget)
        rung = next((r for r in case.rungs if r.status == case.verdict), None)
        yield Answer(
            *(scene.name, fault.name, "", case.verdict),
            rung=rung.name if rung else "",
            reason=case.reason,
        )


def _own_picture(scene: Scene) -> FloatArray:
    """With the same seeds, whatever the fault is: noise cancels where it changes nothing."""
    picture = render(scene, threads=1)
    return display(picture) if isinstance(scene.integrator, RayCast) else picture.colour


def _two_pictures(scene: Scene) -> tuple[FloatArray, FloatArray]:
    """Of independent noise, if they have any."""
    sampler = scene.resolved_sampler
    if isinstance(sampler, Grid):
        return (_own_picture(scene),) * 2
    finer = [
        sampler.model_copy(update={"spp": FINER * sampler.spp, "seed": sampler.seed + k})
        for k in range(2)
    ]
    one, another = (_own_picture(scene.changed(sampler=of)) for of in finer)
    return one, another


def _power(change: PictureChange, one: FloatArray, another: FloatArray) -> float:
    """The root mean square of what a fault changes in a picture, over the picture's mean.  What it
    does to noise, such as to mirror it, is no change: in the product of what it changes in two
    pictures independent noise has no mean."""
    changes = (change(picture[np.newaxis])[0] - picture for picture in (one, another))
    product = float(np.prod([*changes], axis=0).mean())
    return math.sqrt(max(product, 0.0)) / float(np.abs(one).mean())


def _with_pictures(right: Evidence, fault: GrossFault, budget: Budget) -> Case:
    rendered = right.rendered
    assert rendered is not None
    assert fault.of_picture is not None
    if rendered.resampled is None:
        ours = fault.of_picture(rendered.images.candidate[np.newaxis])[0]
        images = Images(np.ascontiguousarray(ours), rendered.images.reference)
        altered = replace(rendered, images=images, checked=None)
    else:
        ours, reference = rendered.resampled
        altered = of_replicates(fault.of_picture(ours), reference, rendered.seconds)
    return judge(replace(right, rendered=altered, lights=None, lengths=None), budget.limit)


def scene_of(name: str, scenes: Path) -> Scene:
    return Scene.load(scenes / f"{name}.yaml")
