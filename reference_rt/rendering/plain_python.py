"""A second process that runs kernels as plain Python, with the same bits as compiled ones."""

import os
import pickle
import signal
import sys
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from reference_rt.core.arrays import FloatArray
from reference_rt.integrators import RayCast
from reference_rt.rendering import tiles
from reference_rt.rendering.accumulation import jobs_of
from reference_rt.rendering.kernels import plain_arguments
from reference_rt.scene.build import BuiltScene


class PlainTile(NamedTuple):
    """The kernel of a scene's tile.  is_cast: whether of ray casting;  arguments: before its
    sums."""

    is_cast: bool
    arguments: tuple[Any, ...]

    def add(self, pixel: int, sample: int) -> FloatArray:
        """The sums of one sample, of the pixel with this number along rows."""
        kernel: Any = tiles.aov_tile if self.is_cast else tiles.render_tile
        sums = [np.zeros((1, 10))] if self.is_cast else [np.zeros((1, 3)), np.zeros((0, 3))]
        kernel(*self.arguments, *sums, pixel, pixel + 1, sample, sample + 1)
        found: FloatArray = sums[0][0]
        return found


def plain_tile(scene: BuiltScene) -> PlainTile:
    """That of the scene's picture, which must not be of the integrator `light`."""
    film = scene.film
    view = scene.camera.setup(film.width, film.height)
    given = plain_arguments(jobs_of(scene)[0], scene.tables, view, film.filter.setup())
    return PlainTile(isinstance(scene.integrator, RayCast), given)


def started_with(answer: Callable[[], None]) -> dict[str, Any]:
    """What `subprocess` is given to call a function of a module in a process of plain Python."""
    call = f"from {answer.__module__} import {answer.__name__} as answer; answer()"
    return {
        "args": [sys.executable, "-P", "-c", call],
        "env": os.environ | {"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": os.pathsep.join(sys.path)},
    }


def request() -> Any:
    """In that process: what it was sent, pickled, on standard input."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # the first process says that it was interrupted
    return pickle.load(sys.stdin.buffer)
