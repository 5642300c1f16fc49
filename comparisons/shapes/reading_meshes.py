"""Meshes of Mitsuba scenes, in world coordinates, with normals and uv as Mitsuba has them.

Mitsuba shades by the vertex normals alone; ours asks the triangle which side is the front, for
lamps.  So triangles are turned where their vertex normals point the other way."""

import struct
import zlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from comparisons.mitsuba.node import Node, Reading
from comparisons.mitsuba.parse import as_transform, scalar
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.transform import Affine, apply_points, flattens
from reference_rt.shapes import Mesh
from reference_rt.shapes.meshes.files import read_mesh
from reference_rt.shapes.meshes.files.data import MeshData, RawMesh, checked
from reference_rt.shapes.meshes.topology import smooth_normals, unit
from reference_rt.shapes.meshes.triangle_table import geometric_normals
from reference_rt.util.files import read_input
from reference_rt.util.memory import check_unpacked

# ---- Mitsuba's `.serialized` meshes, of versions 3 and 4 -----------------------------------------
# Several meshes in a file, each compressed. Layout (src/shapes/serialized.cpp): two shorts, the
# format's number and the version; a zlib stream; at the end of the file the offsets of all meshes
# (u64, in version 3 u32) and their number (u32). The stream: flags (u32); in version 4 a name,
# which ends with a null byte; the numbers of vertices and triangles (u64); positions, and normals,
# uv and colours as the flags say, in float or double; indices (u32).


_FORMAT = 0x041C
_NORMALS, _UV, _COLOURS, _DOUBLE = 0x0001, 0x0002, 0x0008, 0x2000

_HEAD = 1 << 16
"""Bytes of a stream in which its flags, its name and its sizes lie."""


def read(content: bytes, index: int) -> RawMesh:
    """Mesh number `index` of a file.  Raises ValueError (what is wrong, what was expected)."""
    version = _header(content, 0)
    start = 0
    if index != 0:
        start = _offset(content, version, index)
        version = _header(content, start)
    unpacker = zlib.decompressobj()
    try:
        stream = _Stream(unpacker.decompress(content[start + 4 :], _HEAD), index)
        (flags,) = stream.numbers("<u4", 1).tolist()
        if version == 4:
            stream.skip_name()
        vertices, faces = (int(n) for n in stream.numbers("<u8", 2).tolist())
        real = "<f8" if flags & _DOUBLE else "<f4"
        each = 3 + 3 * bool(flags & _NORMALS) + 2 * bool(flags & _UV) + 3 * bool(flags & _COLOURS)
        size = stream.place + np.dtype(real).itemsize * each * vertices + 12 * faces
        check_unpacked(len(content) - start, size, f"mesh {index}")
        if size > len(stream.data):
            rest = unpacker.decompress(unpacker.unconsumed_tail, size - len(stream.data))
            stream.data += rest
    except zlib.error as error:
        raise ValueError(f"mesh {index} cannot be unpacked: {error}") from None
    positions = stream.numbers(real, 3 * vertices).reshape(-1, 3)
    normals = stream.numbers(real, 3 * vertices).reshape(-1, 3) if flags & _NORMALS else None
    uv = stream.numbers(real, 2 * vertices).reshape(-1, 2) if flags & _UV else None
    if flags & _COLOURS:
        stream.numbers(real, 3 * vertices)  # which Mitsuba ignores, too
    indices = stream.numbers("<u4", 3 * faces).reshape(-1, 3)
    return RawMesh(positions, indices.astype(np.int64), normals, uv)


def _header(content: bytes, start: int) -> int:
    """The version of the mesh at this offset."""
    if len(content) < start + 4:
        raise ValueError("the file ends before its header; expected a .serialized mesh")
    number, version = struct.unpack_from("<HH", content, start)
    if number != _FORMAT:
        raise ValueError(f"begins with {number:#06x}; expected {_FORMAT:#06x}, a .serialized mesh")
    if version not in (3, 4):
        raise ValueError(f"has version {version}; expected 3 or 4")
    return int(version)


def _offset(content: bytes, version: int, index: int) -> int:
    if len(content) < 8:
        raise ValueError("the file ends before its table of meshes")
    (count,) = struct.unpack_from("<I", content, len(content) - 4)
    if not 0 <= index < count:
        raise ValueError(f"has {count} meshes; expected a 'shape_index' from 0 to {count - 1}")
    size, kind = (8, "<Q") if version == 4 else (4, "<I")
    place = len(content) - 4 - size * (count - index)
    if place < 4:
        raise ValueError("the file ends before its table of meshes")
    (start,) = struct.unpack_from(kind, content, place)
    return int(start)


class _Stream:
    def __init__(self, data: bytes, index: int) -> None:
        self.data, self.index, self.place = data, index, 0

    def numbers(self, kind: str, count: int) -> npt.NDArray[Any]:
        size = np.dtype(kind).itemsize * count
        if size > len(self.data) - self.place:
            raise ValueError(f"mesh {self.index} ends early: {len(self.data)} bytes unpacked")
        found = np.frombuffer(self.data, kind, count, self.place)
        self.place += size
        return found

    def skip_name(self) -> None:
        end = self.data.find(b"\0", self.place)
        if end < 0:
            raise ValueError(f"mesh {self.index} has a name without an end")
        self.place = end + 1


# ---- meshes --------------------------------------------------------------------------------------


@dataclass
class Surface:
    """A mesh: vertices (n, 3), faces (m, 3), and per vertex, or None, unit normals (n, 3), uv
    (n, 2) and colours (n, 3)."""

    vertices: FloatArray
    faces: IntArray
    normals: FloatArray | None = None
    uv: FloatArray | None = None
    colours: FloatArray | None = None

    def with_own_corners(self) -> "Surface":
        """The same with three vertices for each triangle."""
        corners = self.faces.ravel()
        normals, uv, colours = (
            None if x is None else x[corners] for x in (self.normals, self.uv, self.colours)
        )
        faces = np.arange(len(corners)).reshape(-1, 3)
        return Surface(self.vertices[corners], faces, normals, uv, colours)


def mesh(reading: Reading, node: Node, material: str | None) -> Mesh:
    """An obj, ply or serialized mesh."""
    path = reading.file(node)
    m, of_normals = node.maps(may_flatten=True)
    flat, flip = node.flag("face_normals"), node.flag("flip_normals")
    if node.plugin == "serialized":
        data = _data(reading, node, path, node.integer("shape_index", 0))
        upside_down = False
    else:
        data = _data(reading, node, path)
        upside_down = node.flag("flip_tex_coords", node.plugin == "obj")
    if data.doubtful:
        reading.note(
            node,
            f"{path.name} has {' and '.join(data.doubtful)}: Mitsuba cuts polygons into fans about "
            "their first corner, and has no values of its own where the file has none",
        )
    if data.normals is not None and not flat and flattens(m):
        raise node.error(
            "'to_world' flattens a mesh with normals, which Mitsuba refuses, too; expected a map "
            "that can be undone, or 'face_normals'"
        )
    uv = data.uv
    if uv is not None and upside_down:
        uv = np.column_stack([uv[:, 0], 1.0 - uv[:, 1]])
    surface = Surface(data.vertices, data.faces, None if flat else data.normals, uv)
    surface = placed(surface, m, of_normals, smooth=not flat)
    names = {
        reading.attributes[t] for t in reading.textures_of(material) if t in reading.attributes
    }
    if names:
        surface = _coloured(node, surface, names, path)
    found = finished(surface, flip, reading.uses_uv(material), material)
    is_made = data.normals is None and not flat
    if names or flip or is_made or np.linalg.det(m[:, :3]) < 0.0 or not is_normal(m, of_normals):
        return found
    assert found.faces is not None
    if not np.array_equal(found.faces, data.faces):
        return found
    # As the file has it, under the author's transform.
    normals = None if found.normals is None else data.normals
    steps: Any = as_transform(node.written(), m)
    update = {"vertices": data.vertices, "normals": normals, "uv": uv, "transform": steps}
    return Mesh(faces=data.faces, face_normals=normals is None, material=material, **update)


def is_normal(m: Affine, of_normals: FloatArray) -> bool:
    """Whether `of_normals` is the inverse transpose of m: see `Node.maps`."""
    product = m[:, :3] @ of_normals.T
    return bool(np.abs(product - np.eye(3)).max() <= 1e-9)


def _data(reading: Reading, node: Node, path: Path, index: int = 0) -> MeshData:
    key = (path, index, node.plugin)
    if key not in reading.meshes:
        try:
            if node.plugin == "serialized":
                data = checked(read(read_input(path), index))
            else:
                if path.suffix.lower() != f".{node.plugin}":
                    raise ValueError(f"{path} is no .{node.plugin} file; expected one")
                data = read_mesh(path)
        except OSError as error:
            raise node.error(f"{path} cannot be read: {error.strerror}; expected a mesh") from None
        except ValueError as error:
            text = str(error)
            raise node.error(text if str(path) in text else f"{path}: {text}") from None
        reading.meshes[key] = data
    found: MeshData = reading.meshes[key]
    return found


def placed(surface: Surface, m: Affine, of_normals: FloatArray, smooth: bool) -> Surface:
    """The surface under the map m of points and `of_normals` of normals.

    smooth: make normals where it has none, as Mitsuba does: in the world, a vertex being what the
    file has for one.
    """
    vertices = apply_points(m, surface.vertices)
    if surface.normals is not None:
        normals: FloatArray | None = unit(surface.normals @ of_normals.T)
    elif smooth:
        normals = _smoothed(vertices, surface.faces)
    else:
        normals = None
    return replace(surface, vertices=vertices, normals=normals)


def _smoothed(vertices: FloatArray, faces: IntArray) -> FloatArray:
    # As if each vertex had a uv of its own: vertices at one place stay several.
    apart = np.zeros((len(vertices), 2))
    apart[:, 0] = np.arange(len(vertices))
    at_corners = smooth_normals(vertices, faces, apart).reshape(-1, 3)
    normals = np.tile([1.0, 0.0, 0.0], (len(vertices), 1))  # Mitsuba's of a vertex without a face
    normals[faces.ravel()] = at_corners
    return normals


def finished(surface: Surface, flip: bool, uses_uv: bool, material: str | None) -> Mesh:
    """Our mesh.  flip: turn it inside out;  uses_uv: whether its material depends on its uv."""
    if surface.normals is None:
        turned = np.full(len(surface.faces), flip)
    else:
        geometric = geometric_normals(surface.vertices[surface.faces].reshape(-1, 9))
        towards = surface.normals[surface.faces].sum(axis=1)
        turned = (np.einsum("ij,ij->i", geometric, towards) < 0.0) ^ flip
    if uses_uv and surface.uv is None and turned.any():
        # Without uv they are barycentric, in the order of the corners.
        surface = surface.with_own_corners()
        uv = np.tile([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], (len(surface.faces), 1))
        surface = replace(surface, uv=uv)
    faces = surface.faces.copy()
    faces[turned] = faces[turned][:, [0, 2, 1]]
    normals = surface.normals
    if normals is not None and flip:
        normals = -normals
    if normals is not None and _are_flat(surface.vertices[faces], normals[faces]):
        normals = None
    return Mesh(
        vertices=surface.vertices,
        faces=faces,
        normals=normals,
        uv=surface.uv,
        colours=surface.colours,
        face_normals=normals is None,
        material=material,
    )


def _are_flat(corners: FloatArray, normals: FloatArray) -> bool:
    """Whether all vertex normals (m, 3, 3) are those of the triangles (m, 3, 3) themselves, to
    float32: a mesh without vertex normals is the simpler scene."""
    own = unit(geometric_normals(corners.reshape(-1, 9)))
    return bool(np.abs(normals - own[:, None, :]).max() < 2.0**-22)


def _coloured(node: Node, surface: Surface, names: set[str], path: Path) -> Surface:
    """The surface with the colours of the attribute that its material shows."""
    if len(names) > 1:
        raise node.error(
            f"its material shows several attributes ({', '.join(sorted(names))}); expected one"
        )
    (name,) = names
    values = _attributes(node, path)
    if name not in values:
        raise node.error(f"{path} has no attribute '{name}'; expected one of: {', '.join(values)}")
    if name.startswith("face_"):
        surface = surface.with_own_corners()
        rows, count = np.repeat(np.arange(len(surface.faces)), 3), len(surface.faces)
    else:
        rows, count = np.arange(len(surface.vertices)), len(surface.vertices)
    table = np.asarray(values[name], np.float64).reshape(count, -1)
    if table.shape[1] == 1:
        table = np.repeat(table, 3, axis=1)
    if table.shape[1] != 3:
        raise node.error(f"attribute '{name}' has {table.shape[1]} numbers; expected 1 or 3")
    return replace(surface, colours=table[rows])


def _attributes(node: Node, path: Path) -> dict[str, Any]:
    """Attributes of a file's vertices and faces, as Mitsuba reads and names them: the order is the
    file's."""
    if node.plugin != "ply":
        return {}
    with scalar() as mi:
        try:
            values = mi.traverse(mi.load_dict({"type": "ply", "filename": str(path)}))
        except RuntimeError as error:
            raise node.error(f"{path}: {' '.join(str(error).split())}") from None
        return {
            str(key): np.array(values[key])
            for key in dict(values)
            if str(key).startswith(("vertex_", "face_"))
            and str(key) not in ("vertex_positions", "vertex_normals", "vertex_texcoords")
        }
