"""Formats that trimesh reads, if the packages that it needs for them are installed (.3mf: lxml,
networkx).

It reads positions and triangles, in the scene that the file describes, without normals, uv and
colours (the last two are named as ignored).
"""

import io
import warnings
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from reference_rt.core import transform
from reference_rt.shapes.meshes.files.data import RawMesh
from reference_rt.shapes.meshes.files.join import joined
from reference_rt.util.memory import check_unpacked

# Formats with readers of our own, or without surfaces.
_LEFT_OUT = {"obj", "ply", "stl", "stl_ascii", "off", "gltf", "glb", "xyz"}

PARSED = 40
"""The most bytes of memory that trimesh takes per byte of an unpacked .3mf file: 33 (measured with
one million of the shortest triangles, 2026-11-25)."""


def suffixes() -> list[str]:
    from trimesh.exchange import load  # costs 0.3 s to import, and few scenes need it

    return sorted(f".{kind}" for kind in load.mesh_formats() - _LEFT_OUT)


def reader(suffix: str) -> Callable[[bytes, Path], RawMesh] | None:
    """The reader of files with this suffix; None if there is none."""
    if suffix not in suffixes():
        return None
    return lambda content, folder: joined(_parts(content, suffix[1:]))


def _parts(content: bytes, kind: str) -> Iterator[tuple[RawMesh, transform.Affine]]:
    import trimesh

    file = io.BytesIO(content)
    if zipfile.is_zipfile(file):
        size = sum(entry.file_size for entry in zipfile.ZipFile(file).infolist())
        check_unpacked(len(content), size, "it", PARSED)
    file.seek(0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        # With this resolver no other file is opened, whatever the content names.
        scene = trimesh.load(file, file_type=kind, resolver={}, force="scene", process=False)
    for node in scene.graph.nodes_geometry:
        matrix, name = scene.graph[node]
        geometry = scene.geometry[name]
        if hasattr(geometry, "faces"):
            vertices = np.asarray(geometry.vertices, np.float64)
            faces = np.asarray(geometry.faces, np.int64)
            visual = getattr(geometry.visual, "kind", None)
            ignored = () if visual is None else (f"{visual} colours or textures",)
            raw = RawMesh(vertices, faces, ignored=ignored)
            yield raw, np.asarray(matrix, np.float64)[:3]
