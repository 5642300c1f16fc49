"""A run: scenes through worker processes, findings reduced, results that a later run resumes."""

import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path

from comparisons.experiments.fuzz import assets, results
from comparisons.experiments.fuzz.data import Data
from comparisons.experiments.fuzz.finding import (
    Checked,
    Effort,
    Finding,
    Grammar,
    Reduced,
    Request,
    without_numbers,
)
from comparisons.experiments.fuzz.generate import generate
from comparisons.experiments.fuzz.reduce import reduce
from comparisons.experiments.fuzz.schema import types_in
from comparisons.runs import engine
from comparisons.runs.processes import Ended
from reference_rt.util.errors import UsageError
from reference_rt.util.workers import Threads, Workers

SECONDS = 600.0
"""Time limit of a scene, wall clock.  One takes 1 to 10 s of CPU time, and a process on a shared
machine may get a twentieth of a core; one that takes longer hangs."""

EACH = 3
"""Findings of one rung and cause that are reduced; more are counted."""

BATCH = 400
"""Scenes that are given to the processes at a time."""

WORKER = ("comparisons.experiments.fuzz.worker",)

FEW = 40
"""Scenes that are tried to reduce one at which a process dies or hangs: each takes a process."""


@dataclass(frozen=True)
class Plan:
    """out: folder of the results;  count, seconds: of scenes and wall clock, whichever ends first;
    first: the number of the first scene;  workers: what checks scenes, see `processes.run`;  stop:
    at the first finding;  command: another renderer's;  scenes: data in place of generated scenes;
    shrink: seconds for the reduction of a finding, 0: none;  limit: seconds of a scene."""

    out: Path
    seed: int = 0
    count: int | None = None
    seconds: float | None = None
    first: int = 0
    workers: Workers = field(default_factory=lambda: Threads(1))
    grammar: Grammar = field(default_factory=Grammar)
    effort: Effort = field(default_factory=Effort)
    stop: bool = False
    command: str = ""
    scenes: tuple[Data, ...] = ()
    shrink: float = 120.0
    limit: float = SECONDS

    @property
    def files(self) -> Path:
        """The folder of the files that scenes name."""
        return self.out / "files"

    @property
    def settings(self) -> dict[str, object]:
        """What results of an earlier run must have in common with this one's."""
        return {
            "seed": self.seed,
            "features": list(self.grammar.features),
            "extreme": self.grammar.extreme,
            "effort": self.effort.model_dump(mode="json"),
            "command": self.command,
            "scenes": len(self.scenes),
        }


@dataclass
class Run:
    """scenes: by number, those of earlier runs too;  reduced: findings;  seconds, fresh: wall clock
    and scenes of this run alone."""

    scenes: dict[int, Checked] = field(default_factory=dict)
    reduced: list[Reduced] = field(default_factory=list)
    seconds: float = 0.0
    fresh: int = 0

    @property
    def findings(self) -> list[tuple[int, Finding]]:
        """All findings with the numbers of their scenes."""
        return [(n, f) for n in sorted(self.scenes) for f in self.scenes[n].findings]


Tell = Callable[[Checked], None]
"""Called with what came of each scene."""


def run(plan: Plan, tell: Tell, say: Callable[[str], None] = lambda line: None) -> Run:
    """Check scenes that are not stored yet, and reduce what is found.

    Raises UsageError for a folder with results of other settings, ReferenceUnavailableError.
    """
    plan.out.mkdir(parents=True, exist_ok=True)
    if not results.check_settings(plan.out, plan.settings):
        raise UsageError(
            f"{plan.out}: has results of another seed or other settings; expected the same, or "
            "another folder by --out"
        )
    assets.write(plan.files)
    known = {checked.number: checked for checked in results.every(plan.out, Checked)}
    found = Run(known, [*results.every(plan.out, Reduced)])
    start = time.monotonic()
    try:
        for checked in _checked(plan, found.scenes, start):
            found.scenes[checked.number] = checked
            found.fresh += 1
            tell(checked)
            if plan.stop and checked.findings:
                break
        found.seconds = time.monotonic() - start
    finally:
        found.seconds = found.seconds or time.monotonic() - start
    if plan.shrink:
        _reduce_all(plan, found, say)
    return found


def _numbers(plan: Plan, done: dict[int, Checked]) -> Iterator[int]:
    number = plan.first
    last = None if plan.count is None else plan.first + plan.count
    if plan.scenes:
        last = len(plan.scenes)
    while last is None or number < last:
        if number not in done:
            yield number
        number += 1


def _checked(plan: Plan, done: dict[int, Checked], start: float) -> Iterator[Checked]:
    """What comes of the scenes, as they end."""
    numbers = _numbers(plan, done)

    def is_late() -> bool:
        return plan.seconds is not None and time.monotonic() - start > plan.seconds

    while not is_late():
        batch = [number for number, _ in zip(numbers, range(BATCH), strict=False)]
        if not batch:
            return
        requests = [_request(plan, number) for number in batch]
        for tries_left in (1, 0):
            late: list[Request] = []
            some = (requests, _stored, plan.workers, plan.limit, WORKER)
            with closing(engine.measured(*some)) as running:  # its processes end with it
                for request, found, ended in running:
                    if tries_left and LATE in (ended.failure or ""):
                        late.append(request)
                        continue
                    if found is None:
                        found = _dead(request, ended)
                        results.add(plan.out, found)
                    yield found
                    if is_late():
                        return
            # Once more: the first time it may have compiled kernels, or the machine was busy.
            requests = late


LATE = "took longer than"
"""In the failure of a request whose time was up."""


def _dead(request: Request, ended: Ended) -> Checked:
    """The result of a scene at which its process died, hung or stopped with an error."""
    why = ended.failure or "no result was stored"
    finding = Finding(rung="run", cause=without_numbers(why), detail=f"{why}\n{ended.log[-1500:]}")
    return Checked(number=request.number, findings=[finding], seconds=ended.wall)


def _request(plan: Plan, number: int) -> Request:
    return Request(
        number=number,
        out=plan.out,
        files=plan.files,
        seed=plan.seed,
        features=plan.grammar.features,
        extreme=plan.grammar.extreme,
        effort=plan.effort,
        scene=plan.scenes[number] if plan.scenes else None,
        command=plan.command,
        seconds=plan.shrink,
    )


# ---- reduction ----------------------------------------------------------------------------------


def _reduce_all(plan: Plan, found: Run, say: Callable[[str], None]) -> None:
    """Reduce the first findings of each rung and cause that are not reduced yet."""
    done = {one.number for one in found.reduced}
    counts = Counter(one.finding.rung for one in found.reduced)
    chosen: list[tuple[int, Finding]] = []
    seen: Counter[tuple[str, str]] = Counter()
    for number, one in found.findings:
        seen[one.key] += 1
        if seen[one.key] <= EACH and number not in done:
            chosen.append((number, one))
    if plan.stop:
        chosen = chosen[: max(0, 1 - sum(counts.values()))]
    if chosen:
        say(f"reducing {len(chosen)} findings")
    requests = [
        _request(plan, number).model_copy(update={"task": "reduce", "finding": finding})
        for number, finding in chosen
    ]
    inside = [r for r in requests if not _died(r)]
    limit = 3.0 * plan.shrink + plan.limit
    for request, _, ended in engine.measured(inside, _nothing, plan.workers, limit, WORKER):
        if ended.failure is not None:
            results.add(plan.out, _unreduced(plan, request))
        say(f"scene {request.number}: reduced ({ended.wall:.0f} s)")
    for request in requests:
        if _died(request):
            results.add(plan.out, _outside(plan, request))
    found.reduced = [*results.every(plan.out, Reduced)]


def _stored(request: Request) -> Checked | None:
    return results.read(request.out, Checked, request.number)


def _nothing(request: Request) -> None:
    """What is read of a request whose result is read later, with all others."""


def _died(request: Request) -> bool:
    """Whether the finding is that our process died or hung, not another renderer's."""
    return request.finding is not None and request.finding.rung == "run" and not request.command


def _scene(plan: Plan, number: int) -> Data:
    if plan.scenes:
        return plan.scenes[number]
    return generate(plan.seed, number, plan.grammar, plan.files)


def _unreduced(plan: Plan, request: Request) -> Reduced:
    scene = _scene(plan, request.number)
    assert request.finding is not None
    return Reduced(number=request.number, finding=request.finding, scene=scene, types=_types(scene))


def _types(scene: Data) -> list[str]:
    return sorted(f"{kind}:{name}" for kind, name in types_in(scene))


def _outside(plan: Plan, request: Request) -> Reduced:
    """A scene at which a process dies or hangs, reduced in a new process for each try."""
    wanted = request.finding
    assert wanted is not None

    def fails(candidate: Data) -> bool:
        one = request.model_copy(update={"task": "scene", "scene": candidate})
        one = one.model_copy(update={"out": plan.out / "tried"})
        one.out.mkdir(exist_ok=True)
        limit = min(plan.limit, 30.0) if LATE not in wanted.cause else plan.limit / 2.0
        ((_, _, ended),) = engine.measured([one], _nothing, plan.workers, limit, WORKER)
        return ended.failure is not None and without_numbers(ended.failure) == wanted.cause

    try:
        scene = _scene(plan, request.number)
    except Exception:
        return Reduced(number=request.number, finding=wanted, scene={})
    found = reduce(scene, fails, most=FEW, seconds=10.0 * plan.shrink)
    return Reduced(
        number=request.number,
        finding=wanted,
        scene=found.scene,
        tried=found.tried,
        types=_types(found.scene),
    )
