"""The reference of errors: our own rendering of the scene, kept in the user's cache."""

import hashlib
import time
from contextlib import suppress
from pathlib import Path

import numpy as np

from comparisons.experiments.convergence.data import Reference
from comparisons.gate.digest import scene_digest, source_digest
from comparisons.gate.reference import cache_folder
from comparisons.results.sealed import read_arrays, write_arrays
from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.render import Progress, render
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import Sobol
from reference_rt.util.errors import ImageError

COUNT = 16
"""Independent pictures: the variance of their mean is then known pixel by pixel to one part in
three, and over thousands of pixels far better."""


def key_of(scene: Scene) -> str:
    """The cache key: a hash of the scene, including size and filter, and of our sources."""
    text = f"convergence 1 {scene_digest(scene)} {source_digest()} {COUNT}"
    return hashlib.sha256(text.encode()).hexdigest()


def reference_of(scene: Scene, spp: int, say: Progress = lambda what, fraction: None) -> Reference:
    """COUNT pictures of at least `spp` Sobol' samples per pixel, with seeds that no method uses.

    Cached pictures are used, and samples are added to them if they have fewer.
    """
    key = key_of(scene)
    path = cache_folder() / f"{key[:40]}.npz"
    size = (COUNT, scene.film.height, scene.film.width, 3)
    pictures, taken, rounds = _load(path, size)
    seconds = 0.0
    if taken < spp:
        more = spp - taken
        first = int(key[40:52], 16) << 14
        start = time.perf_counter()
        for k in range(COUNT):
            seed = first + rounds * COUNT + k
            seeded = scene.changed(sampler=Sobol(spp=more, seed=seed))
            picture = render(seeded, tables=scene.tables).colour
            pictures[k] += (picture - pictures[k]) * (more / spp)
            say("reference", (k + 1) / COUNT)
        seconds = time.perf_counter() - start
        taken, rounds = spp, rounds + 1
        _save(path, pictures, taken, rounds)
    variance = pictures.var(axis=0, ddof=1) / COUNT
    return Reference(pictures.mean(axis=0), variance, COUNT, taken, seconds)


def _load(path: Path, size: tuple[int, ...]) -> tuple[FloatArray, int, int]:
    """Cached pictures, their samples per pixel and number of rounds; zeros if none can be used."""
    with suppress(KeyError):
        kept = read_arrays(path)
        pictures, spp, rounds = kept["pictures"], int(kept["spp"]), int(kept["rounds"])
        if pictures.shape == size and pictures.dtype == np.float64 and spp > 0:
            return pictures, spp, rounds
    return np.zeros(size), 0, 0


def _save(path: Path, pictures: FloatArray, spp: int, rounds: int) -> None:
    with suppress(ImageError, OSError):
        write_arrays(path, pictures=pictures, spp=spp, rounds=rounds)
