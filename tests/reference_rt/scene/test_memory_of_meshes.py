"""What a large mesh takes: its tables, and what loading it takes at most.

`tracemalloc` counts what NumPy asks for, also room that is never written to, so that the bounds on
it are above what a process takes: docs/results/speed.md has that.
"""

import os
import tracemalloc

import numpy as np
import pytest

import reference_rt as rt
from reference_rt.integrators import RayCast

SIDE = 250


def grid(side=SIDE):
    """Vertices (n, 3) of a wavy sheet, and its 2 side² triangles (m, 3)."""
    x, y = np.meshgrid(*2 * [np.linspace(-1, 1, side + 1)], indexing="ij")
    i, j = np.meshgrid(*2 * [np.arange(side)], indexing="ij")
    a, b = i * (side + 1) + j, (i + 1) * (side + 1) + j
    faces = np.stack([a, b, b + 1, a, b + 1, a + 1], axis=-1).reshape(-1, 3)
    vertices = np.stack([x, y, 0.2 * np.sin(9 * x) * np.cos(7 * y)], axis=-1).reshape(-1, 3)
    return vertices, faces


def scene_of(**mesh):
    """A scene of one mesh."""
    shape = rt.Mesh(material="clay", **mesh)
    return rt.Scene(shapes=(shape,), materials={"clay": rt.Diffuse()}, integrator=RayCast())


def bytes_of(table):
    """Bytes of each array by name; of views of the same memory only the first."""
    found, seen = {}, set()
    for name, column in table._asdict().items():
        if isinstance(column, np.ndarray) and column.ctypes.data not in seen:
            seen.add(column.ctypes.data)
            found[name] = column.nbytes
    return found


@pytest.mark.parametrize(
    ("more", "of_triangle"),
    [
        ({}, {}),
        ({"normals": 3}, {"normals": 72}),
        ({"uv": 2}, {"uvs": 48}),
        ({"colours": 3}, {"colours": 72}),
    ],
    ids=["plain", "normals", "uv", "colours"],
)
def test_bytes_of_a_triangle(more, of_triangle):
    vertices, faces = grid()
    given = {name: np.ones((len(vertices), k)) for name, k in more.items()}
    geometry = scene_of(vertices=vertices, faces=faces, **given).tables.geometry
    n = len(faces)
    shapes = bytes_of(geometry.shapes.triangles)
    assert shapes.pop("points") == 24 * len(vertices)
    for name in ("owner", "material", "light"):
        assert shapes.pop(name) == 4  # the same for all
    expected = {"corners": 12, "face": 4, **of_triangle}
    assert shapes == {name: size * n for name, size in expected.items()}
    tree = bytes_of(geometry.bvh)
    assert tree.pop("references") == 8 * n
    assert tree.pop("corners") == 72 * n + 64
    assert tree.pop("boxes") < 10 * n  # 256 bytes a node; measured: 8.3
    assert not tree


def peak_of(scene, monkeypatch):
    """The most bytes that building the tables of a scene takes at a time, tables included."""
    monkeypatch.setattr(os, "cpu_count", lambda: 2)  # each thread has room of its own
    tracemalloc.start()
    try:
        tables = scene.tables
        assert len(tables.geometry.shapes.triangles.face) == 2 * SIDE**2
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_a_mesh_is_built_in_little_more_than_twice_its_tables(monkeypatch):
    """Measured: 261 bytes a triangle, of tables of 117; 390 with indices of 64 bits and without
    blocks.  That is room for as many nodes as there may be, 112, of which a third is written to; 64
    for the boxes of references, 41 for tables and indices, and what two threads have."""
    vertices, faces = grid()
    mesh = scene_of(vertices=vertices, faces=faces)
    assert peak_of(mesh, monkeypatch) / len(faces) < 280


def test_vertex_normals_are_made_in_little_more(monkeypatch):
    """Measured: 338 bytes a triangle, 72 of them the normals; 462 before."""
    vertices, faces = grid()
    mesh = scene_of(vertices=vertices, faces=faces, smooth=True)
    assert peak_of(mesh, monkeypatch) / len(faces) < 360


def _ply(path, vertices, faces):
    """Binary, of float32 and int32."""
    rows = np.zeros(len(faces), [("n", "u1"), ("corners", "<i4", 3)])
    rows["n"], rows["corners"] = 3, faces
    head = (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {len(vertices)}\n"
        "property float x\nproperty float y\nproperty float z\n"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    path.write_bytes(head.encode() + vertices.astype("<f4").tobytes() + rows.tobytes())


def _stl(path, vertices, faces):
    """Binary."""
    rows = np.zeros(len(faces), [("normal", "<f4", 3), ("v", "<f4", (3, 3)), ("attribute", "<u2")])
    rows["v"] = vertices[faces]
    path.write_bytes(bytes(80) + np.uint32(len(faces)).tobytes() + rows.tobytes())


@pytest.mark.parametrize("write", [_ply, _stl], ids=["ply", "stl"])
def test_files_are_loaded_in_no_more(write, tmp_path, monkeypatch):
    """Measured: 261 bytes a triangle; 389 and 449 before.  Not .obj, whose reader asks for room by
    the number of words and leaves most of it alone."""
    path = tmp_path / f"mesh.{write.__name__[1:]}"
    vertices, faces = grid()
    write(path, vertices, faces)
    mesh = scene_of(file=str(path))
    assert peak_of(mesh, monkeypatch) / len(faces) < 280
    triangles = mesh.tables.geometry.shapes.triangles
    assert len(triangles.points) == len(vertices)  # equal vertices of an .stl file are one
    order = np.argsort(triangles.face)
    expected = vertices.astype(np.float32)[faces].reshape(-1, 9)
    assert np.array_equal(triangles.vertices[order], expected)
