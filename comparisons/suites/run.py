"""Runs the cases of `reference-rt compare` and `reference-rt suite`, and writes their outputs.

Finished cases are read from the output folder; the others are run by worker processes.
"""

import contextlib
import json
import shlex
import signal
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple

from rich.text import Text

from comparisons.mitsuba.backend import Backend, backend
from comparisons.renderers import witness_facts
from comparisons.report import terminal, write_report, write_results
from comparisons.report.biases import tell
from comparisons.report.ci import ranked
from comparisons.report.table import Column, Table
from comparisons.results.case import PASSING, WARNING, Case, RungResult, how_many
from comparisons.results.headline import first_difference, headline
from comparisons.results.naming import named
from comparisons.results.stored_case import (
    CASE,
    StoredCaseError,
    read_case,
    read_stored_case,
    write_case,
)
from comparisons.runs import engine
from comparisons.runs.engine import Count
from comparisons.runs.processes import Children, Ended, Shown
from comparisons.runs.provenance import provenance
from comparisons.suites import worker_command
from comparisons.suites.keys import case_key
from comparisons.suites.suite import Plan, Source, Work, folder_name
from comparisons.suites.worker import Request
from reference_rt.cli.pictured import Pictured
from reference_rt.util.errors import ImageError, SceneError
from reference_rt.util.files import check_writable, delete_unfinished, discard, read_text, replacing
from reference_rt.util.workers import Threads, Workers

_STYLES = {
    "agree": "green",
    "unchanged": "green",
    "reference-limited": "cyan",
    "inconclusive": "yellow",
    "not-comparable": "yellow",
    "differ": "bold red",
    "invalid": "bold red",
}

_SLOWEST = 3


class Display(Count, Pictured):
    """Shows the progress of cases.  steps: print every step and every reason, for runs of few
    cases."""

    def __init__(self, cases: int, steps: bool = False) -> None:
        super().__init__(cases)
        self._steps = steps
        self._running: dict[str, str] = {}

    def doing(self, request: Request, step: str) -> None:
        """A case has begun (step ""), or has reached `step`, or has such pictures."""
        if isinstance(step, Shown):
            from comparisons.report.terminal_pictures import pictures_in

            self.show_pictures(pictures_in(step))
            return
        self._running[request.name] = step
        if self._steps and step:
            self.line(f"{request.name}: {step}")
        self._show()

    def done(self, case: Case, remark: str) -> None:
        """A case has ended."""
        self._running.pop(case.scene, None)
        self.show_pictures(())
        for note in case.notes:
            if note.startswith(WARNING):
                self.line(note)
        line = Text.assemble(f"{case.scene}: ", (case.verdict, _STYLES[case.verdict]))
        line.append(f" ({remark})")
        told = self._steps or case.verdict not in PASSING
        if told:
            line.append(named(f": {headline(case)}", case.sides))
        if self._steps and self.draws and case.images is not None:
            from comparisons.report.terminal_pictures import COLUMNS, ROWS, pictures_of

            columns = min(self._console.width, COLUMNS)
            self._console.print(self.row(pictures_of(case), columns, ROWS), soft_wrap=True)
        self._console.print(line, soft_wrap=True)
        if told:
            tell(self._console, case)
        self._show(1)

    def _show(self, ended: int = 0) -> None:
        running = [f"{name} {step}".rstrip() for name, step in self._running.items()]
        self.count(", ".join(running)[: self._console.width // 2], ended)


def summarise(
    cases: Sequence[Case],
    walls: Mapping[str, float],
    not_run: Mapping[str, str],
    missing: Sequence[str] = (),
    every: bool = False,
) -> None:
    """Print counts of the verdicts, failed cases with their causes and their first differences, the
    slowest cases, skipped cases, and those that an interrupted run did not reach.

    every: whether cases that have not failed are in the table, too.
    """
    console = terminal.console(stderr=True)
    counts = Counter(case.verdict for case in cases)
    verdicts = ", ".join(f"{number} {verdict}" for verdict, number in counts.most_common())
    verdicts = f": {verdicts}" if verdicts else ""
    console.print(f"{how_many(len(cases), len(missing))}{verdicts}", markup=False)
    shown = [case for case in ranked(cases) if every or case.verdict not in PASSING]
    if shown:
        columns: tuple[Column[Case], ...] = (
            Column("case", lambda case: case.scene),
            Column("verdict", lambda case: Text(case.verdict, _STYLES[case.verdict])),
            Column("likeliest cause", lambda case: "" if case.cause is None else case.cause.name),
            Column("first difference", lambda case: named(first_difference(case), case.sides)),
            Column("seconds", lambda case: walls.get(case.scene), _wall, right=True),
        )
        console.print(Table(columns, shown).terminal(console.width))
    slowest = sorted(walls, key=lambda name: walls[name], reverse=True)[:_SLOWEST]
    if slowest:
        times = ", ".join(f"{name} {walls[name]:.1f} s" for name in slowest)
        console.print(f"slowest: {times}", markup=False, soft_wrap=True)
    for name, why in not_run.items():
        console.print(f"not run: {name}: {why}", markup=False, soft_wrap=True)
    if missing:
        console.print(f"missing: {', '.join(missing)}", markup=False, soft_wrap=True)


def _wall(seconds: float | None) -> str:
    return "" if seconds is None else f"{seconds:.1f}"


# ---- an output folder, read again ---------------------------------------------------------------


class StoredResults(NamedTuple):
    """cases: with their pictures, in order;  walls: seconds of each, by name;  provenance:
    versions, machine, date;  suite: its name;  not_run: why other cases were skipped, by name;
    missing: names of cases that an interrupted run did not reach."""

    cases: tuple[Case, ...]
    walls: dict[str, float]
    provenance: dict[str, Any]
    suite: str | None
    not_run: dict[str, str]
    missing: tuple[str, ...] = ()


def check_stored_results(folder: Path) -> None:
    """Raise RecordError if the folder has nothing that `read_stored_results` could read."""
    if not (folder / "results.json").exists() and not (folder / "cases").is_dir():
        raise _no_case(folder)


def read_stored_results(folder: Path) -> StoredResults:
    """The stored results of the cases that the folder's `results.json` names; without that file,
    all stored results.  Raises RecordError."""
    path = folder / "results.json"
    records = folder / "cases"
    missing: tuple[str, ...] = ()
    try:
        results = json.loads(read_text(path))
        names = [folder_name(case["scene"]) for case in results["cases"]]
        provenance, suite, not_run = results["provenance"], results["suite"], results["not_run"]
        missing = tuple(results.get("missing", ()))
    except FileNotFoundError:
        names = sorted(record.parent.name for record in records.glob(f"*/{CASE}"))
        provenance, suite, not_run = {}, None, {}
    except OSError as error:
        raise StoredCaseError(f"{path}: cannot be read: {error.strerror}") from None
    except (ValueError, KeyError, TypeError, RecursionError):
        raise StoredCaseError(f"{path}: was not written by `suite` or `compare`") from None
    if not names and not missing:
        raise _no_case(folder)
    cases = tuple(read_case(records / name) for name in names)
    folders = zip(cases, names, strict=True)
    walls = {case.scene: read_stored_case(records / name).wall for case, name in folders}
    return StoredResults(cases, walls, provenance, suite, not_run, missing)


def _no_case(folder: Path) -> StoredCaseError:
    return StoredCaseError(
        f"{folder}: has no cases; expected the output folder of `reference-rt suite` or `compare`"
    )


# ---- the run ------------------------------------------------------------------------------------


LOG = "stderr.txt"
"""In the folder of a case whose worker failed: what the worker wrote to stderr."""

_NO_LIMIT = 1e9
"""Seconds, about thirty years: Python's timeouts do not accept infinity."""


@dataclass(frozen=True)
class Run:
    """The outcome of a run.  cases: in the requested order;  walls: seconds of each, by name;
    not_run: why other cases were skipped, by name;  missing: names of cases that an interrupted run
    did not reach."""

    cases: tuple[Case, ...]
    walls: dict[str, float]
    not_run: dict[str, str]
    missing: tuple[str, ...] = ()


@dataclass(frozen=True)
class Options:
    """out: folder of the results;  rungs: only these, empty: all;  workers: what runs cases, see
    `processes.run`;  threads: of each process;  fresh: ignore stored cases;  steps: show each step
    of a case, not only its result;  tell: called with the outcome, after an interruption too;
    runner: see `comparisons.suites.worker`;  children: processes that were begun already."""

    out: Path
    rungs: tuple[str, ...] = ()
    workers: Workers = field(default_factory=lambda: Threads(1))
    threads: int | None = None
    fresh: bool = False
    steps: bool = False
    tell: Callable[[Run], None] = lambda run: None
    runner: str | None = None
    children: Children | None = None

    @property
    def results(self) -> Path:
        """The file `results.json`."""
        return self.out / "results.json"

    @property
    def report(self) -> Path:
        """The page."""
        return self.out / "report.html"

    @property
    def worker(self) -> list[str]:
        """The module that runs cases, and its options."""
        return worker_command(self.threads, self.runner)


def run_suite(source: Source, plan: Plan, options: Options) -> Run:
    """`run_cases` for a suite."""
    work = tuple(w._replace(again=_again(w, source, options)) for w in plan.work)
    facts = {
        "suite": f"{source.name}: {source.suite.about}",
        "workers": options.workers.threads,
        **({"rungs": ", ".join(options.rungs)} if options.rungs else {}),
    }
    seconds = source.suite.case_seconds
    return run_cases(plan._replace(work=work), options, seconds, source.name, facts)


def _witnesses(plan: Plan) -> dict[str, str]:
    """Versions of the renderers that may vote in some case."""
    return {k: v for w in plan.work for k, v in witness_facts(w.budget.witness).items()}


def run_cases(
    plan: Plan,
    options: Options,
    seconds: float = _NO_LIMIT,
    suite: str | None = None,
    facts: Mapping[str, Any] | None = None,
) -> Run:
    """Run the cases that are not stored yet.

    seconds: time limit of a case;  suite: the suite's name, if any;  facts: provenance besides
    versions, date and machine.

    `results.json` in the folder is whole after each case and says how many were requested, so that
    an interrupted run keeps its results.  `report.html` is written at the end, after Ctrl-C or
    SIGTERM too; after a kill, `reference-rt report` writes it.  A scene that is invalid is a case
    with this verdict.  Raises ReferenceUnavailableError; ImageError where nothing can be written.
    """
    check_writable(options.results, options.report, options.out / "cases" / "a case")
    chosen = backend()
    told = provenance(**(facts or {}), **_witnesses(plan))
    found: dict[str, Case] = {}
    run = Run((), {}, dict(plan.skipped))

    def add(case: Case, wall: float) -> None:
        if options.rungs and not _has_one_of(case, options.rungs):
            run.not_run[case.scene] = f"the rung {' or '.join(options.rungs)} does not apply"
        else:
            found[case.scene], run.walls[case.scene] = case, wall

    def now() -> Run:
        names = [work.name for work in plan.work if work.name not in run.not_run]
        cases = tuple(found[name] for name in names if name in found)
        return replace(run, cases=cases, missing=tuple(n for n in names if n not in found))

    def write() -> None:
        at = now()
        write_results(options.results, at.cases, told, suite, at.not_run, at.missing)

    def finish() -> None:
        at = now()
        write_report(
            options.report,
            at.cases,
            told,
            title=suite or "",
            walls=at.walls,
            not_run=at.not_run,
            missing=at.missing,
        )
        options.tell(at)

    with Display(len(plan.work), options.steps) as display, _terminable():
        display.line(f"Mitsuba {told['mitsuba']}")
        # The page's module, while the worker still imports Mitsuba.  Not in a thread: two that
        # import parts of one package may wait for each other.
        import_module("comparisons.report.thumbnails")
        # The page of an earlier run must not be mistaken for this run's.
        discard(options.report)
        try:
            requests: list[Request] = []
            for work in plan.work:
                is_watched = options.steps and display.draws
                request, done = _begun(work, options, chosen, is_watched)
                delete_unfinished(request.folder)
                if done is None:
                    requests.append(request)
                else:
                    add(done.case, done.wall)
                    display.done(done.case, done.remark)
            write()
            some = (requests, _stored, options.workers, seconds, options.worker)
            running = engine.measured(*some, doing=display.doing, children=options.children)
            # If this is interrupted, they are closed at once: no worker outlives this process.
            with contextlib.closing(running):
                for request, stored, ended in running:
                    case = _case(request, stored, ended)
                    add(case, ended.wall)
                    display.done(case, f"{ended.wall:.1f} s")
                    write()
        except (KeyboardInterrupt, SystemExit):
            write()
            finish()
            raise
        write()
    finish()
    return now()


class _Done(NamedTuple):
    """A case that needs no worker;  remark: why."""

    case: Case
    wall: float
    remark: str


def _begun(
    work: Work, options: Options, chosen: Backend, is_watched: bool
) -> tuple[Request, _Done | None]:
    """The request for a case, and the case itself if its scene is invalid or it is stored."""
    request = Request(
        name=work.name,
        scene=work.path,
        changes=work.changes,
        budget=work.budget,
        rungs=options.rungs,
        folder=options.out / "cases" / folder_name(work.name),
        again=work.again,
        is_watched=is_watched,
    )
    try:
        if isinstance(work.scene, SceneError):
            raise work.scene
        key = case_key(work.scene, work.budget, options.rungs, chosen)
    except SceneError as error:
        return request, _Done(_without_result(request, "scene", str(error)), 0.0, "not run")
    request = request.model_copy(update={"key": key})
    return request, None if options.fresh else _done(request)


def _has_one_of(case: Case, rungs: tuple[str, ...]) -> bool:
    """Whether the case could not be run, or any of these rungs applies to it."""
    said = {result.name for result in case.rungs if result.status != "not-applicable"}
    return bool(said & {"scene", "run", "input", *rungs})


def _again(work: Work, source: Source, options: Options) -> str:
    """The command that repeats one case of a suite."""
    command = ["reference-rt", "suite", source.argument]
    command += ["--only", work.name, "--fresh", "--out", str(options.out / "again")]
    if work.path.parent != Path("scenes"):
        command += ["--scenes", str(work.path.parent)]
    for name, value in work.changes.defaults.items():
        command += ["-D", f"{name}={value}"]
    return shlex.join(command)


def _done(request: Request) -> _Done | None:
    """The stored case, if its key is the request's."""
    try:
        record = read_stored_case(request.folder)
        if record.key != request.key:
            return None
        return _Done(read_case(request.folder), record.wall, "done before")
    except ImageError:
        return None


def _stored(request: Request) -> Case:
    return read_case(request.folder)


def _case(request: Request, case: Case | None, ended: Ended) -> Case:
    """The case as its worker stored it, or an invalid one that says why there is none."""
    log = request.folder / LOG
    discard(log)
    if case is not None:
        return case
    reason = ended.failure or ""
    if ended.invalid:
        return _without_result(request, "scene", reason, ended.wall)
    if ended.log:
        with replacing(log) as temporary:
            temporary.write_text(ended.log, encoding="utf-8")
        reason += f"; see {log}"
    return _without_result(request, "run", reason, ended.wall)


def _without_result(request: Request, rung: str, reason: str, wall: float = 0.0) -> Case:
    """Store an invalid case without a key, so that it is run again next time."""
    result = RungResult(rung, "invalid", reason)
    reason = f"{rung}: {reason}"
    case = Case(request.name, "invalid", reason, (result,), None, {}, again=request.again)
    write_case(request.folder, case, wall=wall)
    return case


@contextlib.contextmanager
def _terminable() -> Iterator[None]:
    """Turn SIGTERM, which CI services send, into SystemExit, which ends the workers too."""

    def leave(number: int, frame: FrameType | None) -> None:
        sys.exit(128 + number)

    try:
        former: Any = signal.signal(signal.SIGTERM, leave)
    except ValueError:  # only the main thread may set signal handlers
        yield
        return
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, former)
