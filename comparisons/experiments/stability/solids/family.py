"""The series of F7; the folder's docstring states the law."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

import reference_rt as rt
from comparisons.experiments.methods.setting import unit_vectors
from comparisons.experiments.stability.harness import solids
from comparisons.experiments.stability.harness.core import OURS, Draw, FloatArray, Outcome
from comparisons.experiments.stability.harness.family import Family, Series, Sweep, alone
from comparisons.experiments.stability.harness.meshes import write_smallest_ball
from comparisons.experiments.stability.harness.outcomes import hexed, outcome, together
from comparisons.experiments.stability.harness.solids import INSIDE_TESTS, INTERVALS, LISTS, Truth
from comparisons.experiments.stability.harness.steps import at, scaled, vector
from comparisons.experiments.stability.solids.pictures import shoot
from comparisons.experiments.stability.solids.trees import (
    KINDS,
    Shapes,
    Tree,
    chain,
    leaf,
    placed,
    rewritten,
)
from comparisons.experiments.stability.solids.volumes import volumes
from reference_rt.core import transform

RAYS = 250
"""Of a tree."""

LEAVES = 5
"""Different shapes of a tree: in deep ones each is there many times, in the same place."""

LAWS = 8
"""Applied to a tree, one after another."""


def rays_at(
    rng: np.random.Generator, n: int, middle: FloatArray, size: float
) -> tuple[FloatArray, FloatArray]:
    """From around, outside of everything, at points near the middle."""
    o = middle + 4.0 * size * unit_vectors(rng, n)
    return o, middle + size * rng.uniform(-1.0, 1.0, (n, 3)) - o


def pairs(rng: np.random.Generator, depth: int) -> Iterator[tuple[str, Tree, Tree | None]]:
    """Trees that are the same set; None for the empty one."""
    a, b = chain(rng, depth, LEAVES), int(rng.integers(LEAVES))
    yield "laws", a, rewritten(rng, a, LAWS, LEAVES)
    yield "A | A", a, ("|", a, a)
    yield "A & A", a, ("&", a, a)
    yield "A - A", ("-", a, a), None
    yield "A - (A | B)", ("-", a, ("|", a, b)), None
    yield "(A & B) - A", ("-", ("&", a, b), a), None


def laws(draw: Draw, x: float) -> Mapping[str, Outcome]:
    write_smallest_ball(draw.folder)
    trees = max(1, draw.cases // (6 * RAYS))
    return together(part for _ in range(trees) for part in _laws_of(draw, int(x)))


def _laws_of(draw: Draw, depth: int) -> Iterator[dict[str, Outcome]]:
    kinds = draw.rng.choice(KINDS, LEAVES, replace=False)
    shapes = Shapes([leaf(draw.rng, str(k), placed(draw.rng, 0.6, 0.7)) for k in kinds])
    o, d = rays_at(draw.rng, RAYS, np.zeros(3), 1.0)
    described = [s.model_dump_json(exclude_defaults=True) for s in shapes.leaves]
    for name, one, two in pairs(draw.rng, depth):
        shown = {"tree": repr(one)[:500], "other": repr(two)[:500], "shapes": described}
        found = {}
        for contestant in (OURS, INTERVALS):
            crossings_of = LISTS[contestant]
            a = crossings_of(shapes.solid(one), draw.folder, o, d)
            b = np.empty((len(o), 0))
            if two is not None:
                b = crossings_of(shapes.solid(two), draw.folder, o, d)
            lists = {"expected": _finite(b), "came": _finite(a)}
            rays = {"law": name, "o": o, "d": d}
            found[contestant] = outcome(~solids.same(a, b), rays | lists | shown)
        yield found


def _finite(t: FloatArray) -> Callable[[int], list[str]]:
    return lambda k: hexed(t[k][np.isfinite(t[k])])


# ---- faces that coincide, or nearly -------------------------------------------------------------


def judge(draw: Draw, solid: Any, o: FloatArray, d: FloatArray, size: float) -> dict[str, Outcome]:
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


def coincident(rng: np.random.Generator, kind: str, shift: float, offset: float) -> Any:
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


def _judged(draw: Draw, shift: float, offset: float, size: float) -> Mapping[str, Outcome]:
    write_smallest_ball(draw.folder)
    return together(_one(draw, kind, shift, offset, size) for kind in SETTINGS)


def _one(draw: Draw, kind: str, shift: float, offset: float, size: float) -> Mapping[str, Outcome]:
    sign = float(draw.rng.choice([-1.0, 1.0]))
    solid = coincident(draw.rng, kind, sign * shift, offset)
    scale = scaled(size)
    solid = solid.model_copy(update={"transform": (scale,)})
    middle = np.mean([_middle(part, scale) for part in solid.of], axis=0)
    o, d = rays_at(draw.rng, max(1, draw.cases // len(SETTINGS)), middle, size)
    return judge(draw, solid, o, d, size)


def _middle(part: Any, scale: Any) -> FloatArray:
    return transform.affine((*part.transform, scale))[:, 3]


def shifted(draw: Draw, x: float) -> Mapping[str, Outcome]:
    return _judged(draw, 1.0 / x, 0.0, 1.0)


def unshifted(draw: Draw, _: float) -> Mapping[str, Outcome]:
    return _judged(draw, 0.0, 0.0, 1.0)


def far(draw: Draw, x: float) -> Mapping[str, Outcome]:
    """At any size, shifted by a few roundings of the offset, or by nothing."""
    shift = float(draw.rng.choice([0.0, 1.0, 4.0])) * 2.0**-52 * x
    return _judged(draw, shift, x, float(10.0 ** draw.rng.uniform(-8.0, 8.0)))


SHIFTS = (*(float(f"1e{k}") for k in range(3, 16)), 2.0**51, 2.0**52, 2.0**53)

FAMILY = Family(
    "F7",
    "set operations",
    "Trees of set operations that are the same set have the same crossings, bit for bit; faces "
    "that coincide, or nearly, leave nothing narrower than rounding, and lose nothing wider.",
    (
        Series(
            "shift",
            Sweep("size / shift", tuple(sorted(SHIFTS)), (1e6, 1e12, 1e15), 200, 3000),
            "A solid of each kind without the same one moved by a little, two boxes that nearly "
            "touch, a box without a half of it.  What exact arithmetic tells apart must be told, "
            "and no film between crossings that rounding cannot tell apart.",
            shifted,
            unit="of the size",
            shoot=shoot,
        ),
        Series(
            "laws",
            Sweep(
                "operations in each other",
                (1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0),
                (4.0, 64.0),
                1500,
                21_000,
            ),
            "Random trees of five shapes, each there many times, and others that laws of sets make "
            "of them: the lists of crossings must be the same bit for bit, and those of A - A, "
            "A - (A | B) and (A & B) - A empty.",
            laws,
        ),
        Series(
            "coincident",
            alone(200, 3000),
            "As `shift`, of nothing: the faces are parted by the rounding of the tables, or not.",
            unshifted,
            unit="of the size",
        ),
        Series(
            "offset",
            Sweep(
                "offset / size",
                (1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9),
                (1e3, 1e9),
                200,
                3000,
            ),
            "The same, of any size from 1e-8 to 1e8, away from the origin, shifted by no more than "
            "four units in the last place there.",
            far,
            unit="of the size",
        ),
        Series(
            "volume",
            Sweep("operands", (2.0, 4.0, 8.0, 16.0, 32.0, 64.0), (4.0,), 2, 8),
            "Boxes and closed meshes together and without each other: the mean length of parallel "
            "chords against the volume that manifold3d finds; more than 4 standard errors off "
            "breaks the law.",
            volumes,
            unit="standard errors",
        ),
    ),
    "POV-Ray's issues on coincident surfaces (#125, #139, #209) are open; Embree, pbrt and Mitsuba "
    "have no solids.",
)
