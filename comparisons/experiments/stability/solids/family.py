"""F7, set operations: the laws of sets hold for solids, and coincident faces leave no film.

Laws, along each ray:
- a tree of set operations and any other that is the same set (idempotence, absorption,
  commutativity, associativity, distribution, De Morgan, complements) have the same list of
  crossings, bit for bit: the operands' crossings are the same numbers.  A - A, A - (A | B) and
  (A & B) - A have none;
- crossings of operands further apart than the sum of the widths that `csg.all_crossings` states
  (the error of the surface and of the ray's arithmetic, over the cosine) are told apart: between
  them the list says inside where exact arithmetic on the tables does.  Nothing narrower is told;
- the mean of chord lengths is the volume over the area of the beam: within 4 standard errors of
  manifold3d's.

Ranges: depth 1 to 64, of spheres, ellipsoids, boxes, cylinders, cones, quadrics, tori and closed
meshes; faces shifted by 1e-3 to 2^-53 of the size, and by nothing; offsets to 1e9 sizes; 2 to 64
operands.  Counts: 2 x 10^4 rays a depth, 3000 a shift and an offset, with the exact arbiter.

Ours: `csg.all_crossings`; the text-book's: interval lists (Roth 1982), inside tests (Tilove 1980),
which give the first crossing alone.  Mitsuba has no solids, so that it stays out: what stands in
for it elsewhere (`comparisons/mitsuba/csg.py`) is a program of this project on Mitsuba's hits.
"""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

import reference_rt as rt
from comparisons.experiments.methods.setting import unit_vectors
from comparisons.experiments.stability.harness.family import (
    EXAMPLES,
    OURS,
    Draw,
    Family,
    FloatArray,
    Outcome,
    Series,
)
from comparisons.experiments.stability.solids import lists
from comparisons.experiments.stability.solids.lists import INSIDE_TESTS, INTERVALS, Truth
from comparisons.experiments.stability.solids.pictures import shoot
from comparisons.experiments.stability.solids.trees import (
    KINDS,
    Shapes,
    Tree,
    chain,
    leaf,
    placed,
    rewritten,
    vector,
    write_mesh,
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


def _hex(o: FloatArray, d: FloatArray) -> dict[str, Any]:
    return {"o": [x.hex() for x in o.tolist()], "d": [x.hex() for x in d.tolist()]}


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
    write_mesh(draw.folder)
    found: dict[str, Outcome] = {}
    for _ in range(max(1, draw.cases // (6 * RAYS))):
        kinds = draw.rng.choice(KINDS, LEAVES, replace=False)
        shapes = Shapes([leaf(draw.rng, str(k), placed(draw.rng, 0.6, 0.7)) for k in kinds])
        o, d = rays_at(draw.rng, RAYS, np.zeros(3), 1.0)
        for name, one, two in pairs(draw.rng, int(x)):
            for contestant, ask in _ASK.items():
                a = ask(shapes.solid(one), draw.folder, o, d)
                b = np.empty((len(o), 0)) if two is None else (
                    ask(shapes.solid(two), draw.folder, o, d)
                )  # fmt: skip
                wrong = ~lists.same(a, b)
                examples = tuple(
                    {"law": name, **_hex(o[k], d[k]), "expected": _finite(b[k]),
                     "came": _finite(a[k]), "tree": repr(one)[:500], "other": repr(two)[:500],
                     "shapes": [s.model_dump_json(exclude_defaults=True) for s in shapes.leaves]}
                    for k in np.flatnonzero(wrong)[:EXAMPLES].tolist()
                )  # fmt: skip
                new = Outcome(len(o), int(wrong.sum()), None, 0, examples)
                found[contestant] = found[contestant] + new if contestant in found else new
    return found


def _finite(t: FloatArray) -> list[str]:
    return [float(x).hex() for x in t[np.isfinite(t)]]


_ASK: dict[str, Callable[..., FloatArray]] = {
    OURS: lambda *arguments: lists.ours(*arguments).t,
    INTERVALS: lists.intervals,
}


# ---- faces that coincide, or nearly -------------------------------------------------------------


def judge(draw: Draw, solid: Any, o: FloatArray, d: FloatArray, size: float) -> dict[str, Outcome]:
    """All contestants on one solid; worst: the longest stretch that is wrong, of the size."""
    truths = lists.truths(solid, draw.folder, o, d)
    length = np.linalg.norm(d, axis=1) / size
    found = {}
    for contestant, ask, look in (
        (OURS, _ASK[OURS], lists.problem),
        (INTERVALS, lists.intervals, lists.problem),
        (INSIDE_TESTS, lists.inside_tests, _first),
    ):
        t = ask(solid, draw.folder, o, d)
        failures, worst, opened = 0, 0.0, 0
        examples: list[Mapping[str, Any]] = []
        for k, truth in enumerate(truths):
            if truth.touching:
                opened += 1
                continue
            wrong = look(truth, t[k])
            if wrong is None:
                continue
            failures += 1
            worst = max(worst, wrong[1] * float(length[k]))
            if len(examples) < EXAMPLES:
                scene = solid.model_dump_json(exclude_defaults=True)
                examples.append(
                    {**_hex(o[k], d[k]), "came": wrong[0], "expected": "none", "solid": scene}
                )
        cases = len(o) - opened
        found[contestant] = Outcome(cases, failures, worst, opened, tuple(examples))
    return found


def _first(truth: Truth, t: FloatArray) -> tuple[str, float] | None:
    return lists.first_problem(truth, float(t[0]))


def coincident(rng: np.random.Generator, kind: str, shift: float, offset: float) -> Any:
    """A solid without the same one moved by `shift`, or, of a box, two that share a face but for
    `shift`: a gap, or an overlap where it is negative."""
    steps = placed(rng, 1.0, 0.0)
    away = transform.Translate(translate=vector(offset * unit_vectors(rng, 1)[0]))
    if kind == "touching":
        beside = transform.Translate(translate=(2.0 + shift, 0.0, 0.0))
        return rt.Box(transform=(*steps, away)) | rt.Box(transform=(beside, *steps, away))
    if kind == "cut":
        half = transform.Scale(scale=(0.5, 1.0, 1.0))
        aside = transform.Translate(translate=(0.5 + shift, 0.0, 0.0))
        return rt.Box(transform=(*steps, away)) - rt.Box(transform=(half, aside, *steps, away))
    moved = transform.Translate(translate=vector(shift * unit_vectors(rng, 1)[0]))
    a = leaf(rng, kind, (*steps, away))
    return a - a.model_copy(update={"transform": (*a.transform[:-1], moved, away)})


SETTINGS = ("touching", "cut", *KINDS)


def _judged(draw: Draw, shift: float, offset: float, size: float) -> Mapping[str, Outcome]:
    write_mesh(draw.folder)
    found: dict[str, Outcome] = {}
    n = max(1, draw.cases // len(SETTINGS))
    for kind in SETTINGS:
        sign = float(draw.rng.choice([-1.0, 1.0]))
        solid = coincident(draw.rng, kind, sign * shift, offset)
        scale = transform.Scale(scale=vector([size] * 3))
        solid = solid.model_copy(update={"transform": (scale,)})
        middle = np.mean([_middle(part, scale) for part in solid.of], axis=0)
        o, d = rays_at(draw.rng, n, middle, size)
        for contestant, outcome in judge(draw, solid, o, d, size).items():
            old = found.get(contestant)
            found[contestant] = outcome if old is None else old + outcome
    return found


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
            "size / shift",
            "A solid of each kind without the same one moved by a little, two boxes that nearly "
            "touch, a box without a half of it.  What exact arithmetic tells apart must be told, "
            "and no film between crossings that rounding cannot tell apart.",
            tuple(sorted(SHIFTS)),
            (1e6, 1e12, 1e15),
            {"quick": 200, "full": 3000},
            shifted,
            unit="of the size",
            shoot=shoot,
        ),
        Series(
            "laws",
            "operations in each other",
            "Random trees of five shapes, each there many times, and others that laws of sets make "
            "of them: the lists of crossings must be the same bit for bit, and those of A - A, "
            "A - (A | B) and (A & B) - A empty.",
            (1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0),
            (4.0, 64.0),
            {"quick": 1500, "full": 21_000},
            laws,
        ),
        Series(
            "coincident",
            "",
            "As `shift`, of nothing: the faces are parted by the rounding of the tables, or not.",
            (1.0,),
            (1.0,),
            {"quick": 200, "full": 3000},
            unshifted,
            unit="of the size",
        ),
        Series(
            "offset",
            "offset / size",
            "The same, of any size from 1e-8 to 1e8, away from the origin, shifted by no more than "
            "four units in the last place there.",
            (1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9),
            (1e3, 1e9),
            {"quick": 200, "full": 3000},
            far,
            unit="of the size",
        ),
        Series(
            "volume",
            "operands",
            "Boxes and closed meshes together and without each other: the mean length of parallel "
            "chords against the volume that manifold3d finds; more than 4 standard errors off "
            "breaks the law.",
            (2.0, 4.0, 8.0, 16.0, 32.0, 64.0),
            (4.0,),
            {"quick": 2, "full": 8},
            volumes,
            unit="standard errors",
        ),
    ),
    "POV-Ray's issues on coincident surfaces (#125, #139, #209) are open; Embree, pbrt and Mitsuba "
    "have no solids.",
)
