"""F2: rays that leave a surface.

Law.  A ray meets a shape at p, with the outward normal n, and goes on from there towards any w.
(1) It does not meet again what it leaves: towards the outer side of a convex shape, and to either
side of a flat one, it meets nothing; what it meets else, exact arithmetic on the ray as it begins
(o', w) meets too, within a factor of 2 in t, so that it is another place.
(2) Nothing is lost: into a closed shape it meets the far wall, through its outer side, and

    |o' - p| <= B = 16 sqrt(3) u (2 |c| + 6 s),  u = 2^-53,

c being the middle of the shape (largest coordinate) and s its longest half axis, however thin it is.
(3) The first ray, aimed at what is well inside, meets the shape wherever exact arithmetic says so.

Where the shape is thinner than 4 B at p, along the normal or along w, its walls are one: such cases
are open, and so are first rays whose answer hangs on moving them by B.

Range: 15 kinds of shapes, sizes 1e-8 to 1e8, axes up to 1e12 times as long as others, middles up to
1e10 sizes from the origin and beyond, directions up to cos = 1e-15 to the surface.  Counts, full:
10^6 departures of each kind in its own series, 1000 shapes by 1000 rays.  Passes: no failure.

Every departure is traced; exact arithmetic is asked about those that do not look as they should, by
the sign of w · n where they meet something again, and about a sample of all others.

Mitsuba leaves by `si.spawn_ray(w)`: an offset of (1 + max |p|) RayEpsilon along the normal, and
RayEpsilon is 8.9e-5 in its float32.  It is predicted to fail (2) where the shape is smaller than
that, and (1) where what float32 rounds is larger.  While it takes part, all numbers of shapes and
rays are rounded to float32 first, for everyone.  The law on |o' - p| is not put to it.
The text-book's ray begins at o + t d, what is nearer than 1e-4 not counting.
"""

import math
from collections.abc import Mapping

import numpy as np

from comparisons.stability import f02_leaving_mitsuba as theirs
from comparisons.stability.f02_leaving_judge import Judge, Tally
from comparisons.stability.f02_leaving_shapes import KINDS, Extent, Rays, aim, place
from comparisons.stability.f02_leaving_shots import shoot
from comparisons.stability.f02_leaving_tracer import EPSILON, Subject, Ways, depart, subjects
from comparisons.stability.family import MITSUBA, OURS, Draw, Family, Outcome, Series, decades

FIXED = "fixed epsilon"
"""The text-book's."""

RAYS = 1000
"""From one shape, in the full run."""

FEW = 24
"""Of those, the rays that the others are asked about: Mitsuba takes 20 µs for each in its scalar
variant (in others as long as 2000 to compile for each shape), and exact arithmetic has to look into
most of what they answer."""

FLATTEST = -15.0
"""The least cosine of departures to the normal, as a power of ten."""


def ways(rng: np.random.Generator, n: int, cosine: float | None = None) -> Ways:
    """To both sides: at this cosine, or half of them over the sphere and half grazing."""
    if cosine is None:
        c = np.where(rng.random(n) < 0.5, rng.random(n), 10.0 ** rng.uniform(FLATTEST, 0.0, n))
    else:
        c = np.full(n, cosine)
    sine, phi = np.sqrt((1.0 - c) * (1.0 + c)), rng.uniform(0.0, 2.0 * math.pi, n)
    up = c * rng.choice([-1.0, 1.0], n)
    return Ways(np.column_stack([sine * np.cos(phi), sine * np.sin(phi), up]))


def measure(
    draw: Draw, kinds: tuple[str, ...], extent: Extent, cosine: float | None = None
) -> Mapping[str, Outcome]:
    """`draw.cases` departures from these kinds of shapes."""
    rays = RAYS if draw.effort == "full" else 100
    shapes = max(1, draw.cases // (rays * len(kinds)))
    tallies = {OURS: Tally(), FIXED: Tally()}
    if extent.single:
        tallies[MITSUBA] = Tally()
    for kind in kinds:
        placed = [place(kind, extent, draw) for _ in range(shapes)]
        for one, subject in zip(placed, subjects(kind, placed), strict=True):
            judge = Judge(one, subject, sample=4)
            first, away = aim(one, rays, extent.single, draw.rng), ways(draw.rng, rays, cosine)
            judge(tallies[OURS], first, away.outer, depart(subject, first, away), True)
            first, away = Rays(*(x[:FEW] for x in first)), Ways(away.local[:FEW])
            found = depart(subject, first, away, EPSILON)
            judge(tallies[FIXED], first, away.outer, found, False)
            if MITSUBA in tallies and kind in theirs.KINDS:
                found = theirs.depart(one, first, away)
                judge(tallies[MITSUBA], first, away.outer, found, False)
    return {name: tally.outcome() for name, tally in tallies.items()}
