"""Where a scene contradicts itself about media: a ray comes to a boundary in another medium than
that which the boundary has on this side, as where two filled shapes overlap."""

from collections import Counter

import numpy as np

from reference_rt.rendering.scene import Scene
from reference_rt.scene.likely_mistakes import Mistake
from reference_rt.shapes.instances import Instance

_RAYS = 32
"""Rays across the picture, and down."""


def contradictions(scene: Scene) -> list[Mistake]:
    """By shape: which medium camera rays, straight through everything, bring to it."""
    if not scene.media:
        return []
    x, y = (np.mgrid[0:_RAYS, 0:_RAYS] + 0.5) / _RAYS
    places = np.stack([x * scene.film.width, y * scene.film.height], axis=-1).reshape(-1, 2)
    rays = scene.camera_rays(places)
    found = scene.crossings(rays.origins, rays.directions)
    entering = (rays.directions[found.ray] * found.n).sum(axis=1) < 0.0
    wrong: Counter[tuple[int, str, str | None, str | None]] = Counter()
    for first, last in zip(found.first, found.first[1:], strict=False):
        medium = scene.camera.medium
        for k in range(first, last):
            i = int(found.shape[k])
            shape = scene.shapes[i]
            if isinstance(shape, Instance):
                break  # its group's shapes may be instances, too
            sides = ("exterior", "interior") if entering[k] else ("interior", "exterior")
            before, beyond = (getattr(shape, side) for side in sides)
            if shape.interior is None and shape.exterior is None:
                continue
            if before != medium:
                wrong[i, sides[0], medium, before] += 1
                break  # what comes behind may only follow from it
            medium = beyond
    return [
        Mistake(
            f"{count} of {len(places)} straight rays come to it in {_named(medium)}, but its "
            f"{side} is {_named(said)}; expected the same: media do not overlap, and none has "
            "priority",
            ("shapes", i),
        )
        for (i, side, medium, said), count in sorted(wrong.items(), key=lambda one: one[0][0])
    ]


def _named(medium: str | None) -> str:
    return "no medium" if medium is None else f"the medium '{medium}'"
