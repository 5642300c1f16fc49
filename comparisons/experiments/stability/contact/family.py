"""The series of F13; the folder's docstring states the law."""

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
from comparisons.experiments.stability.harness.family import Family, Series, Sweep, decades

CASES = 400, 20_000
NEAR_LAW = "a gap is kept apart where it is more than 4 B = 4 · 17 sqrt(3) u · 6 s = 7.8e-14 s"
FAR_LAW = (
    "a gap is kept apart where it is more than 4 B = 4 · 17 sqrt(3) u (2 |c| + 6 s) = 2.6e-11 s"
)


def _series(name: str, about: str, make: Callable[..., Stack], far: bool, theirs: bool) -> Series:
    values = decades(1, 12) if far else decades(1, 14)
    return Series(
        f"{name}, far away" if far else name,
        Sweep("scale / gap", values, (1e1, 1e5, 1e10) if far else (1e1, 1e5, 1e13), *CASES),
        about + (", a thousand scales from the origin." if far else "."),
        ordered(make, FAR if far else 0.0, theirs),
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
            "shadow",
            Sweep("scale / gap", decades(1, 14), (1e1, 1e5, 1e12), *CASES),
            "A cube hovers over a floor: light at 45° comes in under its edge by one gap.",
            shadow,
            holds_to=1e13,
            law=NEAR_LAW,
            shoot=shoot,
        ),
        Series(
            "glass",
            Sweep("scale / thickness", decades(1, 14), (1e1, 1e6, 1e13), 200, 2000),
            f"A lamp through {COUNT // 2} slabs of glass, as thick as they are apart: "
            f"(1 - F)^{COUNT}, F by Fresnel.",
            transmitted,
            unit=f"u · {COUNT}, relative",
            holds_to=1e13,
            law=NEAR_LAW,
        ),
    ),
)
