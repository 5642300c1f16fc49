"""Textures, one module each, and the material parameters that may be textures (`parameter.py`).

A texture gives a linear sRGB colour, or through its luminance a number, for surface coordinates
(u, v).  Its module has a `Texture` with `tabulate(folder)`, which returns one row of its table;
the table, a NamedTuple; `greatest(table)`, the largest value in it, by which parameters check their
range; and, where it depends on (u, v), `lookup(table, row, u, v)`, after the texture's uv map.

To add a texture: its module; a code in `texture.py`; in `lookup.py` a field of `Textures` and a
branch; below, `AnyTexture` and a line in `TABLES`; a translator function in
`comparisons.translator`; a scene; a row in the tests' tuple.
"""

from typing import Annotated, Any

from pydantic import Field

from reference_rt.textures import bitmap, checker, product, vertex_colours
from reference_rt.textures.bitmap import Bitmap
from reference_rt.textures.checker import Checker
from reference_rt.textures.lookup import At, Textures
from reference_rt.textures.parameter import (
    NO_TEXTURES,
    ColourParameter,
    Colours,
    Numbers,
    Palette,
    ReflectanceParameter,
    TextureName,
    UnitParameter,
    colour_at,
    number_at,
    texture_names,
)
from reference_rt.textures.product import Product
from reference_rt.textures.texture import BITMAP, CHECKER, PRODUCT, VERTEX_COLOURS, Texture
from reference_rt.textures.vertex_colours import VertexColours

AnyTexture = Annotated[Checker | Bitmap | VertexColours | Product, Field(discriminator="type")]

TABLES: tuple[tuple[int, str, type[Texture], Any], ...] = (
    (CHECKER, "checkers", Checker, checker),
    (BITMAP, "bitmaps", Bitmap, bitmap),
    (VERTEX_COLOURS, "vertex_colours", VertexColours, vertex_colours),
    (PRODUCT, "products", Product, product),
)
"""(code, field of Textures, description, module)."""

__all__ = [
    "NO_TEXTURES",
    "TABLES",
    "AnyTexture",
    "At",
    "Bitmap",
    "Checker",
    "ColourParameter",
    "Colours",
    "Numbers",
    "Palette",
    "Product",
    "ReflectanceParameter",
    "Texture",
    "TextureName",
    "Textures",
    "UnitParameter",
    "VertexColours",
    "colour_at",
    "number_at",
    "texture_names",
]
