"""A first picture while kernels are compiled: a few pixels of it, in plain Python.

Compiling takes many seconds on a machine that has not rendered such a scene before.  Meanwhile a
second process runs the kernel of a tile as plain Python (NUMBA_DISABLE_JIT=1), a millisecond or
two a sample, for the first sample of single pixels: those of a coarse grid, then of finer ones; and
then for their next samples.  They are samples of the picture itself, with the same bits.
"""

import itertools
import os
import pickle
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import IO, Any, NamedTuple

import numpy as np

from reference_rt.core.arrays import FloatArray
from reference_rt.integrators import Light
from reference_rt.rendering.accumulation import jobs_of, layers_of, samples_of
from reference_rt.rendering.image import display, eight_bits
from reference_rt.rendering.picture import Picture
from reference_rt.rendering.plain_python import plain_tile, request, started_with
from reference_rt.rendering.render import shown_of
from reference_rt.scene.build import BuiltScene
from reference_rt.util.processes import tied

PIXELS = 4096
"""At most so many pixels: more take longer than compiling."""

FIRST_STEP = 8
"""Of the finest grid's pixels, each so-manieth of a column and of a row comes first."""

FEWEST = 8
"""Kernels that have to be compiled for a first look: fewer take no longer than it does."""

_BATCH = 32
"""Pixels that are sent at once."""

_BETWEEN = 0.5
"""Seconds between two pictures, at least: drawing them takes time from compiling."""

_NICE = 19
"""The least priority: of the second process once there is a first picture."""

MOST_BYTES = 64 << 20
"""Of the scene's tables: the second process has them, too, and they are copied twice on the way."""

Show = Callable[[Any], None]
"""Called with a picture (height, width, 3) of bytes."""


class Grid(NamedTuple):
    """Pixels of a film, each `step`-th of a column and of a row: so many columns and rows."""

    step: int
    columns: int
    rows: int


class Place(NamedTuple):
    """A sample of a pixel of a grid;  width: of the square of pixels that it stands for, until
    finer grids come."""

    column: int
    row: int
    sample: int
    width: int


Batch = list[tuple[Place, FloatArray]]
"""Places, and the values of the kernel of a tile there."""


def grid_of(width: int, height: int) -> Grid:
    """The finest grid of a film."""
    step = 1
    while -(-width // step) * -(-height // step) > PIXELS:
        step += 1
    return Grid(step, -(-width // step), -(-height // step))


def in_order(grid: Grid, samples: int) -> Iterator[Place]:
    """The samples of a grid's pixels, so many of each: as they are computed."""
    width = FIRST_STEP
    while width >= 1:
        begun = 2 * width if width < FIRST_STEP else 0
        for row, column in itertools.product(
            range(0, grid.rows, width), range(0, grid.columns, width)
        ):
            if not begun or row % begun or column % begun:
                yield Place(column, row, 0, width)
        width //= 2
    for sample, row, column in itertools.product(
        range(1, samples), range(grid.rows), range(grid.columns)
    ):
        yield Place(column, row, sample, 1)


class FirstLook:
    """Shows a first picture of a scene, from `begin` until the end of the context, or `end`."""

    def __init__(self, scene: BuiltScene, show: Show) -> None:
        self._scene = scene.changed(film=scene.film.model_copy(update={"layers": ()}))
        self._show = show
        self._process: subprocess.Popen[bytes] | None = None
        self._reader: threading.Thread | None = None
        self._ended = threading.Event()

    def __enter__(self) -> "FirstLook":
        return self

    def __exit__(self, *error: Any) -> None:
        self.end()

    def compiling(self, done: int, total: int) -> None:
        """A `Report` of kernels: it begins with the first of many, and ends with the last."""
        if done >= total:
            self.end()
        elif total >= FEWEST and self._process is None:
            self.begin()

    def begin(self) -> None:
        """Start the second process, unless it would take much memory or cannot be started.  The
        integrator `light` has no pixels of its own to show."""
        if isinstance(self._scene.integrator, Light):
            return
        film, tile = self._scene.film, plain_tile(self._scene)
        if _bytes_of(tile) > MOST_BYTES:
            return
        grid = grid_of(film.width, film.height)
        asked = tile, film.width, grid, samples_of(self._scene)
        with suppress(OSError):  # a render does not fail for want of a first look
            self._process = subprocess.Popen(
                **started_with(_answer),
                **tied(),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
            )
        if self._process is None:
            return
        arguments = self._process, pickle.dumps(asked), grid
        self._reader = threading.Thread(target=self._read, args=arguments, daemon=True)
        self._reader.start()

    def end(self) -> None:
        """Stop showing anything."""
        if self._process is None or self._reader is None:
            return
        self._ended.set()
        self._process.kill()
        self._reader.join()
        self._process.wait()

    def _read(self, process: "subprocess.Popen[bytes]", request: bytes, grid: Grid) -> None:
        """In a thread of its own: show what the second process sends."""
        assert process.stdin is not None
        assert process.stdout is not None
        with suppress(BrokenPipeError), process.stdin:
            process.stdin.write(request)
        sums, count = np.zeros((grid.rows, grid.columns, 0)), np.zeros((grid.rows, grid.columns))
        due = 0.0
        with process.stdout as source:
            for batch in _batches(source):
                if sums.shape[2] == 0:
                    sums = np.zeros((grid.rows, grid.columns, len(batch[0][1])))
                for place, values in batch:
                    put(sums, count, place, values)
                if count.all() and time.monotonic() >= due:
                    self._show(self._pixels(sums, count))
                    due = time.monotonic() + _BETWEEN
        if count.all() and not self._ended.is_set():
            self._show(self._pixels(sums, count))

    def _pixels(self, sums: FloatArray, count: FloatArray) -> Any:
        """The picture as it would be written to a .png file."""
        rows, columns, width = sums.shape
        flat, job = sums.reshape(-1, width), jobs_of(self._scene)[0]
        named = {name: flat[:, part] for name, part in job.columns.items()} or {"colour": flat}
        found = layers_of(self._scene, named, count.reshape(-1).astype(np.int64))
        layers = {name: a.reshape(rows, columns, *a.shape[1:]) for name, a in found.items()}
        return eight_bits(display(Picture(layers, shown_of(self._scene))))


def _bytes_of(value: Any) -> int:
    """Of all arrays in a tuple, and in those within it."""
    if isinstance(value, tuple):
        return sum(map(_bytes_of, value))
    return value.nbytes if isinstance(value, np.ndarray) else 0


def put(sums: FloatArray, count: FloatArray, place: Place, values: FloatArray) -> None:
    """Add a sample to the sums and counts of a grid's pixels."""
    column, row, sample, width = place
    square = slice(row, row + width), slice(column, column + width)
    if sample == 0:
        sums[square], count[square] = values, 1.0
    else:
        sums[row, column] += values
        count[row, column] += 1.0


def _batches(source: IO[bytes]) -> Iterator[Batch]:
    """What the second process sends, until it ends."""
    with suppress(EOFError, pickle.UnpicklingError):
        while True:
            yield pickle.load(source)


def _answer() -> None:
    """The second process: from the arguments of a kernel on standard input to values of pixels."""
    tile, film_width, grid, samples = request()
    order, is_first = in_order(grid, samples), True
    with np.errstate(all="ignore"):
        while places := [*itertools.islice(order, _BATCH)]:
            if is_first and places[0].width < FIRST_STEP and hasattr(os, "nice"):
                os.nice(_NICE)  # there is a picture: kernels come first from now on
                is_first = False
            batch: Batch = []
            for place in places:
                pixel = (film_width * place.row + place.column) * grid.step
                batch.append((place, tile.add(pixel, place.sample)))
            pickle.dump(batch, sys.stdout.buffer)
            sys.stdout.buffer.flush()
