"""Terms that a renderer lacks: shadows, light that is scattered again, highlights.

Real-time renderers lack some by design.  The scene is known, so it is rendered without them.

Contract: a cause is named only where the gate's own verdict on the pictures and ours without these
terms is `agree`; of several such, the one with the fewest terms.
"""

from collections.abc import Callable, Iterator
from typing import Any

from comparisons.compare.diagnosis import is_sure
from comparisons.compare.diagnosis.misfit import Misfit
from comparisons.compare.path_length import DIRECT, SAMPLES
from comparisons.results.case import Case, Cause, FloatArray
from reference_rt.integrators import Direct, Path
from reference_rt.materials import (
    Conductor,
    GltfPbr,
    Mirror,
    Phong,
    Plastic,
    Principled,
    RoughConductor,
    RoughPlastic,
)
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import Grid

WORTH = 0.25
"""Most of the squared difference that pictures leave which are judged: it is measured at few
samples, whose noise is part of it."""

RIVAL = 2.0
"""Such pictures leave at most this many times what the best one leaves."""


def missing_terms(
    scene: Scene,
    case: Case,
    rim: int,
    threads: int | None,
    judged: Callable[[Scene], Case],
    curve: Callable[[FloatArray], FloatArray] | None = None,
) -> Cause | None:
    """The terms without which our picture of a scene is the candidate's in a case that differs;
    None if it is no such picture, or if the case has a sure cause.

    rim: how many pixels the case leaves out on each side;  judged: the case of the same candidates
    against another scene;  curve: the tone curve of its pictures.
    """
    if is_sure(case.cause):
        return None
    if case.images is None or case.images.candidate.shape != case.images.reference.shape:
        return None
    misfit = Misfit(case.images)
    if not (misfit.clear and misfit.excess > 0.0):
        return None
    left = {}
    for terms, other in variants(scene):
        picture = picture_of(other, rim, threads)
        left[terms] = misfit.squares(picture if curve is None else curve(picture)), other
    most = WORTH * misfit.squares(misfit.reference)
    best = min((squares for squares, _ in left.values()), default=most)
    for terms, (squares, other) in left.items():
        if squares <= min(most, RIVAL * best) and judged(other).verdict == "agree":
            name = f"without {' and '.join(terms)}"
            evidence = f"the pictures agree with ours of the scene {name}"
            return Cause(name, evidence, 1.0 - squares / misfit.squares(misfit.reference))
    return None


def variants(scene: Scene) -> Iterator[tuple[tuple[str, ...], Scene]]:
    """The terms that are missing, and the scene without them: the fewest terms first."""
    own = scene.integrator
    if not isinstance(own, Path | Direct):
        return
    scattered = isinstance(own, Path) and (own.max_depth is None or own.max_depth > DIRECT)
    more = ("multiple scattering",) if scattered else ()
    integrators: dict[tuple[str, ...], Path | Direct] = {(): own}
    if more:
        integrators[more] = Direct(hide_emitters=own.hide_emitters)
    unshadowed = Direct(shadows=False, hide_emitters=own.hide_emitters)
    if own != unshadowed:
        integrators[(*more, "shadows")] = unshadowed
    matte = {name: _matte(material) for name, material in scene.materials.items()}
    scenes = {terms: scene.changed(integrator=one) for terms, one in integrators.items() if terms}
    if matte != scene.materials:
        for terms, one in integrators.items():
            scenes[(*terms, "highlights")] = scene.changed(integrator=one, materials=matte)
    yield from sorted(scenes.items(), key=lambda item: len(item[0]))


def _matte(material: Any) -> Any:
    """A material without the light that its interface mirrors, smooth or rough; glass as it is."""
    black = (0.0, 0.0, 0.0)
    changes: dict[str, Any] = {}
    if isinstance(material, Mirror | Conductor | RoughConductor):
        changes = {"reflectance": black}
    elif isinstance(material, Plastic | RoughPlastic):
        changes = {"specular": black}
    elif isinstance(material, Phong):
        changes = {"specular": black, "mirror": black}
    elif isinstance(material, Principled) and material.spec_trans == 0.0:
        changes = {"specular": 0.0, "eta": None, "clearcoat": 0.0}
        changes |= _without_metal(material.base_colour, material.metallic, "base_colour")
    elif isinstance(material, GltfPbr):
        changes = {"specular": 0.0}
        changes |= _without_metal(material.base_color, material.metallic, "base_color")
    return material.model_copy(update=changes)


def _without_metal(base: Any, metallic: Any, name: str) -> dict[str, Any]:
    """The base of a material whose metal mirrors nothing; textures stay as they are."""
    if isinstance(base, str) or isinstance(metallic, str):
        return {}
    return {name: tuple((1.0 - metallic) * x for x in base), "metallic": 0.0}


def picture_of(scene: Scene, rim: int, threads: int | None) -> FloatArray:
    """Ours with few samples, without a rim of so many pixels."""
    sampler = scene.resolved_sampler
    if not isinstance(sampler, Grid):
        pixels = scene.film.width * scene.film.height
        spp = 1 << max(0, (SAMPLES // pixels).bit_length() - 1)
        scene = scene.changed(sampler=sampler.model_copy(update={"spp": spp}))
    colour = render(scene, threads=threads).colour
    return colour[rim : colour.shape[0] - rim, rim : colour.shape[1] - rim]
