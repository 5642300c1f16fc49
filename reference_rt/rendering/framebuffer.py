"""`Framebuffer`: the sums of a picture while it is rendered, all in memory or band by band on
disk."""

import math
import time
from collections.abc import Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.rendering.accumulation import Sums
from reference_rt.rendering.checkpoint import Band, Checkpoint
from reference_rt.rendering.noise import BETWEEN, COLUMNS, PASSES
from reference_rt.rendering.units import BAND, Unit, chunk_of

_MOST_WRITING = 4
"""Bands that may wait to be written: more would need memory, and save no time."""


class Framebuffer:
    """The sums of all pixels.  Used by one thread; another one writes bands to the store.

    done (chunks,), statistics (chunks, COLUMNS): see `Band`, of the whole picture.
    """

    def __init__(
        self,
        widths: Mapping[str, int],
        pixels: int,
        store: Checkpoint | None = None,
        budget: int | None = None,
    ) -> None:
        """store: has bands of a former run, and takes those of this one;  budget: bytes of bands
        that are in memory at a time, while others are in the store; None: all."""
        self.widths, self.pixels, self.chunk = dict(widths), pixels, chunk_of(pixels)
        count = -(-pixels // self.chunk)
        self.done = np.zeros(count, np.int64)
        self.statistics = np.zeros((count, COLUMNS))
        self._busy = np.zeros(count, np.bool_)
        self._store, self._budget = store, math.inf if budget is None else budget
        self._bands: dict[int, Band] = {}
        self._changed: set[int] = set()
        self._to_save: list[int] = []
        self._writing: dict[int, Future[float]] = {}
        self._writer = ThreadPoolExecutor(1, thread_name_prefix="writer")
        if budget is None:
            whole = {name: np.zeros((pixels, width)) for name, width in widths.items()}
            for k in range(self.bands):
                begin, end = self._pixels_of(k)
                sums = {name: array[begin:end] for name, array in whole.items()}
                chunks = self._chunks_of(k)
                self._bands[k] = Band(sums, self.done[chunks], self.statistics[chunks])
            self.whole: Sums | None = whole
        else:
            self.whole = None
        if store is not None:
            for k in range(self.bands):
                self._read(k)
                if budget is not None:  # only to know what there is of it
                    del self._bands[k]

    @property
    def bands(self) -> int:
        """The number of bands."""
        return -(-self.pixels // BAND)

    def close(self) -> None:
        """End the thread that writes, after what it has to write."""
        self._writer.shutdown()

    def samples(self) -> IntArray:
        """The samples (pixels,) of each pixel, read only."""
        if len(set(self.done.tolist())) == 1:  # no array of as many numbers as the picture has
            return np.broadcast_to(self.done[0], self.pixels)
        return np.repeat(self.done, self.chunk)[: self.pixels]

    # ---- units ----------------------------------------------------------------------------------

    def left(self, unit: Unit) -> list[Unit]:
        """What is left to do of a unit: with its pixels' own samples so far, which are others than
        planned where another run has written to the same store."""
        self._band(unit.begin // BAND)
        found: list[Unit] = []
        for k in range(unit.begin // self.chunk, -(-unit.end // self.chunk)):
            first, end = int(self.done[k]), min((k + 1) * self.chunk, self.pixels)
            if first >= unit.last:
                continue
            last = found[-1] if found else None
            if last is not None and (last.end, last.first) == (k * self.chunk, first):
                found[-1] = last._replace(end=end)
            else:
                found.append(Unit(k * self.chunk, end, first, unit.last))
        return found

    def is_free(self, unit: Unit) -> bool:
        """Whether none of its pixels is being computed."""
        return not self._busy[self._chunks(unit)].any()

    def take(self, unit: Unit) -> Sums:
        """A copy of the sums of its pixels, which are being computed from now on."""
        band, rows = self._band(unit.begin // BAND), self._rows(unit)
        self._busy[self._chunks(unit)] = True
        return {name: array[rows].copy() for name, array in band.sums.items()}

    def put(self, unit: Unit, sums: Sums, statistics: FloatArray) -> None:
        """Store what was computed of a unit."""
        k, chunks = unit.begin // BAND, self._chunks(unit)
        band, rows = self._band(k), self._rows(unit)
        for name, array in band.sums.items():
            array[rows] = sums[name]
        added = slice(BETWEEN, PASSES + 1)
        statistics[:, added] += self.statistics[chunks, added]
        own = slice(chunks.start - self._chunks_of(k).start, chunks.stop - self._chunks_of(k).start)
        self.done[chunks] = band.done[own] = unit.last
        self.statistics[chunks] = band.statistics[own] = statistics
        self._changed.add(k)
        self._busy[chunks] = False

    def forget(self, unit: Unit) -> None:
        """Nothing was computed of a unit: its sums stay as they were."""
        self._busy[self._chunks(unit)] = False

    # ---- reading and writing --------------------------------------------------------------------

    def begin_saving(self) -> None:
        """From now on `save` writes the bands that have changed."""
        self._to_save = sorted(self._changed, reverse=True)

    def save(self, wait: bool = False) -> float | None:
        """Go on with writing; the seconds that it has taken since the last call, None once all is
        written.  wait: until then.  Raises ImageError for what could not be written."""
        seconds = 0.0
        while True:
            idle = [k for k in self._writing if wait or self._writing[k].done()]
            seconds += sum(self._wait(k) for k in idle)
            while self._to_save and len(self._writing) < _MOST_WRITING:
                k = self._to_save.pop()
                if k in self._bands and k in self._changed and k not in self._writing:
                    self._write(k, self._bands[k].copy())
            if not self._writing:
                return None if seconds == 0.0 else seconds
            if not wait:
                return seconds

    def slices(self, pixels: int) -> Iterator[tuple[slice, Sums, IntArray]]:
        """Runs of so many pixels: which, their sums, and their samples (n,).  Raises ImageError
        if another run has changed the store."""
        for begin in range(0, self.pixels, pixels):
            end = min(begin + pixels, self.pixels)
            parts = [self._part(k, begin, end) for k in range(begin // BAND, -(-end // BAND))]
            sums = {name: np.concatenate([p[name] for p in parts]) for name in self.widths}
            counts: IntArray = self.done[np.arange(begin, end) // self.chunk]
            yield slice(begin, end), sums, counts

    def _part(self, k: int, begin: int, end: int) -> Sums:
        start, stop = self._pixels_of(k)
        rows = slice(max(begin, start) - start, min(end, stop) - start)
        return {name: array[rows] for name, array in self._band(k).sums.items()}

    # ---- bands ----------------------------------------------------------------------------------

    def _band(self, k: int) -> Band:
        """Band k, which is in memory from now on, and others perhaps not any more."""
        if k in self._bands:
            return self._bands[k]
        if k in self._writing:
            self._wait(k)
        size = min(BAND, self.pixels) * 8 * sum(self.widths.values())
        while self._bands and (len(self._bands) + 1) * size > self._budget:
            idle = (j for j in self._bands if not self._busy[self._chunks_of(j)].any())
            oldest = next(idle, None)  # dictionaries keep the order in which bands were read
            if oldest is None:
                break
            band = self._bands.pop(oldest)
            if oldest in self._changed:
                self._write(oldest, band)
                if len(self._writing) > _MOST_WRITING:
                    self._wait(next(iter(self._writing)))
        self._read(k)
        return self._bands[k]

    def _read(self, k: int) -> None:
        """Read band k, or begin it with zeros."""
        begin, end = self._pixels_of(k)
        chunks = self._chunks_of(k)
        count = chunks.stop - chunks.start
        sums = {name: np.zeros((end - begin, width)) for name, width in self.widths.items()}
        empty = Band(sums, np.zeros(count, np.int64), np.zeros((count, COLUMNS)))
        found = None if self._store is None else self._store.read(k, empty)
        found = empty if found is None else found
        self.done[chunks], self.statistics[chunks] = found.done, found.statistics
        if self.whole is None:
            self._bands[k] = found
        else:
            for name, array in found.sums.items():
                self.whole[name][begin:end] = array

    def _write(self, k: int, band: Band) -> None:
        assert self._store is not None
        store = self._store

        def write() -> float:
            start = time.perf_counter()
            store.write(k, band)
            return time.perf_counter() - start

        self._changed.discard(k)
        self._writing[k] = self._writer.submit(write)

    def _wait(self, k: int) -> float:
        try:
            return self._writing[k].result()
        except BaseException:
            self._changed.add(k)  # to be written again
            raise
        finally:
            del self._writing[k]

    def _pixels_of(self, k: int) -> tuple[int, int]:
        return k * BAND, min((k + 1) * BAND, self.pixels)

    def _chunks_of(self, k: int) -> slice:
        begin, end = self._pixels_of(k)
        return slice(begin // self.chunk, -(-end // self.chunk))

    def _chunks(self, unit: Unit) -> slice:
        return slice(unit.begin // self.chunk, -(-unit.end // self.chunk))

    def _rows(self, unit: Unit) -> slice:
        start = unit.begin // BAND * BAND
        return slice(unit.begin - start, unit.end - start)
