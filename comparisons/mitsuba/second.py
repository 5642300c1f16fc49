"""Meshes and images by other readers than ours: Mitsuba's own loaders, trimesh and lib3mf.

The rung `files` holds our tables against them, and the counterpart is made from them: a mesh that
we read 5 % too large is then too large in one renderer only.
"""

import functools
import re
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from comparisons.mitsuba.backend import mitsuba
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.image_files import open_image
from reference_rt.core.image_files.exr import ExrFile
from reference_rt.shapes import Mesh, Triangle
from reference_rt.shapes.meshes.topology import smooth_normals
from reference_rt.textures.image_file import COLOURS

ROUNDING = 2.0**-22
"""Of the largest number: a few roundings to float32, in which Mitsuba holds numbers."""

# ---- meshes --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Corners:
    """A mesh before its transform, by corners: points (n, 3, 3), and of these, or None, unit
    normals (n, 3, 3), uv (n, 3, 2), colours (n, 3, 3) and the uv of other sets (n, 3, 2 k).

    source: who says so;  silent: names of what it says nothing of;  bent: of normals that are made
    of those of the triangles around, by how much rounding may change each (n, 3);  doubtful: what
    other programs read otherwise.
    """

    points: FloatArray
    normals: FloatArray | None = None
    uv: FloatArray | None = None
    colours: FloatArray | None = None
    source: str = "the description"
    silent: tuple[str, ...] = ()
    bent: FloatArray | None = None
    doubtful: tuple[str, ...] = ()
    more_uv: FloatArray | None = None


def by_us(shape: Mesh | Triangle, folder: Path) -> Corners:
    """A mesh as our readers read it, with normals that we make."""
    if isinstance(shape, Triangle):
        return Corners(np.array([[shape.v0, shape.v1, shape.v2]]))
    data = shape.data(folder)
    arrays = (data.vertices, data.normals, data.uv, data.colours, data.more_uv)
    points, normals, uv, colours, more = (None if a is None else a[data.faces] for a in arrays)
    bent = None
    if shape.makes_normals(data):
        normals = smooth_normals(data.vertices, data.faces, data.uv).reshape(-1, 3, 3)
        bent = np.zeros(normals.shape[:2])
    elif shape.face_normals:
        normals = None
    assert points is not None
    found = Corners(points, normals, uv, colours, bent=bent, doubtful=data.doubtful)
    return replace(found, more_uv=more)


def by_second(shape: Mesh | Triangle, folder: Path, ours: Corners) -> Corners | None:
    """A mesh as its description and a second reader say, in our order if it has as many triangles.
    None where no second reader takes the file, or float32 does not hold it."""
    if isinstance(shape, Triangle):
        return ours
    if shape.file is None:
        faces = np.asarray(shape.faces)
        arrays = (shape.vertices, shape.normals, shape.uv, shape.colours)
        corners = Corners(*(None if a is None else np.asarray(a)[faces] for a in arrays))  # type: ignore[arg-type]
        if shape.more_uv is not None:
            corners = replace(corners, more_uv=np.asarray(shape.more_uv)[faces])
        if corners.normals is not None:
            corners = replace(corners, normals=_unit(corners.normals))
    else:
        path = folder / shape.file
        known = None if ours.doubtful else _read(path, path.stat().st_mtime_ns)
        if known is None:
            return None
        corners = _in_order(known, ours)
    if shape.face_normals:
        corners = replace(corners, normals=None, silent=tuple({*corners.silent} - {"normals"}))
    elif corners.normals is None and (
        ours.bent is not None or (shape.smooth and "normals" not in corners.silent)
    ):
        # In float32 the small triangles of a mesh that is far away would have other normals.
        points = _refined(corners.points, ours.points)
        uv = ours.uv if "uv" in corners.silent else corners.uv
        corners = _smoothed(replace(corners, points=points), uv)
    return corners


def described(shape: Mesh | Triangle, folder: Path) -> Corners:
    """A mesh for the counterpart: by the second reader.  Ours is taken for what that one does not
    say, and where it is the same in float32, for the digits which that lacks."""
    ours = by_us(shape, folder)
    theirs = by_second(shape, folder, ours)
    if theirs is None:
        return ours
    if len(theirs.points) != len(ours.points):
        return theirs
    columns: dict[str, Any] = {
        name: getattr(ours, name)
        if name in theirs.silent
        else _refined(getattr(theirs, name), getattr(ours, name))
        for name in ("points", "uv", "colours", "more_uv")
    }
    bent = None if theirs.bent is None else theirs.bent[:, :, None]
    normals = _refined(theirs.normals, ours.normals, bent)
    return replace(
        theirs, normals=ours.normals if "normals" in theirs.silent else normals, **columns
    )


def _refined(theirs: Any, ours: FloatArray | None, most: FloatArray | None = None) -> Any:
    """Ours where they differ by at most so much, by default by the rounding of float32."""
    if theirs is None or ours is None or theirs.shape != ours.shape:
        return theirs
    allowed = ROUNDING * np.abs(theirs).max(initial=0.0) if most is None else most
    return np.where(np.abs(theirs - ours) <= allowed, ours, theirs)


def _unit(v: FloatArray) -> FloatArray:
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))


def _smoothed(mesh: Corners, uv: FloatArray | None) -> Corners:
    """With normals of vertices: the mean of the triangles around, weighted by angle, where points
    and uv are equal (Thürmer and Wüthrich 1998, "Computing vertex normals from polygonal facets").
    """
    n = len(mesh.points)
    key = mesh.points if uv is None else np.concatenate([mesh.points, uv], axis=2)
    _, vertex = np.unique(key.reshape(3 * n, -1) + 0.0, axis=0, return_inverse=True)
    vertex = vertex.reshape(n, 3)
    after = _direction(np.roll(mesh.points, -1, axis=1) - mesh.points)
    before = -np.roll(after, 1, axis=1)
    sine = np.linalg.norm(np.cross(after, before), axis=2)
    normal = _direction(np.cross(after[:, 0], after[:, 1]))
    angle = np.arctan2(sine, (after * before).sum(axis=2))
    # The sides are rounded: of a triangle without width they do not tell where it faces.
    thinnest = sine.min(axis=1, initial=1.0)
    unknown = np.minimum(2.0, 2.0**-46 / np.maximum(thinnest, 2.0**-53))
    count = vertex.max() + 1
    total, error = np.zeros((count, 3)), np.zeros(count)
    np.add.at(total, vertex, angle[:, :, None] * normal[:, None])
    np.add.at(error, vertex, (angle + 2.0**-46) * unknown[:, None])
    length = np.linalg.norm(total, axis=1)
    known = np.asarray(length > error, np.bool_)
    bent = np.where(known, np.minimum(2.0, 2.0 * error / np.maximum(length, error)), 2.0)
    normals = np.where(known[vertex][..., None], _direction(total)[vertex], normal[:, None])
    silent = tuple({*mesh.silent} - {"normals"})
    return replace(mesh, normals=normals, bent=bent[vertex], silent=silent)


def _direction(v: FloatArray) -> FloatArray:
    """Vectors of any length but 0, made unit; 0 stays 0."""
    most = np.abs(v).max(axis=-1, keepdims=True)
    v = np.divide(v, most, out=np.zeros_like(v), where=most > 0.0)
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    return np.asarray(np.divide(v, length, out=v, where=length > 0.0))


@functools.lru_cache(maxsize=2)
def _read(path: Path, modified: int) -> Corners | None:
    """A file's mesh by the first second reader that takes it; None where none does, or where
    float32 does not hold its numbers."""
    for reader in READERS.get(path.suffix.lower(), ()):
        with suppress(Exception):  # of a library: it may refuse what ours has read
            corners = reader(path)
            if np.isfinite(corners.points).all():
                return corners
    return None


def _by_mitsuba(path: Path) -> Corners:
    mi, kind = mitsuba(), path.suffix[1:].lower()
    if kind == "ply" and _has_texcoord(path):
        raise ValueError("Mitsuba ignores texture coordinates of corners")
    own = {"flip_tex_coords": False} if kind == "obj" else {}
    mesh = mi.load_dict({"type": kind, "filename": str(path), **own})
    values = mi.traverse(mesh)
    faces = np.array(values["faces"], np.int64).reshape(-1, 3)

    def column(name: str, width: int) -> FloatArray:
        return np.array(values[f"vertex_{name}"], np.float64).reshape(-1, width)[faces]

    more: dict[str, Any] = {}
    if kind == "ply":
        more = _by_vertices(path, len(values["vertex_positions"]) // 3, faces)
    return Corners(
        column("positions", 3),
        column("normals", 3) if _has_normals(path) else None,
        column("texcoords", 2) if mesh.has_vertex_texcoords() else None,
        silent=() if kind == "ply" else ("colours",),
        source="Mitsuba's loader",
        **more,
    )


def _by_vertices(path: Path, vertices: int, faces: IntArray) -> dict[str, FloatArray]:
    """Colours and further uv of a .ply file's vertices, by trimesh; decoded as IEC 61966-2-1
    says."""
    header = path.read_bytes()[:_HEADER]
    if b" red" not in header and b" u1" not in header:  # trimesh need not read it all
        return {}
    import trimesh

    element = trimesh.load(path, process=False).metadata["_ply_raw"]["vertex"]
    if element["length"] != vertices:
        raise ValueError("trimesh finds another number of vertices")
    kinds, found = element["properties"], {}

    def column(*names: str) -> FloatArray:
        return np.stack([np.ravel(element["data"][name]) for name in names], axis=1)[faces]

    if {"red", "green", "blue"} <= {*kinds}:
        kind = np.dtype(kinds["red"])
        white = np.iinfo(kind).max if kind.kind == "u" else 1.0
        found["colours"] = _decoded(column("red", "green", "blue") / white)
    sets = sum(1 for name in kinds if re.fullmatch(r"u[1-9]", name))
    if sets:
        names = [f"{c}{k + 1}" for k in range(sets) for c in "uv"]
        found["more_uv"] = np.asarray(column(*names), np.float64)
    return found


_HEADER = 1 << 14
"""Bytes that hold the header of a .ply file."""


def _has_normals(path: Path) -> bool:
    """Whether a file has vertex normals: where it has none Mitsuba makes its own."""
    content = path.read_bytes()
    if path.suffix.lower() == ".obj":
        return b"\nvn " in content or content.startswith(b"vn ")
    return b" nx\n" in content[: content.find(b"end_header")].replace(b"\r", b"\n")


def _has_texcoord(path: Path) -> bool:
    """Whether a .ply file has texture coordinates of the corners of its faces."""
    return b" texcoord" in path.read_bytes()[:_HEADER].partition(b"end_header")[0]


TRIMESH = "trimesh"


def _by_trimesh(path: Path) -> Corners:
    import trimesh

    content, is_gltf = path.read_bytes(), path.suffix.lower() in (".gltf", ".glb")
    if is_gltf and b'"sparse"' in content:
        raise ValueError("trimesh ignores sparse accessors")
    if is_gltf and (b"_draco_" in content or b"_meshopt_" in content):
        raise ValueError("trimesh has the decoders that ours has, or none")
    scene = trimesh.load(path, process=False, force="scene")
    columns: dict[str, list[Any]] = {"points": [], "normals": [], "uv": []}
    for node in scene.graph.nodes_geometry:
        matrix, name = scene.graph[node]
        mesh = scene.geometry[name]
        if hasattr(mesh, "faces"):
            columns["points"].append(trimesh.transform_points(mesh.vertices, matrix)[mesh.faces])
            if is_gltf:
                normals = mesh.vertex_normals[mesh.faces] @ np.linalg.inv(matrix[:3, :3])
                columns["normals"].append(_direction(normals))
                uv = getattr(mesh.visual, "uv", None)
                columns["uv"].append(None if uv is None else uv[mesh.faces])
    arrays: dict[str, Any] = {}
    silent = ["colours", "more_uv"]
    for name, key in (("points", b"POSITION"), ("normals", b"NORMAL"), ("uv", b"TEXCOORD_0")):
        said = content.count(b'"%s"' % key)
        whole = is_gltf and said == content.count(b'"POSITION"')
        if name == "points" or (whole and not any(c is None for c in columns[name])):
            arrays[name] = np.concatenate(columns[name])
        elif said or not is_gltf:
            # trimesh makes normals where a file has none, and drops uv without a material.
            silent.append(name)
    if path.suffix.lower() == ".ply" and _has_texcoord(path):
        (mesh,) = scene.geometry.values()
        columns_of_faces = mesh.metadata["_ply_raw"]["face"]["data"]
        found = columns_of_faces["texcoord"]
        found = found if isinstance(columns_of_faces, dict) else found["f1"]
        arrays["uv"] = np.reshape(np.asarray(found, np.float64), (-1, 3, 2))
        silent.remove("uv")
    return Corners(**arrays, source=TRIMESH, silent=tuple(silent))


def _by_lib3mf(path: Path) -> Corners:
    """Items and components of a .3mf file, in millimetres, by the library of the 3MF Consortium."""
    import lib3mf

    model = lib3mf.get_wrapper().CreateModel()
    model.QueryReader("3mf").ReadFromFile(str(path))
    parts: list[FloatArray] = []

    def add(part: Any, outer: FloatArray) -> None:
        if part.IsMeshObject():
            points = np.array([[*p.Coordinates] for p in part.GetVertices()]).reshape(-1, 3)
            faces = np.array([[*f.Indices] for f in part.GetTriangleIndices()], np.int64)
            parts.append((points @ outer[:3] + outer[3])[faces.reshape(-1, 3)])
        for k in range(part.GetComponentCount() if part.IsComponentsObject() else 0):
            one = part.GetComponent(k)
            inner = _rows_of(one.GetTransform()) if one.HasTransform() else np.eye(4, 3)
            add(one.GetObjectResource(), inner @ outer[:3] + np.eye(4)[:, 3:] * outer[3])

    items = model.GetBuildItems()
    while items.MoveNext():
        item = items.GetCurrent()
        place = _rows_of(item.GetObjectTransform()) if item.HasObjectTransform() else np.eye(4, 3)
        add(item.GetObjectResource(), place)
    unit = _MILLIMETRES[model.GetUnit().name]
    silent = ("normals", "uv", "colours", "more_uv")
    return Corners(unit * np.concatenate(parts), source="lib3mf", silent=silent)


_MILLIMETRES = {
    "MicroMeter": 0.001,
    "MilliMeter": 1.0,
    "CentiMeter": 10.0,
    "Inch": 25.4,
    "Foot": 304.8,
    "Meter": 1000.0,
}


def _rows_of(transform: Any) -> FloatArray:
    """(4, 3): a map of rows on its left, the last row its translation."""
    return np.array([[*row] for row in transform.Fields], np.float64)


READERS: dict[str, tuple[Callable[[Path], Corners], ...]] = {
    ".obj": (_by_mitsuba, _by_trimesh),
    ".ply": (_by_mitsuba, _by_trimesh),  # Mitsuba refuses polygons
    **dict.fromkeys((".stl", ".off", ".gltf", ".glb"), (_by_trimesh,)),
    ".3mf": (_by_lib3mf,),
}
"""The second readers of each format: never the library that ours reads it with."""


def _in_order(theirs: Corners, ours: Corners) -> Corners:
    """trimesh's triangles may have another order, and begin at another corner: the nearest one of
    theirs for each of ours."""
    if theirs.source != TRIMESH or len(theirs.points) != len(ours.points):
        return theirs
    if np.abs(theirs.points - ours.points).max() <= ROUNDING * np.abs(ours.points).max():
        return theirs
    tree, n = cKDTree(theirs.points.mean(axis=1)), len(ours.points)
    turned = (np.arange(3) + np.arange(3)[:, None]) % 3  # by one, two, no corners
    rows, turns = np.empty((n, 1), np.int64), np.empty((n, 3), np.int64)
    for block in np.array_split(np.arange(n), n // 65536 + 1):  # each triangle takes a kilobyte
        own = ours.points[block]
        near = tree.query(own.mean(axis=1), k=min(4, n))[1].reshape(len(block), -1)
        error = np.abs(theirs.points[near][:, :, turned] - own[:, None, None]).max(axis=(3, 4))
        best = error.reshape(len(block), -1).argmin(axis=1)
        rows[block, 0], turns[block] = near[np.arange(len(block)), best // 3], turned[best % 3]
    columns: dict[str, Any] = {
        name: None if (c := getattr(theirs, name)) is None else c[rows, turns]
        for name in ("points", "normals", "uv")
    }
    return replace(theirs, **columns)


# ---- images --------------------------------------------------------------------------------------


def image(path: Path, encoding: str, layer: str, channel: str = "all") -> FloatArray | None:
    """An image (h, w, 3) as Mitsuba reads it, in linear values, `encoding`, `layer` and `channel`
    as of `Bitmap`; None where it does not, or reads something else."""
    if layer or channel == "alpha" or encoding == "radiance":
        return None
    opened = open_image(path)
    # Mitsuba reads no deep pixels, and takes samples of chroma for those of the pixels' middles.
    if getattr(opened, "gamma", None) is not None or (
        isinstance(opened, ExrFile) and (opened.is_deep or opened.chromaticities)
    ):
        return None
    mi = mitsuba()
    try:
        bitmap = mi.Bitmap(str(path))
    except RuntimeError:
        return None
    if encoding in ("raw", "srgb"):
        bitmap.set_srgb_gamma(encoding == "srgb")
    formats = mi.Bitmap.PixelFormat
    if bitmap.pixel_format() not in (formats.Y, formats.YA, formats.RGB, formats.RGBA):
        return None
    # Mitsuba's own decoding approximates the curve, and beyond 1 it is another one.
    is_srgb = bitmap.srgb_gamma()
    bitmap.set_srgb_gamma(False)
    values = np.array(bitmap.convert(formats.RGB, mi.Struct.Type.Float64, False), np.float64)
    values = _decoded(values) if is_srgb else values
    if channel == "all":
        return values
    return np.repeat(values[..., COLOURS.index(channel), None], 3, axis=2)


def reads_image(path: Path, encoding: str, layer: str) -> bool:
    """Whether Mitsuba reads of an image what we do, or it is none, which is said elsewhere."""
    with suppress(OSError, ValueError):
        return image(path, encoding, layer) is not None
    return True


def _decoded(encoded: FloatArray) -> FloatArray:
    """Linear values of sRGB, by IEC 61966-2-1."""
    high = ((np.maximum(encoded, 0.0) + 0.055) / 1.055) ** 2.4
    return np.asarray(np.where(encoded > 0.04045, high, encoded / 12.92))


INEXACT = (".jpg", ".jpeg")
"""Formats whose decoders may differ by a few codes."""


def rounding_of(path: Path, theirs: FloatArray, scale: float) -> FloatArray:
    """By how much an image, times `scale`, may differ between readers: Mitsuba divides codes by 255
    in float32, which the curve's power makes 2.4 times as inexact."""
    if path.suffix.lower() in INEXACT:
        return 0.02 * scale + 0.05 * np.abs(theirs)
    return 2.0**-21 * np.abs(theirs)


def described_image(
    path: Path, encoding: str, scale: float, layer: str, ours: FloatArray, channel: str = "all"
) -> FloatArray:
    """An image for the counterpart, times `scale`: as Mitsuba reads it.  Ours (h, w, 3) is taken
    where Mitsuba does not read it, and where it is the same but for rounding."""
    theirs = image(path, encoding, layer, channel)
    if theirs is None:
        return ours
    theirs = theirs * scale
    if theirs.shape != ours.shape:
        return theirs
    return np.where(np.abs(ours - theirs) <= rounding_of(path, theirs, scale), ours, theirs)
