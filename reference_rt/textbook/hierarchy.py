"""One scene without a hierarchy, and with hierarchies of three builders (row T18).

All have the same hits.  For small spheres scattered in a cube, measured on one core, a ray costs
9 ns per sphere without a hierarchy; with any of the three it costs 0.04 us for 10 spheres, 0.4 us
for 1000 and 2 us for 10^5, where memory access dominates.
"""

from functools import partial
from typing import NamedTuple

from reference_rt.accel import bvh
from reference_rt.accel.geometry import Geometry, closest_hit
from reference_rt.jit.kernel import entry_kernel
from reference_rt.rendering.scene import Scene
from reference_rt.textbook.method import FloatArray, Method, ray_of


class SceneParameters(NamedTuple):
    """A scene; its own `hierarchy` is ignored."""

    scene: Scene


def prepare(hierarchy: bvh.Method, parameters: SceneParameters) -> Geometry:
    """The geometry tables of the scene, built with this hierarchy."""
    return parameters.scene.changed(hierarchy=hierarchy).tables.geometry


@entry_kernel
def trace(geometry: Geometry, o: FloatArray, d: FloatArray, t: FloatArray) -> None:
    """`Method.run`, for any hierarchy."""
    for i in range(len(o)):
        t[i] = closest_hit(geometry, ray_of(o, d, i)).t


def _method(hierarchy: bvh.Method, summary: str, source: str) -> Method:
    build = partial(prepare, hierarchy)
    return Method(f"hierarchy.{hierarchy}", "T18", summary, source, SceneParameters, build, trace)


METHODS = (
    _method("none", "every shape for every ray", "elementary"),
    _method(
        "median",
        "halved at the median of the sorted centres, along the longest axis",
        "Kay & Kajiya 1986, SIGGRAPH",
    ),
    _method(
        "sah",
        "cut where the surface area heuristic says, in bins",
        "Goldsmith & Salmon 1987, IEEE CG&A 7(5); Wald 2007, IEEE RT",
    ),
    _method(
        "spatial",
        "the heuristic, where cuts may also go through shapes",
        "Stich, Friedrich & Dietrich 2009, HPG",
    ),
)
