"""A row of the table: a number of ours, a peer's, and the goal of their ratio; the options of a
benchmark, common to all groups of rows; alternating measurements of two things.
"""

import math
import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from comparisons.results.files import plain
from comparisons.runs.elsewhere import cool_down
from reference_rt.rendering.render import Progress
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import UsageError

ROUNDS = 7
"""Default number of rounds: one or two disturbances do not move the median far."""


class Spread(NamedTuple):
    """The median of some numbers, and the quartiles around it."""

    low: float
    median: float
    high: float


def spread(numbers: Sequence[float]) -> Spread:
    """Median and quartiles.  Raises ValueError for none."""
    if len(numbers) == 0:
        raise ValueError("nothing was measured")
    low, median, high = np.quantile(np.asarray(numbers, dtype=np.float64), [0.25, 0.5, 0.75])
    return Spread(float(low), float(median), float(high))


def ratios(ours: Sequence[float], peer: Sequence[float]) -> Spread:
    """The spread of ours / peer, round by round: a disturbance of a whole round cancels."""
    return spread([a / b for a, b in zip(ours, peer, strict=True)])


def seconds(run: Callable[[], object]) -> float:
    """Wall-clock seconds of one call."""
    start = time.perf_counter()
    run()
    return time.perf_counter() - start


def alternate(
    measures: Mapping[str, Callable[[], float]],
    rounds: int = ROUNDS,
    say: Callable[[str, float], None] = lambda what, fraction: None,
) -> dict[str, list[float]]:
    """The values of each of `measures` in each round, by name.

    Every other round runs in the reverse order, so that a drift favours neither.  say: called with
    what is being measured, and the fraction that is done.
    """
    found: dict[str, list[float]] = {name: [] for name in measures}
    done, total = 0, rounds * len(measures)
    for k in range(rounds):
        for name in list(measures)[:: 1 if k % 2 == 0 else -1]:
            say(name, done / total)
            cool_down()
            found[name].append(measures[name]())
            done += 1
    return found


def _silent(what: str, fraction: float) -> None:
    pass


@dataclass(frozen=True)
class Setting:
    """scenes: folder of the suite's scenes;  mesh: file that rays are traced against, None for a
    generated mesh;  quick: fewer scenes and smaller pictures;  threads: of our renderer;  say:
    called with the progress."""

    scenes: Path = Path("scenes")
    mesh: Path | None = None
    quick: bool = False
    threads: int = field(default_factory=lambda: os.cpu_count() or 1)
    say: Progress = _silent

    def file(self, name: str) -> Path:
        """The file of a scene.  Raises UsageError."""
        path = self.scenes / f"{name}.yaml"
        if not path.is_file():
            raise UsageError(f"--scenes: there is no {path}; expected the folder of the scenes")
        return path

    def load(self, name: str) -> Scene:
        """A scene by name.  Raises UsageError, SceneError."""
        return Scene.load(self.file(name))

    def names(self) -> list[str]:
        """All scenes of the folder.  Raises UsageError for a folder without any."""
        found = sorted(path.stem for path in self.scenes.glob("*.yaml"))
        if not found:
            raise UsageError(f"--scenes: '{self.scenes}' holds no scene; expected .yaml files")
        return found


Better = Literal["lower", "higher"]

LIMIT = "the limit"
"""The peer's name in a row that compares with a fixed limit; the goal is a ratio of 1."""


@dataclass(frozen=True)
class Row:
    """ours, peer: medians, in `unit`;  ratio: the median of ours / peer;  goal: the largest ratio
    that is good enough, or the smallest if higher is better;  spread: quartiles [low, high] of
    "ours", "peer" and "ratio", as far as measured;  details: further numbers."""

    name: str
    title: str
    ours: float
    peer: float
    peer_name: str
    unit: str
    ratio: float
    goal: float
    better: Better
    spread: dict[str, list[float]] = field(default_factory=dict)
    details: dict[str, Any] = field(default_factory=dict)

    @property
    def met(self) -> bool:
        """Whether the ratio meets the goal; NaN does not."""
        return self.ratio <= self.goal if self.better == "lower" else self.ratio >= self.goal

    def as_json(self) -> dict[str, Any]:
        """Strict JSON: numbers that are not finite are null."""
        document: dict[str, Any] = plain(asdict(self) | {"met": self.met})
        return document


def against(
    name: str,
    title: str,
    ours: Sequence[float],
    peer: tuple[str, Sequence[float]],
    goal: float,
    *,
    unit: str = "s",
    better: Better = "lower",
    details: dict[str, Any] | None = None,
) -> Row:
    """The row of numbers (rounds,) of ours and of a named peer, which took turns."""
    peer_name, theirs = peer
    mine, other, ratio = spread(ours), spread(theirs), ratios(ours, theirs)
    found = {"ours": mine, "peer": other, "ratio": ratio}
    return Row(
        name,
        title,
        mine.median,
        other.median,
        peer_name,
        unit,
        ratio.median,
        goal,
        better,
        {key: _around(value) for key, value in found.items()},
        {"rounds": len(ours), **(details or {})},
    )


def within(
    name: str,
    title: str,
    ours: Sequence[float],
    limit: float,
    *,
    unit: str = "s",
    details: dict[str, Any] | None = None,
) -> Row:
    """The row of numbers (rounds,) that must not exceed a limit."""
    mine = spread(ours)
    around = {"ours": _around(mine), "ratio": [x / limit for x in _around(mine)]}
    more = {"rounds": len(ours), **(details or {})}
    ratio = mine.median / limit
    return Row(name, title, mine.median, limit, LIMIT, unit, ratio, 1.0, "lower", around, more)


def row_from(document: dict[str, Any]) -> Row:
    """The row that `Row.as_json` wrote.  Raises TypeError for another document."""
    fields = {key: value for key, value in document.items() if key != "met"}
    missing = {k: math.nan for k in ("ours", "peer", "ratio") if fields.get(k) is None}
    around = {
        key: [math.nan if x is None else x for x in values]
        for key, values in fields.get("spread", {}).items()
    }
    return Row(**fields | missing | {"spread": around})


def _around(found: Spread) -> list[float]:
    return [found.low, found.high]
