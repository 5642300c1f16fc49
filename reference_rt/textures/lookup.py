"""The choice among textures: what colour each has where."""

from typing import NamedTuple

from reference_rt.kernel import kernel
from reference_rt.shapes.shape import FloatArray, IntArray
from reference_rt.textures import bitmap, checker
from reference_rt.textures.bitmap import Bitmaps
from reference_rt.textures.checker import Checkers
from reference_rt.textures.texture import BITMAP, CHECKER, map_uv
from reference_rt.textures.vertex_colours import VertexColourTable
from reference_rt.vec3 import Vec3, row


class Textures(NamedTuple):
    """kind (n,) and row (n,): which table each texture is a row of; uv (n, 6): its map, see
    `UvMap`; None for absent tables."""

    kind: IntArray
    row: IntArray
    uv: FloatArray
    checkers: Checkers | None
    bitmaps: Bitmaps | None
    vertex_colours: VertexColourTable | None


class At(NamedTuple):
    """Where on a surface textures are asked: its coordinates u, v, and the interpolated colour of a
    mesh's vertices, negative where there is none;  textures: None where the scene has no texture,
    and the rest then means nothing."""

    textures: Textures | None
    u: float
    v: float
    colour: Vec3


@kernel
def lookup(k: int, at: At) -> Vec3:
    """The colour of texture k."""
    return _lookup(at.textures, k, at)


@kernel
def _lookup(textures: Textures | None, k: int, at: At) -> Vec3:
    if textures is None:
        return Vec3(0.0, 0.0, 0.0)
    kind, i = textures.kind[k], textures.row[k]
    u, v = map_uv(textures.uv, k, at.u, at.v)
    if kind == CHECKER:
        return _checker(textures.checkers, i, u, v)
    if kind == BITMAP:
        return _bitmap(textures.bitmaps, i, u, v)
    return _vertex_colours(textures.vertex_colours, i, at)


@kernel
def _checker(checkers: Checkers | None, i: int, u: float, v: float) -> Vec3:
    if checkers is None:
        return Vec3(0.0, 0.0, 0.0)
    return checker.lookup(checkers, i, u, v)


@kernel
def _bitmap(bitmaps: Bitmaps | None, i: int, u: float, v: float) -> Vec3:
    if bitmaps is None:
        return Vec3(0.0, 0.0, 0.0)
    return bitmap.lookup(bitmaps, i, u, v)


@kernel
def lookup_gradient(k: int, at: At) -> tuple[float, float]:
    """The derivatives of texture k's luminance by the surface coordinates u and v; (0, 0) for all
    but bitmaps."""
    return _gradient(at.textures, k, at)


@kernel
def _gradient(textures: Textures | None, k: int, at: At) -> tuple[float, float]:
    if textures is None:
        return 0.0, 0.0
    if textures.kind[k] != BITMAP:
        return 0.0, 0.0
    m = textures.uv[k]
    u, v = map_uv(textures.uv, k, at.u, at.v)
    along_u, along_v = _bitmap_gradient(textures.bitmaps, textures.row[k], u, v)
    return m[0] * along_u + m[3] * along_v, m[1] * along_u + m[4] * along_v


@kernel
def _bitmap_gradient(bitmaps: Bitmaps | None, i: int, u: float, v: float) -> tuple[float, float]:
    if bitmaps is None:
        return 0.0, 0.0
    return bitmap.gradient(bitmaps, i, u, v)


@kernel
def _vertex_colours(table: VertexColourTable | None, i: int, at: At) -> Vec3:
    if table is None:
        return Vec3(0.0, 0.0, 0.0)
    if at.colour.x < 0.0:
        return row(table.without, i)
    scaled: Vec3 = at.colour * table.scale[i]
    return scaled
