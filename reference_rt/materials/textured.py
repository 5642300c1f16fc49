"""Texture lookups of a material, evaluated once per hit and cached.

A material is evaluated several times at each hit, and each of its parameters may be a texture.  The
cache avoids repeated lookups, and keeps the lookup code in one place.  With the code inlined at
every parameter it was half of what is compiled for a scene like textured_room (measured, before
and after optimisation).
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.jit.kernel import kernel
from reference_rt.materials.material import Emissive, Material
from reference_rt.materials.nested.tilted import Bump
from reference_rt.materials.nested.wrappers import Wrapper
from reference_rt.textures import At, Palette, texture_names
from reference_rt.textures.lookup import CachedLookups, lookup


class Textured(NamedTuple):
    """The textures of each material, and of those that it is made of.

    first (m,), number (m,): a material's range of texture (k,), which holds numbers of textures;
    size: the number of textures of the scene.
    """

    first: IntArray
    number: IntArray
    texture: IntArray
    size: int


def textured_table(materials: Mapping[str, Material], palette: Palette) -> Textured:
    """The table of a scene's materials."""
    found = [_textures(name, materials, palette) for name in materials]
    number = np.array([len(numbers) for numbers in found])
    texture = np.array([k for numbers in found for k in sorted(numbers)], np.int64)
    size = len(palette.greatest) if number.any() else 0
    return Textured(np.cumsum(number) - number, number, texture, size)


def _textures(name: str, materials: Mapping[str, Material], palette: Palette) -> set[int]:
    """The numbers of the textures that a material uses for colours."""
    material = materials[name]
    found = {
        palette.numbers_of[texture]
        for path, texture in texture_names(material).items()
        # Of heights the gradient is needed, not the colour, and in one place only.
        if not (isinstance(material, Bump) and path == ("height",))
    }
    return found.union(*(_textures(base, materials, palette) for base in _bases(material)))


def textures_of(name: str, materials: Mapping[str, Material]) -> set[str]:
    """The names of the textures that a material uses, also for heights."""
    material = materials[name]
    found = {*texture_names(material).values()}
    return found.union(*(textures_of(base, materials) for base in _bases(material)))


def _bases(material: Material) -> list[str]:
    """The names of the materials of which a material is made."""
    if isinstance(material, Wrapper):
        named = [getattr(material, base) for base in material.bases]
    else:
        named = [material.base] if isinstance(material, Emissive) else []
    return [base for base in named if base is not None]


@kernel
def lookup_cache_size(textured: Textured) -> int:
    """The size of the array that `evaluate_textures` writes."""
    return 3 * textured.size


@kernel
def evaluate_textures(textured: Textured, m: int, at: At, colours: FloatArray) -> At:
    """Evaluates the textures of material m at `at`, into the scratch buffer `colours`, and returns
    a place where `lookup` reads these."""
    first = textured.first[m]
    for s in range(first, first + textured.number[m]):
        k = textured.texture[s]
        colours[3 * k], colours[3 * k + 1], colours[3 * k + 2] = lookup(k, at)
    return At(CachedLookups(colours), at.u, at.v, at.colour, None)
