"""What a family is made of: the draw of a sweep point, sweeps, series and families.

To add a family: a module beside `harness`, or a folder, that states its law, ranges, counts and
what passes at its top, registers its series and defines a `FAMILY`; and its line of `MODULES`.
"""

import importlib
import math
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple, TypeVar, cast

import numpy as np

from comparisons.experiments.stability.harness.outcomes import Outcomes
from comparisons.experiments.stability.harness.shots import Shot

Effort = Literal["quick", "full"]


class Draw(NamedTuple):
    """The context that the cases of a sweep point are drawn in.

    rng: the same for the same seed, family, series and x, whatever else is measured;  cases: how
    many to draw, the sweep's number for this effort;  mitsuba: whether Mitsuba takes part;
    folder: for files, empty, removed afterwards;  effort: for what `cases` does not decide.
    """

    rng: np.random.Generator
    cases: int
    mitsuba: bool
    folder: Path
    effort: Effort = "quick"


def generator(seed: int, family: str, series: str, x: float) -> np.random.Generator:
    """The random numbers of one sweep point, independent of every other's."""
    return np.random.default_rng((seed, zlib.crc32(f"{family} {series} {x!r}".encode())))


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


def decades(first: int, last: int, step: int = 1) -> tuple[float, ...]:
    """10^first, ..., 10^last, each the float nearest to it."""
    return tuple(float(f"1e{k}") for k in range(first, last + 1, step))


Measure = Callable[[Draw, float], Outcomes]
"""What a series is measured by: an outcome for each contestant, OURS always among them."""


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
    measure: Measure
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


FAMILIES = "comparisons.experiments.stability"
"""The package of the families' modules."""

_REGISTERED: dict[str, dict[str, Series]] = {}
"""By the module or folder of the family, and by name."""

M = TypeVar("M", bound=Measure)


def add(module: str, one: Series) -> None:
    """Register a series of a module's family.  Raises ValueError for a second one of its name."""
    known = _REGISTERED.setdefault(module.removeprefix(f"{FAMILIES}.").partition(".")[0], {})
    if one.name in known:
        raise ValueError(f"{module}: two series of the name '{one.name}'")
    known[one.name] = one


def series(
    sweep: Sweep,
    name: str = "",
    about: str = "",
    unit: str = "",
    holds_to: float = math.inf,
    law: str = "",
    explained: str = "",
    shoot: Callable[[str, float], Shot] | None = None,
) -> Callable[[M], M]:
    """Register a function `measure(draw, x)` as a series, in the family of its module.

    Its name is the series', with spaces, and its docstring says what the series is about, unless
    they are given.  Random numbers depend on the name.  The rest is said of `Series`.
    """

    def register(measure: M) -> M:
        one = Series(
            name or measure.__name__.replace("_", " "),
            sweep,
            about or " ".join((measure.__doc__ or "").split()),
            measure,
            unit,
            holds_to,
            law,
            explained,
            shoot,
        )
        add(measure.__module__, one)
        return measure

    return register


@dataclass(frozen=True)
class Family:
    """id: "F1";  name: "far and small quadrics";  law: what must hold, one sentence;  anchors: what
    other projects test or allow, one sentence."""

    id: str
    name: str
    law: str
    anchors: str = ""

    @property
    def series(self) -> tuple[Series, ...]:
        """Those registered in the family's modules, in the order of their definition: the first one
        is the headline."""
        return tuple(self.by_name.values())

    @property
    def by_name(self) -> Mapping[str, Series]:
        """The same by name."""
        return _REGISTERED.get(MODULES[self.id], {})


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
    "F14": "media",
}


def family(name: str) -> Family:
    """The `FAMILY` of its module, which is imported only when it is needed."""
    module = importlib.import_module(f"{FAMILIES}.{MODULES[name]}")
    return cast(Family, module.FAMILY)
