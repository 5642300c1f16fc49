"""Compressed meshes of glTF files, by libraries: KHR_draco_mesh_compression by DracoPy,
EXT_meshopt_compression, and KHR_meshopt_compression of the same form, by meshopt.

Both are in the extra `gltf`.  Where one is missing the message names the extension and the extra.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from reference_rt.core.arrays import IntArray
from reference_rt.shapes.meshes.files.data import NotReadError
from reference_rt.util.memory import check_unpacked

DRACO = "KHR_draco_mesh_compression"
MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")

_MODES = ("ATTRIBUTES", "TRIANGLES", "INDICES")
_FILTERS = ("NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL", "COLOR")


class DracoMesh(NamedTuple):
    """faces (m, 3);  attributes: (n, width) by their unique number."""

    faces: IntArray
    attributes: dict[int, npt.NDArray[Any]]


def draco(data: bytes) -> DracoMesh:
    """A mesh that Draco compressed.  Raises ValueError."""
    try:
        import DracoPy
    except ImportError:
        raise _missing("DracoPy", DRACO) from None
    try:
        found = DracoPy.decode(data)
    except Exception as error:  # the library's own classes
        raise ValueError(f"its data of {DRACO} are damaged: {error}") from None
    if not hasattr(found, "faces"):
        raise ValueError(f"its data of {DRACO} are no mesh")
    return DracoMesh(
        np.asarray(found.faces, np.int64).reshape(-1, 3),
        {int(one["unique_id"]): np.asarray(one["data"]) for one in found.attributes},
    )


def meshopt(data: bytes, part: dict[str, Any], extension: str, name: str) -> bytes:
    """The bytes of a view.  part: the extension's object in it;  name: of the view.  Raises
    ValueError."""
    count, size = part.get("count"), part.get("byteStride")
    mode, decode = part.get("mode"), part.get("filter", "NONE")
    if mode not in _MODES or decode not in _FILTERS:
        raise ValueError(f"{name} has mode {str(mode)[:20]!r}, filter {str(decode)[:20]!r}")
    if type(count) is not int or type(size) is not int or not (count > 0 and 0 < size <= 256):
        raise ValueError(f"{name} has {str(count)[:20]} rows of {str(size)[:20]} bytes")
    check_unpacked(len(data), count * size, name)
    try:
        from meshopt import decode_gltf_buffer
    except ImportError:
        raise _missing("meshopt", extension) from None
    return np.asarray(decode_gltf_buffer(data, count, size, mode, decode)).tobytes()


def _missing(library: str, extension: str) -> NotReadError:
    return NotReadError(
        f"its data are compressed by {extension}, which {library} reads; expected: "
        "pip install 'reference-rt[gltf]'"
    )
