"""F4: thin shapes, and rays that graze.

Law.  A hit is one: its t is in the exact hit interval, which is where rays moved by no more than
rounding meet the shape (`judge` has the bound, 144 u (|o| + size)); a miss is exact, or a ray so
moved misses.  A hit may also be up to 1e-3 of the shape off the exact one, which lets float32 pass
where it only rounds.  What float64 may not do, and what Embree was found to do (embree#387:
t = 12291.2 on a triangle at 1), is to report a point where there is no shape.

Range.  Triangles of aspect 1 to 1e12, aligned and turned; boxes of aspect 1 to 1e12; angles of 1e-1
to 1e-15 between rays and triangles, rectangles, disks and faces of boxes.

Counts.  8 shapes a point, quick 2,000 rays, full 40,000.

Passes.  No failure, up to the end of every range.

Every other shape and its rays are rounded to float32, and Mitsuba gets the very same numbers as
ours and the textbook's methods; the others are for these alone.  Mitsuba is judged by the same
law: what its rounding turns into a miss or a hit is wrong.

`trials` draws shapes and rays, `judge` decides, `maps` shows."""

from collections.abc import Callable, Iterator
from functools import wraps

import numpy as np

import reference_rt as rt
from comparisons.experiments.stability.harness.in_mitsuba import traced
from comparisons.experiments.stability.harness.outcomes import (
    MITSUBA,
    OURS,
    FloatArray,
    Outcomes,
    together,
)
from comparisons.experiments.stability.harness.series import Draw, Family, Sweep, decades, series
from comparisons.experiments.stability.harness.shots import Shot
from comparisons.experiments.stability.harness.steps import scaled
from comparisons.experiments.stability.slivers.judge import Judge, Question
from comparisons.experiments.stability.slivers.maps import picture, targets
from comparisons.experiments.stability.slivers.trials import (
    OUTSIDE,
    SHAPES,
    Trial,
    grazed_flat,
    grazed_triangle,
    grazing_directions,
    thin_triangle,
)
from comparisons.geometry.frame import round32
from comparisons.referee import columns_of
from reference_rt import textbook
from reference_rt.rendering import query

FAMILY = Family(
    "F4",
    "slivers and grazing rays",
    "t lies in the exact hit interval, or the miss is exact, but for rays moved by rounding",
    "embree#387: a false hit at t = 12291.2 on a sliver; no range is tested elsewhere",
)

Make = Callable[[np.random.Generator, float, int, bool], Trial]
"""Of random numbers, x, how many rays, and whether float32 is to have all numbers."""
Shoot = Callable[[str, float], Shot]

CASES = 2_000, 40_000


def answers(trial: Trial, mitsuba: bool) -> tuple[Question, dict[str, FloatArray]]:
    """The question, and t (n,) of each contestant."""
    # Triangles are traced through a hierarchy, whose leaves test eight at once; others in turn.
    scene = rt.Scene(
        shapes=(trial.shape,), hierarchy="sah" if trial.kind == "triangles" else "auto"
    )
    tables = rt.build_tables(scene)
    row = columns_of(getattr(tables.geometry.shapes, trial.kind))
    found = {OURS: query.first_hits(tables, trial.o, trial.d).t}
    if mitsuba:
        found[MITSUBA] = traced(scene, trial.o, trial.d).t
    if trial.corners is not None:
        family = "triangle" if trial.kind == "triangles" else "box"
        of = textbook.TriangleParameters if family == "triangle" else textbook.BoxParameters
        for name in textbook.names(family):
            found[name] = textbook.intersect(name, of(*trial.corners), trial.o, trial.d)
    return Question(trial.kind, row, trial.o, trial.d, trial.size), found


def map_of(make: Callable[..., Trial]) -> Shoot:
    """A series' `shoot`: a triangle of float32 numbers, with a ray aimed at each point."""

    def shoot(contestant: str, x: float) -> Shot:
        aim = targets()
        trial = make(np.random.default_rng(1), x, len(aim), True, turned=True, aim=aim)
        question, found = answers(trial, contestant == MITSUBA)
        judge = Judge(question)
        t = found[contestant]
        return picture(judge.t, t, judge.wrong(t), "Rays at the points of a triangle")

    return shoot


ASPECT = Sweep("length / height", decades(0, 12), decades(0, 12, 4), *CASES)
ANGLE = Sweep("1 / angle to the plane", decades(1, 15), decades(3, 15, 4), *CASES)
EXACT = (
    "heights and angles are numbers of their own here, not differences of larger ones: float32 has"
    " them to 24 bits at any size, and nothing is lost that float64 would keep"
)


def drawn(
    sweep: Sweep, name: str = "", explained: str = "", shoot: Shoot | None = None
) -> Callable[[Make], Make]:
    """Register what draws a trial as a series of SHAPES trials a point, each for all contestants
    that can take part."""

    def register(make: Make) -> Make:
        def trials(draw: Draw, x: float) -> Iterator[Outcomes]:
            for k in range(SHAPES):
                trial = make(draw.rng, x, draw.cases // SHAPES, k % 2 == 0)
                question, hits = answers(trial, draw.mitsuba and trial.singles)
                judge = Judge(question)
                yield {name: judge.outcome(t) for name, t in hits.items()}

        @series(sweep, name, unit="u (|o| + size)", explained=explained, shoot=shoot)
        @wraps(make)
        def measure(draw: Draw, x: float) -> Outcomes:
            return together(trials(draw, x))

        return make

    return register


@drawn(ASPECT, shoot=map_of(thin_triangle))
def aspect(rng: np.random.Generator, x: float, n: int, singles: bool) -> Trial:
    """Ever thinner triangles, turned any way, met at up to 70° from the normal; three rays in four
    at points inside."""
    return thin_triangle(rng, x, n, singles, turned=True)


@drawn(ASPECT, "aspect, aligned", EXACT)
def aspect_aligned(rng: np.random.Generator, x: float, n: int, singles: bool) -> Trial:
    """The same in planes of the axes, whose heights float32 has exactly."""
    return thin_triangle(rng, x, n, singles, turned=False)


@drawn(ANGLE, shoot=map_of(grazed_triangle))
def grazing(rng: np.random.Generator, x: float, n: int, singles: bool) -> Trial:
    """Rays at a small angle to a triangle, turned any way, three in four at points inside."""
    return grazed_triangle(rng, x, n, singles, turned=True)


@drawn(ANGLE, "grazing, aligned", EXACT)
def grazing_aligned(rng: np.random.Generator, x: float, n: int, singles: bool) -> Trial:
    """The same in planes of the axes, where float32 has every angle exactly."""
    return grazed_triangle(rng, x, n, singles, turned=False)


@drawn(ANGLE, explained=EXACT)
def grazing_a_rectangle(rng: np.random.Generator, x: float, n: int, singles: bool) -> Trial:
    """Rays at a small angle to rectangles: half of these in the plane z = 0, half turned."""
    return grazed_flat(rng, x, n, singles, is_round=False)


@drawn(ANGLE, explained=EXACT)
def grazing_a_disk(rng: np.random.Generator, x: float, n: int, singles: bool) -> Trial:
    """Rays at a small angle to ellipses: half of these in the plane z = 0, half turned."""
    return grazed_flat(rng, x, n, singles, is_round=True)


@drawn(ANGLE)
def grazing_a_box(rng: np.random.Generator, x: float, n: int, singles: bool) -> Trial:
    """Rays along a face of a cube, within twice the angle of it on either side."""
    d = grazing_directions(rng, x, n)
    height = rng.uniform(-2.0, 2.0, n) / x
    target = np.stack([*rng.uniform(-1.2, 1.2, (2, n)), 1.0 + height], axis=1)
    turn, side = np.eye(3)[rng.permutation(3)], rng.choice([-1.0, 1.0])
    o, d = side * (target - 2.0 * d) @ turn.T, side * d @ turn.T
    if singles:
        o, d = round32(o), round32(d)
    one = np.ones(3)
    return Trial("boxes", rt.Box(), o, d, 2.0, singles, np.array([-one, one]))


@drawn(ASPECT._replace(axis="length / thickness"), explained=EXACT)
def needles(rng: np.random.Generator, x: float, n: int, singles: bool) -> Trial:
    """Ever thinner boxes, met from the side."""
    # Along an axis, 2 long and 2 / x thick: three in four rays are aimed at points inside.  It lies
    # about the origin, and across it rays start and move by thicknesses alone, so that float32 can
    # say where they pass.
    thin = 1.0 / x
    along, turn = rng.uniform(-1.1, 1.1, n), np.eye(3)[rng.permutation(3)]
    offset = np.where(rng.uniform(size=n) < OUTSIDE, 3.0, 1.0) * rng.uniform(-1.0, 1.0, n) * thin
    d = np.stack([rng.uniform(-2.0, 2.0, n), rng.uniform(-1.0, 1.0, n) * thin, -np.ones(n)], axis=1)
    target = np.stack([along, offset, np.zeros(n)], axis=1)
    scale = np.array([1.0, thin, thin]) @ turn.T
    d = (d * rng.uniform(1.0, 4.0, (n, 1))) @ turn.T
    o = target @ turn.T - d
    if singles:
        scale, o, d = round32(scale), round32(o), round32(d)
    shape = rt.Box(transform=(scaled(*scale.tolist()),))
    return Trial("boxes", shape, o, d, 2.0, singles, np.array([-scale, scale]))
