"""Families of stability, their series, and the sweeps that series measure along."""

import importlib
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple, cast

from comparisons.experiments.stability.harness.core import Draw, Effort, Outcome, Shot


class Sweep(NamedTuple):
    """The points x of a series, ever more extreme.

    axis: what x is, with its unit: "distance / radius"; "" where there is one point alone;
    values: of x, increasing;  quick: those of them that the quick run takes;  few, many: cases of
    a point in the quick and in the full run.
    """

    axis: str
    values: tuple[float, ...]
    quick: tuple[float, ...]
    few: int
    many: int


def alone(few: int, many: int) -> Sweep:
    """One point, of no extreme."""
    return Sweep("", (1.0,), (1.0,), few, many)


@dataclass(frozen=True)
class Series:
    """A sweep, and what is measured at each of its points.

    name: "distance";  about: one or two sentences: what is drawn, and what breaks the law;
    measure(draw, x): an outcome for each contestant, OURS always among them;
    unit: of `Outcome.worst`: "u (|t| + D)"; "" where the law is yes or no;
    holds_to: ours must not fail up to this x: what float64 itself can do;  law: why the guaranteed
    range ends there, as a formula in u = 2^-53, distance, size; needed where it ends before the
    last value;
    explained: why ours does not reach 1e4 times further than Mitsuba, where it does not;
    shoot(contestant, x): a picture of what goes wrong at x, where there is something to see; the
    page shows it at the first x at which a contestant other than ours fails and its picture is
    another than ours, beside ours.
    """

    name: str
    sweep: Sweep
    about: str
    measure: Callable[[Draw, float], Mapping[str, Outcome]]
    unit: str = ""
    holds_to: float = math.inf
    law: str = ""
    explained: str = ""
    shoot: Callable[[str, float], Shot] | None = None

    @property
    def axis(self) -> str:
        return self.sweep.axis

    @property
    def values(self) -> tuple[float, ...]:
        return self.sweep.values

    @property
    def quick(self) -> tuple[float, ...]:
        return self.sweep.quick

    @property
    def cases(self) -> Mapping[Effort, int]:
        return {"quick": self.sweep.few, "full": self.sweep.many}

    def __post_init__(self) -> None:
        if list(self.values) != sorted(set(self.values)) or not set(self.quick) <= set(self.values):
            raise ValueError(f"{self.name}: values must increase and hold those of the quick run")
        if self.holds_to < self.values[-1] and not self.law:
            raise ValueError(f"{self.name}: a law must say why it ends at {self.holds_to:g}")

    def settings(self, effort: Effort) -> tuple[float, ...]:
        return self.quick if effort == "quick" else self.values


@dataclass(frozen=True)
class Family:
    """id: "F1";  name: "far and small quadrics";  law: what must hold, one sentence;  anchors: what
    other projects test or allow, one sentence;  series: the first one is the headline."""

    id: str
    name: str
    law: str
    series: tuple[Series, ...]
    anchors: str = ""
    by_name: Mapping[str, Series] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "by_name", {s.name: s for s in self.series})
        if len(self.by_name) != len(self.series):
            raise ValueError(f"{self.id}: two series of one name")


def decades(first: int, last: int, step: int = 1) -> tuple[float, ...]:
    """10^first, ..., 10^last, each the float nearest to it."""
    return tuple(float(f"1e{k}") for k in range(first, last + 1, step))


# ---- all families, in order ----------------------------------------------------------------------
#
# To add one: a module beside `harness`, or a folder, that states its law, ranges, counts and what
# passes at its top and defines a `FAMILY`, and a line here.


MODULES = {
    "F1": "far",
    "F2": "leaving",
    "F3": "watertight",
    "F4": "slivers",
    "F5": "hierarchy",
    "F6": "hostile",
    "F7": "solids",
    "F8": "roots",
    "F9": "metamorphic",
    "F10": "furnaces",
    "F11": "bsdfs",
    "F12": "radiometry",
    "F13": "contact",
    "F14": "determinism",
}


def family(name: str) -> Family:
    """The `FAMILY` of its module, which is imported only when it is needed."""
    module = importlib.import_module(f"comparisons.experiments.stability.{MODULES[name]}")
    return cast(Family, module.FAMILY)
