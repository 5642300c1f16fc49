"""The series of F4; the folder's docstring states the law."""

from collections.abc import Callable, Iterator, Mapping
from functools import partial

import numpy as np

import reference_rt as rt
from comparisons.experiments.stability.harness.core import (
    MITSUBA,
    OURS,
    Draw,
    FloatArray,
    Outcome,
    Shot,
)
from comparisons.experiments.stability.harness.family import Family, Series, Sweep, decades
from comparisons.experiments.stability.harness.mitsubas import traced
from comparisons.experiments.stability.harness.outcomes import together
from comparisons.experiments.stability.slivers import drawn, shots
from comparisons.experiments.stability.slivers.drawn import SHAPES, Trial
from comparisons.experiments.stability.slivers.judge import Judge, Question
from reference_rt import textbook
from reference_rt.rendering import query

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
    row = getattr(tables.geometry.shapes, trial.kind)._asdict()
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
        aim = shots.targets()
        trial = make(np.random.default_rng(1), x, len(aim), True, turned=True, aim=aim)
        question, found = answers(trial, contestant == MITSUBA)
        judge = Judge(question)
        t = found[contestant]
        return shots.picture(judge.t, t, judge.wrong(t), "Rays at the points of a triangle")

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
            partial(drawn.thin_triangle, turned=True),
            shoot=map_of(drawn.thin_triangle),
        ),
        _series(
            "aspect, aligned",
            ASPECT,
            "The same in planes of the axes, whose heights float32 has exactly.",
            partial(drawn.thin_triangle, turned=False),
            EXACT,
        ),
        _series(
            "grazing",
            ANGLE,
            "Rays at a small angle to a triangle, turned any way, three in four at points inside.",
            partial(drawn.grazed_triangle, turned=True),
            shoot=map_of(drawn.grazed_triangle),
        ),
        _series(
            "grazing, aligned",
            ANGLE,
            "The same in planes of the axes, where float32 has every angle exactly.",
            partial(drawn.grazed_triangle, turned=False),
            EXACT,
        ),
        _series(
            "grazing a rectangle",
            ANGLE,
            "Rays at a small angle to rectangles: half of these in the plane z = 0, half turned.",
            partial(drawn.grazed_flat, is_round=False),
            EXACT,
        ),
        _series(
            "grazing a disk",
            ANGLE,
            "Rays at a small angle to ellipses: half of these in the plane z = 0, half turned.",
            partial(drawn.grazed_flat, is_round=True),
            EXACT,
        ),
        _series(
            "grazing a box",
            ANGLE,
            "Rays along a face of a cube, within twice the angle of it on either side.",
            drawn.grazed_box,
        ),
        _series(
            "needles",
            ASPECT._replace(axis="length / thickness"),
            "Ever thinner boxes, met from the side.",
            drawn.needle,
            EXACT,
        ),
    ),
)
