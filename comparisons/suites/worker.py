"""`python -m comparisons.suites.worker`: the worker process, which runs one case after another.

It follows `comparisons.runs.processes`: it reads `Request`s and stores each case in the
request's folder.

`--runner module:function` replaces the function `compare` (in tests, by one that crashes);
`--threads` is the number of threads it may use.
"""

import argparse
import contextlib
import dataclasses
import faulthandler
import importlib
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import ClassVar, TextIO

from pydantic import BaseModel, ConfigDict

from comparisons.compare.budget import Budget
from comparisons.compare.watched import Say, Watched
from comparisons.results.case import WARNING, Case, trace_command
from comparisons.results.stored_case import write_case
from comparisons.runs.processes import carry_out, private_stdout, send
from comparisons.suites.suite import Changes
from reference_rt.cli.guarded import our_warnings
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import ReferenceUnavailableError

Runner = Callable[..., Case]
"""Called as `compare` is."""

OURS = "comparisons.suites.worker:compare"


class Request(BaseModel):
    """A case to run.

    name: the case's;  scene: the scene's file;  changes: to the scene;  folder: where the case is
    stored;  key: stored with it, see `comparisons.suites.keys`;  again: the command that repeats
    the case;  is_watched: whether pictures are shown as they grow.
    """

    model_config = ConfigDict(extra="forbid")
    output: ClassVar[str] = "folder"

    name: str
    scene: Path
    changes: Changes = Changes()
    budget: Budget
    rungs: tuple[str, ...] = ()
    folder: Path
    key: str = ""
    again: str = ""
    is_watched: bool = False


def main() -> None:
    """Handle requests until standard input ends."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--runner", default=OURS)
    parser.add_argument("--threads", type=int, default=None)
    options = parser.parse_args()
    faulthandler.enable()
    answers = private_stdout()
    module, _, name = options.runner.partition(":")
    try:
        runner: Runner = getattr(importlib.import_module(module), name)
        if options.runner == OURS:
            _get_ready()
    except ModuleNotFoundError as error:
        send(answers, unavailable=f"comparing needs {error.name}")
        return
    for line in sys.stdin:
        answer(Request.model_validate_json(line), runner, options.threads, answers)


def _get_ready() -> None:
    """Load what the first case needs while the parent reads its scene."""
    from comparisons.mitsuba.backend import mitsuba

    importlib.import_module("comparisons.compare.compare")
    # What does not start is reported with the first case.
    with contextlib.suppress(ReferenceUnavailableError):
        mitsuba()


def answer(request: Request, runner: Runner, threads: int | None, answers: TextIO) -> None:
    """Run and store one case, and report its status to the pool."""

    def run() -> None:
        start = time.perf_counter()
        warned: list[str] = []
        with our_warnings(lambda text: warned.append(f"{WARNING}{text}")):
            case = runner(
                request.changes.load(request.scene),
                request.budget,
                _telling(request, answers),
                threads=threads,
                rungs=request.rungs,
            )
        case = dataclasses.replace(
            case,
            scene=request.name,
            again=request.again,
            trace=_traced(request),
            notes=(*warned, *case.notes, described(request.budget)),
        )
        write_case(request.folder, case, request.key, time.perf_counter() - start)

    carry_out(run, answers)


def _telling(request: Request, answers: TextIO) -> Say:
    """What reports each step."""

    def say(text: str) -> None:
        send(answers, say=text)

    return Watched(say, lambda text: send(answers, show=text)) if request.is_watched else say


def _traced(request: Request) -> str:
    size = request.changes.size
    if request.budget.size is not None:
        size = "{}x{}".format(*request.budget.size)
    return trace_command(request.scene, size, request.changes.defaults)


def described(budget: Budget) -> str:
    """A budget as a note for people."""
    parts = [f"limit {100.0 * budget.limit:g} %", _replicates(budget)]
    if budget.parts > 1:
        more = "twice that in small pictures"
        parts.append(f"a part in {budget.parts} of the scene's samples each, up to {more}")
    if budget.spp is not None:
        parts.append(f"{budget.spp} samples per pixel")
    if budget.reference_spp is not None:
        parts.append(f"{budget.reference_spp} in the reference")
    if budget.size is not None:
        parts.append(f"{budget.size[0]} x {budget.size[1]} pixels")
    if not budget.control:
        parts.append(f"{budget.pixels} camera rays, {budget.light_pixels} for direct light")
    return "budget: " + ", ".join(parts)


def _replicates(budget: Budget) -> str:
    if budget.seconds is None:
        return f"{budget.replicates} replicates"
    first = f"{budget.replicates} replicates"
    if budget.most_first is not None:
        first = f"{budget.replicates} to {budget.most_first} replicates, as the noise asks"
    return f"{first}, and more until the question is decided or {budget.seconds:g} s have passed"


def compare(
    scene: Scene,
    budget: Budget,
    say: Say,
    threads: int | None,
    rungs: tuple[str, ...],
) -> Case:
    """`comparisons.compare.compare.compare_scene`, Mitsuba too with `threads` threads."""
    from comparisons.compare.compare import Subject, compare_scene
    from comparisons.mitsuba.backend import mitsuba, use_threads

    mitsuba()
    if threads is not None:
        use_threads(threads)
    return compare_scene(Subject(scene), budget, say, threads, rungs)


if __name__ == "__main__":
    main()
