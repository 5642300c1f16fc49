"""Units in other processes, on this machine or another.

A worker builds the scene once, and computes units of it from then on.  It refuses a scene whose
files differ from those of the process that asks, and another version of this package: a picture has
the same bits, wherever its units are computed, or there is none.
"""

import pickle
import socket
import threading
import time
import warnings
from typing import NamedTuple

import numpy as np

from reference_rt.rendering.accumulation import Sums, widths_of
from reference_rt.rendering.checkpoint import render_digest, sources_digest
from reference_rt.rendering.prepared import Done, Prepared
from reference_rt.rendering.units import Unit
from reference_rt.scene.build import BuiltScene
from reference_rt.util.errors import SceneWarning, WorkersError

SIZE = 1 << 20
"""Samples of a unit: about a second, beside which the milliseconds that it takes to send it and its
result are nothing."""

_MOST_SCENES = 2
"""Scenes that a worker keeps: one that is being finished, and the next."""

_SPECIALISED_AFTER = 30.0
"""Seconds of units with linked kernels (see `kernels`) after which a worker compiles specialised
ones: these take 8 s to compile, and render in 0.7 of the time."""


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
        self.widths, self.prepared, self.seconds = widths_of(scene), prepared, 0.0
        self.lock = threading.Lock()


_workers: dict[bytes, _Worker] = {}
_lock = threading.Lock()
_never = threading.Event()


def remote_scene(scene: BuiltScene, digest: bytes, chunk: int) -> RemoteScene:
    """A scene for workers, which must have the files that it names under the same paths."""
    copy = scene.changed()  # without its tables
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
    began = time.perf_counter()
    done = worker.prepared.compute(Unit(*unit), sums, scene.chunk, _never)
    worker.seconds += time.perf_counter() - began
    if worker.seconds > _SPECIALISED_AFTER:
        with worker.lock:
            worker.prepared.running.specialise()
    return done


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
