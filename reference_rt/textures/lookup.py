"""Texture lookup: the colour of a texture at a place of a surface."""

from typing import Any, NamedTuple

from numba import types

from reference_rt.core.arrays import FloatArray
from reference_rt.core.vec3 import Vec3, row
from reference_rt.jit.kernel import by_class, kernel
from reference_rt.jit.links import LINK, Link, Linkable, declare, type_of
from reference_rt.textures.product import Products
from reference_rt.textures.tables import BITMAP, PRODUCT, Textures, UvSets, by_code
from reference_rt.textures.texture import map_uv


class CachedLookups(NamedTuple):
    """Cached lookups, in place of `Textures`.  values (3 n,): the colours, at the hit, of those of
    all n textures that its material uses."""

    values: FloatArray


class OnTriangle(NamedTuple):
    """row: of the table of triangles, -1 on other shapes;  u, v: the barycentrics of v1 and v2."""

    row: int
    u: float
    v: float


NOWHERE = OnTriangle(-1, 0.0, 0.0)
"""Not on a triangle: all textures have the surface coordinates."""

# Operations on a link get textures as a link, and places for BSDFs with cached lookups.
declare(Textures | None, LINK)
declare(Textures | CachedLookups | None, type_of(CachedLookups))
declare(OnTriangle | None, types.none)

lookups = Linkable()
"""The operations on textures, or on a link to them."""


class At(NamedTuple):
    """A place for texture lookups.

    u, v: surface coordinates;  colour: the interpolated vertex colour of a mesh, negative if there
    is none;  on: where other sets of texture coordinates are looked up, None beside cached lookups;
    textures: None if the scene has none; the other fields are then undefined.
    """

    textures: Textures | CachedLookups | None
    u: float
    v: float
    colour: Vec3
    on: OnTriangle | None = NOWHERE


@by_code("lookup")
def _lookup_in_table(
    textures: Textures, kind: int, i: int, u: float, v: float, colour: Vec3
) -> Vec3:
    return Vec3(0.0, 0.0, 0.0)


@by_code("gradient")
def _gradient_in_table(
    textures: Textures, kind: int, i: int, u: float, v: float
) -> tuple[float, float]:
    return 0.0, 0.0


@kernel
def lookup(k: int, at: At) -> Vec3:
    """The colour of texture k."""
    found: Vec3 = _lookup(at.textures, k, at)
    return found


@kernel
def _no_colour(textures: None, k: int, at: At) -> Vec3:
    return Vec3(0.0, 0.0, 0.0)


@kernel
def _looked(looked: CachedLookups, k: int, at: At) -> Vec3:
    values = looked.values
    return Vec3(values[3 * k], values[3 * k + 1], values[3 * k + 2])


@lookups.operation
def evaluate(textures: Textures, k: int, u: float, v: float, colour: Vec3, on: OnTriangle) -> Vec3:
    """The colour of texture k at surface coordinates u, v."""
    return _evaluate(textures.products, textures, k, u, v, colour, on)


@kernel
def _evaluate(
    products: Products | None,
    textures: Textures,
    k: int,
    u: float,
    v: float,
    colour: Vec3,
    on: OnTriangle,
) -> Vec3:
    if products is None:
        return _of_one(textures, k, u, v, colour, on)
    if textures.kind[k] != PRODUCT:
        return _of_one(textures, k, u, v, colour, on)
    i = textures.row[k]
    found = row(products.factor, i)
    first = products.first[i]
    for j in range(first, first + products.number[i]):
        found = found * _of_one(textures, products.texture[j], u, v, colour, on)
    return found


@kernel
def _of_one(textures: Textures, k: int, u: float, v: float, colour: Vec3, on: OnTriangle) -> Vec3:
    """The colour of a texture that is no product."""
    kind, i = textures.kind[k], textures.row[k]
    u, v = _in_set(textures.sets, k, u, v, on)
    u, v = map_uv(textures.uv, k, u, v)
    return _lookup_in_table(textures, kind, i, u, v, colour)


@kernel
def _in_set(sets: UvSets, k: int, u: float, v: float, on: OnTriangle) -> tuple[float, float]:
    """The coordinates of texture k's set, as `shapes.meshes.triangle.uv` interpolates the mesh's
    own."""
    number = sets.number[k]
    if number == 0 or on.row < 0:
        return u, v
    width, first, w = sets.corners.shape[1] // 3, 2 * (number - 1), sets.corners[on.row]
    i, j = first + width, first + 2 * width
    a = 1.0 - on.u - on.v
    return (
        a * w[first] + on.u * w[i] + on.v * w[j],
        a * w[first + 1] + on.u * w[i + 1] + on.v * w[j + 1],
    )


@kernel
def _ask(textures: Any, k: int, at: At) -> Vec3:
    on: Any = at.on
    return evaluate(textures, k, at.u, at.v, at.colour, on)


_lookup = by_class(
    "lookup", {type(None): _no_colour, CachedLookups: _looked, Textures: _ask, Link: _ask}
)


@kernel
def lookup_gradient(k: int, at: At) -> tuple[float, float]:
    """The derivatives of texture k's luminance by the surface coordinates u and v; (0, 0) for all
    but bitmaps.  Not for cached lookups."""
    found: tuple[float, float] = _slopes(at.textures, k, at)
    return found


@kernel
def _flat(textures: None, k: int, at: At) -> tuple[float, float]:
    return 0.0, 0.0


@lookups.operation
def gradient(textures: Textures, k: int, u: float, v: float) -> tuple[float, float]:
    """The derivatives of texture k's luminance by u and v; heights have the surface's own."""
    kind, i = textures.kind[k], textures.row[k]
    if kind != BITMAP:
        return 0.0, 0.0
    m = textures.uv[k]
    u, v = map_uv(textures.uv, k, u, v)
    along_u, along_v = _gradient_in_table(textures, kind, i, u, v)
    return m[0] * along_u + m[3] * along_v, m[1] * along_u + m[4] * along_v


@kernel
def _gradient(textures: Any, k: int, at: At) -> tuple[float, float]:
    return gradient(textures, k, at.u, at.v)


_slopes = by_class("lookup_gradient", {type(None): _flat, Textures: _gradient, Link: _gradient})
