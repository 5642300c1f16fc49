"""A scene whose meshes have float32 vertices where they stand, as Mitsuba holds them.

Mitsuba rounds a vertex to float32, which turns the normal of a small triangle by u |p| over its
size: in a scan of 100,000 triangles by more than float32's bound of a ray, and glass before it
amplifies that.  The scene that is compared therefore has these vertices on both sides.
"""

import numpy as np

from comparisons.geometry.frame import Frame
from comparisons.mitsuba.translate.moved import frame_of
from reference_rt.rendering.scene import Scene
from reference_rt.shapes import Mesh, Triangle
from reference_rt.shapes.meshes.triangle import Triangles
from reference_rt.shapes.shape import TabulationContext

SHARE = 0.01
"""Largest distance by which a vertex moves, over the shortest edge's usual length (the median over
the triangles): beyond it the mesh would be another one, and the comparison is to show Mitsuba's
precision.  The same hundredth as `geometry.frame.SHARE`."""


def with_float32_vertices(scene: Scene) -> tuple[Scene, float]:
    """The scene with the meshes and triangles that stand in it by themselves, not in groups or
    solids, moved to the nearest float32 vertices of the counterpart's frame; and the largest
    distance by which a vertex moves, 0 if the scene is as it was.

    A mesh stays as it is where float32 is too coarse for it (SHARE), and where it cannot be used,
    for the error that `build_tables` raises.
    """
    if not any(isinstance(shape, Mesh | Triangle) for shape in scene.shapes):
        return scene, 0.0
    frame = frame_of(scene)
    shapes, largest = list(scene.shapes), 0.0
    for k, shape in enumerate(scene.shapes):
        if not isinstance(shape, Mesh | Triangle):
            continue
        warned: list[str] = []

        def warn(owner: int, message: str, warned: list[str] = warned) -> None:
            warned.append(message)

        try:
            table = shape.tabulate(TabulationContext(folder=scene.folder, warn=warn))
        except ValueError:
            continue
        rounded, moved = _rounded(table, shape.material, frame)
        if 0.0 < moved <= SHARE * _edge(table):
            shapes[k], largest = rounded, max(largest, moved)
            for message in warned:
                scene.warn(message, "shapes", k)
    return (scene.changed(shapes=tuple(shapes)) if largest > 0.0 else scene), largest


def _rounded(table: Triangles, material: str | None, frame: Frame) -> tuple[Mesh, float]:
    """The triangles of a table as a mesh with rounded vertices, and how far a vertex moves."""
    corners = table.vertices.reshape(-1, 3)
    vertices = frame.rounded(corners)
    moved = float(np.linalg.norm(vertices - corners, axis=1).max())
    # Faces that the table left out, as they have no area, are left out again: numbers stay.
    faces = np.zeros((int(table.face.max()) + 1, 3), np.int64)
    faces[table.face] = np.arange(len(corners)).reshape(-1, 3)
    mesh = Mesh(
        material=material,
        vertices=vertices,
        faces=faces,
        normals=None if table.normals is None else table.normals.reshape(-1, 3),
        uv=None if table.uvs is None else table.uvs.reshape(-1, 2),
        colours=None if table.colours is None else table.colours.reshape(-1, 3),
    )
    return mesh, moved


def _edge(table: Triangles) -> float:
    """The median over triangles of the shortest edge."""
    corners = table.vertices.reshape(-1, 3, 3)
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    return float(np.median(edges.min(axis=1)))


__all__ = ["with_float32_vertices"]
