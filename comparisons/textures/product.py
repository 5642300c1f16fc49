"""Products of textures, of which Mitsuba has none: our plugin, and factors in glTF."""

from typing import Any

from comparisons.mitsuba.context import TranslationContext, UntranslatableError
from comparisons.textures.texture import Nested, TextureType, Use
from reference_rt.textures import Product


def _to_mitsuba(
    texture: Product, name: str, context: TranslationContext, use: Use
) -> dict[str, Any]:
    if context.files is not None:
        raise UntranslatableError(texture, "texture")
    return product([Nested(of) for of in texture.of], texture.factor)


def product(
    of: list[Any],
    factor: tuple[float, float, float] = (1.0, 1.0, 1.0),
    cutoff: float = 0.0,
    follow_v: bool = False,
) -> dict[str, Any]:
    """Our plugin `comparisons.mitsuba.plugins.materials`, of colours and of numbers."""
    nested = {f"of_{k}": part for k, part in enumerate(of)}
    factors = {f"factor_{k}": value for k, value in enumerate(factor)}
    options = {"cutoff": cutoff, "follow_v": follow_v}
    return {"type": "texture_product", **options, **factors, **nested}


PRODUCT = TextureType(
    description=Product,
    to_mitsuba=_to_mitsuba,
    from_mitsuba={},
    to_cycles=None,
    to_gltf=None,  # `comparisons.gltf.surfaces` multiplies a colour's images, factors and vertices
    to_pbrt=None,
)
