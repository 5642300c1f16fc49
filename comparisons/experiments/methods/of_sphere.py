"""Spheres: far away, near the silhouette, and from just above the surface."""

import numpy as np

from comparisons.experiments.methods.setting import Draw, Family, Trial, Truth, powers
from comparisons.experiments.methods.vectors import across, unit_vectors
from comparisons.geometry.exact import first_hit
from reference_rt.core.arrays import FloatArray
from reference_rt.textbook import SphereParameters

RADIUS = 1.3
SHAPES = 8
"""Of each setting, at random places."""

HIT_SHARE = 0.75
WITHIN, BEYOND = 0.95, (1.05, 1.5)
"""Rays pass the centre at less than 0.95 radii or at 1.05 to 1.5: rounding cannot change a hit to a
miss."""


def exact(sphere: SphereParameters, o: FloatArray, d: FloatArray) -> Truth:
    row = {"center": np.atleast_2d(sphere.center), "radius": np.array([sphere.radius])}
    hit = first_hit("spheres", row, o, d)
    return Truth(hit.fixed, hit.touching)


SPHERE = Family("sphere", exact)


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


@SPHERE.sweep("distance", "distance / radius", powers(*range(1, 11)), extreme=1e5)
def from_afar(draw: Draw, distance: float) -> list[Trial]:
    """Origins all around at this distance; three rays in four pass within 0.95 radii of the centre,
    the others beyond 1.05."""
    hits = draw.rng.uniform(size=draw.rays) < HIT_SHARE
    within = WITHIN * np.sqrt(draw.rng.uniform(size=draw.rays))
    return _trials(draw, distance, np.where(hits, within, draw.rng.uniform(*BEYOND, draw.rays)))


@SPHERE.sweep(
    "rim", "radius / distance of the ray from the rim", powers(*range(1, 16, 2)), extreme=1e7
)
def near_the_rim(draw: Draw, inverse_gap: float) -> list[Trial]:
    """From 10 radii away; half of the rays pass just inside the silhouette, half just outside."""
    sides = draw.rng.choice([-1.0, 1.0], draw.rays)
    return _trials(draw, 10.0, 1.0 + sides / inverse_gap)


@SPHERE.sweep(
    "surface",
    "radius / height of the origin above the surface",
    powers(1, 4, 7, 10, 12, 14, 15, 16),
    extreme=1e7,
    relative=True,
)
def from_the_surface(draw: Draw, inverse_gap: float) -> list[Trial]:
    """Rays inwards from just outside: the root is near zero, and errors are in units of t alone."""
    trials = []
    for _ in range(SHAPES):  # towards points within half a radius of the centre
        center = draw.rng.uniform(-1.0, 1.0, 3)
        out = unit_vectors(draw.rng, draw.rays // SHAPES)
        o = center + RADIUS * (1.0 + 1.0 / inverse_gap) * out
        d = center + 0.5 * RADIUS * unit_vectors(draw.rng, len(o)) - o
        trials.append(Trial((SphereParameters(center, RADIUS),), o, d, 2.0 * RADIUS))
    return trials
