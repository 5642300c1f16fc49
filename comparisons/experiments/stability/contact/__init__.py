"""F13: surfaces that are close to each other.

Law.  What lies between two surfaces is not skipped: rays that go straight on from surface to
surface meet them in their order, light gets into the gap and no further than it should, and glass
after glass lets through what Fresnel says, as long as the gap is more than

    4 B,  B = 17 sqrt(3) u (2 |c| + 6 s),  u = 2^-53,

c being the middle of the scene (largest coordinate) and s its half width: a ray begins up to B off
what it leaves (F2), on either side of the gap, and its target is seen no more precisely.

Range.  Gaps from 1e-1 to 1e-14 of the scale, about the origin and 1000 scales away.

Counts.  20,000 rays in each point of the full run.

Passes.  No failure up to the last decade of gaps above 4 B: 1e-13 at the origin, 1e-10 far away.
Answers are known in closed form; points of a contact shadow within 4 B of its edge are undecidable.

Mitsuba begins rays (1 + max |p|) RayEpsilon off, RayEpsilon = 8.9e-5 in its float32: gaps below
that are predicted to be skipped, from x = 1.1e4 on at the latest, and far away from x = 11.

`stacks`: surfaces and the order in which rays meet them; `light`: shadows and slabs of glass."""

from collections.abc import Callable

import numpy as np

import reference_rt as rt
from comparisons.experiments.stability.contact.light import (
    TRANSMITTED,
    fresnel,
    panes,
    shadow_scene,
    shoot,
)
from comparisons.experiments.stability.contact.stacks import (
    COUNT,
    FAR,
    STACKS,
    THEIRS,
    Stack,
    differing,
    follow,
    follow_in_mitsuba,
    plates,
    rays_down,
    shells,
    slots,
)
from comparisons.experiments.stability.harness.outcomes import (
    MITSUBA,
    OURS,
    Outcomes,
    U,
    outcome,
    together,
)
from comparisons.experiments.stability.harness.series import Draw, Family, Sweep, decades, series
from comparisons.experiments.stability.harness.shadows import CONTACT, bound, lit
from reference_rt.rendering.query import radiance_without_noise

FAMILY = Family(
    "F13",
    "contact gaps",
    "What lies in a gap is not skipped: order, shadows and light are those of closed forms.",
    "lost contact shadows are reported of Mitsuba (mitsuba3#1871, #219); none is tested.",
)

CASES = 400, 20_000
NEAR_LAW = "a gap is kept apart where it is more than 4 B = 4 · 17 sqrt(3) u · 6 s = 7.8e-14 s"
FAR_LAW = (
    "a gap is kept apart where it is more than 4 B = 4 · 17 sqrt(3) u (2 |c| + 6 s) = 2.6e-11 s"
)


def _ordered(name: str, about: str, make: Callable[..., Stack], far: bool, theirs: bool) -> None:
    """The series of rays straight through a stack with gaps of 1 / x;  far: from the origin;
    theirs: whether Mitsuba has such a stack."""
    values, quick = decades(1, 12 if far else 14), (1e1, 1e5, 1e10 if far else 1e13)
    distance = FAR if far else 0.0

    @series(
        Sweep("scale / gap", values, quick, *CASES),
        f"{name}, far away" if far else name,
        about + (", a thousand scales from the origin." if far else "."),
        holds_to=quick[-1],
        law=FAR_LAW if far else NEAR_LAW,
    )
    def measure(draw: Draw, x: float) -> Outcomes:
        stacks = (make(draw.rng, draw.cases // STACKS, 1.0 / x, distance) for _ in range(STACKS))
        return together(_judged(stack, x, draw.mitsuba and theirs) for stack in stacks)


def _judged(stack: Stack, x: float, mitsuba: bool) -> Outcomes:
    scene, o, d, expected = stack
    found = {OURS: follow(scene, o, d, expected.shape[1])}
    if mitsuba:
        found[MITSUBA] = follow_in_mitsuba(scene, o[:THEIRS], d[:THEIRS], expected.shape[1])
    shown = {"gap": (1.0 / x).hex(), "o": o, "d": d, "expected": expected}
    return {
        name: outcome(differing(expected[: len(met)], met), shown | {"found": met})
        for name, met in found.items()
    }


_KINDS: tuple[tuple[str, str, Callable[..., Stack], bool], ...] = (
    ("plates", f"Rays straight through {COUNT} parallel squares meet them in order", plates, True),
    ("shells", f"Rays through {COUNT} spheres in each other meet them in and out", shells, True),
    ("slots", "Rays through a cube with a slot, and a square in that", slots, False),
)
for _far in (False, True):
    for _name, _about, _make, _theirs in _KINDS:
        _ordered(_name, _about, _make, _far, _theirs)


@series(
    Sweep("scale / gap", decades(1, 14), (1e1, 1e5, 1e12), *CASES),
    holds_to=1e13,
    law=NEAR_LAW,
    shoot=shoot,
)
def shadow(draw: Draw, x: float) -> Outcomes:
    """A cube hovers over a floor: light at 45° comes in under its edge by one gap."""
    gap, n, rng = 1.0 / x, draw.cases, draw.rng
    deep = gap * 2.0 ** rng.uniform(-4.0, 4.0, n)
    slope = np.sqrt(0.5)
    at = np.column_stack([1.0 - deep, rng.uniform(-0.5, 0.5, n), np.zeros(n)])
    d = np.tile([0.0, 0.0, 1.0], (n, 1))
    o, w = at - d, np.tile([slope, 0.0, slope], (n, 1))
    dark = (1.0 - at[:, 0] > gap).astype(np.int64)
    # Near the edge of the shadow either answer is right.
    sure = (np.abs(deep - gap) > CONTACT * bound(0.0, 1.0)) & (deep < 1.5)
    scene = shadow_scene(gap)
    answers = {OURS: lit(OURS, scene, o, d, w)}
    if draw.mitsuba:
        answers[MITSUBA] = lit(MITSUBA, scene, *(a[: 4 * THEIRS] for a in (o, d, w)))
    outcomes = {}
    for name, answer in answers.items():
        met, few = (1.0 - answer[:, 0]).astype(np.int64), slice(len(answer))
        shown = {"gap": gap.hex(), "point": at, "expected": dark, "found": met}
        outcomes[name] = outcome(dark[few] != met, shown, ~sure[few])
    return outcomes


@series(
    Sweep("scale / thickness", decades(1, 14), (1e1, 1e6, 1e13), 200, 2000),
    about=f"A lamp through {COUNT // 2} slabs of glass, as thick as they are apart: "
    f"(1 - F)^{COUNT}, F by Fresnel.",
    unit=f"u · {COUNT}, relative",
    holds_to=1e13,
    law=NEAR_LAW,
)
def glass(draw: Draw, x: float) -> Outcomes:
    """As many surfaces as Whitted may follow: what is mirrored to and fro needs more, so that the
    lamp is seen through all of them alone: (1 - F)^COUNT."""
    o, d = rays_down(draw.rng, draw.cases)
    setup = rt.Whitted(max_depth=COUNT, min_contribution=0.0).setup()
    found = radiance_without_noise(panes(1.0 / x), setup, o + np.array([0.0, 0.0, 0.5]), d)[:, 0]
    expected = fresnel(-d[:, 2]) ** COUNT
    error = np.abs(found - expected) / expected
    shown = {"o": o, "d": d, "expected": expected, "found": found}
    return {OURS: outcome(~(error <= TRANSMITTED), shown, worst=float(error.max() / (COUNT * U)))}
