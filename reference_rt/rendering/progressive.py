"""A picture that becomes less noisy while one watches: independent passes and their mean."""

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.picture import Picture
from reference_rt.rendering.render import Progress, render
from reference_rt.scene.build import BuiltScene

MOST_SAMPLES = 4096
"""Samples per pixel after which a picture is finished."""

_SECONDS = 1.0
"""The longest pass at first: how long one waits for the next picture.  Later a tenth of the time so
far, so that the overhead of passes stays small."""

_MEDIAN_OF_NORMAL = 0.6745
"""The median of |x| for a standard normal x: turns a median deviation into a standard error."""


@dataclass(frozen=True)
class Stage:
    """picture: the mean of all passes so far;  spp: their samples per pixel;  noise: the standard
    error of a typical pixel relative to its luminance, inf after a single pass, 0 if the picture
    has no noise;  finished: whether this is the last stage."""

    picture: Picture
    spp: int
    noise: float
    finished: bool


def progressive(
    scene: BuiltScene,
    *,
    spp: int = MOST_SAMPLES,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Iterator[Stage]:
    """The scene's picture after each of several passes with different seeds, up to `spp` samples
    per pixel.

    The first pass has one sample, each further one at most as many as all before, and as many as
    fit into a second.  Additional layers of the film are left out.  Integrators without random
    numbers have one pass.  threads, progress: as for `render`.  Raises as `render` does.
    """
    scene = scene.changed(film=scene.film.model_copy(update={"layers": ()}))
    tables, seed = scene.tables, getattr(scene.resolved_sampler, "seed", None)
    if seed is None:
        yield Stage(
            render(scene, tables=tables, threads=threads, progress=progress),
            *(scene.resolved_sampler.spp, 0.0, True),
        )
        return
    mean, done, seconds, number = np.zeros(()), 0, 0.0, 0
    while done < spp:
        samples = min(max(done, 1), spp - done)
        if done:
            fitting = max(_SECONDS, seconds / 10.0) * done / max(seconds, 1e-9)
            samples = max(1, min(samples, int(fitting)))
        begin = time.perf_counter()
        picture = render(
            scene,
            spp=samples,
            seed=(seed + number) % 2**63,
            tables=tables,
            threads=threads,
            progress=progress,
        )
        seconds += picture.seconds.get("render", time.perf_counter() - begin)
        colour, noise = picture.colour, math.inf
        if done:
            noise = _noise(mean, done, colour, samples)
            colour = (mean * done + colour * samples) / (done + samples)
        mean, done, number = colour, done + samples, number + 1
        layers = {"colour": mean}
        yield Stage(Picture(layers, "colour", {"render": seconds}, scene), done, noise, done >= spp)


def _noise(a: FloatArray, n: int, b: FloatArray, m: int) -> float:
    """The relative standard error of a typical pixel of (n a + m b) / (n + m).

    a, b: (height, width, 3), independent means of n and of m samples.  With s the variance of one
    sample, b - a has the variance s (1 / n + 1 / m), and the mean of all s / (n + m).
    """
    weights = np.array([0.2126, 0.7152, 0.0722])
    of_a, of_b = a @ weights, b @ weights
    total = (n * of_a + m * of_b) / (n + m)
    lit = np.isfinite(total) & (total > 0.0)
    if not lit.any():
        return math.inf
    error = np.abs(of_b - of_a)[lit] * math.sqrt(n * m) / (n + m)
    return float(np.median(error / total[lit])) / _MEDIAN_OF_NORMAL
