"""Mesh files: `read_mesh` reads one and checks it; one module per format.

A reader takes the content of a file, and its folder, and returns a `RawMesh`: arrays as the file
has them, polygons cut into triangles, and the names of what it ignored.  It raises ValueError with
the line or the element at fault.  Indices, finiteness and lengths are checked for all formats
alike, in `data.checked`.

Readers of our own where trimesh would silently change a file's content: it takes cut .stl and .off
files for whole or empty ones, gives a vertex of an .obj one normal for all of its faces and leaves
out faces that do not exist, refuses binary .ply files of mixed polygons, fills missing data of a
.gltf file with zeros, however much that is, and mixes objects of the same number in different parts
of a .3mf file.  It reads every other format.

Reading a file runs no code, and opens no file that it names, except buffers of a .gltf file in its
folder.

To add a format: a module with `read`, a line in `_READERS`, a row in the tests of damaged files.
"""

import codecs
from collections.abc import Callable
from pathlib import Path

import numpy as np

from reference_rt.shapes.meshes.files import gltf, obj, other, ply, threemf
from reference_rt.shapes.meshes.files.data import MeshData, NotReadError, RawMesh, checked
from reference_rt.util.files import read_input, wide_encoding

__all__ = ["MeshData", "read_mesh"]

Reader = Callable[[bytes, Path], RawMesh]
"""From a file's content and its folder."""

_READERS: dict[str, Reader] = {
    ".obj": lambda content, folder: obj.read(content),
    ".ply": lambda content, folder: ply.read(content),
    ".stl": lambda content, folder: other.read_stl(content),
    ".off": lambda content, folder: other.read_off(content),
    ".glb": gltf.read_glb,
    ".gltf": gltf.read_gltf,
    ".3mf": lambda content, folder: threemf.read(content),
}

_TEXTS = {".obj", ".ply", ".stl", ".off"}
"""Formats that are, or may be, text in ASCII."""


def read_mesh(path: Path) -> MeshData:
    """Read and check a mesh.  Raises ValueError with one line that names the file."""
    suffix = path.suffix.lower()
    reader = _READERS.get(suffix)
    content = _content(path)
    if suffix in _TEXTS - {".stl"}:  # some editors begin texts with a byte-order mark
        content = content.removeprefix(codecs.BOM_UTF8)
    if reader is None and (reader := other.reader(suffix)) is None:
        known = ", ".join([*_READERS, *other.suffixes()])
        raise ValueError(f"mesh {path}: '{suffix}' is not supported; expected one of {known}")
    if not content.strip():
        raise ValueError(f"mesh {path} is empty; expected vertices and faces")
    try:
        with np.errstate(all="ignore"):  # the checks find overflow and NaN
            raw = _parsed(path, reader, content)
            try:
                return checked(raw)
            except ValueError as error:
                raise ValueError(f"mesh {path}{error}") from None
    except ValueError:
        # What a file is said to lack is there, but in an encoding that its format has not.
        if suffix in _TEXTS and (encoding := wide_encoding(content)):
            message = f"is a text in {encoding}; expected ASCII or UTF-8"
            raise ValueError(f"mesh {path} {message}") from None
        raise


def _parsed(path: Path, reader: Reader, content: bytes) -> RawMesh:
    try:
        return reader(content, path.parent)
    except MemoryError:
        raise ValueError(f"mesh {path}: it does not fit into memory") from None
    except NotReadError as error:
        raise ValueError(f"mesh {path} cannot be read: {error}") from None
    except Exception as error:
        # Any error of parsing, also one raised inside a library, means a malformed file.
        detail = (str(error).splitlines() or [""])[0][:200]
        if not isinstance(error, ValueError):
            detail = f"{type(error).__name__} {detail}"
        raise ValueError(f"mesh {path} is malformed: {detail}") from None


def _content(path: Path) -> bytes:
    try:
        return read_input(path)
    except OSError as error:
        raise ValueError(f"cannot read mesh {path}: {error.strerror}; expected a file") from None
