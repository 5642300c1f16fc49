"""The textures of a material, all asked once where a surface is hit.

What a material scatters is asked several times at each hit, and every parameter of it may be a
texture.  Asking them beforehand spares asking again, and there is one place that they are asked
from: with a copy of all textures' code at every parameter, half of what is compiled for a scene
like textured_room was these (measured, before and after optimisation).
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.jit.kernel import ByClass, kernel
from reference_rt.materials.emissive import Emissive
from reference_rt.materials.material import Material
from reference_rt.materials.nested.bump import Bump
from reference_rt.materials.nested.wrappers import Wrapper
from reference_rt.textures import At, Palette, texture_names
from reference_rt.textures.lookup import Looked, lookup


class Textured(NamedTuple):
    """Of each material, those that it is made of included: first (m,) and number (m,) of its
    entries in texture (k,), the numbers of its textures;  size: that of the scene's textures."""

    first: IntArray
    number: IntArray
    texture: IntArray
    size: int


def textured_table(materials: Mapping[str, Material], palette: Palette) -> Textured | None:
    """None where no material has any texture."""
    found = [_textures(name, materials, palette) for name in materials]
    if not any(found):
        return None
    number = np.array([len(numbers) for numbers in found])
    texture = np.array([k for numbers in found for k in sorted(numbers)])
    return Textured(np.cumsum(number) - number, number, texture, len(palette.greatest))


def _textures(name: str, materials: Mapping[str, Material], palette: Palette) -> set[int]:
    """The numbers of the textures that a material asks for colours."""
    material = materials[name]
    found = {
        palette.numbers_of[texture]
        for field, texture in texture_names(material).items()
        # Of heights, the slopes are asked, and there is one place for that anyway.
        if not (isinstance(material, Bump) and field == "height")
    }
    return found.union(*(_textures(base, materials, palette) for base in _bases(material)))


def asks_textures(name: str, materials: Mapping[str, Material]) -> bool:
    """Whether a material asks any texture, also for heights."""
    material = materials[name]
    asked = [asks_textures(base, materials) for base in _bases(material)]
    return bool(texture_names(material)) or any(asked)


def _bases(material: Material) -> list[str]:
    """The names of those that a material is made of."""
    if isinstance(material, Wrapper):
        named = [getattr(material, base) for base in material.bases]
    else:
        named = [material.base] if isinstance(material, Emissive) else []
    return [base for base in named if base is not None]


@kernel
def looked_floats(textured: Textured | None) -> int:
    """The size of the array that `look` fills."""
    if textured is None:
        return 0
    return 3 * textured.size


@kernel
def _nothing(textured: None, m: int, at: At, colours: FloatArray) -> At:
    return at


@kernel
def _look(textured: Textured, m: int, at: At, colours: FloatArray) -> At:
    first = textured.first[m]
    for s in range(first, first + textured.number[m]):
        k = textured.texture[s]
        colours[3 * k], colours[3 * k + 1], colours[3 * k + 2] = lookup(k, at)
    return At(Looked(colours), at.u, at.v, at.colour)


_choice = ByClass("look")
_choice.register(type(None), _nothing)
_choice.register(Textured, _look)
look = _choice.function
"""look(textured, m, at, colours) -> the place where `lookup` finds what the textures of material m
have at `at`: in `colours`, while that lives."""
