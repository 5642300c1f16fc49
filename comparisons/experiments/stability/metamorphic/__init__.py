"""F9: a scene that is moved, scaled, turned, mirrored, reordered or grouped looks the same.

Law, ids.  Rays moved with the scene hit the same (shape, copy, part, face or triangle).  Where the
transformed numbers are exact - whole-number offsets, factors 2^k, another order - t is the same to
the last bit, up to the factor.  Where they are rounded - factors 10^k, turns, offsets beyond 2^53 -
a ray that differs is a failure unless both answers are right, each in its own scene as it is in
float64, by exact arithmetic (`comparisons.referee.referee`), for a ray as near as rounding
moves it; of solids, whose crossings count as one where rounding cannot tell them apart, by the law
of F7.  A third of the rays goes anywhere, a third towards edges at 2^-4 to 2^-14 of the way, a
third towards edges down to float64's rounding, which Mitsuba is not asked.

Law, light.  A pixel changes by at most 4 times what it changes by when the eye, or each shape and
light by itself, moves by 64 u (offset + size), with the roundoff u of each contestant, 2^-53 or
2^-24, plus (512 u + 64 u (offset + size) / size) of itself; `light` derives all of these, and the
band of exact arithmetic is derived in `rays`.  Under 2^k, and in another order, pictures are the
same to the last bit.

Range.  Offset / size 1 to 1e13, factors 1e-50 to 1e50 and 2^-160 to 2^160, all mirrors and
exchanges of axes, any rotation, groups nested up to 16 deep.

Counts.  Rays of a point as in `_CASES`; a picture has 48 x 36 pixels.

Passes.  No failure within each series' guaranteed range.

Scenes are changed by `comparisons.experiments.relations`; `rays` and `light` judge, `pictures`
show."""

from collections.abc import Callable, Iterator
from functools import partial
from itertools import permutations, product
from pathlib import Path
from typing import Any

import numpy as np

import reference_rt as rt
from comparisons.experiments import relations
from comparisons.experiments.relations import Motion, moved
from comparisons.experiments.stability.harness import scenes
from comparisons.experiments.stability.harness.outcomes import (
    OURS,
    FloatArray,
    Outcomes,
    same_bits,
    together,
)
from comparisons.experiments.stability.harness.scenes import SIZE
from comparisons.experiments.stability.harness.series import Draw, Family, Sweep, decades, series
from comparisons.experiments.stability.harness.steps import matrix, turning
from comparisons.experiments.stability.metamorphic import light, rays
from comparisons.experiments.stability.metamorphic.pictures import shoot_light, shoot_rays
from reference_rt.shapes.csg import FAR

FAMILY = Family(
    "F9",
    "metamorphic images",
    "a scene that is moved, scaled, turned, mirrored, reordered or grouped shows the same ids "
    "and, within u times the scene's condition, the same light",
    "ANARI's test suite has scenes with a Variant axis, compared by image metrics; pbrt, "
    "Embree and Mitsuba test no such law",
)

FACTORS = (*decades(0, 12), 1e20, 1e30, 1e50)

_CASES = 600, 6_000

_SCALE = (
    "float32 scales like float64, and rays from the eye have no epsilon: Mitsuba's hit the same "
    "until what it computes leaves float32's range, "
)

_CHANGE = "relative change of t"
_DIFFERENCE = "largest difference / mean of the picture"

_LIGHT_ENDS = (
    "64 u (offset + size) is where rounding may put a point: beyond 1e12 sizes that is 3e-2 of the "
    "size, as large as what the picture shows"
)


def offset(x: float) -> Motion:
    far = x * SIZE
    return Motion(offset=(far, -0.5 * far, 0.25 * far))


def shrunk_by(x: float) -> Motion:
    return Motion(1.0 / x)


TURNINGS = MIRRORS, EXCHANGES, TURNS, BOTH_OF_THESE = 0.0, 1.0, 2.0, 3.0


def turns_of(rng: np.random.Generator, x: float) -> list[FloatArray]:
    if x == MIRRORS:
        return [np.diag(signs) for signs in product((1.0, -1.0), repeat=3) if min(signs) < 0.0]
    if x == EXCHANGES:
        return [np.eye(3)[list(order)] for order in permutations(range(3)) if order != (0, 1, 2)]
    mirror = np.diag([1.0, 1.0, -1.0 if x == BOTH_OF_THESE else 1.0])
    return [turning(rng) @ mirror for _ in range(6)]


EXACT_TO = 1e12
"""The largest offset / size at which all coordinates are exact: 4e12 and multiples of 1/256, which
vertices of scaled meshes are."""


Make = Callable[[Path], rt.Scene]


def rays_under(
    motions: list[Motion],
    exact: bool,
    makes: tuple[Make, ...],
    draw: Draw,
    unmoved: bool = False,
) -> Iterator[Outcomes]:
    """All scenes under all motions; Mitsuba takes part in what it has."""
    for make in makes:
        scene, takes_part = make(draw.folder), draw.mitsuba and make is scenes.things
        bench = rays.Bench(scene, draw.cases // len(motions), draw.rng, takes_part)
        for motion in motions:
            o, d = rays.through(motion, bench.rays)
            yield bench.compared(moved(scene, motion), o, d, None, motion.factor, exact, unmoved)


BOTH = (scenes.things, scenes.curves)
ALL = (*BOTH, scenes.solids)


@series(
    Sweep("offset / size", decades(0, 13), (1.0, 1e8, 1e12), *_CASES),
    unit=_CHANGE,
    shoot=partial(shoot_rays, offset),
)
def translated(draw: Draw, x: float) -> Outcomes:
    """Scenes of every primitive, and their rays, moved by whole numbers. A ray that hits something
    else, or not at exactly the same t, breaks the law."""
    return together(rays_under([offset(x)], x <= EXACT_TO, BOTH, draw))


@series(Sweep("offset / size", decades(0, 12), (1e4,), 240, 1000), unit=_CHANGE)
def translated_solids(draw: Draw, x: float) -> Outcomes:
    """The same of set operations, which are seen from next to them where they are far out. Rays
    that differ must be right by F7's law: beyond 16 sizes in the scene before it is moved, which
    allows no error that grows with the offset."""
    # Solids near the origin round as they are far from it, others as they are large: there the
    # scene before, of which this one is an exact copy, says what is right.
    return together(rays_under([offset(x)], False, (scenes.solids,), draw, unmoved=x > FAR))


@series(
    Sweep("offset / size", decades(0, 13), (1e3, 1e9), 1, 1),
    unit=_DIFFERENCE,
    holds_to=1e12,
    law=_LIGHT_ENDS,
    shoot=partial(shoot_light, offset),
)
def translated_light(draw: Draw, x: float) -> Outcomes:
    """Pictures, path-traced and by Whitted, of scenes moved by whole numbers. A pixel that changes
    by more than its condition times u (offset + size) breaks the law."""
    return light.under(offset, draw, x)


@series(
    Sweep("1 / factor", FACTORS, (1e9,), *_CASES),
    unit=_CHANGE,
    explained=_SCALE + "from 1e20 on (163 of 437 rays)",
    shoot=partial(shoot_rays, shrunk_by),
)
def shrunk(draw: Draw, x: float) -> Outcomes:
    """Scenes of every primitive and of solids, and their rays, made smaller."""
    return together(rays_under([shrunk_by(x)], False, ALL, draw))


@series(
    Sweep("factor", FACTORS, (1e9,), *_CASES),
    unit=_CHANGE,
    explained=_SCALE + "from 1e12 on (132 of 434 rays)",
    shoot=partial(shoot_rays, Motion),
)
def grown(draw: Draw, x: float) -> Outcomes:
    """Scenes of every primitive and of solids, and their rays, made larger."""
    return together(rays_under([Motion(x)], False, ALL, draw))


@series(
    Sweep("1 / factor", FACTORS, (1e1, 1e9), 1, 1),
    unit=_DIFFERENCE,
    shoot=partial(shoot_light, shrunk_by),
)
def shrunk_light(draw: Draw, x: float) -> Outcomes:
    """Pictures of scenes made smaller, lights such that they look the same."""
    return light.under(shrunk_by, draw, x)


@series(
    Sweep("factor", FACTORS, (1e9,), 1, 1),
    unit=_DIFFERENCE,
    explained="Mitsuba begins rays (1 + |p|) 8.9e-5 off surfaces, which grows with them: its "
    "pictures are the same up to 1e8 and fail from 1e9 on (778 of 1,728 pixels)",
    shoot=partial(shoot_light, Motion),
)
def grown_light(draw: Draw, x: float) -> Outcomes:
    """Pictures of scenes made larger, lights such that they look the same."""
    return light.under(Motion, draw, x)


@series(
    Sweep(
        "|k| of the factors 2^k and 2^-k",
        (1.0, 3.0, 10.0, 30.0, 60.0, 100.0, 160.0),
        (160.0,),
        *_CASES,
    ),
    unit=_CHANGE,
    explained=_SCALE + "from 2^60 on (238 of 434 rays); x is an exponent",
)
def powers_of_two(draw: Draw, x: float) -> Outcomes:
    """Rays and pictures of scenes scaled by powers of two: the same to the last bit."""
    motions = [Motion(2.0**x), Motion(2.0**-x)]
    found = [*rays_under(motions, True, ALL, draw)]
    for make, motion in product((scenes.path, scenes.whitted), motions):
        scene = make(draw.folder)
        first, other = (light.colours(OURS, s) for s in (scene, moved(scene, motion)))
        found.append({OURS: same_bits(first, other)})
    return together(found)


@series(
    Sweep(
        "0 mirrors, 1 exchanges of axes, 2 rotations, 3 rotations with mirrors",
        *(TURNINGS, (MIRRORS,), *_CASES),
    ),
    unit=_CHANGE,
    explained="turns have no extreme",
)
def turned(draw: Draw, x: float) -> Outcomes:
    """Rays, and pictures by Whitted, of scenes turned and mirrored."""
    turns = turns_of(draw.rng, x)
    found = [*rays_under([Motion(turn=t) for t in turns], False, ALL, draw)]
    scene = scenes.whitted(draw.folder)
    for turn in turns[:3]:
        mirrored = bool(np.linalg.det(turn) < 0.0)
        found.append({OURS: light.judged(OURS, scene, Motion(turn=turn), mirrored)})
    return together(found)


REVERSED, SHUFFLED, TRIANGLES, SPLIT = 0.0, 1.0, 2.0, 3.0


@series(
    Sweep(
        "0 shapes reversed, 1 shuffled, 2 triangles shuffled, 3 meshes split in two",
        *((REVERSED, SHUFFLED, TRIANGLES, SPLIT), (SPLIT,), *_CASES),
    ),
    unit=_CHANGE,
    explained="an order has no extreme",
)
def rearranged(draw: Draw, x: float) -> Outcomes:
    """Rays and pictures of scenes whose parts come in another order: the same to the last bit."""
    return together(_rearranged(draw, x))


def _rearranged(draw: Draw, x: float) -> Iterator[Outcomes]:
    change = _reordered if x in (REVERSED, SHUFFLED) else _remeshed
    for make in ALL:
        scene = make(draw.folder)
        bench = rays.Bench(scene, draw.cases, draw.rng, draw.mitsuba and make is scenes.things)
        other, names = change(scene, draw, x)
        yield bench.compared(other, bench.rays.o, bench.rays.d, names, exact=True)
    for make in (scenes.path, scenes.whitted):
        scene = make(draw.folder)
        other, _ = change(scene, draw, x)
        yield {OURS: same_bits(*(light.colours(OURS, one) for one in (scene, other)))}


def _reordered(scene: rt.Scene, draw: Draw, x: float) -> tuple[rt.Scene, Any]:
    """Lamps keep their order: a sample picks a light by its number."""
    n = len(scene.shapes)
    order = np.arange(n)[::-1] if x == REVERSED else draw.rng.permutation(n)
    lamps = [k for k in order.tolist() if scene.shapes[k].material == "lamp"]
    order[np.isin(order, lamps)] = sorted(lamps)
    return relations.reordered(scene, order)


def _remeshed(scene: rt.Scene, draw: Draw, x: float) -> tuple[rt.Scene, Any]:
    """Every mesh outside groups and solids with its triangles shuffled, or as two."""

    def parts(count: int) -> list[Any]:
        order = draw.rng.permutation(count)
        return [order] if x == TRIANGLES else [order[: count // 3], order[count // 3 :]]

    return relations.remeshed(scene, parts) or (scene, None)


@series(
    Sweep("groups within groups", (1.0, 2.0, 4.0, 8.0, 16.0), (4.0,), *_CASES),
    unit=_CHANGE,
    explained="Mitsuba knows no groups within groups: it is told the product of the maps",
)
def nested(draw: Draw, x: float) -> Outcomes:
    """Shapes drawn as instances of groups of groups, each under a map of its own, against the same
    shapes under one transform."""
    return together(_nested(draw, x, make) for make in BOTH)


def _nested(draw: Draw, x: float, make: Make) -> Outcomes:
    scene = make(draw.folder)
    shapes = [s for s in scene.shapes if not isinstance(s, rt.Instance | rt.Plane)]
    steps: list[Any] = []
    for _ in range(int(x)):  # maps near the identity, no two alike
        linear = np.eye(3) + 0.3 / x * draw.rng.normal(size=(3, 3))
        steps += matrix(linear, 0.3 / x * draw.rng.normal(size=3))
    bare, grouped, names = relations.nested(scene.changed(groups={}, shapes=()), shapes, steps)
    bench = rays.Bench(bare, draw.cases, draw.rng, draw.mitsuba and make is scenes.things)
    return bench.compared(grouped, bench.rays.o, bench.rays.d, names)
