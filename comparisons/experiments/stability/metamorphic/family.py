"""F9: a scene that is moved, scaled, turned, mirrored, reordered or grouped looks the same.

Law, ids: rays moved with the scene hit the same (shape, copy, part, face or triangle).  Where the
transformed numbers are exact - whole-number offsets, factors 2^k, another order - t is the same to
the last bit, up to the factor.  Where they are rounded - factors 10^k, turns, offsets beyond 2^53 -
a ray that differs is a failure unless both answers are right, each in its own scene as it is in
float64, by exact arithmetic (`comparisons.geometry.exact.referee`), for a ray as near as rounding
moves it; of solids, whose crossings count as one where rounding cannot tell them apart, by the law
of F7. A third of the rays goes anywhere, a third towards edges at 2^-4 to 2^-14 of the way, a third
towards edges down to float64's rounding, which Mitsuba is not asked.

Law, light: a pixel changes by at most 4 times what it changes by when the eye, or each shape and
light by itself, moves by 64 u (offset + size), with the roundoff u of each contestant, 2^-53 or
2^-24, plus (512 u + 64 u (offset + size) / size) of itself; `f09_light` derives all of these, and
the band of exact arithmetic is derived in `f09_rays`.  Under 2^k, and in another order, pictures
are the same to the last bit.

Ranges: offset / size 1 to 1e13, factors 1e-50 to 1e50 and 2^-160 to 2^160, all mirrors and
exchanges of axes, any rotation, groups nested up to 16 deep.  Counts: rays of a setting as in
`_CASES`; a picture has 48 x 36 pixels.
"""

from collections.abc import Callable
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

import reference_rt as rt
from comparisons.experiments.stability.harness import scenes
from comparisons.experiments.stability.harness.bits import same_bits
from comparisons.experiments.stability.harness.family import (
    MITSUBA,
    OURS,
    Draw,
    Family,
    Series,
    decades,
)
from comparisons.experiments.stability.metamorphic import light, rays
from comparisons.experiments.stability.metamorphic.motion import (
    MIRRORS,
    TURNINGS,
    Motion,
    grown,
    moved,
    offset,
    shrunk,
    turns_of,
)
from comparisons.experiments.stability.metamorphic.rays import Outcomes
from comparisons.experiments.stability.metamorphic.rearranged import nested, rearranged
from comparisons.experiments.stability.metamorphic.shots import shoot_light, shoot_rays
from reference_rt.shapes.csg.anchor import FAR

EXACT_TO = 1e12
"""The largest offset / size at which all coordinates are exact: 4e12 and multiples of 1/256, which
vertices of scaled meshes are."""


# ---- rays ---------------------------------------------------------------------------------------

Make = Callable[[Path], rt.Scene]


def rays_under(
    motions: list[Motion],
    exact: bool,
    makes: tuple[Make, ...],
    draw: Draw,
    unmoved: bool = False,
) -> Outcomes:
    """All scenes under all motions; Mitsuba takes part in what it has."""
    total: Outcomes = {}
    for make in makes:
        scene = make(draw.folder)
        bench = rays.Bench(
            scene, draw.cases // len(motions), draw.rng, draw.mitsuba and make is scenes.things
        )
        for motion in motions:
            total = rays.added(total, _rays_of(bench, motion, exact, unmoved))
    return total


def _rays_of(bench: rays.Bench, motion: Motion, exact: bool, unmoved: bool) -> Outcomes:
    scene = moved(bench.ours.scene, motion)
    o, d = rays.through(motion, bench.rays)
    after = rays.Asked(scene, o, d, rays.ours(rt.build_tables(scene), o, d))
    found = {OURS: rays.judged(bench.ours, after, motion.factor, exact, unmoved)}
    if bench.mitsuba is not None:
        o, d = o[bench.rays.coarse], d[bench.rays.coarse]
        after = rays.Asked(scene, o, d, rays.mitsubas(scene, o, d))
        found[MITSUBA] = rays.judged_mitsuba(bench.mitsuba, after, motion.factor)
    return found


BOTH = (scenes.things, scenes.curves)
ALL = (*BOTH, scenes.solids)


def _translated(draw: Draw, x: float) -> Outcomes:
    return rays_under([offset(x)], x <= EXACT_TO, BOTH, draw)


def _translated_solids(draw: Draw, x: float) -> Outcomes:
    """Solids near the origin round as they are far from it, others as they are large: there the
    scene before, of which this one is an exact copy, says what is right."""
    return rays_under([offset(x)], False, (scenes.solids,), draw, unmoved=x > FAR)


def _scaled(motion: Callable[[float], Motion], draw: Draw, x: float) -> Outcomes:
    return rays_under([motion(x)], False, ALL, draw)


def _powers(draw: Draw, x: float) -> Outcomes:
    """Rays and pictures, both ways."""
    motions = [Motion(2.0**x), Motion(2.0**-x)]
    total = rays_under(motions, True, ALL, draw)
    for make, motion in product((scenes.path, scenes.whitted), motions):
        scene = make(draw.folder)
        first, other = (light.colours(OURS, s) for s in (scene, moved(scene, motion)))
        total = rays.added(total, {OURS: same_bits(first, other)})
    return total


def _turned(draw: Draw, x: float) -> Outcomes:
    turns = turns_of(draw.rng, x)
    total = rays_under([Motion(turn=t) for t in turns], False, ALL, draw)
    scene = scenes.whitted(draw.folder)
    for turn in turns[:3]:
        mirrored = bool(np.linalg.det(turn) < 0.0)
        total = rays.added(total, {OURS: light.judged(OURS, scene, Motion(turn=turn), mirrored)})
    return total


# ---- the family ---------------------------------------------------------------------------------

_CASES: Any = {"quick": 600, "full": 6_000}

_SCALE = (
    "float32 scales like float64, and rays from the eye have no epsilon: Mitsuba's hit the same "
    "until what it computes leaves float32's range, "
)

_GROWN = (
    "Mitsuba begins rays (1 + |p|) 8.9e-5 off surfaces, which grows with them: its pictures are "
    "the same up to 1e8 and fail from 1e9 on (778 of 1,728 pixels)"
)

_CHANGE = "relative change of t"
_DIFFERENCE = "largest difference / mean of the picture"

_LIGHT_ENDS = (
    "64 u (offset + size) is where rounding may put a point: beyond 1e12 sizes that is 3e-2 of the "
    "size, as large as what the picture shows"
)

FAMILY = Family(
    id="F9",
    name="metamorphic images",
    law="a scene that is moved, scaled, turned, mirrored, reordered or grouped shows the same ids "
    "and, within u times the scene's condition, the same light",
    anchors="ANARI's test suite has scenes with a Variant axis, compared by image metrics; pbrt, "
    "Embree and Mitsuba test no such law",
    series=(
        Series(
            name="translated",
            axis="offset / size",
            about="Scenes of every primitive, and their rays, moved by whole numbers.  A ray that "
            "hits something else, or not at exactly the same t, breaks the law.",
            values=decades(0, 13),
            quick=(1.0, 1e8, 1e12),
            cases=_CASES,
            measure=_translated,
            unit=_CHANGE,
            shoot=partial(shoot_rays, offset),
        ),
        Series(
            name="translated solids",
            axis="offset / size",
            about="The same of set operations, which are seen from next to them where they are "
            "far out.  Rays that differ must be right by F7's law: beyond 16 sizes in the scene "
            "before it is moved, which allows no error that grows with the offset.",
            values=decades(0, 12),
            quick=(1e4,),
            cases={"quick": 240, "full": 1000},
            measure=_translated_solids,
            unit=_CHANGE,
        ),
        Series(
            name="translated light",
            axis="offset / size",
            about="Pictures, path-traced and by Whitted, of scenes moved by whole numbers.  A pixel"
            " that changes by more than its condition times u (offset + size) breaks the law.",
            values=decades(0, 13),
            quick=(1e3, 1e9),
            cases={"quick": 1, "full": 1},
            measure=partial(light.under, offset),
            unit=_DIFFERENCE,
            holds_to=1e12,
            law=_LIGHT_ENDS,
            shoot=partial(shoot_light, offset),
        ),
        Series(
            name="shrunk",
            axis="1 / factor",
            about="Scenes of every primitive and of solids, and their rays, made smaller.",
            values=(*decades(0, 12), 1e20, 1e30, 1e50),
            quick=(1e9,),
            cases=_CASES,
            measure=partial(_scaled, shrunk),
            unit=_CHANGE,
            explained=_SCALE + "from 1e20 on (163 of 437 rays)",
            shoot=partial(shoot_rays, shrunk),
        ),
        Series(
            name="grown",
            axis="factor",
            about="Scenes of every primitive and of solids, and their rays, made larger.",
            values=(*decades(0, 12), 1e20, 1e30, 1e50),
            quick=(1e9,),
            cases=_CASES,
            measure=partial(_scaled, grown),
            unit=_CHANGE,
            explained=_SCALE + "from 1e12 on (132 of 434 rays)",
            shoot=partial(shoot_rays, grown),
        ),
        Series(
            name="shrunk light",
            axis="1 / factor",
            about="Pictures of scenes made smaller, lights such that they look the same.",
            values=(*decades(0, 12), 1e20, 1e30, 1e50),
            quick=(1e1, 1e9),
            cases={"quick": 1, "full": 1},
            measure=partial(light.under, shrunk),
            unit=_DIFFERENCE,
            shoot=partial(shoot_light, shrunk),
        ),
        Series(
            name="grown light",
            axis="factor",
            about="Pictures of scenes made larger, lights such that they look the same.",
            values=(*decades(0, 12), 1e20, 1e30, 1e50),
            quick=(1e9,),
            cases={"quick": 1, "full": 1},
            measure=partial(light.under, grown),
            unit=_DIFFERENCE,
            explained=_GROWN,
            shoot=partial(shoot_light, grown),
        ),
        Series(
            name="powers of two",
            axis="|k| of the factors 2^k and 2^-k",
            about="Rays and pictures of scenes scaled by powers of two: the same to the last bit.",
            values=(1.0, 3.0, 10.0, 30.0, 60.0, 100.0, 160.0),
            quick=(160.0,),
            cases=_CASES,
            measure=_powers,
            unit=_CHANGE,
            explained=_SCALE + "from 2^60 on (238 of 434 rays); x is an exponent",
        ),
        Series(
            name="turned",
            axis="0 mirrors, 1 exchanges of axes, 2 rotations, 3 rotations with mirrors",
            about="Rays, and pictures by Whitted, of scenes turned and mirrored.",
            values=TURNINGS,
            quick=(MIRRORS,),
            cases=_CASES,
            measure=_turned,
            unit=_CHANGE,
            explained="turns have no extreme",
        ),
        Series(
            name="rearranged",
            axis="0 shapes reversed, 1 shuffled, 2 triangles shuffled, 3 meshes split in two",
            about="Rays and pictures of scenes whose parts come in another order: the same to the "
            "last bit.",
            values=(0.0, 1.0, 2.0, 3.0),
            quick=(3.0,),
            cases=_CASES,
            measure=rearranged,
            unit=_CHANGE,
            explained="an order has no extreme",
        ),
        Series(
            name="nested",
            axis="groups within groups",
            about="Shapes drawn as instances of groups of groups, each under a map of its own, "
            "against the same shapes under one transform.",
            values=(1.0, 2.0, 4.0, 8.0, 16.0),
            quick=(4.0,),
            cases=_CASES,
            measure=nested,
            unit=_CHANGE,
            explained="Mitsuba knows no groups within groups: it is told the product of the maps",
        ),
    ),
)
