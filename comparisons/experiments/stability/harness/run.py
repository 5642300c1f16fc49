"""Measures the sweep points of families in worker processes; reads those that are stored."""

import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from PIL import Image

from comparisons.experiments.stability.harness.core import OURS, Effort, Found
from comparisons.experiments.stability.harness.family import Family, Series, family
from comparisons.experiments.stability.harness.table import contestants, summarise
from comparisons.experiments.stability.harness.worker import Request
from comparisons.mitsuba.backend import backend
from comparisons.runs import processes
from comparisons.runs.provenance import everything_fingerprint
from reference_rt.util.errors import ReferenceUnavailableError
from reference_rt.util.workers import Workers

WORKER = ("comparisons.experiments.stability.harness.worker",)

SECONDS = {"quick": 300.0, "full": 1200.0}
"""Time limit of a point: many times what the slowest takes with cold kernels."""


@dataclass(frozen=True)
class Choice:
    """What to run: families by id, all series or one, all its x or one.

    mitsuba: whether it takes part.
    """

    families: tuple[str, ...]
    effort: Effort
    seed: int
    series: str | None = None
    at: float | None = None
    mitsuba: bool = True

    def settings(self) -> list[tuple[Family, Series, float]]:
        """The sweep points, in the order of the report."""
        return [
            (one, series, x)
            for one in map(family, self.families)
            for series in one.series
            if self.series in (None, series.name)
            for x in ((self.at,) if self.at is not None else series.settings(self.effort))
        ]


class Picture(NamedTuple):
    """A stored image of a failure: whose, at which x, the file, and its caption."""

    family: str
    series: str
    contestant: str
    x: float
    path: Path
    caption: str


@dataclass
class Run:
    """The results, in the order of the sweep points."""

    found: list[Found] = field(default_factory=list)
    pictures: list[Picture] = field(default_factory=list)


Report = Callable[[Found, str], None]
"""Called with each result as soon as there is one, and a remark."""


def mitsuba_is_there() -> str:
    """Why Mitsuba cannot take part; "" if it can."""
    try:
        backend()
    except ReferenceUnavailableError as error:
        return str(error)
    return ""


def key_of(effort: Effort, seed: int) -> str:
    """Fingerprint: a stored result is valid where sources, versions, effort and seed are these."""
    parts = {"sources": everything_fingerprint(), "effort": effort, "seed": seed}
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


def run(choice: Choice, out: Path, workers: Workers, report: Report, fresh: bool = False) -> Run:
    """Measure what is not stored yet; each result is stored in `out`/settings at once."""
    key = f"{key_of(choice.effort, choice.seed)} {choice.mitsuba}"
    settings = choice.settings()
    known: dict[tuple[str, str, float], Found] = {}
    requests = []
    for one, series, x in settings:
        request = _request(choice, one.id, series.name, x, out / "settings", key)
        done = None if fresh else Found.read(request.out, key)
        if done is None:
            requests.append(request)
        else:
            known[one.id, series.name, x] = done
            report(done, "measured before")
    for found in _measured(requests, workers, choice.effort):
        known[found.family, found.series, found.x] = found
        report(found, f"{found.seconds:.1f} s")
    return Run([known[one.id, series.name, x] for one, series, x in settings])


def shoot(choice: Choice, found: Sequence[Found], out: Path, workers: Workers) -> list[Picture]:
    """Images of each series at the first x at which the first contestant other than ours fails and
    its image differs from ours: both."""
    key = f"{key_of(choice.effort, choice.seed)} {choice.mitsuba}"
    left = _failing(choice, found)
    seen: list[Picture] = []
    while left:
        pairs = {}
        for (one, series), (who, places) in left.items():
            at = (one, series, places.pop(0), out / "pictures", key)
            pairs[one, series] = [_request(choice, *at, name) for name in (who, OURS)]
        wanted = [r for pair in pairs.values() for r in pair if _caption(r.out, key) is None]
        limit = SECONDS["full"]
        with closing(processes.run(wanted, workers, limit, lambda *_: None, WORKER)) as running:
            for _ in running:
                pass
        for place, pair in pairs.items():
            captions = [_caption(request.out, key) for request in pair]
            if None not in captions and _differ(*(request.out for request in pair)):
                seen += [
                    Picture(*place, request.shoot, request.x, request.out, str(caption))
                    for request, caption in zip(pair, captions, strict=True)
                ]
                del left[place]
        left = {place: some for place, some in left.items() if some[1]}
    return seen


def _failing(
    choice: Choice, found: Sequence[Found]
) -> dict[tuple[str, str], tuple[str, list[float]]]:
    """By family and series: the first contestant other than ours that fails, and all x where it
    does."""
    failing = {}
    for one in map(family, choice.families):
        for summary in summarise(one, found):
            if summary.series.shoot is None:
                continue
            for name in contestants(summary.found):
                outcomes = [(f.x, f.outcomes[name]) for f in summary.found if name in f.outcomes]
                places = [x for x, some in outcomes if some.failures]
                if name != OURS and places:
                    failing[one.id, summary.series.name] = (name, places)
                    break
    return failing


def _differ(a: Path, b: Path) -> bool:
    with Image.open(a) as one, Image.open(b) as other:
        return one.tobytes() != other.tobytes()


def _caption(path: Path, key: str) -> str | None:
    """The caption of a stored image; None where there is none of this key."""
    try:
        with Image.open(path) as picture:
            facts = dict(picture.info)
    except (OSError, ValueError):
        return None
    return str(facts["caption"]) if facts.get("key") == key and "caption" in facts else None


def _request(
    choice: Choice, one: str, series: str, x: float, folder: Path, key: str, shoot: str = ""
) -> Request:
    name = f"{x!r}_{shoot.replace(' ', '_')}.png" if shoot else f"{x!r}.json"
    return Request(
        family=one,
        series=series,
        x=x,
        seed=choice.seed,
        effort=choice.effort,
        mitsuba=choice.mitsuba,
        out=folder / one / series.replace(" ", "_") / name,
        key=key,
        shoot=shoot,
    )


def _measured(requests: Sequence[Request], workers: Workers, effort: Effort) -> Iterator[Found]:
    running = processes.run(requests, workers, SECONDS[effort], lambda *_: None, WORKER)
    with closing(running):
        for outcome in running:
            request = outcome.request
            found = None if outcome.failure else Found.read(request.out, request.key)
            if found is None:
                why = outcome.failure or "its file cannot be read"
                place = (request.family, request.series, request.x)
                found = Found(*place, {}, outcome.wall, why)
            yield found
