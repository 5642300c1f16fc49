"""POV-Ray as another renderer: pictures without noise, and first hits."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from comparisons.povray import run, translate
from comparisons.renderers import FirstHits, NoCounterpartError, Replicates
from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.scene import Scene


@dataclass(frozen=True)
class PovRay:
    """`comparisons.renderers.NoiseFree`."""

    title: str = "POV-Ray"

    def version(self) -> str:
        return run.version()

    @contextmanager
    def load(self, scene: Scene, threads: int | None = None) -> Iterator["_Loaded"]:
        run.version()
        try:
            text = translate.picture(scene)
        except NoCounterpartError as error:
            raise NoCounterpartError(f"POV-Ray has no equal of {error}") from None
        yield _Loaded(text, scene, threads)

    def first_hits(self, scene: Scene, threads: int | None = None) -> FirstHits:
        """Raises NoCounterpartError, ReferenceUnavailableError."""
        try:
            given = translate.hits(scene)
        except NoCounterpartError as error:
            raise NoCounterpartError(f"POV-Ray has no equal of {error}") from None
        film = scene.film
        shown = run.frames(given.text, film.width, film.height, translate.FRAMES, threads)
        span = 2.0 * translate.RANGE
        p = given.frame.out(span * _number(shown[:3]).reshape(-1, 3) - translate.RANGE)
        front = shown[3].any(axis=-1)
        n = np.where(front[..., None], -np.cos(np.pi * shown[3]), 0.0)
        return FirstHits(
            given.shapes,
            p.reshape(film.height, film.width, 3),
            n,
            np.asarray(shown[:3].any(axis=(0, 3))),
            front,
            given.left_out,
            given.rounding / given.frame.scale,
            *given.frame.out(np.outer([-translate.RANGE, translate.RANGE], np.ones(3))),
        )


def _number(shown: FloatArray) -> FloatArray:
    """Fractions (height, width, axes) from their digits (axes, height, width, channels)."""
    found = shown[..., 0]
    for channel, scale in enumerate(translate.DIGITS[1:], 1):
        digits = shown[..., channel]
        found = (np.round(found * scale - digits) + digits) / scale
    return np.moveaxis(found, 0, -1)


class _Loaded(NamedTuple):
    text: str
    scene: Scene
    threads: int | None

    def render(
        self, count: int, spp: int, seed: int = 0, say: Callable[[str], None] = lambda line: None
    ) -> Replicates:
        """The grid of samples is a larger picture.  Others than ours have the nearest grid."""
        n = max(1, round(spp**0.5))
        start = time.perf_counter()
        width, height = self.scene.film.width, self.scene.film.height
        large = run.rendered(self.text, n * width, n * height, self.threads)
        picture = large.reshape(height, n, width, n, 3).mean(axis=(1, 3))
        seconds = time.perf_counter() - start
        pictures = np.broadcast_to(picture, (count, *picture.shape))
        return Replicates(pictures, np.full(count, seconds), n * n)


RENDERER = PovRay()
