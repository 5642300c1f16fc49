"""The reference of a gate: our float64 rendering of a scene, or pictures from files."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from comparisons.gate.copies import fingerprint
from comparisons.gate.pictures_in import Picture, variance_of
from comparisons.gate.reference_cache import cached, relative_error
from comparisons.rungs.footprints import is_noise_free as is_noise_free
from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.render import Progress
from reference_rt.rendering.scene import Scene
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

_MOST_NUMBERS = 1 << 28
"""Values of all replicates together, 2 GiB: large pictures have fewer replicates."""


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
        picture = cached(scene, 1, lambda pictures, rounds: rounds >= 1, threads, say)[0]
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

    pictures, rounds = cached(scene, count, enough, threads, say, target)
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
