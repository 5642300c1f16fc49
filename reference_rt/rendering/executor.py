"""Executors compute units: the threads of this process, or workers in other processes and machines.

A unit's sums are copied to the executor and back, so that a unit is a function of what it is given:
one that was lost can be computed again, and nothing is ever added twice.
"""

import pickle
import socket
import threading
import time
import warnings
from concurrent.futures import Future, ThreadPoolExecutor
from typing import NamedTuple, Protocol

import numpy as np

from reference_rt.core.arrays import FloatArray
from reference_rt.integrators import Light
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.jit.parallel_compile import Report
from reference_rt.rendering import units
from reference_rt.rendering.accumulation import (
    SPLATS,
    Sums,
    add_samples,
    jobs_of,
    splat_job,
    widths_of,
)
from reference_rt.rendering.checkpoint import render_digest, sources_digest
from reference_rt.rendering.kernels import compile_ahead, kernels_for
from reference_rt.rendering.noise import statistics
from reference_rt.rendering.units import Unit, tiles_of
from reference_rt.scene.build import BuiltScene
from reference_rt.scene.build_lights import emission_of
from reference_rt.scene.likely_mistakes import likely_mistakes
from reference_rt.util.errors import SceneWarning, WorkersError
from reference_rt.util.workers import Workers


class StoppedError(Exception):
    """A unit was given up, since its result is no longer wanted."""


class Done(NamedTuple):
    """What a unit computed: the sums of its pixels, and statistics (chunks, COLUMNS) of `noise`."""

    sums: Sums
    statistics: FloatArray


class Executor(Protocol):
    """size: samples of a unit that it likes best;  slots: units that keep it busy;
    samples_of_pass: samples of all pixels with which a pass keeps it busy."""

    @property
    def size(self) -> int: ...

    @property
    def slots(self) -> int: ...

    @property
    def samples_of_pass(self) -> int: ...

    def submit(self, unit: Unit, sums: Sums) -> "Future[Done]":
        """Add the samples of a unit to the sums of its pixels, sooner or later."""

    def recovers(self, error: BaseException) -> bool:
        """Called for a unit that failed: whether it may be submitted again."""

    def stop(self) -> None:
        """Give up what is being computed, as soon as possible: it raises `StoppedError`."""

    def close(self) -> None:
        """End its threads and processes."""


# ---- threads of this process ---------------------------------------------------------------------


def build_and_check(scene: BuiltScene, tables: SceneTables | None = None) -> SceneTables:
    """The tables of a scene, unless they are given.  Raises SceneError; issues a SceneWarning for
    each of `likely_mistakes`."""
    tables = scene.tables if tables is None else tables
    for mistake in likely_mistakes(scene, tables):
        scene.warn(mistake.message, *mistake.path)
    return tables


class Prepared:
    """A scene with its tables and kernels.

    seconds: of "tables" (files, arrays, hierarchy) and "compile" (or loading cached kernels).
    """

    def __init__(
        self,
        scene: BuiltScene,
        threads: int,
        tables: SceneTables | None = None,
        compiling: Report | None = None,
    ) -> None:
        """Parameters as for `render.render`; raises as `build_and_check` does."""
        film = scene.film
        self.scene, self.jobs = scene, jobs_of(scene)
        view = scene.camera.setup(film.width, film.height)
        clock = [time.perf_counter()]
        with compile_ahead(self.jobs, threads) as ahead:
            self.tables = build_and_check(scene, tables)
            clock.append(time.perf_counter())
            if isinstance(scene.integrator, Light):
                emission = emission_of(scene, self.tables.geometry, self.tables.lights)
                self.jobs.append(splat_job(scene, emission))
            given = self.tables, view, film.filter.setup()
            self._kernels = kernels_for(self.jobs, *given, threads, compiling, ahead)
        clock.append(time.perf_counter())
        self.seconds = dict(zip(("tables", "compile"), np.diff(clock).tolist(), strict=True))

    def compute(self, unit: Unit, sums: Sums, chunk: int, stop: threading.Event) -> Done:
        """Add a unit's samples to the sums of its pixels, and to SPLATS, in place.  Raises
        StoppedError within a tile once `stop` is set."""
        before = sums["colour"].copy()
        # In plain Python (NUMBA_DISABLE_JIT=1) NumPy would warn of intended infinities (IEEE
        # division) and intended overflow (integer hashes).
        with np.errstate(all="ignore"):
            for job, kernel in zip(self.jobs, self._kernels, strict=True):
                for tile in tiles_of(unit):
                    if stop.is_set():
                        raise StoppedError
                    rows = slice(tile.begin - unit.begin, tile.end - unit.begin)
                    own = {name: a if name == SPLATS else a[rows] for name, a in sums.items()}
                    add_samples(kernel, job, own, *tile)
            count = unit.last - unit.first
            return Done(sums, statistics(before, sums["colour"], count, chunk))


_AHEAD = 16
"""Units of each thread: none waits while others are collected."""


class Threads:
    """An `Executor`: the threads of this process."""

    samples_of_pass = 0  # passes of 16 samples are shown sooner

    def __init__(self, prepared: Prepared, threads: int, chunk: int) -> None:
        """chunk: see `units`."""
        self._prepared, self._chunk = prepared, chunk
        self._stop = threading.Event()
        self._pool = ThreadPoolExecutor(threads, thread_name_prefix="tile")
        self.size, self.slots = units.SAMPLES_PER_TILE, _AHEAD * threads

    def submit(self, unit: Unit, sums: Sums) -> "Future[Done]":
        return self._pool.submit(self._prepared.compute, unit, sums, self._chunk, self._stop)

    def recovers(self, error: BaseException) -> bool:
        return False

    def stop(self) -> None:
        self._stop.set()

    def close(self) -> None:
        self._pool.shutdown(cancel_futures=True)


# ---- workers in other processes or on other machines ---------------------------------------------
#
# A worker builds the scene once, and computes units of it from then on.  It refuses a scene whose
# files differ from those of the process that asks, and another version of this package: a picture
# has the same bits, wherever its units are computed, or there is none.


SIZE = 1 << 20
"""Samples of a unit: about a second, beside which the milliseconds that it takes to send it and its
result are nothing."""

_MOST_SCENES = 2
"""Scenes that a worker keeps: one that is being finished, and the next."""


class RemoteScene(NamedTuple):
    """A scene for workers.  digest: of the render (`render_digest`);  sources: of this package;
    description: the scene, pickled;  chunk: see `units`."""

    digest: bytes
    sources: bytes
    description: bytes
    chunk: int


class _Worker:
    """A scene that this process computes units of."""

    def __init__(self, scene: BuiltScene, prepared: Prepared) -> None:
        self.widths, self.prepared = widths_of(scene), prepared


_workers: dict[bytes, _Worker] = {}
_lock = threading.Lock()
_never = threading.Event()


def remote_scene(scene: BuiltScene, digest: bytes, chunk: int) -> RemoteScene:
    """A scene for workers, which must have the files that it names under the same paths."""
    copy = scene.without_tables()
    copy._folder = scene.folder.resolve()
    return RemoteScene(digest, sources_digest(), pickle.dumps(copy), chunk)


def compute_remotely(scene: RemoteScene, unit: Unit, sums: Sums | None) -> Done:
    """Compute a unit in this process, a worker.  sums: of its pixels, None if these have no samples
    yet.  Raises WorkersError."""
    worker = _worker_for(scene)
    if sums is None:
        count = unit.end - unit.begin
        sums = {name: np.zeros((count, width)) for name, width in worker.widths.items()}
    # Arrays from a message may be read-only.
    sums = {name: a if a.flags.writeable else a.copy() for name, a in sums.items()}
    return worker.prepared.compute(Unit(*unit), sums, scene.chunk, _never)


def _worker_for(scene: RemoteScene) -> _Worker:
    with _lock:
        if scene.digest not in _workers:
            while len(_workers) >= _MOST_SCENES:
                del _workers[next(iter(_workers))]
            _workers[scene.digest] = _prepare(scene)
        return _workers[scene.digest]


def _prepare(scene: RemoteScene) -> _Worker:
    here = f"the worker on {socket.gethostname()}"
    if scene.sources != sources_digest():
        raise WorkersError(
            f"{here} has another version of reference_rt or NumPy; expected the same sources as "
            "here"
        )
    description: BuiltScene = pickle.loads(scene.description)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SceneWarning)  # issued by the process that asks
        prepared = Prepared(description, threads=1)
    if render_digest(description, prepared.tables) != scene.digest:
        raise WorkersError(
            f"{here} has other tables of the scene; expected the same files under "
            f"{description.folder}, and a processor of the same kind"
        )
    return _Worker(description, prepared)


_THREADS_OF_SIZE, _LARGEST = 32, SIZE << 4
"""Threads of workers that units of SIZE keep busy, while client and scheduler take 5 to 10 ms for
each (measured); samples of the largest units, of ten seconds."""


class Remote:
    """An `Executor`: workers in other processes or on other machines."""

    def __init__(self, scene: RemoteScene, workers: Workers) -> None:
        self._scene, self._workers = scene, workers

    @property
    def slots(self) -> int:
        return 2 * self._workers.threads + 1

    @property
    def size(self) -> int:
        """Larger for more workers: client and scheduler take milliseconds for each unit."""
        size = SIZE
        while size * _THREADS_OF_SIZE < SIZE * self._workers.threads and size < _LARGEST:
            size *= 2
        return size

    @property
    def samples_of_pass(self) -> int:
        return 2 * self.slots * self.size

    def submit(self, unit: Unit, sums: Sums) -> "Future[Done]":
        given = sums if unit.first else None
        return self._workers.submit(compute_remotely, self._scene, unit, given)

    def recovers(self, error: BaseException) -> bool:
        return self._workers.recovers(error)

    def stop(self) -> None:
        self._workers.stop()

    def close(self) -> None:
        self._workers.close()
