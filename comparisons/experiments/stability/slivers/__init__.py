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

`judge` draws shapes and rays, and decides."""

from collections.abc import Callable, Iterator, Mapping
from functools import partial

import numpy as np

import reference_rt as rt
from comparisons.experiments.stability.harness.core import (
    MITSUBA,
    OURS,
    Draw,
    Family,
    FloatArray,
    Outcome,
    Series,
    Shot,
    Sweep,
    decades,
    pixel_grid,
    together,
)
from comparisons.experiments.stability.harness.steps import traced
from comparisons.experiments.stability.slivers.judge import (
    SHAPES,
    Judge,
    Question,
    Trial,
    grazed_box,
    grazed_flat,
    grazed_triangle,
    needle,
    thin_triangle,
)
from comparisons.geometry.exact.dyadic import BoolArray
from comparisons.referee import columns_of
from reference_rt import textbook
from reference_rt.rendering import query

# ---- maps of a triangle: the outcome of the ray that is aimed at each of its points --------------


PIXELS = 192

RIGHT, LOST, FALSE, OFF = (70, 110, 150), (250, 250, 250), (240, 160, 40), (200, 40, 40)


def targets() -> FloatArray:
    """Barycentrics (PIXELS², 3) of a picture in which any triangle has its vertices near the lower
    corners and the middle of the upper edge."""
    x, y = pixel_grid(PIXELS, 1.2)
    top = 0.5 * (y + 1.0)
    right = 0.5 * (x + 1.0 - top)
    return np.stack([1.0 - top - right, right, top], axis=-1)


def picture(expected: FloatArray, found: FloatArray, wrong: BoolArray, caption: str) -> Shot:
    """expected, found (PIXELS²,): t, inf for misses;  wrong: which break the law."""
    pixels = np.full((PIXELS * PIXELS, 3), 20, np.uint8)
    hit, there = np.isfinite(found), np.isfinite(expected)
    pixels[hit] = RIGHT
    pixels[wrong & hit & there] = OFF
    pixels[wrong & hit & ~there] = FALSE
    pixels[wrong & ~hit] = LOST
    counts = [
        f"{int(which.sum())} {word}"
        for which, word in (
            (wrong & ~hit, "lost (white)"),
            (wrong & hit & ~there, "false (orange)"),
            (wrong & hit & there, "elsewhere (red)"),
        )
    ]
    return Shot(pixels.reshape(PIXELS, PIXELS, 3), f"{caption}: {', '.join(counts)}.")


# ---- the series ----------------------------------------------------------------------------------


Make = Callable[[np.random.Generator, float, int, bool], Trial]
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


def measured(make: Make) -> Callable[[Draw, float], Mapping[str, Outcome]]:
    """A series' `measure`: SHAPES trials, each for all contestants that can take part."""

    def trials(draw: Draw, x: float) -> Iterator[dict[str, Outcome]]:
        for k in range(SHAPES):
            trial = make(draw.rng, x, draw.cases // SHAPES, k % 2 == 0)
            question, found = answers(trial, draw.mitsuba and trial.singles)
            judge = Judge(question)
            yield {name: judge.outcome(t) for name, t in found.items()}

    return lambda draw, x: together(trials(draw, x))


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


def _series(
    name: str, sweep: Sweep, about: str, make: Make, explained: str = "", shoot: Shoot | None = None
) -> Series:
    unit = "u (|o| + size)"
    return Series(name, sweep, about, measured(make), unit, explained=explained, shoot=shoot)


ASPECT = Sweep("length / height", decades(0, 12), decades(0, 12, 4), *CASES)
ANGLE = Sweep("1 / angle to the plane", decades(1, 15), decades(3, 15, 4), *CASES)
EXACT = (
    "heights and angles are numbers of their own here, not differences of larger ones: float32 has"
    " them to 24 bits at any size, and nothing is lost that float64 would keep"
)

FAMILY = Family(
    id="F4",
    name="slivers and grazing rays",
    law="t lies in the exact hit interval, or the miss is exact, but for rays moved by rounding",
    anchors="embree#387: a false hit at t = 12291.2 on a sliver; no range is tested elsewhere",
    series=(
        _series(
            "aspect",
            ASPECT,
            "Ever thinner triangles, turned any way, met at up to 70° from the normal; three rays"
            " in four at points inside.",
            partial(thin_triangle, turned=True),
            shoot=map_of(thin_triangle),
        ),
        _series(
            "aspect, aligned",
            ASPECT,
            "The same in planes of the axes, whose heights float32 has exactly.",
            partial(thin_triangle, turned=False),
            EXACT,
        ),
        _series(
            "grazing",
            ANGLE,
            "Rays at a small angle to a triangle, turned any way, three in four at points inside.",
            partial(grazed_triangle, turned=True),
            shoot=map_of(grazed_triangle),
        ),
        _series(
            "grazing, aligned",
            ANGLE,
            "The same in planes of the axes, where float32 has every angle exactly.",
            partial(grazed_triangle, turned=False),
            EXACT,
        ),
        _series(
            "grazing a rectangle",
            ANGLE,
            "Rays at a small angle to rectangles: half of these in the plane z = 0, half turned.",
            partial(grazed_flat, is_round=False),
            EXACT,
        ),
        _series(
            "grazing a disk",
            ANGLE,
            "Rays at a small angle to ellipses: half of these in the plane z = 0, half turned.",
            partial(grazed_flat, is_round=True),
            EXACT,
        ),
        _series(
            "grazing a box",
            ANGLE,
            "Rays along a face of a cube, within twice the angle of it on either side.",
            grazed_box,
        ),
        _series(
            "needles",
            ASPECT._replace(axis="length / thickness"),
            "Ever thinner boxes, met from the side.",
            needle,
            EXACT,
        ),
    ),
)
