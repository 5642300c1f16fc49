"""One picture of triangles by both loops: rasterising, and casting rays (rows T1, T3).

Casting asks for each pixel which triangle is nearest, rasterising for each triangle which pixels it
covers.  All methods give the same depths, and take the rays of the picture's pixels: their
origins are the eye, their order is that of `Scene.camera_rays`.
"""

import math
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from reference_rt.cameras import Perspective
from reference_rt.core.vec3 import Vec3, cross, dot, triple
from reference_rt.jit.kernel import entry_kernel, kernel
from reference_rt.textbook import hierarchy, triangle
from reference_rt.textbook.hierarchy import SceneParameters
from reference_rt.textbook.method import FloatArray, Method, ray_of, vector


class Prepared(NamedTuple):
    """triangles (m, 9);  eye; forward, unit;  corner, right, down: of the picture at distance 1,
    right and down over their square and for one pixel, so that dot products give pixels;  width,
    height: in pixels."""

    triangles: FloatArray
    eye: Vec3
    forward: Vec3
    corner: Vec3
    right: Vec3
    down: Vec3
    width: int
    height: int


def prepare(parameters: SceneParameters) -> Prepared:
    """The scene's triangles and its camera, checked."""
    scene = parameters.scene
    camera, film = scene.camera, scene.film
    if not isinstance(camera, Perspective) or camera.near or camera.far:
        raise ValueError("expected a camera of type perspective, without clipping planes")
    if any(shape.type not in ("triangle", "mesh") for shape in scene.shapes):
        raise ValueError("expected a scene of triangles and meshes alone")
    view, triangles = camera.setup(film.width, film.height), scene.tables.geometry.shapes.triangles
    if triangles is None:
        raise ValueError("expected a scene that has triangles")
    right, down = (
        np.array(edge) * (pixels / np.dot(edge, edge))
        for edge, pixels in ((view.right, film.width), (view.down, film.height))
    )
    return Prepared(
        np.ascontiguousarray(triangles.vertices),
        vector(view.eye, "eye"),
        vector(-camera.basis[2], "forward"),
        vector(view.corner, "corner"),
        vector(right, "right"),
        vector(down, "down"),
        film.width,
        film.height,
    )


@kernel
def on_film(picture: Prepared, p: Vec3) -> Vec3:
    """(x z, y z, z): where `p` is seen, in pixels from the top left corner, times its depth z.
    Not divided by z, a point behind the eye needs no clipping."""
    from_eye = p - picture.eye
    z = dot(from_eye, picture.forward)
    across = from_eye - picture.corner * z
    return Vec3(dot(across, picture.right), dot(across, picture.down), z)


@kernel
def bounds(a: float, b: float, c: float, size: int) -> tuple[int, int]:
    """The first pixel, and the one after the last, whose centres may lie between three numbers."""
    low, high = min(a, min(b, c)) - 1.0, max(a, max(b, c)) + 1.0  # a pixel more: they are rounded
    return int(min(max(low, 0.0), 1.0 * size)), int(min(max(high, 0.0), 1.0 * size))


@kernel
def rasterise(picture: Prepared, depths: FloatArray) -> None:
    """For each triangle: the pixels that it covers, into a depth buffer.

    With corners a, b, c = (x z, y z, z) on the film, the pixel (x, y) sees the triangle where the
    edge functions w_a = (b x c)·(x, y, 1), w_b and w_c have one sign.  Over their sum w they are
    the perspective-correct barycentrics, and a·(b x c) / w is the depth: 1 / depth is linear on
    the film, depth is not.
    Cost: 53 +, 63 *, 6 / for a triangle; 3 +, 3 * for a pixel within its bounds, 2 +, 1 * for one
    that it covers, and 1 / where it is the nearest so far.
    Fails: at edges, as `watertight` does: a pixel whose edge function rounds to 0 is both
    neighbours'.
    """
    width = picture.width
    depths[:] = math.inf
    for k in range(len(picture.triangles)):
        a = on_film(picture, triple(picture.triangles, k, 0))
        b = on_film(picture, triple(picture.triangles, k, 1))
        c = on_film(picture, triple(picture.triangles, k, 2))
        e_a, e_b, e_c = cross(b, c), cross(c, a), cross(a, b)
        volume = dot(a, e_a)
        if volume == 0.0 or max(a.z, max(b.z, c.z)) <= 0.0:
            continue
        if volume < 0.0:
            volume, e_a, e_b, e_c = -volume, -e_a, -e_b, -e_c
        left, end, top, bottom = 0, width, 0, picture.height
        if min(a.z, min(b.z, c.z)) > 0.0:
            left, end = bounds(a.x / a.z, b.x / b.z, c.x / c.z, width)
            top, bottom = bounds(a.y / a.z, b.y / b.z, c.y / c.z, picture.height)
        for j in range(top, bottom):
            y = j + 0.5
            row_a, row_b, row_c = e_a.y * y + e_a.z, e_b.y * y + e_b.z, e_c.y * y + e_c.z
            for i in range(left, end):
                x = i + 0.5
                w_a, w_b, w_c = e_a.x * x + row_a, e_b.x * x + row_b, e_c.x * x + row_c
                if w_a >= 0.0 and w_b >= 0.0 and w_c >= 0.0:
                    w = w_a + w_b + w_c
                    if volume < depths[j * width + i] * w:
                        depths[j * width + i] = volume / w


@entry_kernel
def _rasterise(picture: Prepared, d: FloatArray, t: FloatArray) -> None:
    rasterise(picture, t)
    for i in range(len(t)):
        t[i] /= dot(picture.forward, ray_of(d, d, i).d)


def _whole(picture: Prepared, o: FloatArray, d: FloatArray, t: FloatArray) -> None:
    if len(o) != picture.width * picture.height:
        raise ValueError(f"{len(o)} rays; expected those of all pixels, in their order")
    _rasterise(picture, d, t)


@kernel
def cast(picture: Prepared, o: FloatArray, d: FloatArray, i: int) -> float:
    """For one pixel: the nearest of all triangles.

    Cost: 22 +, 16 *, 4 / for a triangle, by `watertight`.
    Fails: as `watertight` does.
    """
    closest = math.inf
    for k in range(len(picture.triangles)):
        a, b = triple(picture.triangles, k, 0), triple(picture.triangles, k, 1)
        found = triangle.watertight(ray_of(o, d, i), a, b, triple(picture.triangles, k, 2))
        if found.t < closest:
            closest = found.t
    return closest


@entry_kernel
def _cast(picture: Prepared, o: FloatArray, d: FloatArray, t: FloatArray) -> None:
    for i in range(len(o)):
        t[i] = cast(picture, o, d, i)


def _method(name: str, summary: str, source: str, prepare: Any, run: Any, whole: bool) -> Method:
    return Method(
        f"picture.{name}", "T3", summary, source, SceneParameters, prepare, run, whole=whole
    )


METHODS = (
    _method(
        "rasterise",
        "triangles outside, pixels inside, with a depth buffer",
        "Pineda 1988, SIGGRAPH; Olano & Greer 1997, Graphics Hardware",
        prepare,
        _whole,
        True,
    ),
    _method("cast", "pixels outside, triangles inside", "Appel 1968, AFIPS", prepare, _cast, False),
    _method(
        "cast_hierarchy",
        "pixels outside, triangles by a hierarchy",
        "Rubin & Whitted 1980, SIGGRAPH",
        partial(hierarchy.prepare, "sah"),
        hierarchy.trace,
        False,
    ),
)
