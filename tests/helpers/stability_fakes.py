"""Families with known outcomes; run as a module, a worker that knows them."""

import math
import os
import sys
import time

import numpy as np

from comparisons.experiments.stability.harness import families, worker
from comparisons.experiments.stability.harness.family import (
    MITSUBA,
    OURS,
    Family,
    Outcome,
    Series,
    Shot,
    decades,
)

METHOD = "sphere.algebraic"


def _grows(draw, x):
    """Ours fails beyond 1e8, Mitsuba beyond 1e3, a method beyond 1e5; errors grow as x."""
    outcomes = {}
    for name, end, u in ((OURS, 1e8, 1.0), (MITSUBA, 1e3, 2.0**29), (METHOD, 1e5, 100.0)):
        if name == MITSUBA and not draw.mitsuba:
            continue
        bad = draw.cases // 10 if x > end else 0
        examples = ({"o": (0.1).hex(), "drawn": draw.rng.random()},) if bad else ()
        outcomes[name] = Outcome(draw.cases, bad, u * x, 1, examples)
    return outcomes


def _crashes(draw, x):
    if x == 10.0:
        os.abort()
    if x == 100.0:
        raise ValueError("of no use")
    return {OURS: Outcome(5, 0, math.inf)}


def _slow(draw, x):
    time.sleep(x)
    return {OURS: Outcome(1, 0)}


def _shoot(contestant, x):
    shade = 200 if contestant == OURS else 100
    return Shot(np.full((8, 8, 3), shade, np.uint8), f"{contestant} at {x:g}: <grey>")


CASES = {"quick": 20, "full": 2000}

GROWS = Family(
    "T1",
    "growing <errors>",
    "Errors grow as x.",
    (
        Series("far", "distance / radius", "It is far.", decades(0, 12), (1.0, 1e4, 1e8), CASES,
               _grows, "u", 1e8, "eight decades and no more", shoot=_shoot),
        Series("alone", "", "One setting.", (1.0,), (1.0,), CASES, _grows),
    ),
)  # fmt: skip
BREAKS = Family(
    "T2",
    "what breaks",
    "Nothing.",
    (Series("crash", "x", "Dies at 10.", decades(0, 2), decades(0, 2), CASES, _crashes),),
)
FAILS = Family(
    "T3",
    "failing",
    "Ours must hold.",
    (Series("near", "x", "It fails.", decades(8, 10), decades(8, 10), CASES, _grows),),
)
SLOW = Family(
    "T4",
    "slow",
    "Takes x seconds.",
    (Series("slow", "s", "Sleeps.", (0.25, 60.0), (0.25, 60.0), CASES, _slow),),
)

FAMILIES = {one.id: one for one in (GROWS, BREAKS, FAILS, SLOW)}


def install():
    """Let the fakes stand for the families."""
    module = sys.modules[__name__]
    for name, one in FAMILIES.items():
        fake = type(module)(f"comparisons.experiments.stability.{name}")
        fake.FAMILY = one
        sys.modules[fake.__name__] = fake
    families.MODULES.clear()
    families.MODULES.update({name: name for name in FAMILIES})


if __name__ == "__main__":
    install()
    worker.main()
