"""Texture lookup: the colour of a texture at a place of a surface."""

from typing import Any, NamedTuple

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.vec3 import Vec3, row
from reference_rt.jit.by_code import ByCode
from reference_rt.jit.kernel import ByClass, kernel
from reference_rt.jit.links import LINK, Link, Linkable, declare, type_of
from reference_rt.textures import bitmap, checker, vertex_colours
from reference_rt.textures.bitmap import Bitmaps
from reference_rt.textures.checker import Checkers
from reference_rt.textures.product import Products
from reference_rt.textures.texture import BITMAP, CHECKER, PRODUCT, VERTEX_COLOURS, map_uv
from reference_rt.textures.vertex_colours import VertexColourTable


class Textures(NamedTuple):
    """kind (n,), row (n,): the table and row of each texture;  uv (n, 6): its map, see `UvMap`;  a
    table for each type, None for types that the scene lacks."""

    kind: IntArray
    row: IntArray
    uv: FloatArray
    checkers: Checkers | None
    bitmaps: Bitmaps | None
    vertex_colours: VertexColourTable | None
    products: Products | None = None


class CachedLookups(NamedTuple):
    """Cached lookups, in place of `Textures`.  values (3 n,): the colours, at the hit, of those of
    all n textures that its material uses."""

    values: FloatArray


# Operations on a link get textures as a link, and places for BSDFs with cached lookups.
declare(Textures | None, LINK)
declare(Textures | CachedLookups | None, type_of(CachedLookups))

_textures = Linkable()
textures_operations = _textures.operations


class At(NamedTuple):
    """A place for texture lookups.

    u, v: surface coordinates;  colour: the interpolated vertex colour of a mesh, negative if there
    is none;  textures: None if the scene has none; the other fields are then undefined.
    """

    textures: Textures | CachedLookups | None
    u: float
    v: float
    colour: Vec3


_by_code = ByCode(
    [
        (CHECKER, "checkers", checker),
        (BITMAP, "bitmaps", bitmap),
        (VERTEX_COLOURS, "vertex_colours", vertex_colours),
    ]
)


@_by_code("lookup")
def _lookup_in_table(
    textures: Textures, kind: int, i: int, u: float, v: float, colour: Vec3
) -> Vec3:
    return Vec3(0.0, 0.0, 0.0)


@_by_code("gradient")
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


@_textures.operation
def evaluate(textures: Textures, k: int, u: float, v: float, colour: Vec3) -> Vec3:
    """The colour of texture k at surface coordinates u, v."""
    return _evaluate(textures.products, textures, k, u, v, colour)


@kernel
def _evaluate(
    products: Products | None, textures: Textures, k: int, u: float, v: float, colour: Vec3
) -> Vec3:
    if products is None:
        return _of_one(textures, k, u, v, colour)
    if textures.kind[k] != PRODUCT:
        return _of_one(textures, k, u, v, colour)
    i = textures.row[k]
    found = row(products.factor, i)
    first = products.first[i]
    for j in range(first, first + products.number[i]):
        found = found * _of_one(textures, products.texture[j], u, v, colour)
    return found


@kernel
def _of_one(textures: Textures, k: int, u: float, v: float, colour: Vec3) -> Vec3:
    """The colour of a texture that is no product."""
    kind, i = textures.kind[k], textures.row[k]
    u, v = map_uv(textures.uv, k, u, v)
    return _lookup_in_table(textures, kind, i, u, v, colour)


@kernel
def _ask(textures: Any, k: int, at: At) -> Vec3:
    return evaluate(textures, k, at.u, at.v, at.colour)


_choice = ByClass("lookup")
_choice.register(type(None), _no_colour)
_choice.register(CachedLookups, _looked)
_choice.register(Textures, _ask)
_choice.register(Link, _ask)
_lookup = _choice.function


@kernel
def lookup_gradient(k: int, at: At) -> tuple[float, float]:
    """The derivatives of texture k's luminance by the surface coordinates u and v; (0, 0) for all
    but bitmaps.  Not for cached lookups."""
    found: tuple[float, float] = _slopes(at.textures, k, at)
    return found


@kernel
def _flat(textures: None, k: int, at: At) -> tuple[float, float]:
    return 0.0, 0.0


@_textures.operation
def gradient(textures: Textures, k: int, u: float, v: float) -> tuple[float, float]:
    """The derivatives of texture k's luminance by u and v."""
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


_by_class = ByClass("lookup_gradient")
_by_class.register(type(None), _flat)
_by_class.register(Textures, _gradient)
_by_class.register(Link, _gradient)
_slopes = _by_class.function
