"""The kernels of a picture, compiled and ready to be run.

Kernels reach a scene's tables through links (`jit/links.py`): they are compiled for types, once for
all scenes, and what a scene lacks is neither compiled nor called.
"""

import re
from collections.abc import Callable, Sequence
from typing import Any

import numba

from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.jit import parallel_compile
from reference_rt.jit.kernel import is_compiled, precompile, signature_of
from reference_rt.jit.links import Link, Linker
from reference_rt.jit.parallel_compile import Ahead, Call, Report, precompile_all
from reference_rt.rendering.accumulation import Job
from reference_rt.rendering.kept_links import linked
from reference_rt.rendering.linking import (
    EMPTY_SCENE,
    EMPTY_VIEW,
    calls_of,
    linked_filter,
    linked_scene,
    linked_view,
)


def compile_ahead(jobs: Sequence[Job], threads: int) -> Ahead:
    """Begins to compile the kernels of some jobs, which do not depend on the tables, so that these
    can be built meanwhile."""
    if numba.config.DISABLE_JIT or threads < 2 or not parallel_compile.may_fork():
        return Ahead([], threads)  # to make the signatures takes 3 ms
    given = (EMPTY_SCENE, EMPTY_VIEW, Link(0))
    return Ahead([_call(job, job.arguments(*given)) for job in jobs], threads)


def _call(job: Job, arguments: tuple[Any, ...]) -> Call:
    return job.kernel, signature_of(*arguments, *job.empty(), 0, 0, 0, 0)


def calls_for(jobs: Sequence[Job], tables: SceneTables, view: Any, film_filter: Any) -> list[Call]:
    """The kernels of some jobs, to be compiled: the jobs' own, then those behind links."""
    linker, given = _Given(jobs, view, film_filter), Linker()
    for job in jobs:
        linked_scene(given, tables, calls_of(job.kernel, job.setup))
    return [*linker.calls, *sorted(given.calls, key=cost, reverse=True)]


class _Given:
    """What jobs are given besides the scene.  calls: the jobs' kernels, and those behind links."""

    def __init__(self, jobs: Sequence[Job], view: Any, film_filter: Any) -> None:
        self.linker = linker = Linker()
        calls = frozenset[Any]().union(*(calls_of(job.kernel, job.setup) for job in jobs))
        self.view = linked_view(linker, view, calls)
        self.filter = linked_filter(linker, film_filter, calls)
        self.own = [_call(job, job.arguments(EMPTY_SCENE, self.view, self.filter)) for job in jobs]
        self.calls = [*self.own, *linker.calls]


def kernels_for(
    jobs: Sequence[Job],
    tables: SceneTables,
    view: Any,
    film_filter: Any,
    threads: int,
    say: Report | None = None,
    ahead: Ahead | None = None,
) -> list[Callable[..., None]]:
    """The jobs' kernels, compiled, as functions of (sums, begin, end, first, last).

    sums: arrays by name, see `accumulation.Job`;  say, ahead: see `precompile_all`.
    """
    given = _Given(jobs, view, film_filter)

    def link(linker: Linker) -> Any:
        called = [calls_of(job.kernel, job.setup) for job in jobs]
        return [linked_scene(linker, tables, calls) for calls in called]

    def compile_for(linker: Linker) -> None:
        calls = [*given.calls, *sorted(linker.missing, key=cost, reverse=True)]
        precompile_all(calls, threads, say, ahead)

    purpose = tuple((job.kernel, job.setup) for job in jobs)
    scene = linked(tables, purpose, link, compile_for)
    if not all(is_compiled(*call) for call in given.calls):  # where the links were there already
        precompile_all(given.calls, threads, say, ahead)

    def bound(job: Job, kernel: Callable[..., Any], of_job: Any) -> Callable[..., None]:
        arguments = job.arguments(of_job, given.view, given.filter)
        kept = scene, given  # which the arguments point into

        def run(sums: Any, *tile: int) -> None:
            assert kept
            kernel(*arguments, *job.given(sums), *tile)

        return run

    compiled = [precompile(*call) for call in given.calls]
    given.linker.resolve()
    return [bound(*one) for one in zip(jobs, compiled, scene.tables, strict=False)]


def plain_arguments(job: Job, tables: SceneTables, view: Any, film_filter: Any) -> tuple[Any, ...]:
    """What a job's kernel takes before its sums, for a process that runs it as plain Python."""
    linker, calls = Linker(is_plain=True), calls_of(job.kernel, job.setup)
    return job.arguments(
        linked_scene(linker, tables, calls),
        linked_view(linker, view, calls),
        linked_filter(linker, film_filter, calls),
    )


# ---- how long kernels take to compile ------------------------------------------------------------

_COSTS = {
    "render_tile": 1.6,
    "splat_tile": 1.6,
    "closest_hits": 1.3,
    "any_hits": 0.9,
    "closest_hit": 0.8,
    "occluded": 0.6,
    "first_hits_tile": 0.4,
    "aov_tile": 0.4,
    "cost_tile": 0.4,
    "traversal_cost": 0.8,
}
_COST = 0.13


def cost(call: Call) -> float:
    """About how many seconds it takes to compile a kernel (measured: means; others take _COST),
    for the order and for progress bars."""
    return _COSTS.get(operation_of(call[0]), _COST)


def operation_of(compiled: Any) -> str:
    """The name of a kernel's operation, or of a kernel that is none; without the code of the type
    that kernels of operations end with."""
    return re.sub(r"_\d+$", "", compiled.__name__)
