"""`Framebuffer`: the sums of a picture while it is rendered, all in memory or band by band on disk;
`Checkpoint`: the same in files, so that a render that is ended goes on later.
"""

import functools
import hashlib
import json
import math
import shutil
import struct
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.rendering.accumulation import Sums
from reference_rt.rendering.noise import BETWEEN, COLUMNS, PASSES
from reference_rt.rendering.units import BAND, Unit, chunk_of
from reference_rt.sampling import Grid
from reference_rt.scene.build import BuiltScene
from reference_rt.textures.bitmap import Memory
from reference_rt.util.files import delete_unfinished, read_input, replacing

_MOST_WRITING = 4
"""Bands that may wait to be written: more would need memory, and save no time."""


class Band(NamedTuple):
    """A band of pixels.  sums: by name, (pixels, width);  done (chunks,): samples of each chunk;
    statistics (chunks, COLUMNS): see `noise`."""

    sums: Sums
    done: IntArray
    statistics: FloatArray

    def copy(self) -> "Band":
        sums = {name: array.copy() for name, array in self.sums.items()}
        return Band(sums, self.done.copy(), self.statistics.copy())

    @property
    def bytes(self) -> int:
        """Bytes of its sums."""
        return sum(array.nbytes for array in self.sums.values())


class Framebuffer:
    """The sums of all pixels.  Used by one thread; another one writes bands to the store.

    done (chunks,), statistics (chunks, COLUMNS): see `Band`, of the whole picture.
    """

    def __init__(
        self,
        widths: Mapping[str, int],
        pixels: int,
        store: "Checkpoint | None" = None,
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
        """The samples (pixels,) of each pixel."""
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


# ---- checkpoints ---------------------------------------------------------------------------------
# A checkpoint is a folder with a file per band of pixels.  Each file is written whole or not at
# all, and carries a digest of all that its sums depend on, and a checksum: a file that is damaged,
# or of another scene, another version or another part of the picture is never used.  No lock is
# needed: what is written is correct whoever writes it, and of two files of one band either can be
# used.

_MAGIC = b"reference_rt samples 1\n"
_HEAD = struct.Struct("<32sqq")
"""The digest of the render, the number of the band, and of bytes that follow the checksum."""

_CHECKSUM_BYTES = 32


class Checkpoint:
    """The bands of one render in a folder: what a `Framebuffer` keeps on disk."""

    def __init__(self, folder: Path, digest: Callable[[], bytes], resume: bool = True) -> None:
        """folder: has a folder for each render, which is made when the first band is written;
        digest: see `render_digest`: called when it is needed, since it takes a second for a large
        scene;  resume: whether bands of former runs are read."""
        self._parent, self._make_digest, self._resume = folder, digest, resume
        self._written: set[int] = set()

    @functools.cached_property
    def _digest(self) -> bytes:
        return self._make_digest()

    @functools.cached_property
    def folder(self) -> Path:
        """The folder of this render."""
        folder = self._parent / self._digest.hex()[:16]
        delete_unfinished(folder)
        return folder

    def exists(self) -> bool:
        """Whether there is any file of a band, usable or not."""
        return any(self.folder.glob("band-*.samples"))

    @property
    def is_used(self) -> bool:
        """Whether this run has written a band, or may have read one."""
        return bool(self._written) or (self._resume and self.exists())

    def path(self, k: int) -> Path:
        """The file of band k."""
        return self.folder / f"band-{k:06d}.samples"

    def read(self, k: int, empty: Band) -> Band | None:
        """Band k, of the shape of `empty`; None unless its file is whole and of this render."""
        if not self._resume and k not in self._written:
            return None
        try:
            content = read_input(self.path(k))
        except OSError:
            return None
        parts = [empty.done, empty.statistics, *empty.sums.values()]
        size = sum(part.nbytes for part in parts)
        head = _MAGIC + _HEAD.pack(self._digest, k, size)
        start = len(head) + _CHECKSUM_BYTES
        if len(content) != start + size or not content.startswith(head):
            return None
        payload = memoryview(content)[start:]
        if content[len(head) : start] != _checksum(head, payload):
            return None
        found, at = [], 0
        for part in parts:
            array = np.frombuffer(payload, part.dtype, part.size, at).reshape(part.shape)
            found.append(array.copy())
            at += part.nbytes
        sums = dict(zip(empty.sums, found[2:], strict=True))
        return Band(sums, found[0], found[1])

    def write(self, k: int, band: Band) -> None:
        """Write band k.  Raises ImageError: the former file is as it was."""
        parts = [band.done, band.statistics, *band.sums.values()]
        payload = b"".join(np.ascontiguousarray(part).data.cast("B") for part in parts)
        head = _MAGIC + _HEAD.pack(self._digest, k, len(payload))
        with replacing(self.path(k)) as temporary, temporary.open("wb") as file:
            file.write(head)
            file.write(_checksum(head, payload))
            file.write(payload)
        self._written.add(k)


def _checksum(head: bytes, payload: Any) -> bytes:
    digest = hashlib.blake2b(head, digest_size=_CHECKSUM_BYTES)
    digest.update(payload)
    return digest.digest()


def render_digest(scene: BuiltScene, tables: SceneTables) -> bytes:
    """The digest of all that a picture's sums depend on: sources, camera, film, sampler, integrator
    and the scene's tables, with what files they were read from; not the number of samples, unless
    the samples depend on it."""
    sampler: Any = scene.resolved_sampler
    if not isinstance(sampler, Grid):
        sampler = sampler.model_copy(update={"spp": 1})
    description = [
        json.loads(part.model_dump_json())
        for part in (scene.camera, scene.film, sampler, scene.integrator)
    ]
    digest = hashlib.blake2b(sources_digest(), digest_size=32)
    digest.update(json.dumps(description, sort_keys=True).encode())
    for part in _parts(tables):
        digest.update(part)
    return digest.digest()


def _parts(table: Any) -> Iterator[Any]:
    """The bytes of a table, and what tells types and shapes apart."""
    if isinstance(table, np.ndarray):
        yield f"{table.dtype.str}{table.shape}".encode()
        yield np.ascontiguousarray(table).data.cast("B") if table.size else b""
    elif isinstance(table, Memory):
        yield from _parts(table.codes8)  # the others are the same bytes
    elif isinstance(table, tuple):
        yield f"{type(table).__name__}{len(table)}".encode()
        for part in table:
            yield from _parts(part)
    else:
        yield repr(table).encode()


@functools.cache
def sources_digest() -> bytes:
    """The digest of this package's sources and of NumPy's version."""
    package = Path(__file__).parents[1]
    digest = hashlib.blake2b(np.__version__.encode(), digest_size=32)
    for source in sorted(package.rglob("*.py")):
        digest.update(source.relative_to(package).as_posix().encode() + b"\0")
        digest.update(hashlib.blake2b(source.read_bytes()).digest())
    return digest.digest()


_UNUSED_FOR = 14 * 24 * 3600.0
"""Seconds without being written after which a render is deleted."""


def delete_old(folder: Path) -> None:
    """Delete the renders in a folder that nobody has gone on with for long.  Errors are ignored:
    another process may be deleting the same ones."""
    with suppress(OSError):
        for render in folder.iterdir():
            with suppress(OSError):
                if time.time() - render.stat().st_mtime > _UNUSED_FOR:
                    shutil.rmtree(render, ignore_errors=True)
