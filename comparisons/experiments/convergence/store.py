"""Stores finished rungs in a folder, and references in the user's cache, so that they are not
rendered again."""

import hashlib
import os
import platform
import shutil
import time
import zlib
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.gate.digest import scene_digest, source_digest
from comparisons.gate.reference_cache import cache_folder
from comparisons.mitsuba.backend import backend
from comparisons.results.files import read_arrays, write_arrays
from comparisons.runs import engine
from comparisons.runs.provenance import package_versions
from comparisons.statistics.metrics import RELMSE_EPSILON
from comparisons.suites.keys import code_fingerprint, files_digest
from reference_rt.cameras.film import Film
from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.render import Progress, render
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import Sobol
from reference_rt.util.errors import ImageError
from reference_rt.util.files import delete_unfinished

# ---- settings of a run, its reference, and its rungs ---------------------------------------------


FIRST = 4
"""Samples per pixel of the first rung; each rung has twice those of the one before."""

WIDEST = 128
"""Default limit of the width in pixels: errors are means over pixels, so that small pictures show
the same slopes, and twice the width takes four times as long."""


@dataclass(frozen=True)
class Settings:
    """The settings of a run.

    time_limit: seconds for the ladder and the reference of one scene, shared equally by the methods
    and the reference; compilation and trials (of costs, of Mitsuba's samplers) come in addition;
     size: width and height, None: the scene's, at most WIDEST wide;  max_spp: largest
    number of samples per pixel;  replicates: independent pictures at each rung;  targets: relative
    errors to which the time is determined;  only: names of methods, empty: all;  crops: whether to
    render pictures to show.
    """

    time_limit: float = 60.0
    size: tuple[int, int] | None = None
    max_spp: int = 4096
    replicates: int = 8
    targets: tuple[float, ...] = (0.1, 0.03, 0.01, 0.003)
    only: tuple[str, ...] = ()
    crops: bool = True


def size_within(film: Film, widest: int) -> tuple[int, int]:
    """Width and height of a film, scaled down to the width `widest` if it is wider."""
    if film.width <= widest:
        return film.width, film.height
    return widest, max(1, round(film.height * widest / film.width))


def weights(reference: FloatArray) -> FloatArray:
    """Weights (height, width, 3) that make squared errors relative: 1 / (r² + epsilon m²), with m
    the reference's mean, as in `comparisons.statistics.metrics`."""
    scale = reference**2 + RELMSE_EPSILON * reference.mean() ** 2
    return np.asarray(1.0 / np.where(scale > 0.0, scale, 1.0))


@dataclass(frozen=True)
class Reference:
    """The reference of errors: our own pictures, with seeds that no method uses.

    mean (height, width, 3): of independent pictures;  variance (height, width, 3): of that mean,
    estimated from their scatter;  count: number of pictures;  spp: samples per pixel of each;
    seconds: to render it, 0 if it came from the cache.
    """

    mean: FloatArray
    variance: FloatArray
    count: int
    spp: int
    seconds: float = 0.0

    @property
    def checksum(self) -> int:
        """Of its pictures: another reference of the same scene has another one."""
        return zlib.crc32(self.mean.tobytes())

    @property
    def relmse(self) -> float:
        """The relMSE of its own noise."""
        return float((weights(self.mean) * self.variance).mean())


@dataclass(frozen=True)
class Rung:
    """The replicates of a method at one number of samples.

    asked, spp: requested and actual samples per pixel;  seconds (replicates,): wall clock;  mse,
    relmse (replicates,): see `estimates.errors`;  mean, squares (height, width, 3): over the
    replicates, the mean and the sum of squared deviations from it;  reference: checksum of the
    reference of the errors.
    """

    asked: int
    spp: int
    seconds: FloatArray
    mse: FloatArray
    relmse: FloatArray
    mean: FloatArray
    squares: FloatArray
    reference: int = 0

    @property
    def replicates(self) -> int:
        return len(self.seconds)

    @property
    def variance(self) -> FloatArray:
        """That of one replicate (height, width, 3)."""
        return self.squares / max(self.replicates - 1, 1)

    @property
    def warm(self) -> FloatArray:
        """The seconds of all but the first picture, which may compile: the kernels of Mitsuba's
        stratified samplers have the number of samples as a constant."""
        return self.seconds[1:] if len(self.seconds) > 1 else self.seconds


# ---- the reference ------------------------------------------------------------------------------


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


# ---- stored rungs -------------------------------------------------------------------------------


SCHEMA = 3
"""Increased whenever what is stored, or its meaning, changes."""

_NUMBERS = ("asked", "spp", "reference")
_ARRAYS = ("seconds", "mse", "relmse", "mean", "squares")
"""The fields of a rung."""


def run_key(scene: Scene, replicates: int) -> str:
    """SHA-256 of all that rungs depend on: the scene as rendered and its files, our sources, the
    versions of packages that compute, the machine, and the number of replicates."""
    chosen = backend()
    return engine.key_of(
        schema=SCHEMA,
        scene=scene.digest(),
        files=files_digest(scene),
        sources=code_fingerprint(),
        reference=key_of(scene),
        versions=package_versions(),
        mitsuba=(chosen.variant, chosen.llvm_path),
        machine=(platform.node(), platform.machine(), os.cpu_count()),
        replicates=replicates,
    )


class Store:
    """Rungs, and small facts by name, of one scene.  Contents with another key are deleted.

    folder: None stores nothing.
    """

    def __init__(self, folder: Path | None, key: str, *, fresh: bool = False) -> None:
        self._folder, self._key = folder, key
        if folder is not None and (fresh or engine.stored(folder / "key.json", key) is None):
            shutil.rmtree(folder, ignore_errors=True)
            engine.store(folder / "key.json", key, "this run's")
        if folder is not None:
            delete_unfinished(folder)

    # ---- rungs ----------------------------------------------------------------------------------

    def rung(self, method: str, asked: int) -> Rung | None:
        """The stored one; None where there is none, or none that can be read."""
        if self._folder is None:
            return None
        kept = read_arrays(self._rung_path(method, asked))
        with suppress(KeyError):
            numbers = {name: int(kept[name]) for name in _NUMBERS}
            return Rung(**numbers, **{name: kept[name] for name in _ARRAYS})  # type: ignore[arg-type]
        return None

    def keep(self, method: str, rung: Rung) -> None:
        """Store a rung, whole or not at all and without rounding: a run that was killed ends with
        the same bits.  Raises ImageError where the folder cannot be written."""
        if self._folder is not None:
            write_arrays(self._rung_path(method, rung.asked), **vars(rung))

    def _rung_path(self, method: str, asked: int) -> Path:
        assert self._folder is not None
        return self._folder / f"{method}-{asked}.npz"

    # ---- pictures -------------------------------------------------------------------------------

    def picture(self, name: str) -> Any:
        """An array kept by `keep_picture`; None where there is none."""
        if self._folder is None:
            return None
        return read_arrays(self._picture_path(name)).get("picture")

    def keep_picture(self, name: str, picture: Any) -> None:
        """Store an array."""
        if self._folder is not None:
            write_arrays(self._picture_path(name), picture=picture)

    def _picture_path(self, name: str) -> Path:
        assert self._folder is not None
        return self._folder / f"{name}.npz"

    # ---- facts ----------------------------------------------------------------------------------

    def fact(self, name: str, settings: Any = None) -> Any:
        """What `keep_fact` stored, if it was for the same settings; else None."""
        return self._folder and engine.stored(*self._fact(self._folder, name, settings))

    def keep_fact(self, name: str, fact: Any, settings: Any = None) -> None:
        """Store what JSON can hold."""
        if self._folder is not None:
            engine.store(*self._fact(self._folder, name, settings), fact)

    def _fact(self, folder: Path, name: str, settings: Any) -> tuple[Path, str]:
        """Its file and key."""
        return folder / f"{name}.json", engine.key_of(run=self._key, settings=settings)
