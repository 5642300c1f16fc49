"""The kernels of a picture, linked or specialised.

*Linked* kernels reach a scene's tables through links (`jit/links.py`): they are compiled for types,
once for all scenes.  *Specialised* kernels have the same code inlined, for one kind of scene: they
take seconds to compile and render in 0.6 to 1.0 of the time.  Both give the same bits.

A picture uses specialised kernels if they are in the cache.  Otherwise it starts with linked ones;
if it takes long, or if this process has rendered such pictures for long, a second process compiles
the specialised ones meanwhile, and they take over between two tiles or in the next picture.
"""

import math
import os
import re
import signal
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

import numba
import numpy as np

from reference_rt.accel.block_query import tracer_of
from reference_rt.integrators import traces_blocks
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.jit import parallel_compile
from reference_rt.jit.function_pointer import pointer_to
from reference_rt.jit.kernel import is_compiled, is_named_tuple, precompile, signature_of
from reference_rt.jit.links import Link, Linker
from reference_rt.jit.parallel_compile import (
    Ahead,
    Call,
    Report,
    fork_with_compiler,
    has_ended,
    precompile_all,
)
from reference_rt.rendering.accumulation import ABSENT, Job
from reference_rt.rendering.linking import (
    EMPTY_SCENE,
    EMPTY_VIEW,
    calls_of,
    linked_filter,
    linked_scene,
    linked_view,
)

WAIT = 2.0
"""Seconds of rendering after which the rest of the time is estimated."""

WORTHWHILE = 30.0
"""Seconds left to render from which on specialised kernels are compiled meanwhile.  On two cores
the 8 s of compiling cost 4 s of rendering, and what is left then takes 0.7 of the time: that pays
from 22 s on."""

BREAK_EVEN = 13.0
"""Seconds that this process has rendered with linked kernels of a kind after which the specialised
ones are compiled during the next picture.  Rendering with them would have saved as much by then as
compiling them costs; how many more pictures will come is unknown."""

_spent: dict[tuple[Call, ...], float] = {}
"""Seconds rendered with linked kernels in place of these specialised ones."""

_children: dict[tuple[Call, ...], int] = {}
"""Child processes that compile these kernels, though the picture that started them is done."""


def compile_ahead(jobs: Sequence[Job], threads: int) -> Ahead:
    """Begins to compile the linked kernels of some jobs, which do not depend on the tables, so that
    these can be built meanwhile."""
    if numba.config.DISABLE_JIT or threads < 2 or not parallel_compile.may_fork():
        return Ahead([], threads)  # to make the signatures takes 3 ms
    given = (EMPTY_SCENE, EMPTY_VIEW, Link(0))
    return Ahead([_call(job, job.arguments(*given), ABSENT) for job in jobs], threads)


def _call(job: Job, arguments: tuple[Any, ...], absent: Any) -> Call:
    return job.kernel, signature_of(*arguments, *job.empty(absent), 0, 0, 0, 0)


class Running:
    """The kernels of some jobs, ready to be run, as functions of (sums, begin, end, first, last).
    sums: arrays by name, see `accumulation.Job`."""

    def __init__(
        self,
        jobs: Sequence[Job],
        tables: SceneTables,
        view: Any,
        film_filter: Any,
        threads: int,
        say: Report | None = None,
        specialised: bool | None = None,
        ahead: Ahead | None = None,
    ) -> None:
        """specialised: which kernels to use; None: see above.  say, ahead: see `precompile_all`."""
        own = Specialised(jobs, tables, view, film_filter)
        self._may_change = specialised is None
        if numba.config.DISABLE_JIT or (specialised is None and own.are_compiled()):
            specialised = True
        self._may_change = self._may_change and not specialised
        self._specialised, self._kind = own, tuple(own.calls)
        self._child, self._began = _children.pop(self._kind, 0), math.nan
        used = own if specialised else Linked(jobs, tables, view, film_filter)
        precompile_all(used.calls, threads, say, None if specialised else ahead)
        self._used, self.kernels = used, used.kernels()

    def __enter__(self) -> "Running":
        self._began = time.monotonic()
        if self._may_change and not self._child and _spent.get(self._kind, 0.0) > BREAK_EVEN:
            self._start()
        return self

    def __exit__(self, error: type | None, *rest: Any) -> None:
        if self._may_change:
            spent = _spent.get(self._kind, 0.0) + time.monotonic() - self._began
            _spent[self._kind] = spent
            if self._child and error is None and spent > BREAK_EVEN:
                _children[self._kind], self._child = self._child, 0
        if self._child:
            with suppress(ProcessLookupError, ChildProcessError):
                os.kill(self._child, signal.SIGKILL)
                os.waitpid(self._child, 0)

    def run(self, k: int) -> Callable[..., None]:
        """Job k's kernel, a function that may change to the specialised one while it is used."""
        return lambda *tile: self.kernels[k](*tile)

    def specialise(self) -> None:
        """Compile the specialised kernels in this process, and take them into use."""
        if self._may_change:
            self._may_change = False
            self.kernels = self._specialised.kernels()

    def progress(self, fraction: float) -> None:
        """To be called now and then while rendering: starts to compile the specialised kernels, or
        takes them into use."""
        if not self._may_change:
            return
        if self._child:
            if has_ended(self._child):
                self._child = 0
                if self._specialised.are_compiled():
                    self.kernels = self._specialised.kernels()
                else:
                    _spent[self._kind] = -math.inf  # it failed: not again
                self._may_change = False
            return
        elapsed = time.monotonic() - self._began
        if elapsed > WAIT and fraction > 0.0:
            if elapsed / fraction * (1.0 - fraction) > WORTHWHILE:
                self._start()

    def _start(self) -> None:
        if not parallel_compile.may_fork():
            return
        child = fork_with_compiler()
        if child == 0:
            try:
                for call in self._specialised.calls:
                    precompile(*call)
            finally:
                os._exit(0)
        self._child = child


class Linked:
    """The linked kernels of some jobs.  calls: those to be compiled, the jobs' own first."""

    def __init__(
        self, jobs: Sequence[Job], tables: SceneTables, view: Any, film_filter: Any
    ) -> None:
        self._linker = linker = Linker()
        self._arguments = []
        self.calls: list[Call] = []
        for job in jobs:
            given = job.arguments(
                linked_scene(linker, tables, calls_of(job.kernel, job.setup)),
                linked_view(linker, view),
                linked_filter(linker, film_filter),
            )
            self._arguments.append(given)
            self.calls.append(_call(job, given, ABSENT))
        self._jobs = jobs
        self.calls += sorted(linker.calls, key=cost, reverse=True)

    def kernels(self) -> list[Callable[..., None]]:
        """The jobs' kernels, once all calls are compiled.  They are valid as long as this lives."""
        compiled = [precompile(*call) for call in self.calls[: len(self._jobs)]]
        self._linker.resolve()
        bound = zip(self._jobs, compiled, self._arguments, strict=True)
        return [_bound(*one, ABSENT) for one in bound]


class Specialised:
    """The specialised kernels of some jobs.  The kernel that traces the rays of blocks is called
    through a function pointer (`Geometry.tracer`), so that scenes share it."""

    def __init__(
        self, jobs: Sequence[Job], tables: SceneTables, view: Any, film_filter: Any
    ) -> None:
        has_blocks = any(job.setup is not None and traces_blocks(job.setup) for job in jobs)
        self._tracer = tracer_of(tables.geometry) if has_blocks else None
        if self._tracer is not None:
            geometry = tables.geometry._replace(tracer=np.zeros(1, np.intp))
            tables = tables._replace(geometry=geometry)
        self._tables = tables
        self._arguments = [job.arguments(tables, view, film_filter) for job in jobs]
        self.calls: list[Call] = [
            _call(job, given, None) for job, given in zip(jobs, self._arguments, strict=True)
        ]
        self._jobs = jobs
        if self._tracer is not None:
            self.calls.append(self._tracer)

    def are_compiled(self) -> bool:
        return all(is_compiled(*call) for call in self.calls)

    def kernels(self) -> list[Callable[..., None]]:
        compiled = [precompile(*call) for call in self.calls]
        if self._tracer is not None:
            address: Any = self._tables.geometry.tracer
            address[0] = pointer_to(*self._tracer)
        bound = zip(self._jobs, compiled[: len(self._jobs)], self._arguments, strict=True)
        return [_bound(*one, None) for one in bound]


def _bound(job: Job, kernel: Any, arguments: tuple[Any, ...], absent: Any) -> Callable[..., None]:
    return lambda sums, *tile: kernel(*arguments, *job.given(sums, absent), *tile)


# ---- how long kernels take to compile ------------------------------------------------------------

_COSTS = {
    "trace_block": 4.0,  # of specialised kernels only
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
_COST_SPECIALISED = 8.0


def cost(call: Call) -> float:
    """About how many seconds it takes to compile a kernel (measured: means; others take _COST),
    for the order and for progress bars."""
    compiled, signature = call
    arguments = signature if isinstance(signature, tuple) else signature.args
    if any(is_named_tuple(of, SceneTables) for of in arguments):
        return _COST_SPECIALISED
    return _COSTS.get(operation_of(compiled), _COST)


def operation_of(compiled: Any) -> str:
    """The name of a kernel's operation, or of a kernel that is none; without the code of the type
    that kernels of operations end with."""
    return re.sub(r"_\d+$", "", compiled.__name__)
