"""A scene that is ready to be rendered: its tables and its compiled kernels."""

import threading
import time
from typing import NamedTuple

import numpy as np

from reference_rt.core.arrays import FloatArray
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.jit.parallel_compile import Report
from reference_rt.rendering.accumulation import Sums, add_samples, jobs_of
from reference_rt.rendering.kernels import Running, compile_ahead
from reference_rt.rendering.noise import statistics
from reference_rt.rendering.thread_pool import tiles_of
from reference_rt.rendering.units import Unit
from reference_rt.scene.build import BuiltScene, build_tables
from reference_rt.scene.likely_mistakes import likely_mistakes


class StoppedError(Exception):
    """A unit was given up, since its result is no longer wanted."""


class Done(NamedTuple):
    """What a unit computed: the sums of its pixels, and statistics (chunks, COLUMNS) of `noise`."""

    sums: Sums
    statistics: FloatArray


def build_and_check(scene: BuiltScene, tables: SceneTables | None = None) -> SceneTables:
    """The tables of a scene, unless they are given.  Raises SceneError; issues a SceneWarning for
    each of `likely_mistakes`."""
    tables = build_tables(scene) if tables is None else tables
    for mistake in likely_mistakes(scene, tables):
        scene.warn(mistake.message, *mistake.path)
    return tables


class Prepared:
    """A scene with its tables and kernels.  A context manager while units are computed.

    seconds: of "tables" (files, arrays, hierarchy) and "compile" (or loading cached kernels).
    """

    def __init__(
        self,
        scene: BuiltScene,
        threads: int,
        tables: SceneTables | None = None,
        compiling: Report | None = None,
        specialised: bool | None = None,
    ) -> None:
        """Parameters as for `render.render`; raises as `build_and_check` does."""
        film = scene.film
        self.scene, self.jobs = scene, jobs_of(scene)
        view = scene.camera.setup(film.width, film.height)
        clock = [time.perf_counter()]
        with compile_ahead(self.jobs, threads if specialised is not True else 1) as ahead:
            self.tables = build_and_check(scene, tables)
            clock.append(time.perf_counter())
            filter_setup = film.filter.setup()
            self.running = Running(
                self.jobs, self.tables, view, filter_setup, threads, compiling, specialised, ahead
            )
        clock.append(time.perf_counter())
        self._kernels = [self.running.run(k) for k in range(len(self.jobs))]
        self.seconds = dict(zip(("tables", "compile"), np.diff(clock).tolist(), strict=True))

    def compute(self, unit: Unit, sums: Sums, chunk: int, stop: threading.Event) -> Done:
        """Add a unit's samples to the sums of its pixels, in place.  Raises StoppedError within a
        tile once `stop` is set."""
        before = sums["colour"].copy()
        # In plain Python (NUMBA_DISABLE_JIT=1) NumPy would warn of intended infinities (IEEE
        # division) and intended overflow (integer hashes).
        with np.errstate(all="ignore"):
            for job, kernel in zip(self.jobs, self._kernels, strict=True):
                for tile in tiles_of(unit):
                    if stop.is_set():
                        raise StoppedError
                    rows = slice(tile.begin - unit.begin, tile.end - unit.begin)
                    own = {name: array[rows] for name, array in sums.items()}
                    add_samples(kernel, job, own, *tile)
            count = unit.last - unit.first
            return Done(sums, statistics(before, sums["colour"], count, chunk))
