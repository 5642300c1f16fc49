"""Rays in a closed mesh: ours counted by triangles, Mitsuba in three ways, textbook methods."""

from collections.abc import Callable
from typing import Any

import numpy as np

from comparisons.experiments.stability.harness.meshes import Closed, mitsuba_mesh
from comparisons.experiments.stability.harness.outcomes import MITSUBA, FloatArray
from comparisons.geometry.exact.dyadic import BoolArray
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.scene import for_rays
from reference_rt import textbook
from reference_rt.core.arrays import IntArray
from reference_rt.core.ray import Ray
from reference_rt.core.vec3 import row
from reference_rt.jit.kernel import entry_kernel
from reference_rt.shapes.meshes import triangle
from reference_rt.shapes.meshes.triangle import Triangles
from reference_rt.shapes.meshes.watertight import shear_of

Tracer = Callable[[FloatArray, FloatArray], BoolArray]

NOT_ROBUST, INSTANCED = "mitsuba, not robust", "mitsuba, instanced"

COARSEST = 0.1
"""The spacing of float32 beyond which a mesh of radius 1 to 6 is deformed too much."""


@entry_kernel
def _count(
    triangles: Triangles, o: FloatArray, d: FloatArray, crossings: IntArray, balance: IntArray
) -> None:
    for i in range(len(o)):
        shear = shear_of(Ray(row(o, i), row(d, i), np.inf))
        for k in range(len(triangles.face)):
            if triangle.intersect(triangles, k, shear).t < np.inf:
                crossings[i] += 1
                balance[i] += triangle.enters(triangles, k, shear)


def crossings(tables: Any, o: FloatArray, d: FloatArray) -> tuple[IntArray, IntArray]:
    """How many triangles of a scene each ray crosses, each tested by itself, and how many more
    times it goes in than out."""
    number, balance = np.zeros((2, len(o)), np.int64)
    with np.errstate(all="ignore"):
        _count(tables.geometry.shapes.triangles, o, d, number, balance)
    return number, balance


def fits(coordinates: FloatArray) -> bool:
    """Whether float32 resolves coordinates of this size to COARSEST."""
    return bool(np.spacing(np.float32(np.abs(coordinates).max())) < COARSEST)


def mitsubas(mesh: Closed) -> dict[str, Tracer]:
    """Whether rays hit a mesh whose vertices are rounded to float32: with Embree's robust flag, as
    the translation has it, without, and in a group, which ignores it."""
    mi = mitsuba()

    def scene(is_robust: bool, **shapes: Any) -> Any:
        flags = {"type": "scene", "embree_use_robust_intersections": is_robust}
        return mi.load_dict({**flags, **shapes}, optimize=False)

    def made() -> Any:
        return mitsuba_mesh(mesh.vertices, mesh.faces)

    group = {"type": "shapegroup", "member": made()}
    copy = {"type": "instance", "group": {"type": "ref", "id": "group"}}
    return {
        MITSUBA: _tracer(mi, scene(True, mesh=made())),
        NOT_ROBUST: _tracer(mi, scene(False, mesh=made())),
        INSTANCED: _tracer(mi, scene(True, group=group, copy=copy)),
    }


def _tracer(mi: Any, scene: Any) -> Tracer:
    def hits(origin: Any, direction: Any) -> tuple[Any, ...]:
        return (scene.ray_intersect_preliminary(mi.Ray3f(mi.Point3f(origin), direction)).t,)

    def trace(o: FloatArray, d: FloatArray) -> BoolArray:
        (t,) = for_rays(hits, o, d)
        return np.asarray(np.isfinite(t))

    return trace


def by_method(name: str, mesh: Closed) -> Tracer:
    """One of the textbook's tests of a triangle, of all of a mesh's."""

    def trace(o: FloatArray, d: FloatArray) -> BoolArray:
        met = np.zeros(len(o), np.bool_)
        for corners in mesh.vertices[mesh.faces]:
            t = textbook.intersect(name, textbook.TriangleParameters(*corners), o, d)
            met |= np.isfinite(t)
        return met

    return trace
