"""F2: rays that leave a surface do not meet it again, and lose nothing that is near.

Law.  A ray meets a shape at p, with the outward normal n, and goes on from there towards any w.
(1) It does not meet again what it leaves: towards the outer side of a convex shape, and to either
side of a flat one, it meets nothing; whatever else it meets, exact arithmetic on the ray as it
begins, (o', w), meets too, within a factor of 2 in t, so that it is another place.
(2) Nothing is lost: into a closed shape it meets the far wall, through its outer side, and

    |o' - p| <= B = 17 sqrt(3) u (2 |c| + 6 s),  u = 2^-53,

c being the middle of the shape (largest coordinate) and s its longest half axis, however thin.
(3) The first ray, aimed at what is well inside, meets the shape wherever exact arithmetic says so.

Undecidable.  Where the shape is thinner than 4 B within B of p, along the normal or along w, its
walls are one: next to an edge, p may lie beyond the neighbouring face, by its rounding.  Such cases
are left open, and so are first rays whose answer hangs on moving them by B.

Range.  15 kinds of shapes, sizes 1e-8 to 1e8, axes up to 1e12 times as long as others, middles up
to 1e10 sizes from the origin and beyond, directions up to cos = 1e-15 to the surface.

Counts.  In the full run 10^6 departures of each kind in its own series, 1000 shapes by 1000 rays.
Every departure is traced; exact arithmetic decides those that look suspicious, by the sign of w · n
where they meet something again, and a sample of all others.

Passes.  No failure.

Mitsuba leaves by `si.spawn_ray(w)`: an offset of (1 + max |p|) RayEpsilon along the normal, and
RayEpsilon is 8.9e-5 in its float32.  It is judged by the size in place of B: a ray that begins more
than s / 100 off has lost neighbours that are as near, as predicted from |c| = 112 s on, and for
shapes smaller than 8.9e-3.  While it takes part, all numbers of shapes and rays are rounded to
float32 first, for everyone.  The textbook's ray, which begins at o + t d + 1e-4 w, is judged in
the same way.

`shapes` places shapes and aims rays, `departures` traces them; `judge` decides."""

import contextlib
import math
from collections.abc import Callable
from functools import wraps
from typing import Any

import numpy as np

from comparisons.experiments.stability.harness.outcomes import MITSUBA, OURS, Outcomes
from comparisons.experiments.stability.harness.series import Draw, Family, Sweep, decades, series
from comparisons.experiments.stability.harness.shadows import EPSILON
from comparisons.experiments.stability.harness.shots import Shot
from comparisons.experiments.stability.leaving.departures import (
    MITSUBA_KINDS,
    Ways,
    depart,
    depart_in_mitsuba,
    outer,
    subjects,
)
from comparisons.experiments.stability.leaving.judge import Judge, Tally
from comparisons.experiments.stability.leaving.shapes import KINDS, WHOLE, Extent, Rays, aim, place
from comparisons.experiments.stability.leaving.sunlight import shoot
from comparisons.mitsuba.backend import scalar
from reference_rt.util.files import temporary_folder

FAMILY = Family(
    "F2",
    "leaving a surface",
    "A ray that leaves a surface neither meets it again nor loses what is near.",
    "pbrt's reintersection test: radii 1e-4 to 1e4, first misses skipped, cones and paraboloids"
    " switched off.",
)

FIXED = "fixed epsilon"
"""The textbook's."""

RAYS = 1000
"""From one shape, in the full run."""

FEW = 24
"""Of those, the rays that the other contestants get: Mitsuba takes 20 µs for each in its scalar
variant (in others as long as 2000 to compile for each shape), and exact arithmetic has to check
most of their answers."""

FEW_SHAPES = {"quick": 1, "full": 8}
"""Shapes of a kind at a point that the other contestants get."""

SAMPLE = 4
"""Departures from a shape that exact arithmetic checks even if nothing is suspicious; one where it
works ray by ray."""

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
) -> Outcomes:
    """`draw.cases` departures from shapes of these kinds."""
    rays = RAYS if draw.effort == "full" else 100
    shapes = max(1, draw.cases // (rays * len(kinds)))
    tallies = {OURS: Tally(), FIXED: Tally()}
    if extent.single and not set(kinds).isdisjoint(MITSUBA_KINDS):
        tallies[MITSUBA] = Tally()
    with scalar() if MITSUBA in tallies else contextlib.nullcontext():
        for kind in kinds:
            placed = [place(kind, extent, draw) for _ in range(shapes)]
            for k, (one, subject) in enumerate(zip(placed, subjects(kind, placed), strict=True)):
                judge = Judge(one, subject, sample=1 if kind in WHOLE else SAMPLE)
                first, away = aim(one, rays, extent.single, draw.rng), ways(draw.rng, rays, cosine)
                judge(tallies[OURS], first, away.outer, depart(subject, first, away), True)
                if k >= FEW_SHAPES[draw.effort]:
                    continue
                first, away = Rays(*(x[:FEW] for x in first)), Ways(away.local[:FEW])
                found = depart(subject, first, away, EPSILON)
                judge(tallies[FIXED], first, away.outer, found, False)
                if MITSUBA in tallies and kind in MITSUBA_KINDS:
                    found = depart_in_mitsuba(one, first, away)
                    judge(tallies[MITSUBA], first, outer(away, found), found, False)
    return {name: tally.outcome() for name, tally in tallies.items()}


ALL = tuple(KINDS)
STRETCHED = tuple(kind for kind in ALL if kind != "sphere")

BOUND = (
    "B = 17 sqrt(3) u (2 |c| + 6 s) is s / 100 at |c| = 1.5e12 s, and s at 1.5e14 s: nothing is "
    "left of the shape that is not within a few B of its edges"
)


OFFSET_GROWS = (
    "Mitsuba begins rays (1 + max |p|) 8.9e-5 off a surface, which grows with the size: from 1 to "
    "1e8, as far as it is asked, none of its 192 departures fails"
)

OFFSET_ALONG_NORMAL = (
    "Mitsuba begins rays (1 + max |p|) 8.9e-5 off a surface along its normal, at whatever angle "
    "they leave: at cosines from 0.1 to 1e-15 none of its 192 departures fails"
)


def _extent(
    draw: Draw,
    x: float,
    size: tuple[float, float] = (0.0, 0.0),
    ratio: tuple[float, float] = (1.0, 2.0),
    distance: tuple[float, float] = (1.0, 1.0),
    theirs_to: float = 1e6,
) -> Extent:
    """Half axes from 1/2 to 1, by default, as far away.  theirs_to: x up to which Mitsuba takes
    part: beyond, float32 cannot say where the shape is."""
    return Extent(size, ratio, distance, draw.mitsuba and x <= theirs_to)


Place = Callable[[Draw, float], Extent]


def _departures(
    sweep: Sweep,
    kinds: tuple[str, ...] = ALL,
    name: str = "",
    about: str = "",
    grazing: bool = False,
    **more: Any,
) -> Callable[[Place], Place]:
    """Register what says where shapes lie as a series of departures from them;  grazing: at the
    cosine 1 / x."""

    def register(extent: Place) -> Place:
        def shot(contestant: str, x: float) -> Shot:
            with temporary_folder() as folder:
                single = contestant == MITSUBA
                draw = Draw(np.random.default_rng(2), 1, single, folder)
                return shoot(contestant, kinds[0], extent(draw, x)._replace(single=single), draw)

        @series(sweep, name, about, unit="of the bound B", shoot=shot, **more)
        @wraps(extent)
        def run(draw: Draw, x: float) -> Outcomes:
            return measure(draw, kinds, extent(draw, x), 1.0 / x if grazing else None)

        return extent

    return register


DISTANCES = (1e0, 1e2, 1e4, 1e6, 1e8, 1e10, 1e12, 1e14)
SIZES = (1e0, 1e2, 1e4, 1e6, 1e8, 1e16, 1e32, 1e64)

FAR = Sweep("distance / size", DISTANCES, (1e0, 1e4, 1e10), 500, 1_000_000 // len(DISTANCES))

OF_ALL = 500 * len(ALL), 150_000
"""Cases of a point."""


def _distance(draw: Draw, x: float) -> Extent:
    return _extent(draw, x, distance=(x, x))


for _kind in ALL:
    _departures(
        FAR,
        (_kind,),
        _kind,
        f"Departures from one {_kind} each, size 1, so far from the origin.",
        holds_to=1e12,
        law=BOUND,
    )(_distance)


@_departures(Sweep("1 / size", SIZES, (1e8, 1e64), *OF_ALL))
def small(draw: Draw, x: float) -> Extent:
    """All kinds, as far from the origin as they are large."""
    return _extent(draw, x, size=(-math.log10(x), -math.log10(x)), theirs_to=1e8)


@_departures(Sweep("size", SIZES, (1e8, 1e64), *OF_ALL), explained=OFFSET_GROWS)
def large(draw: Draw, x: float) -> Extent:
    """All kinds, as far from the origin as they are large."""
    return _extent(draw, x, size=(math.log10(x), math.log10(x)), theirs_to=1e8)


@_departures(
    Sweep(
        *("longest / shortest axis", decades(0, 12, 2), (1e6, 1e12)),
        *(500 * len(STRETCHED), 140_000),
    ),
    STRETCHED,
)
def anisotropy(draw: Draw, x: float) -> Extent:
    """All kinds but round spheres, stretched along their axes and turned."""
    return _extent(draw, x, ratio=(x, x))


@_departures(
    Sweep("1 / cosine of the departure", decades(1, 15, 2), (1e5, 1e15), *OF_ALL),
    grazing=True,
    explained=OFFSET_ALONG_NORMAL,
)
def grazing(draw: Draw, _x: float) -> Extent:
    """All kinds, left at this cosine to the normal, to either side."""
    return _extent(draw, 1.0)


@_departures(Sweep("distance / size", decades(0, 10, 2), (1e10,), *OF_ALL))
def everything(draw: Draw, x: float) -> Extent:
    """All kinds, with sizes from x^-0.8 to x^0.8, axes up to x^0.6 times as long as others,
    distances up to x: at 1e10 from 1e-8 to 1e8, 1e6 and 1e10."""
    power = math.log10(x)
    return _extent(draw, x, (-0.8 * power, 0.8 * power), (1.0, 10.0 ** (0.6 * power)), (1.0, x))
