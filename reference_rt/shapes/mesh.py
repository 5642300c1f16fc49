"""Mesh: triangles from an .obj or .ply file."""

import io
import itertools
import math
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from reference_rt import transform
from reference_rt.shapes import triangle
from reference_rt.shapes.shape import FloatArray, Shape


class Mesh(Shape):
    """The triangles of a file.  Normals: by winding; shading normals: the file's, if it has any."""

    type: Literal["mesh"] = "mesh"
    file: str
    """An .obj or .ply file; a relative name counts from the scene file's folder."""
    face_normals: bool = False
    """Shade with each triangle's own normal, whatever the file has."""

    def tabulate(self, shape: int, material: int, folder: Path) -> triangle.Triangles:
        m = transform.affine(self.transform)
        transform.invert(m)  # refuses singular maps
        data = read_mesh(folder / self.file)
        vertices = transform.apply_points(m, data.vertices)[data.faces].reshape(-1, 9)
        normals = None
        if data.normals is not None and not self.face_normals:
            normals = transform.apply_normals(m, data.normals)[data.faces].reshape(-1, 9)
        # Without area there is no normal, but rounding alone makes rays hit: left out.
        has_area = np.linalg.norm(triangle.geometric_normals(vertices), axis=1) > 0.0
        if not has_area.any():
            raise ValueError(f"mesh {folder / self.file}: no triangle has any area")
        normals = None if normals is None else np.ascontiguousarray(normals[has_area])
        return triangle.soup(np.ascontiguousarray(vertices[has_area]), normals, shape, material)


class MeshData:
    """vertices (n, 3), faces (m, 3) of indices into them, unit vertex normals (n, 3) or None."""

    def __init__(
        self,
        vertices: FloatArray,
        faces: npt.NDArray[np.int64],
        normals: FloatArray | None,
    ) -> None:
        self.vertices, self.faces, self.normals = vertices, faces, normals


def read_mesh(path: Path) -> MeshData:
    """Read and check a mesh.  Raises ValueError with one line that names the file."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ValueError(f"cannot read mesh {path}: {error.strerror}; expected a file") from None
    suffix = path.suffix.lower()
    if suffix not in (".obj", ".ply"):
        raise ValueError(f"mesh {path}: '{suffix}' is not supported; expected .obj or .ply")
    try:
        arrays = _load_obj(content) if suffix == ".obj" else _load_ply(content)
    except MemoryError:
        raise ValueError(f"mesh {path}: its counts do not fit in memory") from None
    except Exception as error:
        # trimesh raises whatever its parsing stumbles over: any of it means a malformed file.
        detail = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ValueError(f"mesh {path} is malformed: {detail}") from None
    return _checked(path, arrays)


def _load_obj(content: bytes) -> dict[str, Any]:
    """Vertices, their normals and faces of an .obj file; polygons become fans of triangles.

    Not by trimesh: it gives a vertex one normal for all of its faces, counts negative indices from
    the end of the file and leaves out faces whose indices are out of range, all silently.
    """
    rows: dict[bytes, list[tuple[float, ...]]] = {b"v": [], b"vn": [], b"vt": []}
    numbers: dict[tuple[int, int], int] = {}  # of each pair of a position and a normal
    faces: list[tuple[int, int, int]] = []
    for line, text in enumerate(content.splitlines(), start=1):
        words = text.partition(b"#")[0].split()
        try:
            if words and words[0] in rows:
                rows[words[0]].append(_obj_numbers(words))
            elif words and words[0] == b"f":
                ring = [numbers.setdefault(_obj_corner(w, rows), len(numbers)) for w in words[1:]]
                if len(ring) < 3:
                    raise ValueError("a face has fewer than three corners")
                faces += [(ring[0], b, c) for b, c in itertools.pairwise(ring[1:])]
        except ValueError as error:
            raise ValueError(f"line {line}: {error}") from None
    positions = [rows[b"v"][v] for v, _ in numbers]
    arrays: dict[str, Any] = {"vertices": np.array(positions), "faces": np.array(faces)}
    if all(n >= 0 for _, n in numbers):
        arrays["vertex_normals"] = np.array([rows[b"vn"][n] for _, n in numbers])
    return arrays


def _obj_numbers(words: list[bytes]) -> tuple[float, ...]:
    numbers = tuple(float(w) for w in words[1:4])
    if words[0] != b"vt" and not (len(numbers) == 3 and all(map(math.isfinite, numbers))):
        raise ValueError(f"'{words[0].decode()}' needs three finite numbers")
    return numbers


def _obj_corner(word: bytes, rows: dict[bytes, list[tuple[float, ...]]]) -> tuple[int, int]:
    """Indices, from 0, of the position and the normal of "v", "v/vt", "v//vn" or "v/vt/vn"; -1 for
    no normal.  A negative index counts back from the latest row before it."""
    found = {b"v": -1, b"vt": -1, b"vn": -1}
    for kind, text in zip((b"v", b"vt", b"vn"), word.split(b"/"), strict=False):
        if text or kind == b"v":
            count = len(rows[kind])
            index = int(text)
            if index == 0 or abs(index) > count:
                raise ValueError(
                    f"index {index} of {count} '{kind.decode()}' lines is out of range"
                )
            found[kind] = index - 1 if index > 0 else count + index
    return found[b"v"], found[b"vn"]


def _load_ply(content: bytes) -> dict[str, Any]:
    from trimesh.exchange import ply  # costs 0.3 s to import, and few scenes have meshes

    loaded: dict[str, Any] = ply.load_ply(io.BytesIO(content), skip_materials=True)
    return loaded


def _checked(path: Path, arrays: dict[str, Any]) -> MeshData:
    vertices, faces = arrays.get("vertices"), arrays.get("faces")
    if vertices is None or faces is None or len(vertices) == 0 or len(faces) == 0:
        raise ValueError(f"mesh {path} is empty; expected vertices and faces")
    vertices = np.ascontiguousarray(vertices, dtype=np.float64)
    corners = np.shape(faces)[1]
    fans = [(0, k, k + 1) for k in range(1, corners - 1)]
    faces = np.ascontiguousarray(np.asarray(faces, np.int64)[:, fans].reshape(-1, 3))
    if not np.all(np.isfinite(vertices)):
        bad = int(np.flatnonzero(~np.isfinite(vertices).all(axis=1))[0])
        raise ValueError(f"mesh {path}: vertex {bad} is not finite")
    outside = (faces < 0) | (faces >= len(vertices))
    if np.any(outside):
        bad = int(np.flatnonzero(outside.any(axis=1))[0])
        raise ValueError(
            f"mesh {path}: face {bad} has index {faces[bad][outside[bad]][0]}, out of range; "
            f"expected 0 to {len(vertices) - 1}"
        )
    normals = arrays.get("vertex_normals")
    if normals is None or len(normals) != len(vertices):
        return MeshData(vertices, faces, None)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    if not np.all((lengths > 0.0) & np.isfinite(lengths)):
        raise ValueError(f"mesh {path}: a vertex normal is zero or not finite")
    return MeshData(vertices, faces, np.asarray(normals / lengths, dtype=np.float64))
