"""The reference of a gate: our float64 rendering of a scene, or pictures from files."""

import hashlib
import math
import os
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import platformdirs

from comparisons.gate.copies import fingerprint
from comparisons.gate.digest import scene_digest, source_digest
from comparisons.gate.pictures_in import Picture, variance_of
from comparisons.results.files import read_arrays, write_arrays
from comparisons.statistics.cells import divisor
from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.render import Progress, render
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import Grid
from reference_rt.scene.build import build_tables
from reference_rt.util.errors import ImageError, UsageError

REPLICATES = 16
"""Pictures of the reference: its own noise is then known to 20 % (15 degrees of freedom)."""

SHARE = 1 / 20
"""The reference's standard error as a fraction of the bias that must be detectable. Confidence
intervals for a few tests at a level of 5e-4 are about five standard errors wide to either side: a
quarter of that bias is given to the reference's noise, the rest is left to the candidate's."""

MOST_SAMPLES = 1 << 30
"""Limit of a reference's camera samples, about ten minutes; if they do not suffice, the statistics
report that the run was too noisy."""

_ROUND = 1 << 18
"""Minimum of camera samples of one picture in one round: half a second."""

_SAVED_EACH = 20.0
"""Seconds after which pictures are stored while others are rendered: what a kill can cost."""

_MOST_NUMBERS = 1 << 28
"""Values of all replicates together, 2 GiB: large pictures have fewer replicates."""

_KEPT = 2 << 30
"""Bytes of references in the cache; the least recently used is deleted first."""


@dataclass(frozen=True)
class Reference:
    """pictures: (replicates, height, width, 3) linear radiance;  variance: (height, width, 3) of
    their mean, if given separately;  noise_free: made without random numbers;  name: whose pictures
    these are, for people;  fingerprints: those of the pictures that candidates may be copies of."""

    pictures: FloatArray
    variance: FloatArray | None = None
    noise_free: bool = False
    name: str = "the reference's"
    notes: tuple[str, ...] = ()
    fingerprints: tuple[str, ...] = ()


def is_noise_free(scene: Scene) -> bool:
    """Whether a correct picture of the scene has no noise, because its samples are fixed."""
    return scene.integrator.type == "ray_cast" or isinstance(scene.resolved_sampler, Grid)


def of_scene(
    scene: Scene,
    limit: float,
    *,
    threads: int | None = None,
    say: Progress = lambda what, fraction: None,
) -> Reference:
    """Our own replicates of a scene, with noise small compared with `limit`.

    Each round adds the scene's samples per pixel, with new seeds, to every replicate, until the
    standard error of the image mean, estimated from the replicates, is below SHARE of the limit in
    every channel.  The cache keeps the pictures for the same scene and sources.
    """
    if is_noise_free(scene):
        picture = _cached(scene, 1, lambda pictures, rounds: rounds >= 1, threads, say)[0]
        note = ("ray casting: the colours of the surfaces hit are compared",)
        casts = scene.integrator.type == "ray_cast"
        return Reference(picture, None, True, "reference_rt's", note if casts else ())
    pixels = scene.film.width * scene.film.height
    sampler = scene.resolved_sampler
    # More samples per round for small pictures; a power of two, which suits Sobol' points.
    spp = max(sampler.spp, 1 << max(0, (_ROUND // pixels).bit_length() - 1))
    scene = scene.changed(sampler=sampler.model_copy(update={"spp": spp}))
    count = min(REPLICATES, max(4, _MOST_NUMBERS // (3 * pixels)))
    most = max(1, MOST_SAMPLES // (count * pixels * spp))
    target = SHARE * limit

    def enough(pictures: FloatArray, rounds: int) -> bool:
        return rounds >= most or relative_error(pictures) <= target

    pictures, rounds = _cached(scene, count, enough, threads, say, target)
    error = relative_error(pictures)
    notes = [
        f"the reference: {count} pictures of {rounds * spp} samples per pixel, float64; the "
        f"standard error of the image mean is {100.0 * error:.2g} %"
    ]
    if error > target:
        notes.append(f"the reference is noisier than intended ({100.0 * target:.2g} %)")
    return Reference(pictures, None, False, "reference_rt's", tuple(notes))


def of_files(references: Sequence[Picture], variance: Path | None, noise_free: bool) -> Reference:
    """Pictures from files, several being replicates.  Raises ImageError, UsageError."""
    pictures = usable(references)
    if noise_free and len(pictures) > 1:
        raise UsageError(f"{len(pictures)} references without noise; expected one")
    spread = None
    if variance is not None:
        if len(pictures) > 1:
            raise UsageError(
                "--variance: only applies to one reference; the variance of several is estimated"
            )
        spread = variance_of(variance)
        if spread.shape != pictures.shape[1:]:
            raise ImageError(
                f"{variance}: is {size_of(spread)} pixels; expected {size_of(pictures[0])}, as "
                f"{references[0].name}"
            )
    prints = tuple(fingerprint(picture) for picture in pictures)
    notes = next(((p.note,) for p in references if p.note), ())
    return Reference(pictures, spread, noise_free, notes=notes, fingerprints=prints)


class SizeError(ImageError):
    """A picture has another size than the reference."""


def check_sizes(candidates: Sequence[Picture], expected: str, whose: str) -> None:
    """Raise SizeError for the first candidate that is not `expected`, "width x height"."""
    if not candidates:
        raise UsageError("there is no candidate; expected at least one")
    for picture in candidates:
        size = size_of(picture.radiance)
        if size != expected:
            raise SizeError(f"{picture.name}: is {size} pixels; expected {expected}, {whose}")


def usable(pictures: Sequence[Picture]) -> FloatArray:
    """(replicates, height, width, 3) of pictures that can be a reference.  Raises ImageError for
    different sizes, for pixels that are not finite, and for black pictures."""
    for picture in pictures:
        bad = int(np.count_nonzero(~np.isfinite(picture.radiance).all(axis=-1)))
        if bad:
            count = "1 pixel is" if bad == 1 else f"{bad} pixels are"
            raise ImageError(f"{picture.name}: {count} not finite; expected finite ones")
        if not picture.radiance.any():
            raise ImageError(f"{picture.name}: is black throughout; expected a picture")
    return stacked(pictures)


def stacked(pictures: Sequence[Picture]) -> FloatArray:
    """(replicates, height, width, 3).  Raises ImageError unless all are of one size."""
    first = pictures[0]
    for other in pictures[1:]:
        if other.radiance.shape != first.radiance.shape:
            raise ImageError(
                f"{other.name}: is {size_of(other.radiance)} pixels; expected "
                f"{size_of(first.radiance)}, as {first.name}: replicates must have the same size"
            )
    return np.stack([picture.radiance for picture in pictures])


def size_of(picture: FloatArray) -> str:
    """Width and height, for people."""
    return f"{picture.shape[1]} x {picture.shape[0]}"


def relative_error(pictures: FloatArray) -> float:
    """The largest standard error of a channel's image mean, relative to that mean; of pictures
    (replicates >= 2, height, width, 3).  0 for black ones."""
    means = pictures.mean(axis=(1, 2))
    scale = divisor(means.mean(axis=0), means.mean())
    error = means.std(axis=0, ddof=1) / math.sqrt(len(means))
    return float(np.where(error > 0.0, error / np.where(scale > 0.0, scale, 1.0), 0.0).max())


# ---- rendering, and the cache of what was rendered ----------------------------------------------


def _cached(
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
