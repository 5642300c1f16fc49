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
from reference_rt.jit.kernel import precompile, signature_of
from reference_rt.jit.links import Link, Linker
from reference_rt.jit.parallel_compile import Ahead, Call, Report, precompile_all
from reference_rt.rendering.accumulation import Job
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


class Linked:
    """The kernels of some jobs, with their arguments.  calls: those to be compiled, the jobs' own
    first."""

    def __init__(
        self, jobs: Sequence[Job], tables: SceneTables, view: Any, film_filter: Any
    ) -> None:
        self._linker = linker = Linker()
        self._jobs, self._arguments = jobs, list[tuple[Any, ...]]()
        self.calls: list[Call] = []
        for job in jobs:
            given = job.arguments(
                linked_scene(linker, tables, calls_of(job.kernel, job.setup)),
                linked_view(linker, view),
                linked_filter(linker, film_filter),
            )
            self._arguments.append(given)
            self.calls.append(_call(job, given))
        self.calls += sorted(linker.calls, key=cost, reverse=True)

    def compile(
        self, threads: int, say: Report | None = None, ahead: Ahead | None = None
    ) -> list[Callable[..., None]]:
        """The jobs' kernels, as functions of (sums, begin, end, first, last);  sums: arrays by
        name, see `accumulation.Job`.  They are valid as long as this lives.  say, ahead: see
        `precompile_all`."""
        precompile_all(self.calls, threads, say, ahead)
        self._linker.resolve()
        own = zip(self._jobs, self.calls, self._arguments, strict=False)
        return [self._bound(job, precompile(*call), given) for job, call, given in own]

    def _bound(
        self, job: Job, kernel: Callable[..., Any], arguments: tuple[Any, ...]
    ) -> Callable[..., None]:
        linked = self  # which the kernel's arguments point into

        def run(sums: Any, *tile: int) -> None:
            assert linked
            kernel(*arguments, *job.given(sums), *tile)

        return run


# ---- how long kernels take to compile ------------------------------------------------------------

_COSTS = {
    "render_tile": 1.6,
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
