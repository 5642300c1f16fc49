"""Hypotheses about media that a renderer has wrong: the sign of g, one density for all colours, a
medium that is not left.

The scene is known, so it is rendered with each such mistake, and the change of our picture is what
the candidate should show.  Flights change with a density, so that both pictures have noise of their
own, which is measured.
"""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from comparisons.compare.diagnosis.hypothesis import Hypothesis
from comparisons.compare.diagnosis.misfit import REST
from comparisons.results.case import FloatArray
from reference_rt.media import AnyPhase, BlendPhase, HenyeyGreenstein, Homogeneous, Isotropic
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.shapes import Shape

SAMPLES = 1 << 16
"""Camera samples of a picture of a batch."""

BATCHES = 8
"""Pictures of each kind, whose spread is the noise."""

Change = Callable[[Homogeneous], dict[str, Any]]


def media_mistakes(
    scene: Scene, reference: FloatArray, threads: int | None = None
) -> Iterator[Hypothesis]:
    """Hypotheses about a reference (height, width, 3); renders them."""
    pixels = scene.film.width * scene.film.height
    spp = 1 << max(0, (SAMPLES // pixels).bit_length() - 1)
    right: FloatArray | None = None
    for name, evidence, other in mistaken(scene):
        if right is None:
            right = _pictures(scene, spp, threads)
        found = _pictures(other, spp, threads) - right
        if found.shape[1:] == reference.shape and found.any():
            picture = reference + found.mean(axis=0)
            noise = found.var(axis=0, ddof=1) / len(found)
            yield Hypothesis("media", name, evidence, picture, 0, REST, None, noise)


def _pictures(scene: Scene, spp: int, threads: int | None) -> FloatArray:
    sampler = scene.resolved_sampler
    seeds = range(BATCHES)
    each = (
        scene.changed(sampler=sampler.model_copy(update={"spp": spp, "seed": 1000 + seed}))
        for seed in seeds
    )
    return np.stack([render(one, threads=threads).colour for one in each])


EVIDENCE = "so does our picture change if rendered so"


def mistaken(scene: Scene) -> Iterator[tuple[str, str, Scene]]:
    """Each mistake that changes the scene: its name, the evidence, and the scene with it."""
    for name, change in CHANGES.items():
        media = {k: m.model_copy(update=change(m)) for k, m in scene.media.items()}
        if media != scene.media:
            yield name, EVIDENCE, scene.changed(media=media)
    if scene.media:
        # A medium that nothing names may stay: surfaces without one are boundaries no more.
        changes: dict[str, Callable[[Shape], dict[str, Any]]] = {
            "light does not leave the media that it has entered": _not_left,
            "the media inside and outside of surfaces change places": _exchanged,
        }
        for name, of_shape in changes.items():
            shapes = tuple(s.model_copy(update=of_shape(s)) for s in scene.shapes)
            groups = {
                k: tuple(s.model_copy(update=of_shape(s)) for s in members)
                for k, members in scene.groups.items()
            }
            if shapes != scene.shapes or groups != scene.groups:
                yield name, EVIDENCE, scene.changed(shapes=shapes, groups=groups)
    if scene.camera.medium is not None:
        camera = scene.camera.model_copy(update={"medium": None})
        name = "the camera is not in its medium"
        yield name, EVIDENCE, scene.changed(camera=camera)


def _not_left(shape: Shape) -> dict[str, Any]:
    return {"exterior": shape.interior} if shape.interior and not shape.exterior else {}


def _exchanged(shape: Shape) -> dict[str, Any]:
    return {"interior": shape.exterior, "exterior": shape.interior}


def _phase(change: Callable[[Any], Any]) -> Change:
    """Changes each part of a phase function."""

    def of(phase: AnyPhase) -> AnyPhase:
        if isinstance(phase, BlendPhase):
            first, second = change(phase.first), change(phase.second)
            return phase.model_copy(update={"first": first, "second": second})
        return change(phase)  # type: ignore[no-any-return]

    return lambda medium: {"phase": of(medium.phase)}


def _turned(phase: Any) -> Any:
    return HenyeyGreenstein(g=-phase.g) if isinstance(phase, HenyeyGreenstein) else phase


def _grey(of: Callable[[Any], float]) -> Change:
    return lambda medium: {"sigma_t": (float(of(medium.sigma_t)),) * 3}


CHANGES: dict[str, Change] = {
    "g of phase functions has the other sign": _phase(_turned),
    "phase functions are isotropic": _phase(lambda phase: Isotropic()),
    "media have the mean density for all colours": _grey(np.mean),
    "media have the density of red for all colours": _grey(lambda sigma_t: sigma_t[0]),
    "media have the largest density for all colours": _grey(max),
    "red and blue of media change places": lambda medium: {
        "sigma_t": medium.sigma_t[::-1],
        "albedo": medium.albedo[::-1],
    },
    "media absorb nothing": lambda medium: {"albedo": (1.0, 1.0, 1.0)},
    "media scatter nothing": lambda medium: {"albedo": (0.0, 0.0, 0.0)},
    "the scale of media is forgotten": lambda medium: {"scale": 1.0},
    "there are no media": lambda medium: {"scale": 0.0},
    "media are twice as dense": lambda medium: {"scale": 2.0 * medium.scale},
    "media are half as dense": lambda medium: {"scale": 0.5 * medium.scale},
    "the extinction is taken for the absorption alone": lambda medium: {
        "sigma_t": tuple(t * (1.0 + a) for t, a in zip(medium.sigma_t, medium.albedo, strict=True)),
        "albedo": tuple(a / (1.0 + a) for a in medium.albedo),
    },
}
"""By what a renderer does: fields that it has otherwise."""
