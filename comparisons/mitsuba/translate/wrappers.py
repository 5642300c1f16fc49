"""Materials made of others -> Mitsuba, and the BSDF and emitter of a shape."""

from dataclasses import replace
from typing import Any

from comparisons.mitsuba.translate.errors import UntranslatableError
from comparisons.mitsuba.translate.materials import translate_material
from comparisons.mitsuba.translate.textures import Surroundings, colour, depends_on_uv, number, rgb
from reference_rt.materials import (
    Blend,
    Bump,
    Diffuse,
    Emissive,
    Mask,
    Material,
    NormalMap,
    TwoSided,
    Wrapper,
)
from reference_rt.textures import Bitmap, VertexColours, texture_names


def _named(name: str, around: Surroundings) -> dict[str, Any]:
    return translate_material(around.materials[name], around)


@translate_material.register
def _(material: Emissive, around: Surroundings) -> dict[str, Any]:
    """Only the BSDF: the emission is the shape's emitter, see `parts_of`."""
    if material.base is None:
        return {"type": "diffuse", "reflectance": rgb((0.0, 0.0, 0.0))}
    return _named(material.base, around)


@translate_material.register
def _(material: Mask, around: Surroundings) -> dict[str, Any]:
    base = _named(material.base, around)
    name = "mask" if around.native else "mixture_mask"
    return {"type": name, "opacity": number(material.opacity, around), "base": base}


@translate_material.register
def _(material: Blend, around: Surroundings) -> dict[str, Any]:
    first, second = _named(material.first, around), _named(material.second, around)
    weight = number(material.weight, around)
    if has_delta(material, around) and not around.native:
        return {"type": "mixture_blend", "weight": weight, "first": first, "second": second}
    return {"type": "blendbsdf", "weight": weight, "0_first": first, "1_second": second}


def has_delta(material: Material, around: Surroundings) -> bool:
    """Whether a material has a delta lobe: perfect reflection, refraction or transparency."""
    if isinstance(material, Mask):
        return True
    if isinstance(material, Wrapper):
        return any(has_delta(base, around) for base in _bases(material, around))
    return material.delta


def _bases(material: Wrapper, around: Surroundings) -> list[Material]:
    names = (getattr(material, field) for field in material.bases)
    return [around.materials[name] for name in names if name is not None]


@translate_material.register
def _(material: TwoSided, around: Surroundings) -> dict[str, Any]:
    bsdf = {"type": "twosided", "0_front": _named(material.base, around)}
    if material.back is not None:
        bsdf["1_back"] = _named(material.back, around)
    return bsdf


# By default Mitsuba's bump and normal maps flip normals that face away, and apply a shadowing term.
_PLAIN = {"flip_invalid_normals": False, "use_shadowing_function": False}


@translate_material.register
def _(material: Bump, around: Surroundings) -> dict[str, Any]:
    base = _named(material.base, around)
    texture = around.textures[material.height]
    if not isinstance(texture, Bitmap) or texture.filter != "bilinear":
        return base  # no slopes
    if any(leaf.oriented for leaf in _leaves(material, around)):
        # Mitsuba mixes a local normal with a world-space tangent (src/bsdfs/bumpmap.cpp).
        raise UntranslatableError("Bump over a material with a grain", "material")
    height = number(material.height, around)
    m = texture.uv.matrix()
    if (m[1] != 0.0 or m[3] != 0.0) and not _is_square(height):
        # Mitsuba rotates the gradient before it multiplies by width and height
        # (src/textures/bitmap.cpp).
        raise UntranslatableError("Bump by a turned image that is not square", "material")
    return {"type": "bumpmap", "scale": material.scale, "height": height, "bsdf": base, **_PLAIN}


def _is_square(height: Any) -> bool:
    size = height["bitmap"].size()
    return bool(size[0] == size[1])


def _leaves(material: Material, around: Surroundings) -> list[Material]:
    """The BSDF leaves of a material."""
    if isinstance(material, Wrapper):
        return [leaf for base in _bases(material, around) for leaf in _leaves(base, around)]
    return [material]


@translate_material.register
def _(material: NormalMap, around: Surroundings) -> dict[str, Any]:
    base = _named(material.base, around)
    texture = around.textures[material.normals]
    if not isinstance(texture, Bitmap):
        raise UntranslatableError("NormalMap of a texture that is no image", "material")
    normals = colour(material.normals, around)
    return {"type": "normalmap", "normalmap": normals, "bsdf": base, **_PLAIN}


def parts_of(name: str | None, around: Surroundings) -> dict[str, Any]:
    """The parts of a shape with material `name`: "bsdf" and, if it is emissive, "emitter".

    Raises as `translate_material` does.
    """
    material: Material = Diffuse() if name is None else around.materials[name]
    parts = {"bsdf": translate_material(material, around)}
    if isinstance(material, Emissive):
        radiance = colour(material.radiance, around)
        parts["emitter"] = {"type": "area", "radiance": radiance}
    return parts


def coloured_parts_of(name: str | None, around: Surroundings) -> dict[str, Any] | None:
    """The same for a mesh with vertex colours; None if no texture uses them."""
    if not any(isinstance(texture, VertexColours) for texture in around.textures.values()):
        return None
    return parts_of(name, replace(around, has_colours=True))


def is_textured(name: str | None, around: Surroundings) -> bool:
    """Whether material `name` depends on a surface's uv or tangents."""
    if name is None:
        return False
    material = around.materials[name]
    if any(leaf.oriented for leaf in _leaves(material, around)):
        return True
    if any(depends_on_uv(around.textures[t]) for t in texture_names(material).values()):
        return True
    bases = _bases(material, around) if isinstance(material, Wrapper) else []
    if isinstance(material, Emissive) and material.base is not None:
        bases = [around.materials[material.base]]
    names = {id(m): n for n, m in around.materials.items()}
    return any(is_textured(names[id(base)], around) for base in bases)
