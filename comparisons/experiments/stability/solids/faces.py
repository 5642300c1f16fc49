"""Faces that coincide, or nearly."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

import reference_rt as rt
from comparisons.experiments.stability.harness import solids
from comparisons.experiments.stability.harness.meshes import write_smallest_ball
from comparisons.experiments.stability.harness.outcomes import (
    OURS,
    FloatArray,
    Outcomes,
    outcome,
    together,
)
from comparisons.experiments.stability.harness.series import Draw, Sweep, alone, decades, series
from comparisons.experiments.stability.harness.solids import INSIDE_TESTS, INTERVALS, LISTS, Truth
from comparisons.experiments.stability.harness.steps import at, scaled, vector
from comparisons.experiments.stability.solids.films import shoot
from comparisons.experiments.stability.solids.trees import KINDS, leaf, placed, rays_at
from comparisons.geometry.affine import unit_vectors
from reference_rt.core import transform

SHIFTS = (*(float(f"1e{k}") for k in range(3, 16)), 2.0**51, 2.0**52, 2.0**53)


def judge(draw: Draw, solid: Any, o: FloatArray, d: FloatArray, size: float) -> Outcomes:
    """All contestants on one solid; worst: the longest stretch that is wrong, of the size."""
    truths = solids.truths(solid, draw.folder, o, d)
    undecided = np.array([truth.touching for truth in truths])
    length = np.linalg.norm(d, axis=1) / size
    found = {}
    for contestant in (OURS, INTERVALS, INSIDE_TESTS):
        problem_of = _first if contestant == INSIDE_TESTS else solids.problem
        t = LISTS[contestant](solid, draw.folder, o, d)
        problems = [
            None if truth.touching else problem_of(truth, row)
            for truth, row in zip(truths, t, strict=True)
        ]
        wrong = np.array([problem is not None for problem in problems])
        stretches = [p[1] * float(n) for p, n in zip(problems, length, strict=True) if p]
        shown = {"o": o, "d": d, "came": _said(problems), "expected": "none"}
        shown |= {"solid": solid.model_dump_json(exclude_defaults=True)}
        found[contestant] = outcome(wrong, shown, undecided, max(stretches, default=0.0))
    return found


Problem = tuple[str, float] | None
"""What is wrong with a ray's crossings, and how long the stretch is."""


def _said(problems: Sequence[Problem]) -> Callable[[int], str]:
    return lambda k: problems[k][0]  # type: ignore[index]


def _first(truth: Truth, t: FloatArray) -> Problem:
    return solids.first_problem(truth, float(t[0]))


def pair_of(rng: np.random.Generator, kind: str, shift: float, offset: float) -> Any:
    """A solid without the same one moved by `shift`, or, of a box, two that share a face but for
    `shift`: a gap, or an overlap where it is negative."""
    steps = placed(rng, 1.0, 0.0)
    away = at(*vector(offset * unit_vectors(rng, 1)[0]))
    if kind == "touching":
        beside = at(2.0 + shift, 0.0, 0.0)
        return rt.Box(transform=(*steps, away)) | rt.Box(transform=(beside, *steps, away))
    if kind == "cut":
        half = (scaled(0.5, 1.0, 1.0), at(0.5 + shift, 0.0, 0.0))
        return rt.Box(transform=(*steps, away)) - rt.Box(transform=(*half, *steps, away))
    moved = at(*vector(shift * unit_vectors(rng, 1)[0]))
    a = leaf(rng, kind, (*steps, away))
    return a - a.model_copy(update={"transform": (*a.transform[:-1], moved, away)})


SETTINGS = ("touching", "cut", *KINDS)


def _judged(draw: Draw, shift: float, offset: float, size: float) -> Outcomes:
    write_smallest_ball(draw.folder)
    return together(_one(draw, kind, shift, offset, size) for kind in SETTINGS)


def _one(draw: Draw, kind: str, shift: float, offset: float, size: float) -> Outcomes:
    sign = float(draw.rng.choice([-1.0, 1.0]))
    solid = pair_of(draw.rng, kind, sign * shift, offset)
    scale = scaled(size)
    solid = solid.model_copy(update={"transform": (scale,)})
    middle = np.mean([_middle(part, scale) for part in solid.of], axis=0)
    o, d = rays_at(draw.rng, max(1, draw.cases // len(SETTINGS)), middle, size)
    return judge(draw, solid, o, d, size)


def _middle(part: Any, scale: Any) -> FloatArray:
    return transform.affine((*part.transform, scale))[:, 3]


@series(
    Sweep("size / shift", tuple(sorted(SHIFTS)), (1e6, 1e12, 1e15), 200, 3000),
    unit="of the size",
    shoot=shoot,
)
def shift(draw: Draw, x: float) -> Outcomes:
    """A solid of each kind without the same one moved by a little, two boxes that nearly touch, a
    box without a half of it. What exact arithmetic tells apart must be told, and no film between
    crossings that rounding cannot tell apart."""
    return _judged(draw, 1.0 / x, 0.0, 1.0)


@series(alone(200, 3000), unit="of the size")
def coincident(draw: Draw, _: float) -> Outcomes:
    """As `shift`, of nothing: the faces are parted by the rounding of the tables, or not."""
    return _judged(draw, 0.0, 0.0, 1.0)


@series(Sweep("offset / size", decades(0, 9), (1e3, 1e9), 200, 3000), unit="of the size")
def offset(draw: Draw, x: float) -> Outcomes:
    """The same, of any size from 1e-8 to 1e8, away from the origin, shifted by no more than four
    units in the last place there."""
    shift = float(draw.rng.choice([0.0, 1.0, 4.0])) * 2.0**-52 * x
    return _judged(draw, shift, x, float(10.0 ** draw.rng.uniform(-8.0, 8.0)))
