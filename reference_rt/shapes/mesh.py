"""Mesh: triangles from an .obj or .ply file."""

import io
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
        vertices = transform.apply_points(m, data.vertices)[data.faces]
        normals = None
        if data.normals is not None and not self.face_normals:
            normals = transform.apply_normals(m, data.normals)[data.faces].reshape(-1, 9)
        triangles = triangle.soup(
            np.ascontiguousarray(vertices.reshape(-1, 9)), normals, shape, material
        )
        # Without area there is no normal, but rounding alone makes rays hit: left out, where the
        # others keep their numbers.
        has_area = triangle.areas(triangles) > 0.0
        if not has_area.any():
            raise ValueError(f"mesh {folder / self.file}: no triangle has any area")
        columns: list[Any] = [None if a is None else a[has_area] for a in triangles]
        return triangle.Triangles(*columns)


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
    from trimesh.exchange import obj  # costs 0.3 s to import, and few scenes have meshes

    _check_obj_indices(content)
    return _only_geometry(
        obj.load_obj(io.BytesIO(content), skip_materials=True, maintain_order=True)
    )


def _check_obj_indices(content: bytes) -> None:
    """trimesh drops faces whose indices are out of range; a reference renderer must not."""
    counts = {b"v": 0, b"vt": 0, b"vn": 0}
    for number, line in enumerate(content.splitlines(), start=1):
        words = line.split()
        if not words:
            continue
        if words[0] in counts:
            counts[words[0]] += 1
        elif words[0] == b"f":
            for corner in words[1:]:
                for kind, text in zip((b"v", b"vt", b"vn"), corner.split(b"/"), strict=False):
                    if text:
                        _check_index(number, kind.decode(), int(text), counts[kind])


def _check_index(line: int, kind: str, index: int, count: int) -> None:
    if index == 0 or abs(index) > count:
        raise ValueError(f"line {line}: index {index} of {count} '{kind}' lines is out of range")


def _load_ply(content: bytes) -> dict[str, Any]:
    from trimesh.exchange import ply

    return _only_geometry(ply.load_ply(io.BytesIO(content), skip_materials=True))


def _only_geometry(loaded: dict[str, Any]) -> dict[str, Any]:
    """The arrays of one mesh from those of the groups that a file has."""
    parts = list(loaded["geometry"].values()) if "geometry" in loaded else [loaded]
    if not parts:
        return {}
    keys = [k for k in ("vertices", "vertex_normals") if all(k in p for p in parts)]
    joined = {k: np.concatenate([p[k] for p in parts]) for k in keys}
    starts = np.cumsum([0, *(len(p["vertices"]) for p in parts[:-1])])
    if all(p.get("faces") is not None for p in parts):
        joined["faces"] = np.concatenate(
            [p["faces"] + start for p, start in zip(parts, starts, strict=True)]
        )
    return joined


def _checked(path: Path, arrays: dict[str, Any]) -> MeshData:
    vertices, faces = arrays.get("vertices"), arrays.get("faces")
    if vertices is None or faces is None or len(vertices) == 0 or len(faces) == 0:
        raise ValueError(f"mesh {path} is empty; expected vertices and faces")
    vertices = np.ascontiguousarray(vertices, dtype=np.float64)
    faces = np.ascontiguousarray(faces, dtype=np.int64)
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
    if not np.all(lengths > 0.0):
        raise ValueError(f"mesh {path}: a vertex normal is zero or not finite")
    return MeshData(vertices, faces, np.asarray(normals / lengths, dtype=np.float64))
