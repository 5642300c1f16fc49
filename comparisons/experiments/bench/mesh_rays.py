"""Ray-mesh intersection: ours in float64 against Mitsuba's (Embree, float32), and any-hit against
closest-hit.

Both return the same for each ray: t, the triangle, and the position on it."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from comparisons.experiments.bench.row import Row, Setting, against, alternate, seconds
from comparisons.mitsuba.files import ply
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.integrators import RayCast
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.materials import Diffuse
from reference_rt.rendering import query
from reference_rt.rendering.scene import Scene
from reference_rt.shapes import Mesh
from reference_rt.shapes.meshes.files import MeshData
from reference_rt.util.errors import UsageError
from reference_rt.util.files import replacing, temporary_folder

# ---- a generated mesh ---------------------------------------------------------------------------


BUNNY = 69_451
"""Triangles of the Stanford bunny, a common benchmark."""


class Blob(NamedTuple):
    """vertices (n, 3), faces (m, 3), counter-clockwise seen from outside."""

    vertices: FloatArray
    faces: IntArray


def blob(triangles: int) -> Blob:
    """A sphere with bumps that occlude each other, of at least this many triangles: the six faces
    of a cube as grids, projected to the sphere."""
    n = int(np.ceil(np.sqrt(triangles / 12)))
    u, v = np.meshgrid(*(2 * [np.linspace(-1.0, 1.0, n + 1)]), indexing="ij")
    i, j = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    c00, c10 = i * (n + 1) + j, (i + 1) * (n + 1) + j
    grid = np.stack([c00, c10, c10 + 1, c00, c10 + 1, c00 + 1], axis=-1).reshape(-1, 3)
    sides = []
    for axis in range(3):
        for sign in (1.0, -1.0):
            corners = np.stack([np.full_like(u, sign), u, sign * v], axis=-1)
            sides.append(np.roll(corners, axis, axis=-1).reshape(-1, 3))
    cube = np.concatenate(sides)
    sphere = cube / np.linalg.norm(cube, axis=1, keepdims=True)
    x, y, z = sphere.T
    bumps = np.sin(7.0 * x + 1.0) * np.sin(6.0 * y + 2.0) * np.sin(8.0 * z + 3.0)
    ripples = np.sin(41.0 * x) * np.sin(37.0 * y) * np.sin(43.0 * z)
    radius = 1.0 + 0.35 * bumps + 0.03 * ripples
    faces = np.concatenate([grid + k * (n + 1) ** 2 for k in range(6)])
    return Blob(sphere * radius[:, None], faces)


def write_ply(path: Path, mesh: Blob) -> None:
    """A binary .ply file of float32 positions and int32 indices."""
    with replacing(path) as temporary:
        temporary.write_bytes(ply(MeshData(mesh.vertices, mesh.faces), float32=True))


# ---- rays and rates -----------------------------------------------------------------------------


WIDTH = 1024
"""Width of a square picture with one ray per pixel: 2^20 rays; coherent ones are in row order."""

FOV = math.radians(40.0)

GOALS = {"incoherent": 0.9, "coherent": 0.55}

Rays = tuple[FloatArray, FloatArray]


class Subject(NamedTuple):
    """A mesh file, its name for people, and the tables of a scene with this mesh."""

    path: Path
    title: str
    tables: SceneTables


def measure(setting: Setting) -> list[Row]:
    """Incoherent, coherent, and any-hit rays.  Raises UsageError, ReferenceUnavailableError."""
    with temporary_folder() as folder:
        subject = _subject(setting, folder)
        width = WIDTH // 2 if setting.quick else WIDTH
        vertices = _corners(subject.tables)
        rays = {"incoherent": incoherent(vertices, width**2), "coherent": coherent(vertices, width)}
        rows = [_against_mitsuba(kind, rays[kind], subject, setting) for kind in GOALS]
        return [*rows, _any_hit(rays["incoherent"], subject, setting)]


def _subject(setting: Setting, folder: Path) -> Subject:
    path, title = setting.mesh, ""
    if path is None:
        path, title = folder / "blob.ply", "a generated mesh"
        write_ply(path, blob(BUNNY))
    elif path.suffix.lower() not in (".obj", ".ply"):
        raise UsageError(f"--mesh: expected an .obj or .ply file, got '{path}'")
    shape = Mesh(file=str(path.resolve()), material="clay")
    scene = Scene(shapes=(shape,), materials={"clay": Diffuse()}, integrator=RayCast())
    title = f"{title or path.stem} of {len(_corners(scene.tables)) // 3:,} triangles"
    return Subject(path, title, scene.tables)


def _corners(tables: SceneTables) -> FloatArray:
    """(3 n, 3) vertices of all triangles."""
    triangles: Any = tables.geometry.shapes.triangles
    return np.asarray(triangles.vertices).reshape(-1, 3)


def _sphere_around(vertices: FloatArray) -> tuple[FloatArray, float]:
    """Centre and radius of the sphere around the box."""
    lower, upper = vertices.min(axis=0), vertices.max(axis=0)
    return (lower + upper) / 2.0, float(np.linalg.norm(upper - lower)) / 2.0


def coherent(vertices: FloatArray, width: int) -> Rays:
    """Unit rays of a pinhole camera that sees the whole mesh, in the order of the pixels."""
    center, radius = _sphere_around(vertices)
    eye = center + np.array([0.6, 0.8, 3.0]) * radius
    forward = (center - eye) / np.linalg.norm(center - eye)
    right = np.cross(forward, [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    at = math.tan(FOV / 2.0) * ((np.arange(width) + 0.5) / width * 2.0 - 1.0)
    y, x = np.meshgrid(at, at, indexing="ij")
    d = forward + x.reshape(-1, 1) * right - y.reshape(-1, 1) * up
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    return np.tile(eye, (width**2, 1)), d


def incoherent(vertices: FloatArray, count: int) -> Rays:
    """Unit rays from random points on the sphere around the mesh to random points inside it."""
    rng = np.random.default_rng(1)
    center, radius = _sphere_around(vertices)
    start, end = rng.normal(size=(2, count, 3))
    start /= np.linalg.norm(start, axis=1, keepdims=True)
    end *= (rng.random(count) ** (1.0 / 3.0) / np.linalg.norm(end, axis=1))[:, None]
    d = end - start
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    return center + radius * start, d


def chords(vertices: FloatArray, count: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Segments between random points of the sphere around the mesh: o, unit d, lengths (n,)."""
    rng = np.random.default_rng(2)
    center, radius = _sphere_around(vertices)
    ends = rng.normal(size=(2, count, 3))
    ends *= radius / np.linalg.norm(ends, axis=2, keepdims=True)
    d = ends[1] - ends[0]
    length = np.linalg.norm(d, axis=1)
    return center + ends[0], d / length[:, None], length


def _against_mitsuba(kind: str, rays: Rays, subject: Subject, setting: Setting) -> Row:
    from comparisons.mitsuba.backend import LLVM, variant

    o, d = rays
    with variant(LLVM) as mi:
        robust = {flag: _mitsuba_scene(mi, subject.path, flag) for flag in (True, False)}
        runs: dict[str, Callable[[], float]] = {
            f"Mitsuba, coherent={hint}": _mitsuba_rate(mi, robust[True], rays, hint)
            for hint in (True, False)
        }
        runs |= {
            "ours": lambda: _rate(
                len(o), lambda: query.first_hits(subject.tables, o, d, threads=setting.threads)
            )
        }
        runs["Mitsuba, not robust"] = _mitsuba_rate(mi, robust[False], rays, kind == "coherent")
        for run in runs.values():
            run()  # compile
        rates = alternate(runs, say=setting.say)
    medians = {name: float(np.median(rate)) for name, rate in rates.items()}
    best = max((name for name in rates if "coherent=" in name), key=lambda name: medians[name])
    hits = query.first_hits(subject.tables, o, d).hit
    return against(
        f"rays_{kind}",
        f"closest hit, {subject.title}, {kind}: ours (float64) / Mitsuba llvm",
        rates["ours"],
        (f"{best.replace('Mitsuba', 'Mitsuba llvm')}, robust", rates[best]),
        GOALS[kind],
        unit="Mray/s",
        better="higher",
        details={
            "mesh": subject.title,
            "rays": len(o),
            "hit_share": float(hits.mean()),
            "threads": setting.threads,
            "rates": rates,
            "median_rates": medians,
        },
    )


def _mitsuba_scene(mi: Any, path: Path, robust: bool) -> Any:
    """A scene with the mesh; comparisons use `robust`: without it, rays leak through edges."""
    mesh = {"type": path.suffix[1:].lower(), "filename": str(path), "face_normals": True}
    return mi.load_dict({"type": "scene", "embree_use_robust_intersections": robust, "mesh": mesh})


def _mitsuba_rate(mi: Any, scene: Any, rays: Rays, hint: bool) -> Callable[[], float]:
    """A function that measures Mray/s.  The rays are converted for Mitsuba beforehand; its lazy
    results are evaluated."""
    import drjit as dr

    o, d = (a.T.astype(np.float32) for a in rays)
    origin, direction = mi.Point3f(o), mi.Vector3f(d)
    dr.eval(origin, direction)
    dr.sync_thread()

    def trace() -> object:
        ray = mi.Ray3f(origin, direction)
        found = scene.ray_intersect_preliminary(ray, coherent=hint)
        dr.eval(found.t, found.prim_index, found.prim_uv)
        dr.sync_thread()
        return found

    return lambda: _rate(len(rays[0]), trace)


def _rate(count: int, run: Callable[[], object]) -> float:
    """Millions of rays per second."""
    return count / seconds(run) / 1e6


def _any_hit(rays: Rays, subject: Subject, setting: Setting) -> Row:
    n = len(rays[0])
    o, d, length = chords(_corners(subject.tables), n)
    threads = setting.threads
    runs: dict[str, Callable[[], float]] = {
        "any hit": lambda: _rate(n, lambda: query.occluded(subject.tables, o, d, length, threads)),
        "closest hit": lambda: _rate(
            n, lambda: query.first_hits(subject.tables, o, d, threads=threads)
        ),
    }
    for run in runs.values():
        run()  # compile
    rates = alternate(runs, say=setting.say)
    occluded = query.occluded(subject.tables, o, d, length)
    return against(
        "any_hit",
        f"any-hit shadow rays, {subject.title}, chords of the sphere around it: / closest hit",
        rates["any hit"],
        ("closest hit of the same rays", rates["closest hit"]),
        1.5,
        unit="Mray/s",
        better="higher",
        details={"rays": n, "hit_share": float(occluded.mean()), "rates": rates},
    )
