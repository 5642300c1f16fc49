"""Differences that are exactly a convention of a renderer that was measured.

Contract: as in `terms`, a convention is named only where the gate's own verdict on the pictures,
read with it undone, is `agree`.
"""

import math
from collections.abc import Callable, Collection
from dataclasses import replace

import numpy as np
from scipy import ndimage

from comparisons.gate.conventions import RENDERERS, Changes
from comparisons.gate.terms import picture_of
from comparisons.gate.undone import Undo
from comparisons.results.case import Case, Cause, FloatArray, Images
from reference_rt.materials import Dielectric
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import UsageError

SAME = 0.1
"""Relative difference of a picture's mean from a known factor beyond which it is another factor: it
saves rendering, and the gate judges afterwards. A shift of the picture changes its mean, too."""

WORTH, RIVAL = 0.7, 2.0
"""Most of the squared difference that predictions leave which are judged, and how many times what
the best one leaves: where they are interpolated, edges leave some."""


SINGLE, TINY, ALIKE = 1e-5, 1e-9, 0.99
"""Difference of a value that is rounded to float32 on the way, relative to the value and to the
largest, and the least share of values that have no other: of a hundred, one may be rounded to the
next code."""


def as_renderers(
    case: Case,
    scene: Scene | None,
    threads: int | None,
    judged: Callable[[Undo], Case],
    scaled: Callable[[float], Case],
) -> Cause | None:
    """The conventions whose undoing makes the candidate of a case that differs ours; None if there
    are none.

    scene: the reference's, None if that is a picture;  judged: the case of the same candidates,
    read so;  scaled: against the reference times a factor.
    """
    if case.images is None or case.images.candidate.shape != case.images.reference.shape:
        return None
    images = case.images
    total = _squares(images, images.reference)
    if not 0.0 < total < math.inf:  # also refuses NaN
        return None
    left: list[tuple[float, Undo, list[str]]] = []
    kinds = set() if scene is None else {light.type for light in scene.lights}
    tall = scene is not None and scene.film.height > scene.film.width
    for changes, whose in _all(kinds, tall):
        try:
            undo = Undo(changes, scene, scene is None)
        except UsageError:
            continue
        if not _could_be(undo, images):
            continue
        left.append((_squares(images, _predicted(undo, images, threads)), undo, whose))
    best = min((squares for squares, _, _ in left), default=total)
    for squares, undo, whose in sorted(left, key=lambda one: one[0]):
        if squares > min(WORTH * total, RIVAL * best):
            continue
        if _same(images, undo, threads) if _is_final(undo) else judged(undo).verdict == "agree":
            name = f"{', '.join(undo.changes.words())}, as {' and '.join(whose)}"
            numbers = ":numbers" if undo.changes.lights else ""
            option = " or ".join(f"--from {n}{numbers}" for n in _options(undo.changes, kinds))
            evidence = "the pictures agree where that is undone"
            if option:
                evidence = f"with {option} the pictures agree"
            return Cause(name, evidence, 1.0 - squares / total)
    return None if scene is None else _of_glass(images, scene, scaled)


def _squares(images: Images, picture: FloatArray) -> float:
    """Of what a picture leaves of the candidate, noise included: the gate judges afterwards."""
    return float(((images.candidate - picture) ** 2).sum())


def _all(kinds: Collection[str], tall: bool) -> list[tuple[Changes, list[str]]]:
    """Each convention, and those of a renderer together, with the renderers that have it, of a
    scene with these types of lights;  tall: whether its pictures' longer side is the height."""
    found: list[tuple[Changes, list[str]]] = []
    for renderer in RENDERERS.values():
        own = renderer.changes.seen(kinds)
        alone = [Changes(lights={kind: value}) for kind, value in own.lights.items()]
        every = [*renderer.picture.parts(), *alone, Changes(lights=own.lights), own]
        every += [one for one in renderer.also if one.lights.keys() <= set(kinds)]
        for changes in filter(None, every):
            if changes.fov == "larger":
                if not tall:
                    continue
                changes = replace(changes, fov="y")
            whose = next((names for other, names in found if other == changes), None)
            if whose is None:
                found.append((changes, [renderer.whose]))
            elif renderer.whose not in whose:
                whose.append(renderer.whose)
    return found


def _options(changes: Changes, kinds: Collection[str]) -> list[str]:
    """The renderers whose conventions are these and no more."""
    return [
        name
        for name, one in RENDERERS.items()
        if changes == (one.changes.seen(kinds) if changes.lights else one.picture)
    ]


def _could_be(undo: Undo, images: Images) -> bool:
    """Whether the numbers of lights, if they are part of it, change the light of this scene by what
    the candidate's mean differs."""
    factors, scene = undo.changes.lights, undo.scene
    if not factors or undo.changes.unfaded:
        return True
    assert scene is not None
    values = [factors.get(light.type, 1.0) for light in scene.lights]
    means = images.reference.mean()
    if not means > 0.0:
        return False
    ratio = float(images.candidate.mean() / means)
    return (1.0 - SAME) * min(*values, 1.0) <= ratio <= (1.0 + SAME) * max(*values, 1.0)


def _predicted(undo: Undo, images: Images, threads: int | None) -> FloatArray:
    """The candidate that the changes predict: with few samples where lights change, interpolated
    where it is moved."""
    changes = undo.changes
    picture = images.reference
    if changes.lights or changes.fov:
        there = Changes(lights=changes.lights, fov=changes.fov)
        described = replace(undo, changes=there).described()
        assert described is not None
        picture = picture_of(described, 0, threads)
    by = (changes.down, changes.right, 0.0)
    return undo.applied(ndimage.shift(picture, by, order=1, mode="nearest") if any(by) else picture)


def _is_final(undo: Undo) -> bool:
    """Whether what happened cannot be undone: our picture has to become the candidate."""
    return bool(undo.changes.codes or undo.changes.unfaded)


def _same(images: Images, undo: Undo, threads: int | None) -> bool:
    """Whether the candidate is what our picture becomes."""
    predicted = _predicted(undo, images, threads)
    size = np.abs(predicted)
    near = np.abs(images.candidate - predicted) <= SINGLE * size + TINY * size.max()
    return bool(near.mean() >= ALIKE) and images.error is None


def _of_glass(images: Images, scene: Scene, scaled: Callable[[float], Case]) -> Cause | None:
    """Radiance that is not divided by the square of an index: of an eye in glass all light is 1/n²
    of what it should be, of lamps in glass n² times."""
    means = images.reference.mean()
    ratio = float(images.candidate.mean() / means) if means > 0.0 else 0.0
    for material in scene.materials.values():
        if not isinstance(material, Dielectric):
            continue
        n = float(material.interior_ior / material.exterior_ior)
        for factor, where in ((n**-2, "eye"), (n**2, "lamp")):
            if math.isclose(ratio, factor, rel_tol=SAME) and scaled(factor).verdict == "agree":
                whose = [one.whose for one in RENDERERS.values() if one.glass is False]
                what = f"{'divided' if where == 'eye' else 'multiplied'} by {n:g}²"
                name = f"radiance without 1/eta² in glass, as {', '.join(whose)}"
                evidence = f"the {where} is in glass, and the pictures agree with ours {what}"
                squares = _squares(images, factor * images.reference)
                left = squares / _squares(images, images.reference)
                return Cause(name, evidence, 1.0 - left)
    return None
