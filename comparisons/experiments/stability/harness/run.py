"""Measures the sweep points of families in worker processes, and makes images of failures; as a
module it is the process, because extreme numbers crash native libraries."""

import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, NamedTuple

from PIL import Image
from PIL.PngImagePlugin import PngInfo
from pydantic import BaseModel, ConfigDict

from comparisons.experiments.stability.harness.outcomes import OURS
from comparisons.experiments.stability.harness.points import Found, contestants, summarise
from comparisons.experiments.stability.harness.series import (
    Draw,
    Effort,
    Family,
    Series,
    family,
    generator,
)
from comparisons.mitsuba.backend import backend
from comparisons.runs import engine
from comparisons.runs.processes import serve
from comparisons.runs.provenance import everything_fingerprint
from reference_rt.util.errors import ReferenceUnavailableError, SceneWarning
from reference_rt.util.files import replacing, temporary_folder
from reference_rt.util.workers import Workers

WORKER = ("comparisons.experiments.stability.harness.run",)

SECONDS = {"quick": 300.0, "full": 1200.0}
"""Time limit of a point: many times what the slowest takes with cold kernels."""


class Request(BaseModel):
    """A sweep point to measure, or, where `shoot` names a contestant, to make an image of.

    out: the file of the result, or of the image, a .png that holds its caption;  key: fingerprint
    that is stored with it.
    """

    model_config = ConfigDict(extra="forbid")
    output: ClassVar[str] = "out"

    family: str
    series: str
    x: float
    seed: int
    effort: Effort
    mitsuba: bool
    out: Path
    key: str
    shoot: str = ""


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

    def request(self, one: str, series: str, x: float, out: Path, shoot: str = "") -> Request:
        """out: the folder of the run."""
        name = f"{x!r}_{shoot.replace(' ', '_')}.png" if shoot else f"{x!r}.json"
        folder = out / ("pictures" if shoot else "settings") / one / series.replace(" ", "_")
        common = {"effort": self.effort, "seed": self.seed, "mitsuba": self.mitsuba}
        key = engine.key_of(sources=everything_fingerprint(), **common)
        place = {"family": one, "series": series, "x": x}
        return Request(**common, **place, out=folder / name, key=key, shoot=shoot)


class Picture(NamedTuple):
    """A stored image of a failure: whose, at which x, the file, and its caption."""

    family: str
    series: str
    contestant: str
    x: float
    path: Path
    caption: str


Report = Callable[[Found, str], None]
"""Called with each result as soon as there is one, and a remark."""


def mitsuba_is_there() -> str:
    """Why Mitsuba cannot take part; "" if it can."""
    try:
        backend()
    except ReferenceUnavailableError as error:
        return str(error)
    return ""


def run(
    choice: Choice, out: Path, workers: Workers, report: Report, fresh: bool = False
) -> list[Found]:
    """Measure what is not stored yet; each result is stored in `out`/settings at once."""
    requests = [choice.request(one.id, s.name, x, out) for one, s, x in choice.settings()]
    done, left = engine.known(requests, _found, fresh)
    results = {request.out: found for request, found in done}
    for found in results.values():
        report(found, "measured before")
    # From the last family on: what the first ones compile takes little, and they have many points,
    # which all processes share at the end.
    some = (left[::-1], _found, workers, SECONDS[choice.effort], WORKER)
    for request, result, ended in engine.measured(*some, kin=_family):
        if result is None:
            why = ended.failure or "its file cannot be read"
            result = Found(request.family, request.series, request.x, {}, ended.wall, why)
        results[request.out] = result
        report(result, f"{result.seconds:.1f} s")
    return [results[request.out] for request in requests]


def _found(request: Request) -> Found | None:
    return Found.read(request.out, request.key)


def _family(request: Request) -> str:
    """Its points share kernels."""
    return request.family


def shoot(choice: Choice, found: Sequence[Found], out: Path, workers: Workers) -> list[Picture]:
    """Images of each series at the first x at which the first contestant other than ours fails and
    its image differs from ours: both.  The first x of all series first, as most differ there."""
    seen: dict[tuple[str, str], list[Picture]] = {}
    for some in (slice(1), slice(1, None)):
        pairs = {
            (place, x): [choice.request(*place, x, out, name) for name in (who, OURS)]
            for place, (who, places) in _failing(choice, found).items()
            if place not in seen
            for x in places[some]
        }
        wanted = [request for pair in pairs.values() for request in pair]
        done, left = engine.known(wanted, _caption)
        made = engine.measured(left, _caption, workers, SECONDS["full"], WORKER, kin=_family)
        captions: dict[Path, str | None] = {request.out: caption for request, caption in done}
        captions |= {request.out: caption for request, caption, _ in made}
        for (place, x), pair in pairs.items():
            told = [captions[request.out] for request in pair]
            if place in seen or None in told or not _differ(*(request.out for request in pair)):
                continue
            seen[place] = [
                Picture(*place, request.shoot, x, request.out, str(caption))
                for request, caption in zip(pair, told, strict=True)
            ]
    return [picture for pictures in seen.values() for picture in pictures]


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


def _caption(request: Request) -> str | None:
    """The caption of a stored image; None where there is none of this key."""
    try:
        with Image.open(request.out) as picture:
            facts = dict(picture.info)
    except (OSError, ValueError):
        return None
    return facts.get("caption") if facts.get("key") == request.key else None


# ---- the process --------------------------------------------------------------------------------


def carry_out(request: Request) -> None:
    """Measure a sweep point and store the result, or make an image of a failure and store that."""
    series = family(request.family).by_name[request.series]
    if request.shoot:
        assert series.shoot is not None
        shot = series.shoot(request.shoot, request.x)
        facts = PngInfo()
        facts.add_text("caption", shot.caption)
        facts.add_text("key", request.key)
        with replacing(request.out) as temporary:
            Image.fromarray(shot.pixels).save(temporary, pnginfo=facts)
        return
    start, place = time.perf_counter(), (request.family, request.series, request.x)
    with temporary_folder() as folder:
        rng, cases = generator(request.seed, *place), series.cases[request.effort]
        draw = Draw(rng, cases, request.mitsuba, folder, request.effort)
        outcomes = series.measure(draw, request.x)
    if OURS not in outcomes:
        raise RuntimeError(f"{request.family} {request.series}: nothing was said about ours")
    found = Found(*place, dict(outcomes), time.perf_counter() - start)
    engine.store(request.out, request.key, found)


def main() -> None:
    """Carry out requests until standard input ends."""
    # Cases have triangles without area on purpose: what a mesh leaves out is no news here.
    warnings.simplefilter("ignore", SceneWarning)
    serve(Request, carry_out)


if __name__ == "__main__":
    main()
