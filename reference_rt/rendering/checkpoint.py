"""`Checkpoint`: the samples of a picture in files, so that a render that is ended goes on later.

A checkpoint is a folder with a file per band of pixels.  Each file is written whole or not at all,
and carries a digest of all that its sums depend on, and a checksum: a file that is damaged, or of
another scene, another version or another part of the picture is never used.  No lock is needed:
what is written is correct whoever writes it, and of two files of one band either can be used.
"""

import functools
import hashlib
import json
import shutil
import struct
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.rendering.accumulation import Sums
from reference_rt.sampling import Grid
from reference_rt.scene.build import BuiltScene
from reference_rt.textures.bitmap import Memory
from reference_rt.util.files import delete_unfinished, read_input, replacing


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
    for part in _parts(tables.parts):
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
