"""Shapes, from the float64 numbers that our own tables hold: both trace the same surfaces.

Mitsuba's rectangles, cubes and spheres turn inside out, or disagree with themselves (a rectangle's
geometric normal follows the winding, its shading normal the transform), where a transform mirrors
space; ours keep their outward side.  So a mirroring transform is never passed on.
"""

from functools import singledispatch
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.mitsuba_backend import mitsuba
from comparisons.translate.errors import UntranslatableError
from reference_rt import transform
from reference_rt.shapes import Box, Mesh, Rectangle, Sphere, Triangle
from reference_rt.shapes.shape import FloatArray
from reference_rt.shapes.triangle import Triangles


@singledispatch
def translate_shape(shape: Any, folder: Path, parts: dict[str, Any]) -> Any:
    """A shape's dict, or a Mitsuba object.

    `folder` is what file names are relative to, `parts` holds the BSDF and, where it shines, the
    emitter.  Raises UntranslatableError, and ValueError for a file that cannot be used.
    """
    raise UntranslatableError(shape, "shape")


@translate_shape.register
def _(shape: Sphere, folder: Path, parts: dict[str, Any]) -> dict[str, Any]:
    table = shape.tabulate(0, 0, folder)
    rotation = np.linalg.inv(table.to_local[0].reshape(3, 3))
    return {
        "type": "sphere",
        "to_world": _map(rotation * table.radius[0], table.center[0]),
        # A mirrored sphere keeps its mirrored uv; turned over once more, its normals are outward.
        "flip_normals": bool(np.linalg.det(rotation) < 0.0),
        **parts,
    }


@translate_shape.register
def _(shape: Rectangle, folder: Path, parts: dict[str, Any]) -> dict[str, Any]:
    m = transform.affine(shape.transform)
    mirrored = bool(np.linalg.det(m[:, :3]) < 0.0)
    # The third column moves nothing: any that makes the map proper will do.
    columns = np.column_stack([m[:, 0], m[:, 1], -m[:, 2] if mirrored else m[:, 2]])
    return {
        "type": "rectangle",
        "to_world": _map(columns, m[:, 3]),
        "flip_normals": mirrored,
        **parts,
    }


@translate_shape.register
def _(shape: Box, folder: Path, parts: dict[str, Any]) -> dict[str, Any]:
    m = transform.affine(shape.transform)
    edges = m[:, :3].copy()
    if np.linalg.det(edges) < 0.0:
        # The same box.  Where it is a light of Whitted's, the point that stands for it lies in the
        # middle along this axis, and stays (see comparisons.mitsuba_plugins.light_points).
        areas = np.linalg.norm(np.cross(edges.T[[1, 2, 0]], edges.T[[2, 0, 1]]), axis=1)
        edges[:, 1 if areas[2] >= areas[0] + areas[1] else 2] *= -1.0
    return {"type": "cube", "to_world": _map(edges, m[:, 3]), **parts}


@translate_shape.register(Triangle)
@translate_shape.register(Mesh)
def _(shape: Triangle | Mesh, folder: Path, parts: dict[str, Any]) -> Any:
    return _mesh(shape.tabulate(0, 0, folder), parts)


def _map(linear: FloatArray, offset: FloatArray) -> Any:
    """p -> linear p + offset; Mitsuba rounds the matrix to float32."""
    matrix = np.eye(4)
    matrix[:3] = np.column_stack([linear, offset])
    return mitsuba().ScalarTransform4f(matrix)


def _mesh(table: Triangles, parts: dict[str, Any]) -> Any:
    """A mesh of separate triangles in our order: Mitsuba's prim_index is our face."""
    if "emitter" in parts and table.normals is not None:
        # Which side shines: ours by the geometric normal, Mitsuba's by the shading normal.
        raise UntranslatableError("Mesh that shines and has vertex normals", "shape")
    mi = mitsuba()
    properties = mi.Properties()
    for name, part in parts.items():
        properties[name] = mi.load_dict(part)
    count = len(table.face)
    mesh = mi.Mesh(
        "mesh", 3 * count, count, has_vertex_normals=table.normals is not None, props=properties
    )
    values = mi.traverse(mesh)
    values["vertex_positions"] = table.vertices.astype(np.float32).ravel()
    values["faces"] = np.arange(3 * count, dtype=np.uint32)
    if table.normals is not None:
        values["vertex_normals"] = table.normals.astype(np.float32).ravel()
    values.update()
    return mesh
