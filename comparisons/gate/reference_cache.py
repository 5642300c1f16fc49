"""Our own references: rendered as long as they are too noisy, and kept."""

import hashlib
import math
import os
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import platformdirs

from comparisons.gate.digest import scene_digest, source_digest
from comparisons.results.files import read_arrays, write_arrays
from comparisons.statistics.cells import divisor
from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.render import Progress, render
from reference_rt.rendering.scene import Scene
from reference_rt.scene.build import build_tables
from reference_rt.util.errors import ImageError

_SAVED_EACH = 20.0
"""Seconds after which pictures are stored while others are rendered: what a kill can cost."""

_KEPT = 2 << 30
"""Bytes of references in the cache; the least recently used is deleted first."""


def cached(
    scene: Scene,
    count: int,
    enough: Callable[[FloatArray, int], bool],
    threads: int | None,
    say: Progress,
    target: float = 0.0,
) -> tuple[FloatArray, int]:
    """`count` pictures of the scene, each the mean of some rounds, and the number of rounds."""
    sampler = scene.resolved_sampler
    spp = getattr(sampler, "spp", 1)
    key = f"2 {scene_digest(scene)} {source_digest()} {sampler.type} {spp} {count}"
    name = hashlib.sha256(key.encode()).hexdigest()
    path = cache_folder() / f"{name[:40]}.npz"
    shape = (count, scene.film.height, scene.film.width, 3)
    pictures, made = _load(path, shape)
    rounds, done = divmod(made, count)  # so many pictures of a round that was cut off
    if rounds > 0 and done == 0 and enough(pictures, rounds):
        return pictures, rounds
    # Far from the seeds that users choose: equal seeds would give both sides the same noise.
    first = int(name[40:52], 16) << 14
    tables = build_tables(scene)
    task, start = "rendering the reference", made

    def compiling(what: str, part: float) -> None:
        if what == "compile":
            say(what, part)

    say(task, 0.0)
    saved = time.monotonic()
    try:
        while rounds == 0 or done or not enough(pictures, rounds):
            seeded = scene
            if hasattr(sampler, "seed"):
                seeded = scene.changed(sampler=sampler.model_copy(update={"seed": first + made}))
            picture = render(
                seeded,
                tables=tables,
                threads=threads,
                progress=compiling if made == start else None,
            ).colour
            pictures[done] += (picture - pictures[done]) / (rounds + 1)
            made += 1
            rounds, done = divmod(made, count)
            total = _rounds_needed(pictures, rounds, target)
            say(task, min(0.999, (rounds + done / count) / total))
            if time.monotonic() - saved > _SAVED_EACH:
                _save(path, pictures, made)
                saved = time.monotonic()
    finally:  # after Ctrl-C too: the next gate goes on from here
        _save(path, pictures, made)
    say(task, 1.0)
    return pictures, rounds


def _rounds_needed(pictures: FloatArray, rounds: int, target: float) -> float:
    """Estimate from the complete rounds: the error falls with the square root of their number."""
    if rounds == 0 or target == 0.0:
        return rounds + 1.0
    return max(rounds + 1.0, rounds * (relative_error(pictures) / target) ** 2)


def cache_folder() -> Path:
    """Where references are kept: REFERENCE_RT_CACHE, or the user's cache folder."""
    root = os.environ.get("REFERENCE_RT_CACHE") or platformdirs.user_cache_dir("reference_rt")
    return Path(root) / "references"


def _load(path: Path, shape: tuple[int, ...]) -> tuple[FloatArray, int]:
    """Pictures from the cache, and how many renderings they are the means of, one after the other;
    zeros if it has none that can be used."""
    with suppress(KeyError, TypeError):
        kept = read_arrays(path)
        pictures, made = kept["pictures"], int(kept["made"])
        if pictures.shape == shape and pictures.dtype == np.float64 and made > 0:
            with suppress(OSError):
                os.utime(path)
            return pictures, made
    return np.zeros(shape), 0


def _save(path: Path, pictures: FloatArray, made: int) -> None:
    """Store pictures if the cache can be written, and delete the least recently used ones."""
    if made == 0:
        return
    with suppress(ImageError, OSError):
        write_arrays(path, pictures=pictures, made=made)
        kept = sorted(path.parent.glob("*.npz"), key=lambda file: -file.stat().st_mtime)
        total = 0
        for file in kept:
            total += file.stat().st_size
            if total > _KEPT and file != path:
                file.unlink(missing_ok=True)


def relative_error(pictures: FloatArray) -> float:
    """The largest standard error of a channel's image mean, relative to that mean; of pictures
    (replicates >= 2, height, width, 3).  0 for black ones."""
    means = pictures.mean(axis=(1, 2))
    scale = divisor(means.mean(axis=0), means.mean())
    error = means.std(axis=0, ddof=1) / math.sqrt(len(means))
    return float(np.where(error > 0.0, error / np.where(scale > 0.0, scale, 1.0), 0.0).max())
