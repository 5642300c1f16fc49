"""The register of textures: their descriptions, and the tables that hold them.

A new texture has a line in `AnyTexture` and one in `Textures`; all else follows from these two.
Its import as itself makes it a name of `reference_rt.textures`.
"""

from collections.abc import Mapping
from typing import Annotated, Any, NamedTuple, get_args

from pydantic import Field

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.jit.by_code import ByCode, described_in, tables_of
from reference_rt.textures import bitmap, checker, product, vertex_colours
from reference_rt.textures.bitmap import Bitmap as Bitmap
from reference_rt.textures.checker import Checker as Checker
from reference_rt.textures.product import Product as Product
from reference_rt.textures.vertex_colours import VertexColours as VertexColours

AnyTexture = Annotated[Checker | Bitmap | VertexColours | Product, Field(discriminator="type")]


class UvSets(NamedTuple):
    """number (n,): the set of texture coordinates of each texture, 0 for the surface's own;
    corners (m, 3 2 k): those of the sets 1 to k, see `Triangles.more_uvs`."""

    number: IntArray
    corners: FloatArray


class Textures(NamedTuple):
    """kind (n,), row (n,): the table and row of each texture;  uv (n, 6): its map, see `UvMap`;  a
    table for each type, None for types that the scene lacks;  sets: which texture coordinates each
    texture has."""

    kind: IntArray
    row: IntArray
    uv: FloatArray
    checkers: Annotated[checker.Checkers | None, checker]
    bitmaps: Annotated[bitmap.Bitmaps | None, bitmap]
    vertex_colours: Annotated[vertex_colours.VertexColourTable | None, vertex_colours]
    products: Annotated[product.Products | None, product]
    sets: UvSets


TABLES: tuple[tuple[int, str, Any, Any], ...] = tuple(
    (code, field, described_in(module, get_args(AnyTexture)[0]), module)
    for code, field, _, module in tables_of(Textures)
)
"""(code, field of Textures, description, module), in the order of the codes, `Textures.kind`."""

_CODES = {module: code for code, _, _, module in TABLES}
CHECKER, BITMAP, PRODUCT = _CODES[checker], _CODES[bitmap], _CODES[product]


def largest_uv_set(name: str, textures: Mapping[str, Any]) -> int:
    """The largest number of a set of texture coordinates that a texture depends on."""
    texture = textures[name]
    if isinstance(texture, Product):
        return max(largest_uv_set(of, textures) for of in texture.of)
    return 0 if isinstance(texture, VertexColours) else int(texture.uv_set)


by_code = ByCode(Textures)
