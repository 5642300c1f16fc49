"""Families with known outcomes; run as a module, a worker that knows them."""

import math
import os
import sys
import time
from types import ModuleType

import numpy as np

from comparisons.experiments.stability.harness import run
from comparisons.experiments.stability.harness.outcomes import MITSUBA, OURS, Outcome
from comparisons.experiments.stability.harness.series import (
    FAMILIES,
    MODULES,
    Family,
    Series,
    Sweep,
    add,
    alone,
    decades,
)
from comparisons.experiments.stability.harness.shots import Shot

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


CASES = 20, 2000


FAR = Sweep("distance / radius", decades(0, 12), (1.0, 1e4, 1e8), *CASES)
END = {"unit": "u", "holds_to": 1e8, "law": "eight decades and no more"}
CRASH = Sweep("x", decades(0, 2), decades(0, 2), *CASES)
NEAR = Sweep("x", decades(8, 10), decades(8, 10), *CASES)
SLEEP = Sweep("s", (0.25, 60.0), (0.25, 60.0), *CASES)

ALL = {
    Family("T1", "growing <errors>", "Errors grow as x."): (
        Series("far", FAR, "It is far.", _grows, **END, shoot=_shoot),
        Series("alone", alone(*CASES), "One setting.", _grows),
    ),
    Family("T2", "what breaks", "Nothing."): (Series("crash", CRASH, "Dies at 10.", _crashes),),
    Family("T3", "failing", "Ours must hold."): (Series("near", NEAR, "It fails.", _grows),),
    Family("T4", "slow", "Takes x seconds."): (Series("slow", SLEEP, "Sleeps.", _slow),),
}


def install(families=ALL):
    """Let the fakes stand for the families."""
    MODULES.clear()
    for family, some in families.items():
        fake = ModuleType(f"{FAMILIES}.{family.id}")
        fake.FAMILY = family
        sys.modules[fake.__name__] = fake
        MODULES[family.id] = family.id
        for one in some:
            add(fake.__name__, one)


if __name__ == "__main__":
    install()
    run.main()
