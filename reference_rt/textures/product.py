"""Product texture: the colours of other textures, multiplied."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.model import Colour, Examples
from reference_rt.textures.texture import MayBeTexture, Texture


class Product(Texture):
    """The product of textures and a colour, such as an image times vertex colours; its own `uv` map
    and `uv_set` are ignored."""

    EXAMPLES: ClassVar[Examples] = (
        {"of": ("texture",)},
        {"of": ("texture", "small"), "factor": (0.9, 0.5, 0.7)},
    )
    type: Literal["product"] = "product"
    of: Annotated[tuple[str, ...], MayBeTexture(), Field(strict=False, min_length=1)]
    """Names of the textures that are multiplied: of any type but `product`."""
    factor: Colour = (1.0, 1.0, 1.0)
    """A colour that is multiplied with them: linear sRGB of at least 0."""

    def tabulate(self, folder: Any) -> Any:
        raise TypeError("a product refers to the other textures: see `table_of`")


class Products(NamedTuple):
    """factor (n, 3); first (n,), number (n,): a product's range of texture (k,), which holds
    numbers of textures."""

    factor: FloatArray
    first: IntArray
    number: IntArray
    texture: IntArray


def table_of(product: Product, numbers: Mapping[str, int]) -> Products:
    """One row.  numbers: of the scene's textures, by name."""
    texture = np.array([numbers[name] for name in product.of])
    return Products(np.array([product.factor]), np.zeros(1, int), np.array([len(texture)]), texture)


def join(parts: Sequence[Products]) -> Products:
    """One table from several of one product."""
    factor, _, number, texture = map(np.concatenate, zip(*parts, strict=True))
    return Products(factor, np.cumsum(number) - number, number, texture)


def greatest(products: Products) -> float:
    """The largest value of a factor."""
    return float(products.factor.max())
