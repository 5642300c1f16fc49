"""`render`: from a scene, or its file, to a picture; `Session`: a render that may end early."""

import functools
import logging
import math
import os
import shutil
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple, Self, TypeVar

import numpy as np

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.exr import EXR_ROWS, exr_rows
from reference_rt.core.model import name_of, types_of
from reference_rt.integrators import AnyIntegrator, Light, RayCast
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.jit.parallel_compile import Report
from reference_rt.rendering.accumulation import layers_of, samples_of, widths_of
from reference_rt.rendering.checkpoint import Checkpoint, render_digest
from reference_rt.rendering.executor import (
    Executor,
    Prepared,
    Remote,
    Threads,
    build_and_check,
    remote_scene,
)
from reference_rt.rendering.framebuffer import Framebuffer
from reference_rt.rendering.image import channels
from reference_rt.rendering.loop import Limits, Loop, Saving
from reference_rt.rendering.picture import MOST_PLACES, Picture, Taken, Written, header_of, written
from reference_rt.rendering.splat_loop import SplatLoop
from reference_rt.rendering.units import BAND
from reference_rt.sampling import Grid
from reference_rt.scene.build import BuiltScene
from reference_rt.scene.model import SceneModel
from reference_rt.util.errors import ImageError, SceneError, UsageError
from reference_rt.util.memory import resident_memory
from reference_rt.util.workers import Processes, Workers

_LOG = logging.getLogger(__name__)

Progress = Callable[[str, float], None]
"""Called with the phase ("compile" or "render") and the fraction of it that is done."""


def render(
    scene: BuiltScene | str | os.PathLike[str],
    *,
    spp: int | None = None,
    size: tuple[int, int] | None = None,
    seed: int | None = None,
    threads: int | None = None,
    tables: SceneTables | None = None,
    progress: Progress | None = None,
    compiling: Report | None = None,
    time_limit: float | None = None,
    target_error: float | None = None,
    checkpoint: str | os.PathLike[str] | None = None,
    workers: int | None = None,
) -> Picture:
    """Render a scene, or a scene file.

    spp: samples per pixel;  size: width and height in pixels;  seed: of the random numbers; None:
    the scene's own.  threads: default all cores; their number changes no bit.  tables: others than
    the scene's own, which are built once: a file that changes later is read by a scene that is
    loaded again.  progress: called as the render goes on;  compiling: called
    in its place while kernels are compiled, with the number of those that are, and of all.
    Ctrl-C stops it within a tile.

    time_limit: seconds after which it ends, with the samples that there are by then;
    target_error: relative standard error (see `noise`) at which it ends;  checkpoint: a folder
    where it is stored as it goes on: a render that was ended goes on there.  workers: processes to
    compute it, of one thread each, in place of threads of this one; they change no bit.

    Raises SceneError, UsageError, WorkersError; issues a SceneWarning for each of
    `likely_mistakes`.
    """
    say = progress or (lambda what, fraction: None)
    if not isinstance(scene, BuiltScene):
        scene = BuiltScene.load(os.fspath(scene))
    if (spp, size, seed) != (None, None, None):
        scene = with_settings(scene, spp=spp, size=size, seed=seed)
    limits = Limits(math.inf if time_limit is None else time_limit, target_error or 0.0)
    with Session(
        scene,
        threads=threads,
        tables=tables,
        compiling=compiling or (lambda done, total: say("compile", done / total)),
        limits=limits,
        workers=None if workers is None else lambda: Processes(workers),
        storage=None if checkpoint is None else Storage(Path(checkpoint)),
        at_once=limits == Limits() and checkpoint is None,
    ) as session:
        say("compile", 1.0)
        session.run(say)
        return session.picture()


# ---- one render ----------------------------------------------------------------------------------


class Storage(NamedTuple):
    """Where a render is stored while it goes on.

    folder: has a folder for each render;  after: seconds before the first time that it is written;
    resume: whether what is there is used;  more: samples per pixel to add to what is there.
    """

    folder: Path
    after: float = 0.0
    resume: bool = True
    more: int = 0


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
        limits: Limits | None = None,
        storage: Storage | None = None,
        memory: int | None = None,
        workers: Callable[[], Workers] | None = None,
        at_once: bool = False,
    ) -> None:
        """threads, tables, compiling: see `render.render`;  limits: what ends it
        early;  memory: bytes that this process may take; None: as much as it needs, with all
        pixels in memory;  workers: opens what computes it in place of this process;  at_once: see
        `Loop`.  Raises SceneError, UsageError, WorkersError."""
        _check(scene, memory)
        if isinstance(scene.integrator, Light):
            if memory is not None or workers is not None or storage is not None:
                raise scene.error(
                    "a particle may be seen in any pixel, so that 'light' needs the whole picture "
                    "in one process; expected no --workers, --memory or --checkpoint, or 'path'",
                    *("integrator", "type"),
                )
        threads = threads or os.cpu_count() or 1
        prepared: Prepared | None = None
        if workers is None:
            prepared = Prepared(scene, threads, tables, compiling)
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
            remote = remote_scene(scene, digest(), self.frame.chunk)
            self._executor = Remote(remote, workers())
        after = math.inf if storage is None else storage.after
        saving, loop = Saving(after, needed=budget is not None), Loop
        if isinstance(scene.integrator, Light):
            loop = SplatLoop
        self.loop = loop(self.frame, self._executor, spp, limits or Limits(), saving, at_once)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: Any) -> None:
        self._executor.close()
        self.frame.close()

    def run(self, say: Progress, watch: Callable[[], None] = lambda: None) -> None:
        """Render; calls say("render", fraction) and `watch` meanwhile.  Raises what they raise."""
        began = time.perf_counter()

        def look() -> None:
            say("render", self.loop.fraction)
            watch()

        try:
            self.loop.run(look)
        finally:
            self.seconds["render"] = time.perf_counter() - began
            film, seconds = self.scene.film, self.seconds
            told = self.scene.name, film.width, film.height, int(self.frame.done.min())
            spent = seconds["compile"], seconds["render"]
            text = "%s: %d x %d pixels, %d samples each; kernels %.2f s, rendering %.2f s"
            _LOG.info(text, *told, *spent)

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


# ---- memory: does a picture fit, and how is one that does not written? ---------------------------


def _check(scene: BuiltScene, memory: int | None) -> None:
    """Raise SceneError for a picture that needs more than the machine's memory, before anything is
    allocated, and for a variance of one sample."""
    film = scene.film
    casts = isinstance(scene.integrator, RayCast)
    if "variance" in film.layers and scene.resolved_sampler.spp < 2 and not casts:
        raise scene.error(
            "one sample per pixel has no variance; expected at least 2", "film", "layers"
        )
    if "variance" in film.layers and isinstance(scene.integrator, Light):
        raise scene.error(
            "the pixels of 'light' are no means of samples of their own; expected no variance",
            *("film", "layers"),
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


_FEWEST_BANDS = 8
"""Bands that are in memory at least: two that are computed, and others that are being read and
written, each with a copy as the bytes of its file."""

_OTHER = 96 << 20
"""Bytes for all else that a render needs: units that are computed, pages of libraries that have not
been used yet, rows that are being written."""

_SHARE = 0.9
"""The part of the memory that is given away: some of what is freed does not go back to the system.
32768 x 32768 pixels took 1.07 times the 2 GiB that they might when all of it was given away."""


def check_fits(
    scene: BuiltScene, widths: Mapping[str, int], memory: int | None, store: Checkpoint | None
) -> int | None:
    """The bytes of a picture's sums that may be in memory at a time, None for all of them.

    memory: bytes that this process may take, None for no limit.  Raises UsageError where that is
    too little, ImageError where the disk has too little room for what is not in memory.
    """
    if memory is None:
        return None
    size = scene.film.width * scene.film.height * 8 * sum(widths.values())
    used = resident_memory() or 0
    free = int(_SHARE * memory) - used - _OTHER
    if 3 * size <= free:  # sums, layers, and float32 with what the library makes of them
        return None
    band = BAND * 8 * sum(widths.values())
    if free < _FEWEST_BANDS * band:
        least = (used + _OTHER + _FEWEST_BANDS * band) / _SHARE
        raise UsageError(
            f"--memory: the scene and the program take {used / 2**20:.0f} MiB already; expected at "
            f"least {least / 2**20:.0f} MiB"
        )
    if store is None:
        raise UsageError(
            "--memory: the picture does not fit, and there is no checkpoint that takes the rest; "
            "expected --checkpoint"
        )
    folder = next(parent for parent in store.folder.parents if parent.exists())
    room = shutil.disk_usage(folder).free
    if size > room and not store.exists():
        raise ImageError(
            f"{folder}: has {room / 2**30:.1f} GiB of free space; expected the "
            f"{size / 2**30:.1f} GiB of the picture's samples"
        )
    return free // 2


def write_in_parts(
    path: Path, scene: BuiltScene, frame: Framebuffer, shown: str, header: Mapping[str, str]
) -> Written:
    """Write a picture to an .exr file, some rows at a time.  Raises ImageError."""
    film = scene.film
    nothing = {name: np.zeros((0, width)) for name, width in frame.widths.items()}
    names = [*channels(_rows_of(layers_of(scene, nothing, 1), film.width))]
    total = Written(0, (), True)
    with exr_rows(path, (film.width, film.height), names, header) as put:
        for pixels, sums, samples in frame.slices(film.width * EXR_ROWS):
            layers = _rows_of(layers_of(scene, sums, samples), film.width)
            put(channels(layers))
            part = written(Picture(layers, shown), pixels.start // film.width)
            total = Written(
                total.nonfinite + part.nonfinite,
                (total.places + part.places)[:MOST_PLACES],
                total.black and part.black,
            )
    return total


def _rows_of(layers: Mapping[str, FloatArray], width: int) -> dict[str, FloatArray]:
    """Layers (n, ...) as rows of pixels."""
    return {
        name: layer.reshape(len(layer) // width, width, *layer.shape[1:])
        for name, layer in layers.items()
    }


# ---- settings that a render may change without another scene file --------------------------------


S = TypeVar("S", bound=SceneModel)

_INTEGRATORS: dict[str, Any] = {name_of(cls): cls for cls in types_of(AnyIntegrator)}


def with_settings(
    scene: S,
    *,
    spp: int | None = None,
    size: tuple[int, int] | None = None,
    integrator: AnyIntegrator | str | None = None,
    seed: int | None = None,
) -> S:
    """The scene with other settings; None keeps the scene's own.

    size: width and height in pixels;  spp: samples per pixel;  integrator: a description, or a
    type's name for its defaults; another one of the scene's own type keeps the scene's settings.
    Samplers without a seed keep theirs.  Raises SceneError, whose path is the setting.
    """
    parts: dict[str, Any] = {}
    if size is not None:
        width, height = size
        parts["film"] = _changed(scene.film, "size", width=width, height=height)
    if integrator is not None and integrator != scene.integrator.type:
        chosen: Any = integrator
        if isinstance(integrator, str):
            if integrator not in _INTEGRATORS:
                known = ", ".join(_INTEGRATORS)
                message = f"expected one of {known}, got '{integrator}'"
                raise SceneError(message, ("integrator",))
            chosen = _INTEGRATORS[integrator]()
        parts["integrator"] = chosen
        if chosen.deterministic != isinstance(scene.resolved_sampler, Grid):
            parts["sampler"] = None
    scene = scene.changed(**parts)
    sampler = scene.resolved_sampler
    if spp is not None:
        sampler = _changed(sampler, "spp", spp=spp)
    if seed is not None and hasattr(sampler, "seed"):
        sampler = _changed(sampler, "seed", seed=seed)
    return scene.changed(sampler=sampler)


def _changed(part: Any, setting: str, **fields: Any) -> Any:
    """`part` with some fields changed, checked again."""
    try:
        return type(part)(
            **{name: getattr(part, name) for name in type(part).__pydantic_fields__} | fields
        )
    except SceneError as error:
        raise SceneError(error.message, (setting,)) from None
