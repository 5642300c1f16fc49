"""A suite from its plan to its results: what is done is read, the rest is run, all of it told."""

import contextlib
import shlex
import signal
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import FrameType
from typing import Any

from comparisons.mitsuba_backend import backend
from comparisons.processes import pool
from comparisons.provenance import provenance
from comparisons.record import read_case, read_record, write_case
from comparisons.report import write_report, write_results
from comparisons.results import Case, Tier
from comparisons.suites.display import Display
from comparisons.suites.keys import case_key
from comparisons.suites.suite import Plan, Source, Work, folder_name
from comparisons.suites.worker import Request
from reference_rt.errors import ImageError
from reference_rt.files import check_writable

LOG = "stderr.txt"
"""In the folder of a case that could not be carried through: what its process wrote meanwhile."""


@dataclass(frozen=True)
class Options:
    """out: folder of the results;  rungs: only these, all if none;  jobs: processes at once;
    threads: of each;  fresh: do again what is done;  runner: see `comparisons.suites.worker`."""

    out: Path
    rungs: tuple[str, ...] = ()
    jobs: int = 1
    threads: int | None = None
    fresh: bool = False
    runner: str | None = None


@dataclass(frozen=True)
class Run:
    """What came of a suite: cases, in the order of the plan, the seconds each took, and why others
    were not run, by name."""

    cases: tuple[Case, ...]
    walls: dict[str, float]
    not_run: dict[str, str]


def run_suite(source: Source, plan: Plan, options: Options) -> Run:
    """Run what is not done yet.

    `results.json` in the folder is whole after each case, so that an interrupted run keeps what it
    found, and `report.html` comes at the end.  Raises ReferenceUnavailableError; SceneError for a
    file that a scene names; ImageError where nothing can be written.
    """
    check_writable(options.out / "results.json")
    chosen = backend()
    facts = provenance(
        suite=f"{source.name}: {source.suite.about}",
        jobs=options.jobs,
        **({"rungs": ", ".join(options.rungs)} if options.rungs else {}),
        **{f"not run: {name}": why for name, why in plan.skipped.items()},
    )
    found: dict[str, Case] = {}
    run = Run((), {}, dict(plan.skipped))
    requests: list[Request] = []

    def add(case: Case, wall: float) -> None:
        if options.rungs and not _has_one_of(case, options.rungs):
            run.not_run[case.scene] = f"has no rung {' or '.join(options.rungs)}"
        else:
            found[case.scene], run.walls[case.scene] = case, wall

    def write() -> list[Case]:
        cases = [found[work.name] for work in plan.work if work.name in found]
        write_results(options.out / "results.json", cases, facts, source.name, run.not_run)
        return cases

    with Display(len(plan.work)) as display, _terminable():
        display.line(f"Mitsuba {facts['mitsuba']}")
        for work in plan.work:
            key = case_key(work.scene, work.budget, options.rungs, chosen)
            request = _request(work, source, options, key)
            done = None if options.fresh else _done(request)
            if done is None:
                requests.append(request)
            else:
                add(*done)
                display.done(done[0], "done before")
        write()
        for outcome in _outcomes(requests, source.suite.case_seconds, options, display):
            case = _case(outcome)
            add(case, outcome.wall)
            display.done(case, f"{outcome.wall:.1f} s")
            write()
        cases = write()
    write_report(options.out / "report.html", cases, facts)
    return replace(run, cases=tuple(cases))


def _has_one_of(case: Case, rungs: tuple[str, ...]) -> bool:
    """Whether the case could not be run, or any of these rungs says anything about it."""
    said = {tier.name for tier in case.tiers if tier.status != "not-applicable"}
    return bool(said & {"run", "input", *rungs})


def _request(work: Work, source: Source, options: Options, key: str) -> Request:
    command = ["reference-rt", "suite", source.argument]
    command += ["--only", work.name, "--fresh", "--out", str(options.out / "again")]
    if work.path.parent != Path("scenes"):
        command += ["--scenes", str(work.path.parent)]
    return Request(
        name=work.name,
        scene=work.path,
        budget=work.budget,
        rungs=options.rungs,
        folder=options.out / "cases" / folder_name(work.name),
        key=key,
        again=shlex.join(command),
    )


def _done(request: Request) -> tuple[Case, float] | None:
    """The case and its seconds, if the record is of what is asked for."""
    try:
        record = read_record(request.folder)
        return (read_case(request.folder), record.wall) if record.key == request.key else None
    except ImageError:
        return None


def _outcomes(
    requests: Sequence[Request], seconds: float, options: Options, display: Display
) -> Iterator[pool.Outcome[Request]]:
    worker = ["comparisons.suites.worker"]
    if options.threads is not None:
        worker += ["--threads", str(options.threads)]
    if options.runner is not None:
        worker += ["--runner", options.runner]
    running = pool.run(requests, options.jobs, seconds, display.doing, worker)
    # Closed at once if the caller is interrupted: no process outlives this one.
    with contextlib.closing(running):
        yield from running


def _case(outcome: pool.Outcome[Request]) -> Case:
    """The case as its worker recorded it, or one that says why there is none; that one has no key,
    so that it is run again next time."""
    request = outcome.request
    log = request.folder / LOG
    log.unlink(missing_ok=True)
    if outcome.failure is None:
        return read_case(request.folder)
    reason = outcome.failure
    if outcome.log:
        log.parent.mkdir(parents=True, exist_ok=True)
        log.write_text(outcome.log, encoding="utf-8")
        reason += f"; see {log}"
    tier = Tier("run", "invalid", reason)
    case = Case(request.name, "invalid", f"run: {reason}", (tier,), None, {}, again=request.again)
    write_case(request.folder, case, wall=outcome.wall)
    return case


@contextlib.contextmanager
def _terminable() -> Iterator[None]:
    """Being told to end (SIGTERM, as build machines do) ends the workers too."""

    def leave(number: int, frame: FrameType | None) -> None:
        sys.exit(128 + number)

    try:
        former: Any = signal.signal(signal.SIGTERM, leave)
    except ValueError:  # not the main thread, which alone may
        yield
        return
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, former)
