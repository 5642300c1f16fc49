"""`Session`: one render, from its scene to its picture."""

import functools
import math
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple, Self

from reference_rt.core.arrays import IntArray
from reference_rt.integrators import RayCast
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.jit.parallel_compile import Report
from reference_rt.rendering.accumulation import layers_of, samples_of, widths_of
from reference_rt.rendering.checkpoint import Checkpoint, render_digest
from reference_rt.rendering.executor import Executor, Threads
from reference_rt.rendering.framebuffer import Framebuffer
from reference_rt.rendering.loop import Limits, Loop, Saving
from reference_rt.rendering.picture import Picture, Taken, header_of
from reference_rt.rendering.prepared import Prepared, build_and_check
from reference_rt.rendering.remote import RemoteScene, remote_scene
from reference_rt.rendering.settings import with_settings
from reference_rt.rendering.streaming import Written, check_fits, write_in_parts, written
from reference_rt.rendering.thread_pool import Progress
from reference_rt.sampling import Grid
from reference_rt.scene.build import BuiltScene
from reference_rt.util.errors import UsageError


class Storage(NamedTuple):
    """Where a render is stored while it goes on.

    folder: has a folder for each render;  after: seconds before the first time that it is written;
    resume: whether what is there is used;  more: samples per pixel to add to what is there.
    """

    folder: Path
    after: float = 0.0
    resume: bool = True
    more: int = 0


Workers = Callable[[RemoteScene], Executor]
"""Makes an executor of other processes or machines: `executor.Remote`."""


class Session:
    """A render that is begun, goes on, and may end early.  A context manager.

    scene: what is rendered;  loop: see `Loop`;  seconds: see `Picture`;  storage: the folder of its
    checkpoint, None without one.
    """

    def __init__(
        self,
        scene: BuiltScene,
        *,
        threads: int | None = None,
        tables: SceneTables | None = None,
        compiling: Report | None = None,
        specialised: bool | None = None,
        limits: Limits | None = None,
        storage: Storage | None = None,
        memory: int | None = None,
        workers: Workers | None = None,
        at_once: bool = False,
    ) -> None:
        """threads, tables, compiling, specialised: see `render.render`;  limits: what ends it
        early;  memory: bytes that this process may take; None: as much as it needs, with all
        pixels in memory;  workers: what computes it, other than this process;  at_once: see
        `Loop`.  Raises SceneError, UsageError, WorkersError."""
        _check(scene, memory)
        threads = threads or os.cpu_count() or 1
        prepared: Prepared | None = None
        if workers is None:
            prepared = Prepared(scene, threads, tables, compiling, specialised)
            tables, self.seconds = prepared.tables, dict(prepared.seconds)
        else:
            began = time.perf_counter()
            tables = build_and_check(scene, tables)
            self.seconds = {"tables": time.perf_counter() - began, "compile": 0.0}
        pixels, widths = scene.film.width * scene.film.height, widths_of(scene)
        self.store = None
        digest = functools.cache(functools.partial(render_digest, scene, tables))
        if storage is not None:
            self.store = Checkpoint(storage.folder, digest, storage.resume)
        budget = check_fits(scene, widths, memory, self.store)
        self.frame = Framebuffer(widths, pixels, self.store, budget)
        if storage is not None and storage.more:
            scene = _with_more(scene, self.frame, storage)
        self.scene, self._prepared = scene, prepared
        spp = samples_of(scene)
        if (stored := int(self.frame.done.max())) > spp:
            raise UsageError(
                f"--spp: the checkpoint has {stored} samples per pixel already; expected at least "
                "as many"
            )
        if prepared is not None:
            self._executor: Executor = Threads(prepared, threads, self.frame.chunk)
        else:
            assert workers is not None
            self._executor = workers(remote_scene(scene, digest(), self.frame.chunk))
        after = math.inf if storage is None else storage.after
        saving = Saving(after, needed=budget is not None)
        self.loop = Loop(self.frame, self._executor, spp, limits or Limits(), saving, at_once)

    def __enter__(self) -> Self:
        if self._prepared is not None:
            self._prepared.running.__enter__()
        return self

    def __exit__(self, *error: Any) -> None:
        self._executor.close()
        self.frame.close()
        if self._prepared is not None:
            self._prepared.running.__exit__(*error)

    def run(self, say: Progress, watch: Callable[[], None] = lambda: None) -> None:
        """Render; calls say("render", fraction) and `watch` meanwhile.  Raises what they raise."""
        began = time.perf_counter()

        def look() -> None:
            say("render", self.loop.fraction)
            self._executor.progress(self.loop.fraction)
            watch()

        try:
            self.loop.run(look)
        finally:
            self.seconds["render"] = time.perf_counter() - began

    @property
    def taken(self) -> Taken:
        """How many samples there are, and their noise."""
        done = self.frame.done
        return Taken(int(done.min()), int(done.max()), samples_of(self.scene), self.loop.error)

    def save(self, path: Path) -> Written:
        """Write the picture so far.  Raises ImageError; UsageError for a .png of a picture that is
        not all in memory."""
        if self.frame.whole is not None:
            picture = self.picture()
            picture.save(path)
            return written(picture)
        if path.suffix.lower() != ".exr":
            raise UsageError(
                f"--memory: {path} needs the whole picture in memory; expected an .exr, or more"
            )
        header = header_of(self.scene, self.taken)
        return write_in_parts(path, self.scene, self.frame, shown_of(self.scene), header)

    def picture(self) -> Picture:
        """The picture so far, of a render whose pixels are all in memory."""
        assert self.frame.whole is not None
        return self._picture(self.frame.whole, self.frame.samples())

    def preview(self) -> Picture | None:
        """The picture a moment ago, while it is rendered; None if it must be asked for again."""
        found = self.loop.snapshot()
        return None if found is None else self._picture(*found)

    def _picture(self, sums: Any, samples: IntArray) -> Picture:
        """The picture of some sums, which may be older than `taken`."""
        film = self.scene.film
        counts = int(samples.min()), int(samples.max())
        taken = Taken(*counts, samples_of(self.scene), self.loop.error)
        count = taken.fewest if taken.fewest == taken.most else samples
        layers = {
            name: layer.reshape(film.height, film.width, *layer.shape[1:])
            for name, layer in layers_of(self.scene, sums, count).items()
        }
        return Picture(layers, shown_of(self.scene), dict(self.seconds), self.scene, taken)


def shown_of(scene: BuiltScene) -> str:
    """The layer of a scene's picture that is shown."""
    return scene.integrator.show if isinstance(scene.integrator, RayCast) else "colour"


def _with_more(scene: BuiltScene, frame: Framebuffer, storage: Storage) -> BuiltScene:
    """The scene with as many samples as are stored, and more."""
    if isinstance(scene.integrator, RayCast) or isinstance(scene.resolved_sampler, Grid):
        raise UsageError(
            "--more-spp: the samples of this scene depend on their number; expected --spp, or a "
            "sampler 'sobol' or 'independent'"
        )
    stored = int(frame.done.max())
    if stored == 0:
        raise UsageError(
            f"--more-spp: {storage.folder} has no samples of this scene, of these settings and of "
            "this version; expected a render that was stored there"
        )
    return with_settings(scene, spp=stored + storage.more)


def _check(scene: BuiltScene, memory: int | None) -> None:
    """Raise SceneError for a picture that needs more than the machine's memory, before anything is
    allocated, and for a variance of one sample."""
    film = scene.film
    casts = isinstance(scene.integrator, RayCast)
    if "variance" in film.layers and scene.resolved_sampler.spp < 2 and not casts:
        raise scene.error(
            "one sample per pixel has no variance; expected at least 2", "film", "layers"
        )
    if memory is not None:
        return
    # At most 10 channels of float64, 25 with layers, and the same again while files are written.
    needed = film.width * film.height * (25 if film.layers else 10) * 2 * 8
    try:
        available = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (ValueError, OSError, AttributeError):  # not every system has these
        available = 1 << 36
    if needed > available:
        raise scene.error(
            f"{film.width} x {film.height} pixels need {needed / 2**30:.3g} GiB; "
            f"expected at most the {available / 2**30:.3g} GiB that this machine has",
            "film",
        )
