"""The rung `files`: whether our tables hold what the scene's files and descriptions say.

The other rungs compare two renderers that are fed from our readers and our tables: a mesh that we
read 5 % too large is too large in both.  Here each shape and image is held against sources that
share nothing with them:

- files of meshes: Mitsuba's own loader (.obj, .ply), or trimesh (.stl, .off, .gltf, .glb), for
  corners, faces, normals and uv;
- images: Mitsuba's own loader, and its conversion to linear values;
- transforms: Mitsuba's own functions, step by step, in float64, and the inverse transpose for
  normals;
- spheres, boxes, cylinders, ...: the equation of the description's own numbers, at the points and
  for the normals that our tracer finds.

What no second source reads is counted, and named.
"""

import warnings
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from comparisons.geometry.equations import EQUATIONS
from comparisons.mitsuba.reading.parse import scalar
from comparisons.results.case import RungResult
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.image_files import open_image
from reference_rt.lights import EnvironmentMap
from reference_rt.rendering.scene import Scene
from reference_rt.shapes import (
    Box,
    Disk,
    Mesh,
    Plane,
    Quadric,
    Rectangle,
    Sphere,
    Torus,
    Triangle,
)
from reference_rt.shapes.shape import Shape, Solid, TabulationContext
from reference_rt.textures import Bitmap

FLOAT32 = 2.0**-24
"""The rounding of the numbers that Mitsuba holds."""

LEAST32 = 2.0**-126
"""The least number that float32 holds with all of its bits."""

MOST_TRIANGLES = 4_000_000
"""Triangles of a scene after which no further mesh is checked: these take some seconds."""

MOST_SHAPES = 200
"""Most shapes of a scene that are checked, evenly chosen: a shape takes some milliseconds."""

RAYS = 64
"""Rays at a shape without a table of corners."""


@dataclass
class Found:
    """checked: how many of each kind;  unread: what no second source reads;  differences: what
    differs, the first one first;  read: meshes of second sources, by file;  triangles: how many
    have been compared."""

    checked: dict[str, int] = field(default_factory=dict)
    unread: list[str] = field(default_factory=list)
    differences: list[str] = field(default_factory=list)
    read: dict[Path, "tuple[Second, str] | None"] = field(default_factory=dict)
    triangles: int = 0

    def count(self, kind: str) -> None:
        self.checked[kind] = self.checked.get(kind, 0) + 1


def files(scene: Scene) -> RungResult:
    """Compare what we hold of a scene's shapes and images with second sources."""
    found = Found()
    shapes = list(_shapes(scene))
    step = max(1, -(-len(shapes) // MOST_SHAPES))
    with scalar() as mi, warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")  # they were issued when the scene was built
        for where, shape in shapes[::step]:
            _check_shape(mi, where, shape, scene.folder, found)
        for name, texture in scene.textures.items():
            if isinstance(texture, Bitmap):
                _check_bitmap(mi, f"textures.{name}", texture, scene.folder, found)
        for i, light in enumerate(scene.lights):
            if isinstance(light, EnvironmentMap):
                _check_environment(mi, f"lights[{i}]", light, scene.folder, found)
    numbers: dict[str, Any] = {"checked": found.checked, "unread": sorted(set(found.unread))}
    if found.differences:
        more = len(found.differences) - 1
        others = f"; and {more} more" if more else ""
        return RungResult("files", "differ", found.differences[0] + others, numbers)
    if not found.checked:
        return RungResult(
            "files", "not-applicable", "no file or shape has a second source", numbers
        )
    facts = ", ".join(f"{count} {kind}" for kind, count in sorted(found.checked.items()))
    left_out = f"; without a second source: {', '.join(numbers['unread'])}"
    reason = f"as second sources say: {facts}{left_out if found.unread else ''}"
    return RungResult("files", "agree", reason, numbers)


def _shapes(scene: Scene) -> Iterator[tuple[str, Shape]]:
    """Every shape of a scene with its place: those of groups and the operands of solids, too."""
    groups = ((f"groups.{name}", shapes) for name, shapes in scene.groups.items())
    waiting = [
        (f"{place}[{i}]", shape)
        for place, shapes in (("shapes", scene.shapes), *groups)
        for i, shape in reversed(list(enumerate(shapes)))
    ]
    while waiting:
        place, shape = waiting.pop()
        if isinstance(shape, Solid):
            waiting += [(f"{place}.of[{i}]", one) for i, one in enumerate(shape.of)]
        else:
            yield f"{place} ({type(shape).__name__.lower()})", shape


def _check_shape(mi: Any, where: str, shape: Shape, folder: Path, found: Found) -> None:
    if isinstance(shape, Mesh):
        _check_mesh(mi, where, shape, folder, found)
    elif isinstance(shape, Triangle):
        corners = np.array([[shape.v0, shape.v1, shape.v2]])
        second = Second(corners, None, None)
        table = shape.tabulate(TabulationContext(folder=folder))
        _compare(where, "the description", table, second, _matrix(mi, shape), found)
        found.count("triangles")
    elif type(shape) in EQUATIONS:
        _check_equation(mi, where, shape, found)
    else:
        found.unread.append(type(shape).__name__.lower())


# ---- transforms ----------------------------------------------------------------------------------


def _matrix(mi: Any, described: Any) -> FloatArray:
    """The transform (4, 4) of a description, by Mitsuba's functions in float64."""
    known = mi.ScalarTransform4d
    total = known()
    for step in described.transform:
        match step.model_dump():
            case {"translate": offset}:
                one = known().translate(list(offset))
            case {"scale": factors}:
                one = known().scale(list(factors))
            case {"rotate": {"axis": axis, "degrees": degrees}}:
                unit = np.array(axis) / np.linalg.norm(axis)
                one = known().rotate(unit.tolist(), degrees)
            case {"matrix": rows}:
                one = known(np.vstack([rows, [[0.0, 0.0, 0.0, 1.0]]]))
        total = one @ total
    return np.array(total.matrix, np.float64)


# ---- meshes --------------------------------------------------------------------------------------


class Second(NamedTuple):
    """A mesh of a second source, before its transform: corners (n, 3, 3), and at these, or None,
    unit normals (n, 3, 3) and uv (n, 3, 2)."""

    corners: FloatArray
    normals: FloatArray | None
    uv: FloatArray | None


def _check_mesh(mi: Any, where: str, mesh: Mesh, folder: Path, found: Found) -> None:
    if found.triangles > MOST_TRIANGLES:
        found.unread.append(f"meshes beyond {MOST_TRIANGLES:,} triangles")
        return
    table = mesh.tabulate(TabulationContext(folder=folder))
    found.triangles += len(table.face)
    if mesh.file is None:
        assert mesh.vertices is not None
        assert mesh.faces is not None
        faces = np.asarray(mesh.faces)
        vertices: Any
        vertices, normals, uv = (None if a is None else a[faces] for a in _arrays(mesh))
        second, source = Second(vertices, normals, uv), "the description"
    else:
        path = folder / mesh.file
        suffix = path.suffix.lower()
        if mesh.data(folder).doubtful:
            found.unread.append(f"{suffix} of concave polygons, or with uv and normals in part")
            return
        if path not in found.read:
            found.read[path] = _second(mi, path)
        if (known := found.read[path]) is None:
            found.unread.append(f"{suffix} that no other reader takes, or beyond float32")
            return
        second, source = known
    if mesh.face_normals:
        second = second._replace(normals=None)
    _compare(where, source, table, second, _matrix(mi, mesh), found, made=mesh.smooth)
    found.count("meshes")


def _second(mi: Any, path: Path) -> "tuple[Second, str] | None":
    """A mesh by the first second reader that takes it; None where none does, or where float32 does
    not hold the numbers."""
    for reader in READERS.get(path.suffix.lower(), ()):
        with suppress(Exception):  # of a library: it may refuse what ours has read
            second, source = reader(mi, path)
            if np.isfinite(second.corners).all():
                return second, source
    return None


def _arrays(mesh: Mesh) -> tuple[Any, Any, Any]:
    normals = mesh.normals
    if normals is not None:
        normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    return mesh.vertices, normals, mesh.uv


def _of_mitsuba(mi: Any, path: Path) -> tuple[Second, str]:
    kind = path.suffix[1:].lower()
    own = {"flip_tex_coords": False} if kind == "obj" else {}
    mesh = mi.load_dict({"type": kind, "filename": str(path), **own})
    values = mi.traverse(mesh)
    faces = np.array(values["faces"], np.int64).reshape(-1, 3)
    columns: list[Any] = []
    for name, width, is_there in (
        ("vertex_positions", 3, True),
        ("vertex_normals", 3, _has_normals(path)),
        ("vertex_texcoords", 2, mesh.has_vertex_texcoords()),
    ):
        rows = np.array(values[name], np.float64).reshape(-1, width) if is_there else None
        columns.append(None if rows is None else rows[faces])
    return Second(*columns), "Mitsuba's loader"


def _has_normals(path: Path) -> bool:
    """Whether a file has vertex normals: where it has none Mitsuba makes its own."""
    content = path.read_bytes()
    if path.suffix.lower() == ".obj":
        return b"\nvn " in content or content.startswith(b"vn ")
    return b" nx\n" in content[: content.find(b"end_header")].replace(b"\r", b"\n")


TRIMESH = "trimesh"


def _of_trimesh(mi: Any, path: Path) -> tuple[Second, str]:
    import trimesh

    if path.suffix.lower() in (".gltf", ".glb") and b'"sparse"' in path.read_bytes():
        raise ValueError("trimesh ignores sparse accessors")
    scene = trimesh.load(path, process=False, force="scene")
    parts = [
        trimesh.transform_points(scene.geometry[name].vertices, matrix)[scene.geometry[name].faces]
        for matrix, name in (scene.graph[node] for node in scene.graph.nodes_geometry)
        if hasattr(scene.geometry[name], "faces")
    ]
    return Second(np.concatenate(parts), None, None), TRIMESH


READERS: dict[str, tuple[Callable[[Any, Path], tuple[Second, str]], ...]] = {
    ".obj": (_of_mitsuba, _of_trimesh),
    ".ply": (_of_mitsuba, _of_trimesh),  # Mitsuba refuses polygons
    **dict.fromkeys((".stl", ".off", ".gltf", ".glb"), (_of_trimesh,)),
}
"""The second readers of each format: never the library that ours reads it with."""


def _compare(
    where: str,
    source: str,
    table: Any,
    second: Second,
    matrix: FloatArray,
    found: Found,
    made: bool = False,
) -> None:
    """A table of triangles against a second source under a transform.  made: whether normals that
    the source does not have are made."""
    linear, offset = matrix[:3, :3], matrix[:3, 3]
    order = [0, 2, 1] if np.linalg.det(linear) < 0.0 else [0, 1, 2]  # the front stays the front
    corners = (second.corners @ linear.T + offset)[:, order]
    kept: IntArray = table.face
    if len(kept) and kept.max() >= len(corners):
        found.differences.append(
            f"{where}: has {kept.max() + 1} triangles; {source} finds {len(corners)}"
        )
        return
    sides = corners[:, 1:] - corners[:, :1]
    area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    # A product of three rounded numbers, of the size of the coordinates.
    size = np.abs(second.corners) @ np.abs(linear).T + np.abs(offset)
    rounding = 4.0 * FLOAT32 * float(size.max(initial=0.0)) + LEAST32 * float(np.abs(linear).max())
    longest = np.linalg.norm(sides, axis=-1).max(axis=1, initial=0.0)
    lost = np.ones(len(corners), bool)
    lost[kept] = False
    if (seen := np.flatnonzero(lost & (area > 8.0 * rounding * (longest + rounding)))).size:
        found.differences.append(
            f"{where}: lacks triangle {seen[0]} of {len(corners)}, which {source} has"
        )
        return
    n = len(kept)
    if source == TRIMESH:
        corners[kept] = _matched(table.vertices.reshape(n, 3, 3), corners)
    expected: list[tuple[str, FloatArray | None, FloatArray | None, float]] = [
        ("is at", table.vertices.reshape(n, 3, 3), corners[kept], rounding)
    ]
    if second.normals is not None:
        normals = second.normals[kept][:, order] @ np.linalg.inv(linear)
        normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
        ours = None if table.normals is None else table.normals.reshape(n, 3, 3)
        bent = 16.0 * FLOAT32 * float(np.linalg.cond(linear))
        expected.append(("has the normal", ours, normals, bent))
    elif table.normals is not None and not made:
        found.differences.append(f"{where}: has vertex normals; {source} finds none")
    if second.uv is not None:
        uv = second.uv[kept][:, order]
        ours = None if table.uvs is None else table.uvs.reshape(n, 3, 2)
        most = 4.0 * FLOAT32 * float(np.abs(uv).max(initial=1.0))
        expected.append(("has the uv", ours, uv, most))
    for what, ours, theirs, most in expected:
        if theirs is None:
            continue
        if ours is None:
            found.differences.append(f"{where}: no corner {what} that {source} finds")
            continue
        error = np.abs(ours - theirs).max(axis=-1)
        if (error > most).any():
            k, corner = np.unravel_index(int(error.argmax()), error.shape)
            found.differences.append(
                f"{where}: corner {corner} of triangle {kept[k]} {what} "
                f"{_text(ours[k, corner])}; {source} has {_text(theirs[k, corner])}"
            )


def _matched(ours: FloatArray, theirs: FloatArray) -> FloatArray:
    """For each of our triangles (n, 3, 3) the nearest of theirs, which may have another order, and
    may begin at another corner."""
    _, near = cKDTree(theirs.mean(axis=1)).query(ours.mean(axis=1), k=min(4, len(theirs)))
    near = near.reshape(len(ours), -1)
    candidates = np.stack([np.roll(theirs[near], k, axis=2) for k in range(3)], axis=2)
    candidates = candidates.reshape(len(ours), -1, 3, 3)
    best = np.abs(candidates - ours[:, None]).max(axis=(2, 3)).argmin(axis=1)
    return np.asarray(candidates[np.arange(len(ours)), best])


def _text(numbers: Any) -> str:
    return f"({', '.join(f'{x:.6g}' for x in np.ravel(numbers))})"


# ---- shapes with an equation ---------------------------------------------------------------------


def _unit(v: FloatArray) -> FloatArray:
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))


NAMES = {kind: "boxes" if kind is Box else f"{kind.__name__.lower()}s" for kind in EQUATIONS} | {
    Torus: "tori"
}


def _check_equation(mi: Any, where: str, shape: Shape, found: Found) -> None:
    """Rays at places within the shape, from everywhere; they must meet it where its equation holds,
    and reach as far as it does."""
    surface, matrix = EQUATIONS[type(shape)](shape), _matrix(mi, shape)
    linear, offset = matrix[:3, :3], matrix[:3, 3]
    inverse = np.linalg.inv(linear)
    rng = np.random.default_rng(38)
    half, middle = np.array(surface.half, float), np.array(surface.middle, float)
    size = float(np.linalg.norm(half))
    target = middle + half * rng.uniform(-0.95, 0.95, (RAYS, 3))
    begin = middle + 4.0 * size * _unit(rng.normal(size=(RAYS, 3)))
    o, d = begin @ linear.T + offset, (target - begin) @ linear.T
    hits = Scene(shapes=(shape.model_copy(update={"material": None}),)).intersect(o, d)
    found.count(NAMES[type(shape)])
    if not hits.hit.any():
        if isinstance(shape, Sphere | Box | Disk | Rectangle | Plane):
            found.differences.append(f"{where}: rays do not meet it where its description is")
        return
    q = (hits.p[hits.hit] - offset) @ inverse.T
    # Our points are right to some ulp of the coordinates, in the world, seen in the shape's space.
    reach = float(np.abs(hits.p[hits.hit]).max() + np.abs(offset).max())
    rounding = 2.0**-40 * (size + np.linalg.norm(inverse, 2) * reach)
    error = np.abs(surface.f(q)) if not _is_flat(shape) else np.maximum(surface.f(q), 0.0)
    p, n = hits.p[hits.hit], hits.n[hits.hit]
    k = int(error.argmax())
    if error[k] > rounding:
        found.differences.append(
            f"{where}: is met at {_text(p[k])}, {error[k]:.3g} off the surface that is described, "
            "in its own space"
        )
        return
    gradient = surface.gradient(q)
    is_smooth = np.linalg.norm(gradient, axis=1) > 0.0
    if isinstance(shape, Quadric) and shape.capped:
        value = np.maximum(np.array(shape.lower) - q, q - np.array(shape.upper)).max(axis=1)
        is_smooth &= value < -1e-9 * size
    p, n, expected = p[is_smooth], n[is_smooth], _unit(gradient[is_smooth] @ inverse)
    # Mirrored shapes keep the front of their description.
    off = np.linalg.norm(expected - n, axis=1)
    if len(off) and off.max() > 3e-5 + 16.0 * rounding / size:
        k = int(off.argmax())
        found.differences.append(
            f"{where}: has the normal {_text(n[k])} at {_text(p[k])}; expected {_text(expected[k])}"
        )


def _is_flat(shape: Shape) -> bool:
    return isinstance(shape, Disk | Rectangle | Plane)


# ---- images --------------------------------------------------------------------------------------


def _image(mi: Any, path: Path, encoding: str) -> FloatArray | None:
    """An image (h, w, 3) as Mitsuba reads it, in linear values; None where it does not."""
    try:
        bitmap = mi.Bitmap(str(path))
    except RuntimeError:
        return None
    if encoding in ("raw", "srgb"):
        bitmap.set_srgb_gamma(encoding == "srgb")
    formats = mi.Bitmap.PixelFormat
    if bitmap.pixel_format() not in (formats.Y, formats.YA, formats.RGB, formats.RGBA):
        return None
    return np.array(bitmap.convert(formats.RGB, mi.Struct.Type.Float64, False), np.float64)


_INEXACT = (".jpg", ".jpeg")
"""Formats whose decoders may differ by a few codes."""


def _compare_images(
    where: str, path: Path, ours: FloatArray, theirs: FloatArray, scale: float, found: Found
) -> None:
    if ours.shape != theirs.shape:
        found.differences.append(
            f"{where}: {path.name} has {ours.shape[1]} x {ours.shape[0]} pixels; Mitsuba's loader "
            f"finds {theirs.shape[1]} x {theirs.shape[0]}"
        )
        return
    theirs = theirs * scale
    # Mitsuba decodes sRGB in float32: a power, and a few operations; floats are the same.
    is_decoded = path.suffix.lower() not in (".exr", ".hdr", ".pfm")
    allowed = 2.0**-19 * np.abs(theirs) + (2.0**-24 * scale if is_decoded else 0.0)
    if path.suffix.lower() in _INEXACT:
        allowed = 0.02 * scale + 0.05 * np.abs(theirs)
    error = np.abs(ours - theirs) - allowed
    if (error > 0.0).any():
        y, x, _ = np.unravel_index(int(error.argmax()), error.shape)
        found.differences.append(
            f"{where}: {path.name}: the pixel at column {x}, row {y} is {_text(ours[y, x])}; "
            f"Mitsuba's loader has {_text(theirs[y, x])}"
        )
    found.count("images")


def _check_bitmap(mi: Any, where: str, bitmap: Bitmap, folder: Path, found: Found) -> None:
    path = folder / bitmap.file
    encoding = bitmap.encoding
    theirs = None if bitmap.layer or encoding == "radiance" else _image(mi, path, encoding)
    if theirs is None or getattr(open_image(path), "gamma", None) is not None:
        found.unread.append(path.suffix.lower())
        return
    texels = bitmap.read(folder)
    if len(texels.decoded):
        codes = texels.values if texels.values.dtype != np.float16 else texels.values.view("u2")
        ours = texels.decoded[codes]
    else:
        ours = texels.values.astype(np.float64) * texels.scale
    ours = np.broadcast_to(ours, (*ours.shape[:2], 3))
    _compare_images(where, path, ours, theirs, bitmap.scale, found)


def _check_environment(
    mi: Any, where: str, light: EnvironmentMap, folder: Path, found: Found
) -> None:
    path, table = folder / light.file, light.tabulate(folder)
    theirs = None if light.layer or light.encoding == "radiance" else _image(mi, path, "auto")
    if theirs is None:
        found.unread.append(path.suffix.lower())
    else:
        _compare_images(where, path, table.texels, theirs, light.scale, found)
    to_map, expected = table.to_map.reshape(3, 3), np.linalg.inv(_matrix(mi, light)[:3, :3])
    if np.abs(to_map - expected).max() > 1e-5:  # seven digits are taken for a rotation
        found.differences.append(
            f"{where}: turns directions by {_text(to_map)}; its transform undone is "
            f"{_text(expected)}"
        )
