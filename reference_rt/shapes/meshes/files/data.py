"""`MeshData`, which every mesh file is read into, the checks for all formats, and how the parts of
a scene file are joined to one mesh.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from reference_rt.core import transform
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.diagnosis import FieldError


class NotReadError(ValueError):
    """A file may be sound, but is not read; the text says why, and what was expected."""


@dataclass(frozen=True, eq=False)
class MeshData:
    """A checked mesh.  A property that the file does not have for every vertex is None.

    Triangles are numbered in the order of the file, those of a polygon one after the other; those
    without area are included.  A vertex whose normal, uv or colour differs between faces is several
    vertices.  Polygons are cut into triangles by `polygons.triangulated`.
    """

    vertices: FloatArray
    """(n, 3), finite."""
    faces: IntArray
    """(m, 3) indices of vertices, m > 0, counter-clockwise seen from the front."""
    normals: FloatArray | None = None
    """(n, 3) unit vectors."""
    uv: FloatArray | None = None
    """(n, 2), finite; (0, 0) is the lower left corner of a picture, (1, 1) the upper right."""
    colours: FloatArray | None = None
    """(n, 3) linear sRGB, finite, not negative."""
    ignored: tuple[str, ...] = ()
    """Names of ignored parts of the file, as the format calls them."""
    doubtful: tuple[str, ...] = ()
    """What other programs read otherwise: concave polygons, attributes of some corners."""
    more_uv: FloatArray | None = None
    """(n, 2 k), finite: uv of the sets 1 to k."""


class RawMesh(NamedTuple):
    """`MeshData` as a reader returns it, before the checks: normals of any length."""

    vertices: npt.NDArray[Any]
    faces: npt.NDArray[Any]
    normals: npt.NDArray[Any] | None = None
    uv: npt.NDArray[Any] | None = None
    colours: npt.NDArray[Any] | None = None
    ignored: tuple[str, ...] = ()
    doubtful: tuple[str, ...] = ()
    more_uv: npt.NDArray[Any] | None = None


def checked(mesh: RawMesh) -> MeshData:
    """Checks a mesh.  Raises FieldError, whose text follows the file's name in a message."""
    if len(mesh.vertices) == 0 or len(mesh.faces) == 0:
        field = "faces" if len(mesh.vertices) else "vertices"
        raise FieldError(field, " is empty; expected vertices and faces")
    vertices = np.ascontiguousarray(mesh.vertices, np.float64)
    faces = np.ascontiguousarray(mesh.faces, np.int64)
    for name in ("normals", "uv", "more_uv", "colours"):
        values = getattr(mesh, name)
        if values is not None and len(values) != len(vertices):
            raise FieldError(
                name, f": {len(values)} {name} and {len(vertices)} vertices; expected one for each"
            )
    _expect_finite("vertices", vertices, "vertex {} is not finite; expected three finite numbers")
    if not 0 <= faces.min() <= faces.max() < len(vertices):
        outside = (faces < 0) | (faces >= len(vertices))
        bad = int(np.flatnonzero(outside.any(axis=1))[0])
        raise FieldError(
            "faces",
            f": face {bad} has index {faces[bad][outside[bad]][0]}, out of range; "
            f"expected 0 to {len(vertices) - 1}",
        )
    uv = more_uv = colours = None
    if mesh.uv is not None:
        uv = np.ascontiguousarray(mesh.uv, np.float64)
        _expect_finite("uv", uv, "the uv of vertex {} is not finite; expected two finite numbers")
    if mesh.more_uv is not None:
        more_uv = np.ascontiguousarray(mesh.more_uv, np.float64)
        _expect_finite("more_uv", more_uv, "the uv of vertex {} are not finite; expected numbers")
    if mesh.colours is not None:
        colours = np.ascontiguousarray(mesh.colours, np.float64)
        _expect_finite(
            "colours",
            np.where(colours < 0.0, np.nan, colours),
            "the colour of vertex {} is negative or not finite; expected numbers of at least 0",
        )
    said = mesh.ignored, mesh.doubtful
    return MeshData(vertices, faces, _unit(mesh.normals), uv, colours, *said, more_uv=more_uv)


def _expect_finite(field: str, rows: FloatArray, message: str) -> None:
    finite = np.isfinite(rows).all(axis=1)
    if not finite.all():
        raise FieldError(field, ": " + message.format(int(np.argmin(finite))))


def _unit(normals: npt.NDArray[Any] | None) -> FloatArray | None:
    if normals is None:
        return None
    n = np.asarray(normals, np.float64)
    largest = np.abs(n).max(axis=1)
    bad = ~((largest > 0.0) & np.isfinite(largest))
    if bad.any():
        raise FieldError(
            "normals",
            f": a vertex normal is zero or not finite, of vertex {int(np.argmax(bad))}; "
            "expected a direction",
        )
    n = n / largest[:, None]  # squares of extreme lengths overflow
    return np.ascontiguousarray(n / np.linalg.norm(n, axis=1, keepdims=True))


def linear(encoded: FloatArray) -> FloatArray:
    """Linear values of sRGB-encoded ones, 0 to 1 (IEC 61966-2-1)."""
    high = np.power((np.maximum(encoded, 0.04045) + 0.055) / 1.055, 2.4)
    return np.where(encoded <= 0.04045, encoded / 12.92, high)


LIMIT = 2**24
"""The most vertices, and triangles: about 1 GB.  A small file can name the same part any number of
times and must not fill the memory."""


def joined(parts: Iterable[tuple[RawMesh, transform.Affine]]) -> RawMesh:
    """Parts, each with its map (3, 4) to the scene.

    Normals, uv and colours that not all parts have are ignored.  For a map that flips orientation
    the winding is reversed, so that the front stays outside.  Raises ValueError for indices beyond
    their own part.
    """
    vertices, faces, n_vertices, n_faces = [], [], 0, 0
    others: dict[str, list[npt.NDArray[Any] | None]] = {"normals": [], "uv": [], "colours": []}
    names: dict[str, None] = {}  # a set in the order of the parts
    for part, m in parts:
        f = part.faces.astype(np.int64, copy=False)
        if f.size and not 0 <= f.min() <= f.max() < len(part.vertices):
            raise ValueError(
                f"a part of {len(part.vertices)} vertices has indices {f.min()} to {f.max()}"
            )
        n_faces += len(f)
        if max(n_vertices + len(part.vertices), n_faces) > LIMIT:
            raise ValueError(f"its parts have more than {LIMIT} vertices or triangles")
        mirrored = np.linalg.det(m[:, :3]) < 0.0
        vertices.append(transform.apply_points(m, np.asarray(part.vertices, np.float64)))
        normals = part.normals
        if normals is not None:
            normals = transform.apply_normals(m, normals.astype(np.float64))
        f = f[:, ::-1] if mirrored else f
        faces.append(n_vertices + f if n_vertices else f)
        n_vertices += len(part.vertices)
        for name, found in (("normals", normals), ("uv", part.uv), ("colours", part.colours)):
            others[name].append(found)
        names |= dict.fromkeys(part.ignored)
    if not vertices:
        return RawMesh(np.zeros((0, 3)), np.zeros((0, 3), np.int64))
    for name, values in others.items():
        if any(v is None for v in values) and any(v is not None for v in values):
            names[f"{name} of some parts"] = None
    return RawMesh(
        _one_after_another(vertices),
        _one_after_another(faces),
        normals=_all_or_none(others["normals"]),
        uv=_all_or_none(others["uv"]),
        colours=_all_or_none(others["colours"]),
        ignored=tuple(names),
    )


def _one_after_another(parts: list[npt.NDArray[Any]]) -> npt.NDArray[Any]:
    return parts[0] if len(parts) == 1 else np.concatenate(parts)


def _all_or_none(values: list[npt.NDArray[Any] | None]) -> FloatArray | None:
    found = [v for v in values if v is not None]
    return np.concatenate(found, dtype=np.float64) if len(found) == len(values) else None
