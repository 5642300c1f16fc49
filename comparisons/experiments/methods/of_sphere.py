"""Spheres: from far away, near the rim, from just outside."""

import numpy as np

from comparisons.experiments.methods.setting import (
    Draw,
    Family,
    FloatArray,
    Series,
    Trial,
    Truth,
    across,
    powers,
    unit_vectors,
)
from comparisons.geometry.exact import first_hit
from reference_rt import textbook
from reference_rt.textbook import SphereParameters

RADIUS = 1.3
SHAPES = 8
"""Of each setting, at random places."""

HIT_SHARE = 0.75
WITHIN, BEYOND = 0.95, (1.05, 1.5)
"""Rays pass the centre at less than 0.95 radii or at 1.05 to 1.5, so that no rounding decides."""


def exact(sphere: SphereParameters, o: FloatArray, d: FloatArray) -> Truth:
    row = {"center": np.atleast_2d(sphere.center), "radius": np.array([sphere.radius])}
    hit = first_hit("spheres", row, o, d)
    return Truth(hit.fixed, hit.touching)


def _trials(draw: Draw, distance: float, aims: FloatArray) -> list[Trial]:
    """Origins at `distance` radii; rays that pass the centre at `aims` (n,) radii."""
    return [
        _trial(draw.rng, distance, aim, draw.rng.uniform(-1.0, 1.0, 3))
        for aim in np.array_split(aims, SHAPES)
    ]


def _trial(rng: np.random.Generator, distance: float, aim: FloatArray, center: FloatArray) -> Trial:
    o = center + distance * RADIUS * unit_vectors(rng, len(aim))
    side = across(rng, o - center)
    # The foot of the perpendicular is that near, seen from the origin under this angle.
    reach = distance * np.tan(np.arcsin(aim / distance)) * RADIUS
    d = center + side * reach[:, None] - o
    return Trial((SphereParameters(center, RADIUS),), o, d, 2.0 * RADIUS)


def from_afar(draw: Draw, distance: float) -> list[Trial]:
    hits = draw.rng.uniform(size=draw.rays) < HIT_SHARE
    within = WITHIN * np.sqrt(draw.rng.uniform(size=draw.rays))
    return _trials(draw, distance, np.where(hits, within, draw.rng.uniform(*BEYOND, draw.rays)))


def near_the_rim(draw: Draw, inverse_gap: float) -> list[Trial]:
    sides = draw.rng.choice([-1.0, 1.0], draw.rays)
    return _trials(draw, 10.0, 1.0 + sides / inverse_gap)


def from_the_surface(draw: Draw, inverse_gap: float) -> list[Trial]:
    """Rays inwards, towards points within half a radius of the centre."""
    trials = []
    for _ in range(SHAPES):
        center = draw.rng.uniform(-1.0, 1.0, 3)
        out = unit_vectors(draw.rng, draw.rays // SHAPES)
        o = center + RADIUS * (1.0 + 1.0 / inverse_gap) * out
        d = center + 0.5 * RADIUS * unit_vectors(draw.rng, len(o)) - o
        trials.append(Trial((SphereParameters(center, RADIUS),), o, d, 2.0 * RADIUS))
    return trials


SPHERE = Family(
    "sphere",
    {name: textbook.METHODS[name] for name in textbook.names("sphere")},
    (
        Series(
            "distance",
            "distance / radius",
            "Origins all around at this distance; three rays in four pass within 0.95 radii of the"
            " centre, the others beyond 1.05.",
            powers(*range(1, 11)),
            1e5,
            from_afar,
        ),
        Series(
            "rim",
            "radius / distance of the ray from the rim",
            "From 10 radii away, half of the rays pass just inside the rim and half just outside.",
            powers(1, 3, 5, 7, 9, 11, 13, 15),
            1e7,
            near_the_rim,
        ),
        Series(
            "surface",
            "radius / height of the origin above the surface",
            "Rays inwards from just outside: the root near zero, errors in units of t alone.",
            powers(1, 4, 7, 10, 12, 14, 15, 16),
            1e7,
            from_the_surface,
            relative=True,
        ),
    ),
    exact,
)
