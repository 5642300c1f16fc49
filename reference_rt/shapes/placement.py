"""Affine placement: primitives that are intersected in local coordinates, and the maps there and
back.

The table of such a primitive has center (n, 3), the rows of the inverse linear map `to_local` (n,
9), and the columns of the map itself, `edges` (n, 9): p = center + A q and q = M (p - center), with
M = A^-1.
"""

from typing import Any

import numpy as np

from reference_rt.core.arrays import Bounds, FloatArray
from reference_rt.core.ray import UNIT_ROUNDOFF, Ray, SurfacePoint
from reference_rt.core.transform import Affine, invert
from reference_rt.core.vec3 import Vec3, dot, length, max_abs, row, triple
from reference_rt.jit.kernel import kernel
from reference_rt.shapes.shape import TabulationContext, outward


def columns(m: Affine, context: TabulationContext) -> dict[str, Any]:
    """The columns of every table of placed primitives, one row, for the map m of one shape."""
    return {
        "center": m[:, 3].copy()[None],
        "to_local": invert(m)[:, :3].reshape(1, 9).copy(),
        "edges": m[:, :3].T.reshape(1, 9).copy(),
        **owners(context),
    }


def owners(context: TabulationContext) -> dict[str, Any]:
    """The columns of every table of shapes, one row.

    owner: the shape id, an index in the scene (in the group);  material, light: rows of those
    tables, light -1 for none;  face: the number of a face within the shape.
    """
    return {
        "owner": np.array([context.owner]),
        "material": np.array([context.material]),
        "light": np.array([-1]),
        "face": np.array([0]),
    }


def bounds(center: FloatArray, edges: FloatArray, lower: FloatArray, upper: FloatArray) -> Bounds:
    """Boxes along the axes (n, 3), (n, 3) around local boxes (n, 3), (n, 3), rounded outwards."""
    linear = edges.reshape(-1, 3, 3)
    middle, half = 0.5 * lower + 0.5 * upper, 0.5 * upper - 0.5 * lower
    p = center + np.einsum("nki,nk->ni", linear, middle)
    reach = np.einsum("nki,nk->ni", np.abs(linear), half)
    # Two sums of three products, and the halves: at most sixteen roundings, of numbers no larger
    # than `size`.
    size = np.abs(center) + np.einsum("nki,nk->ni", np.abs(linear), np.abs(middle)) + reach
    reach += 16.0 * UNIT_ROUNDOFF * size
    return outward(p - reach, p + reach)


@kernel
def local_vector(table: Any, i: int, v: Vec3) -> Vec3:
    """M v."""
    return Vec3(
        dot(triple(table.to_local, i, 0), v),
        dot(triple(table.to_local, i, 1), v),
        dot(triple(table.to_local, i, 2), v),
    )


@kernel
def local_point(table: Any, i: int, p: Vec3) -> Vec3:
    """M (p - center)."""
    return local_vector(table, i, p - row(table.center, i))


@kernel
def local_ray(table: Any, i: int, ray: Ray) -> Ray:
    """The same ray in local coordinates: t keeps its meaning."""
    return Ray(local_point(table, i, ray.o), local_vector(table, i, ray.d), ray.t_max)


@kernel
def world_point(table: Any, i: int, q: Vec3) -> Vec3:
    """center + A q."""
    return (
        row(table.center, i)
        + triple(table.edges, i, 0) * q.x
        + triple(table.edges, i, 1) * q.y
        + triple(table.edges, i, 2) * q.z
    )


@kernel
def _combination(vectors: FloatArray, i: int, v: Vec3) -> Vec3:
    """The linear combination of the three vectors in row i."""
    return triple(vectors, i, 0) * v.x + triple(vectors, i, 1) * v.y + triple(vectors, i, 2) * v.z


@kernel
def world_vector(table: Any, i: int, v: Vec3) -> Vec3:
    """A v."""
    return _combination(table.edges, i, v)


@kernel
def world_covector(table: Any, i: int, n: Vec3) -> Vec3:
    """M^T n: a normal of any length, by the inverse transpose."""
    return _combination(table.to_local, i, n)


@kernel
def _magnitudes(a: Vec3, b: Vec3, c: Vec3, q: Vec3) -> Vec3:
    """|A| |q| for the columns a b c of A."""
    x, y, z = abs(q.x), abs(q.y), abs(q.z)
    return Vec3(
        abs(a.x) * x + abs(b.x) * y + abs(c.x) * z,
        abs(a.y) * x + abs(b.y) * y + abs(c.y) * z,
        abs(a.z) * x + abs(b.z) * y + abs(c.z) * z,
    )


@kernel
def world_error(
    table: Any, i: int, p: Vec3, q: Vec3, n: Vec3, covector_length: float, error: float
) -> float:
    """`SurfacePoint.error` of p = center + A q, given the local surface's unit normal n
    there, |M^T n| and its own `error`.

    In the world, computing p takes at most 8 roundings of numbers no larger than |c| + |A| |q| and
    |p|.  Transforming a ray's origin into local coordinates, M (o - c), takes 4, and M is A's
    inverse to within 8 more, on numbers no larger than |M| |A| |q|: these, and the surface's own
    error, are lengths along the local normal, which become 1 / |M^T n| times as long in the world.
    For a thin shape |M| |A| is as large as its map is ill-conditioned.
    """
    reach = _magnitudes(
        triple(table.edges, i, 0), triple(table.edges, i, 1), triple(table.edges, i, 2), q
    )
    m0, m1, m2 = (
        triple(table.to_local, i, 0),
        triple(table.to_local, i, 1),
        triple(table.to_local, i, 2),
    )
    seen = (
        abs(n.x) * (abs(m0.x) * reach.x + abs(m0.y) * reach.y + abs(m0.z) * reach.z)
        + abs(n.y) * (abs(m1.x) * reach.x + abs(m1.y) * reach.y + abs(m1.z) * reach.z)
        + abs(n.z) * (abs(m2.x) * reach.x + abs(m2.y) * reach.y + abs(m2.z) * reach.z)
    )
    in_world = max_abs(row(table.center, i)) + max_abs(p) + max_abs(reach)
    rounding = 8.0 * 1.7320508075688774 * UNIT_ROUNDOFF
    return rounding * in_world + (1.5 * rounding * seen + error) / covector_length


@kernel
def world_surface(
    table: Any, i: int, q: Vec3, n: Vec3, error: float, material: int, light: int
) -> SurfacePoint:
    """The world's `SurfacePoint` of the local point q, outward unit normal n and error bound."""
    p = world_point(table, i, q)
    covector = world_covector(table, i, n)
    covector_length = length(covector)
    normal = covector * (1.0 / covector_length)
    bound = world_error(table, i, p, q, n, covector_length, error)
    return SurfacePoint(p, normal, normal, bound, material, light)
