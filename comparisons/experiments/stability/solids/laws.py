"""Trees of set operations that are the same set."""

from collections.abc import Callable, Iterator

import numpy as np

from comparisons.experiments.stability.harness import solids
from comparisons.experiments.stability.harness.meshes import write_smallest_ball
from comparisons.experiments.stability.harness.outcomes import (
    OURS,
    FloatArray,
    Outcome,
    Outcomes,
    hexed,
    outcome,
    together,
)
from comparisons.experiments.stability.harness.series import Draw, Sweep, series
from comparisons.experiments.stability.harness.solids import INTERVALS, LISTS
from comparisons.experiments.stability.solids.trees import (
    KINDS,
    Shapes,
    Tree,
    chain,
    leaf,
    placed,
    rays_at,
    rewritten,
)

RAYS = 250
"""Of a tree."""

LEAVES = 5
"""Different shapes of a tree: in deep ones each is there many times, in the same place."""

LAWS = 8
"""Applied to a tree, one after another."""


def pairs(rng: np.random.Generator, depth: int) -> Iterator[tuple[str, Tree, Tree | None]]:
    """Trees that are the same set; None for the empty one."""
    a, b = chain(rng, depth, LEAVES), int(rng.integers(LEAVES))
    yield "laws", a, rewritten(rng, a, LAWS, LEAVES)
    yield "A | A", a, ("|", a, a)
    yield "A & A", a, ("&", a, a)
    yield "A - A", ("-", a, a), None
    yield "A - (A | B)", ("-", a, ("|", a, b)), None
    yield "(A & B) - A", ("-", ("&", a, b), a), None


@series(
    Sweep("operations in each other", tuple(2.0**k for k in range(7)), (4.0, 64.0), 1500, 21_000)
)
def laws(draw: Draw, x: float) -> Outcomes:
    """Random trees of five shapes, each there many times, and others that laws of sets make of
    them: the lists of crossings must be the same bit for bit, and those of A - A, A - (A | B) and
    (A & B) - A empty."""
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
