"""F13: surfaces that are close to each other.

Law.  What lies between two surfaces is not skipped: rays that go straight on from surface to
surface meet them in their order, light gets into the gap and no further than it should, and glass
after glass lets through what Fresnel says, as long as the gap is more than

    4 B,  B = 17 sqrt(3) u (2 |c| + 6 s),  u = 2^-53,

c being the middle of the scene (largest coordinate) and s its half width: a ray begins up to B off
what it leaves (F2), on either side of the gap, and its target is seen no more precisely.

Range: gaps from 1e-1 to 1e-14 of the scale, about the origin and 1000 scales away.  Counts, full:
20,000 rays in each setting.  Passes: no failure up to the last decade of gaps above 4 B: 1e-13 at
the origin, 1e-10 far away.  Answers are known in closed form; open are points of a contact shadow
that lie within 4 B of its edge.

Mitsuba begins rays (1 + max |p|) RayEpsilon off, RayEpsilon = 8.9e-5 in its float32: gaps below
that are predicted to be skipped, from x = 1.1e4 on at the latest, and far away from x = 11.
"""

from collections.abc import Callable

from comparisons.experiments.stability.contact.light import shadow, shoot, transmitted
from comparisons.experiments.stability.contact.stacks import (
    COUNT,
    FAR,
    Stack,
    ordered,
    plates,
    shells,
    slots,
)
from comparisons.experiments.stability.harness.family import Effort, Family, Series, decades

CASES: dict[Effort, int] = {"quick": 400, "full": 20_000}
NEAR_LAW = "a gap is kept apart where it is more than 4 B = 4 · 17 sqrt(3) u · 6 s = 7.8e-14 s"
FAR_LAW = (
    "a gap is kept apart where it is more than 4 B = 4 · 17 sqrt(3) u (2 |c| + 6 s) = 2.6e-11 s"
)


def _series(name: str, about: str, make: Callable[..., Stack], far: bool, theirs: bool) -> Series:
    values = decades(1, 12) if far else decades(1, 14)
    return Series(
        name=f"{name}, far away" if far else name,
        axis="scale / gap",
        about=about + (", a thousand scales from the origin." if far else "."),
        values=values,
        quick=(1e1, 1e5, 1e10) if far else (1e1, 1e5, 1e13),
        cases=CASES,
        measure=ordered(make, FAR if far else 0.0, theirs),
        holds_to=1e10 if far else 1e13,
        law=FAR_LAW if far else NEAR_LAW,
    )


STACKS: tuple[tuple[str, str, Callable[..., Stack], bool], ...] = (
    ("plates", f"Rays straight through {COUNT} parallel squares meet them in order", plates, True),
    ("shells", f"Rays through {COUNT} spheres in each other meet them in and out", shells, True),
    ("slots", "Rays through a cube with a slot, and a square in that", slots, False),
)

FAMILY = Family(
    id="F13",
    name="contact gaps",
    law="What lies in a gap is not skipped: order, shadows and light are those of closed forms.",
    anchors="lost contact shadows are reported of Mitsuba (mitsuba3#1871, #219); none is tested.",
    series=(
        *(
            _series(name, about, make, far, theirs)
            for far in (False, True)
            for name, about, make, theirs in STACKS
        ),
        Series(
            name="shadow",
            axis="scale / gap",
            about="A cube hovers over a floor: light at 45° comes in under its edge by one gap.",
            values=decades(1, 14),
            quick=(1e1, 1e5, 1e12),
            cases=CASES,
            measure=shadow,
            holds_to=1e13,
            law=NEAR_LAW,
            shoot=shoot,
        ),
        Series(
            name="glass",
            axis="scale / thickness",
            about=f"A lamp through {COUNT // 2} slabs of glass, as thick as they are apart: "
            f"(1 - F)^{COUNT}, F by Fresnel.",
            values=decades(1, 14),
            quick=(1e1, 1e6, 1e13),
            cases={"quick": 200, "full": 2000},
            measure=transmitted,
            unit=f"u · {COUNT}, relative",
            holds_to=1e13,
            law=NEAR_LAW,
        ),
    ),
)
