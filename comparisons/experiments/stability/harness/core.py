"""The vocabulary of all families: contestants, the context of a sweep point, and its outcome."""

import importlib
import math
import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, NamedTuple, cast

import numpy as np
import numpy.typing as npt

from comparisons.geometry.exact.dyadic import BoolArray
from comparisons.geometry.frame import UNIT_ROUNDOFF as U32
from comparisons.runs.engine import stored

U = 2.0**-53
"""Unit roundoff: half a unit in the last place of 1."""

PIXEL = 1e-3
"""A hit is misplaced if it is off by more than this share of the shape's size: a pixel, where the
shape fills a picture 1000 pixels wide."""

FloatArray = npt.NDArray[np.float64]

OURS, MITSUBA = "ours", "mitsuba"
"""Names of contestants; textbook methods go by theirs: "sphere.algebraic"."""

EXAMPLES = 3
"""Failures of a contestant at a sweep point that are kept word for word."""

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


@dataclass(frozen=True)
class Outcome:
    """The result of a contestant at one sweep point.

    cases: those that were decided;  failures: those of them that break the law;  worst: the largest
    error in the series' unit, of cases that have one, failed or not (inf counts); None where none
    has, or the law is yes or no;  open: undecidable cases, such as rays that touch exactly;
    examples: failures, at most EXAMPLES, as JSON: the input (floats as `float.hex`, so that nothing
    is rounded), what was expected and what was found.
    """

    cases: int
    failures: int
    worst: float | None = None
    open: int = 0
    examples: tuple[Mapping[str, Any], ...] = ()

    def __post_init__(self) -> None:
        if not 0 <= self.failures <= self.cases:
            raise ValueError(f"{self.failures} failures of {self.cases} cases")
        if self.worst is not None and math.isnan(self.worst):
            raise ValueError("the worst error is NaN: a case that gives NaN has failed, with inf")

    def __add__(self, other: "Outcome") -> "Outcome":
        """The outcome of both sets of cases together."""
        known = [x.worst for x in (self, other) if x.worst is not None]
        return Outcome(
            self.cases + other.cases,
            self.failures + other.failures,
            max(known, default=None),
            self.open + other.open,
            (self.examples + other.examples)[:EXAMPLES],
        )


class Shot(NamedTuple):
    """An image of a failure: pixels (height, width, 3) uint8 sRGB, row 0 on top, and one sentence
    that says what is to be seen."""

    pixels: npt.NDArray[np.uint8]
    caption: str


def generator(seed: int, family: str, series: str, x: float) -> np.random.Generator:
    """The random numbers of one sweep point, independent of every other's."""
    return np.random.default_rng((seed, zlib.crc32(f"{family} {series} {x!r}".encode())))


def pixel_grid(pixels: int, half: float) -> tuple[FloatArray, FloatArray]:
    """x, y (pixels², ) of the middles of a picture's pixels, from -half to half; row 0 on top."""
    ticks = (np.arange(pixels) + 0.5) / pixels * (2.0 * half) - half
    x, y = np.meshgrid(ticks, -ticks)
    return x.ravel(), y.ravel()


# ---- outcomes out of arrays: which cases failed, and the first failures word for word ------------


Columns = dict[str, Any]
"""The keys and values of the examples of failures: see `outcome`."""


def unit_of(contestant: str) -> float:
    """The unit roundoff that a contestant works in."""
    return U32 if contestant == MITSUBA else U


def outcome(
    wrong: BoolArray,
    columns: Columns,
    undecided: BoolArray | None = None,
    worst: float | None = None,
) -> Outcome:
    """wrong (n,): which cases fail;  undecided (n,): which are left open, wrong or not.

    columns: what the examples show, by key: of an array its row, floats as hex; of a function what
    it returns for the number of the case; anything else as it is.
    """
    count = len(wrong)
    if undecided is not None:
        wrong, count = wrong & ~undecided, count - int(np.count_nonzero(undecided))
    which = np.flatnonzero(wrong)
    examples = tuple(
        {key: _shown(column, k) for key, column in columns.items()}
        for k in which[:EXAMPLES].tolist()
    )
    return Outcome(count, len(which), worst, len(wrong) - count, examples)


def _shown(column: Any, k: int) -> Any:
    if isinstance(column, np.ndarray):
        return hexed(column[k])
    return column(k) if callable(column) else column


def of_errors(errors: FloatArray, allowed: FloatArray | float, columns: Columns) -> Outcome:
    """errors (n,): above `allowed` is a failure, and so is NaN, which counts as inf."""
    errors = np.where(np.isnan(errors), np.inf, errors)
    return outcome(errors > allowed, columns, worst=float(errors.max(initial=0.0)))


def one_case(failed: bool, error: float | None, example: Mapping[str, Any]) -> Outcome:
    """A single case;  error: of `Outcome.worst`, where NaN counts as inf."""
    worst = np.inf if error is not None and np.isnan(error) else error
    return Outcome(1, int(failed), worst, examples=(example,) if failed else ())


def hexed(values: Any) -> Any:
    """Floats as `float.hex`, which rounds nothing; whole numbers and texts as they are."""
    array = np.asarray(values)
    show = float.hex if array.dtype.kind == "f" else lambda x: x
    return [show(x) for x in array.ravel().tolist()] if array.ndim else show(array.item())


def plain(values: Any) -> Callable[[int], Any]:
    """A column of numbers that are rounded for people, as JSON has them."""
    return lambda k: values[k].tolist()


def relative(value: FloatArray, exact: FloatArray) -> FloatArray:
    """|value - exact| / |exact|; 0 where both are 0, inf where one alone is."""
    off = np.abs(value - exact)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(off == 0.0, 0.0, off / np.abs(exact))


def together(found: Iterable[Mapping[str, Outcome]]) -> dict[str, Outcome]:
    """Outcomes added up, contestant by contestant."""
    total: dict[str, Outcome] = {}
    for part in found:
        for name, one in part.items():
            total[name] = total[name] + one if name in total else one
    return total


# The result of one sweep point, stored in a file of its own, so that it is not measured again.


@dataclass(frozen=True)
class Found:
    """outcomes: by contestant;  seconds: that it took, compiling included;  broken: why there are
    no outcomes, "" where there are."""

    family: str
    series: str
    x: float
    outcomes: dict[str, Outcome]
    seconds: float
    broken: str = ""

    @property
    def ours(self) -> Outcome | None:
        return self.outcomes.get(OURS)

    @classmethod
    def read(cls, path: Path, key: str) -> "Found | None":
        """The stored result, None where there is none of this key."""
        try:
            document: dict[str, Any] = stored(path, key)
            outcomes = {
                name: Outcome(**(some | {"examples": tuple(some["examples"])}))
                for name, some in document.pop("outcomes").items()
            }
            return cls(outcomes=outcomes, **document)
        except (ValueError, KeyError, TypeError, AttributeError):
            return None


# ---- families, their series, and the sweeps that series measure along ----------------------------


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
}


def family(name: str) -> Family:
    """The `FAMILY` of its module, which is imported only when it is needed."""
    module = importlib.import_module(f"comparisons.experiments.stability.{MODULES[name]}")
    return cast(Family, module.FAMILY)


# ---- sweep points added up: how far each contestant holds, and whether ours holds its range ------


FURTHER = 1e4
"""Times that ours should hold further than float32: what 29 bits more allow."""


def found_of(found: Iterable[Found], family: str, series: str | None = None) -> list[Found]:
    return [f for f in found if f.family == family and series in (None, f.series)]


def contestants(found: Sequence[Found]) -> list[str]:
    """Ours first, then Mitsuba, then the others in the order of their appearance."""
    names = dict.fromkeys(name for f in found for name in f.outcomes)
    return sorted(names, key=lambda name: (name != OURS, name != MITSUBA))


def named(contestant: str) -> str:
    """The name that tables and charts show."""
    return "Mitsuba" if contestant == MITSUBA else contestant.replace("_", " ")


def first_failure(found: Iterable[Found], contestant: str) -> float | None:
    """The smallest x at which a case of this series failed; None where none did."""
    failing = [
        f.x for f in found if contestant in f.outcomes and f.outcomes[contestant].failures > 0
    ]
    return min(failing, default=None)


def total(found: Iterable[Found], contestant: str) -> Outcome | None:
    """All points together; None where the contestant did not take part."""
    some = [f.outcomes[contestant] for f in found if contestant in f.outcomes]
    return sum(some[1:], some[0]) if some else None


@dataclass(frozen=True)
class SeriesSummary:
    """ours, mitsuba: where each starts to fail, None where it does not, up to `last`, or does not
    take part;  last: the largest x;  broken: why points were not measured;  failed: x within the
    guaranteed range at which ours failed."""

    series: Series
    found: tuple[Found, ...]
    ours: float | None
    mitsuba: float | None
    mitsuba_took_part: bool
    last: float
    broken: tuple[str, ...]
    failed: tuple[float, ...]

    @property
    def holds(self) -> bool:
        return not self.broken and not self.failed

    @property
    def further(self) -> float | None:
        """How many times further ours holds, at least; None where Mitsuba does not fail."""
        if self.mitsuba is None:
            return None
        return (self.ours if self.ours is not None else self.last) / self.mitsuba

    @property
    def unexplained(self) -> bool:
        """Whether ours should hold further than it does, and nothing says why it does not."""
        if not self.series.axis or self.further is None or self.series.explained:
            return False
        return self.further < FURTHER


def summarise(family: Family, found: Sequence[Found]) -> list[SeriesSummary]:
    """The series of a family that were measured."""
    summaries = []
    for series in family.series:
        some = found_of(found, family.id, series.name)
        if not some:
            continue
        failed = [f.x for f in some if f.x <= series.holds_to and f.ours and f.ours.failures]
        summaries.append(
            SeriesSummary(
                series,
                tuple(some),
                first_failure(some, OURS),
                first_failure(some, MITSUBA),
                any(MITSUBA in f.outcomes for f in some),
                max(f.x for f in some),
                tuple(f"{series.name} at {f.x:g}: {f.broken}" for f in some if f.broken),
                tuple(failed),
            )
        )
    return summaries


def summaries(found: Sequence[Found]) -> dict[str, list[SeriesSummary]]:
    """By the ids of families."""
    names = dict.fromkeys(f.family for f in found)
    return {name: summarise(family(name), found_of(found, name)) for name in names}
