"""Materials -> Mitsuba's BSDFs, and the BSDF and emitter of a shape."""

from collections.abc import Callable
from dataclasses import replace
from functools import singledispatch
from typing import Any

import numpy as np

import reference_rt as rt
from comparisons.geometry import affine
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.plugins.exact_coat import COLOURS, SUBSTITUTE, accepted
from comparisons.mitsuba.plugins.materials import GLTF_COLOURS, GLTF_NUMBERS
from comparisons.textures.translate import (
    TranslationContext,
    UntranslatableError,
    colour,
    depends_on_uv,
    number,
    product,
    rgb,
    texels_of,
    translate_texture,
)
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
from reference_rt.textures.texture import UvMap


@singledispatch
def translate_material(material: Any, context: TranslationContext) -> dict[str, Any]:
    """A BSDF's dict.  Raises UntranslatableError, ValueError for a file that cannot be used."""
    raise UntranslatableError(material, "material")


@translate_material.register
def _(material: rt.Diffuse, context: TranslationContext) -> dict[str, Any]:
    return {"type": "diffuse", "reflectance": colour(material.reflectance, context)}


@translate_material.register
def _(material: rt.Mirror, context: TranslationContext) -> dict[str, Any]:
    # Without a material Mitsuba's conductor has eta = 0, k = 1, and reflects everything.
    return {"type": "conductor", "specular_reflectance": colour(material.reflectance, context)}


@translate_material.register
def _(material: rt.Conductor, context: TranslationContext) -> dict[str, Any]:
    return {"type": "conductor", **_metal(material, context)}


@translate_material.register
def _(material: rt.RoughConductor, context: TranslationContext) -> dict[str, Any]:
    return _rough("roughconductor", material, _metal(material, context), context)


def _metal(
    material: rt.Conductor | rt.RoughConductor, context: TranslationContext
) -> dict[str, Any]:
    return {
        "eta": rgb(material.eta),
        "k": rgb(material.k),
        "specular_reflectance": colour(material.reflectance, context),
    }


@translate_material.register
def _(material: rt.Dielectric, context: TranslationContext) -> dict[str, Any]:
    return {"type": "dielectric", **_glass(material, context)}


@translate_material.register
def _(material: rt.ThinDielectric, context: TranslationContext) -> dict[str, Any]:
    return {"type": "thindielectric", **_glass(material, context)}


@translate_material.register
def _(material: rt.RoughDielectric, context: TranslationContext) -> dict[str, Any]:
    return _rough("roughdielectric", material, _glass(material, context), context)


def _glass(
    material: rt.Dielectric | rt.ThinDielectric | rt.RoughDielectric, context: TranslationContext
) -> dict[str, Any]:
    return {
        **_indices(material),
        "specular_reflectance": colour(material.reflectance, context),
        "specular_transmittance": colour(material.transmittance, context),
    }


def _indices(material: Any) -> dict[str, Any]:
    """Always given: Mitsuba's defaults are BK7 glass and air."""
    return {"int_ior": material.interior_ior, "ext_ior": material.exterior_ior}


def _rough(
    plugin: str,
    material: rt.RoughConductor | rt.RoughDielectric,
    values: dict[str, Any],
    context: TranslationContext,
) -> dict[str, Any]:
    alpha = material.alpha
    along_u, along_v = (alpha, alpha) if isinstance(alpha, str) else alpha
    alphas = {"alpha_u": number(along_u, context), "alpha_v": number(along_v, context)}
    bsdf = {"type": plugin, "distribution": material.distribution, **alphas, **values}
    if material.distribution == "ggx" or context.native:
        return bsdf
    return {"type": "exact_beckmann", "nested": bsdf, **alphas}


@translate_material.register
def _(material: rt.Plastic, context: TranslationContext) -> dict[str, Any]:
    return _coated("plastic", material, context, {})


@translate_material.register
def _(material: rt.RoughPlastic, context: TranslationContext) -> dict[str, Any]:
    rough = {"distribution": material.distribution, "alpha": material.alpha}
    return _coated("roughplastic", material, context, rough)


def _coated(
    plugin: str,
    material: rt.Plastic | rt.RoughPlastic,
    context: TranslationContext,
    rough: dict[str, Any],
) -> dict[str, Any]:
    """Mitsuba's own material, wrapped in `exact_coat`, which corrects its tables."""
    base, specular = (colour(of, context) for of in (material.reflectance, material.specular))
    of_vertices = [part["type"] == "mesh_attribute" for part in (base, specular)]
    if any(of_vertices) and context.native:
        # Mitsuba's own need the mean of their colours, which it lacks for those of vertices.
        raise UntranslatableError(f"{type(material).__name__} with vertex colours", "material")
    nested = {
        "type": plugin,
        "diffuse_reflectance": base,
        "specular_reflectance": specular,
        "nonlinear": material.nonlinear,
        **_indices(material),
        **rough,
    }
    eta = material.interior_ior / material.exterior_ior
    if rough and eta == 1.0:
        nested |= {"int_ior": accepted(eta), "ext_ior": 1.0}
    if context.native:
        return nested
    if rough:
        nested["sample_visible"] = rough["distribution"] == "ggx"
    exact = {"type": "exact_coat", "reflectance": base, "nonlinear": material.nonlinear, "eta": eta}
    for name, replaced in zip(COLOURS, of_vertices, strict=True):
        if replaced:
            nested[name] = rgb((SUBSTITUTE,) * 3)
    if of_vertices[1]:
        exact["specular"] = specular
    return {**exact, "nested": nested, **rough}


@translate_material.register
def _(material: rt.Principled, context: TranslationContext) -> dict[str, Any]:
    numbers = (
        "roughness", "metallic", "spec_tint", "anisotropic", "sheen", "sheen_tint", "clearcoat",
        "clearcoat_gloss", "spec_trans", "flatness",
    )  # fmt: skip
    if material.eta is not None:
        index = {"eta": material.eta}
    else:
        index = {"specular": 0.5 if material.specular is None else material.specular}
    return {
        "type": "principled",
        "base_color": colour(material.base_colour, context),
        **index,
        **{name: number(getattr(material, name), context) for name in numbers},
    }


@translate_material.register
def _(material: rt.PrincipledThin, context: TranslationContext) -> dict[str, Any]:
    numbers = (
        "roughness", "anisotropic", "spec_trans", "spec_tint", "sheen", "sheen_tint", "flatness",
        "diff_trans",
    )  # fmt: skip
    return {
        "type": "principledthin",
        "base_color": colour(material.base_colour, context),
        "eta": material.eta,
        **{name: number(getattr(material, name), context) for name in numbers},
    }


@translate_material.register
def _(material: rt.Phong, context: TranslationContext) -> dict[str, Any]:
    """Our plugin `comparisons.mitsuba.plugins.materials`."""
    colours = ("ambient", "diffuse", "specular", "mirror")
    return {
        "type": "textbook_phong",
        **{name: colour(getattr(material, name), context) for name in colours},
        "exponent": material.exponent,
        "half_vector": material.half_vector,
    }


@translate_material.register
def _(material: rt.GltfPbr, context: TranslationContext) -> dict[str, Any]:
    return {
        "type": "gltf_pbr",
        "ior": material.ior,
        **{name: colour(getattr(material, name), context) for name in GLTF_COLOURS},
        **{name: number(getattr(material, name), context) for name in GLTF_NUMBERS},
    }


# ---- materials made of others --------------------------------------------------------------------


def _named(name: str, context: TranslationContext) -> dict[str, Any]:
    return translate_material(context.materials[name], context)


@translate_material.register
def _(material: Emissive, context: TranslationContext) -> dict[str, Any]:
    """Only the BSDF: the emission is the shape's emitter, see `parts_of`."""
    if material.base is None:
        return {"type": "diffuse", "reflectance": rgb((0.0, 0.0, 0.0))}
    return _named(material.base, context)


@translate_material.register
def _(material: Mask, context: TranslationContext) -> dict[str, Any]:
    base = _named(material.base, context)
    name = "mask" if context.native else "mixture_mask"
    return {"type": name, "opacity": number(material.opacity, context), "base": base}


@translate_material.register
def _(material: Blend, context: TranslationContext) -> dict[str, Any]:
    first, second = _named(material.first, context), _named(material.second, context)
    weight = number(material.weight, context)
    if has_delta(material, context) and not context.native:
        return {"type": "mixture_blend", "weight": weight, "first": first, "second": second}
    return {"type": "blendbsdf", "weight": weight, "0_first": first, "1_second": second}


def has_delta(material: Material, context: TranslationContext) -> bool:
    """Whether a material has a delta lobe: perfect reflection, refraction or transparency."""
    if isinstance(material, Mask):
        return True
    if isinstance(material, Wrapper):
        return any(has_delta(base, context) for base in _bases(material, context))
    return material.delta


def _bases(material: Wrapper, context: TranslationContext) -> list[Material]:
    names = (getattr(material, field) for field in material.bases)
    return [context.materials[name] for name in names if name is not None]


@translate_material.register
def _(material: TwoSided, context: TranslationContext) -> dict[str, Any]:
    front = _named(material.base, context)
    if material.back is None:
        return {"type": "twosided", "0_front": front}
    back = _named(material.back, context)
    if has_delta(material, context) and not context.native:
        return {"type": "mixture_sides", "front": front, "back": back}
    return {"type": "twosided", "0_front": front, "1_back": back}


def _tilt(material: Bump | NormalMap) -> dict[str, Any]:
    """The options that both have; Mitsuba's are on by default."""
    return {
        "flip_invalid_normals": material.flip_invalid_normals,
        "use_shadowing_function": material.use_shadowing_function,
    }


@translate_material.register
def _(material: Bump, context: TranslationContext) -> dict[str, Any]:
    base = _named(material.base, context)
    texture = context.textures[material.height]
    if not isinstance(texture, Bitmap) or texture.filter != "bilinear" or texture.cutoff:
        return base  # no slopes
    if context.native:
        height = number(material.height, context)
        own = {"type": "bumpmap", "scale": material.scale, "height": height, "bsdf": base}
        return {**own, **_tilt(material)}
    upright = texture.model_copy(update={"uv": UvMap()})
    names = ("u_u", "u_v", "u_1", "v_u", "v_v", "v_1")
    return {
        "type": "exact_bump",
        "scale": material.scale,
        "height": translate_texture(upright, material.height, context, True),
        "base": base,
        **dict(zip(names, affine.of_uv(texture.uv)[:2].ravel().tolist(), strict=True)),
        **_tilt(material),
    }


@translate_material.register
def _(material: NormalMap, context: TranslationContext) -> dict[str, Any]:
    base = _named(material.base, context)
    texture = context.textures[material.normals]
    if not isinstance(texture, Bitmap) or texture.cutoff is not None:
        raise UntranslatableError("NormalMap of a texture that is no image", "material")
    if context.in_file is not None and (material.follow_v or material.scale != 1.0):
        raise UntranslatableError("NormalMap with 'scale' or 'follow_v'", "material")
    normals = colour(material.normals, context)
    if material.scale != 1.0:
        factors = np.array([material.scale, material.scale, 1.0])
        texels = texels_of(texture, context) * factors + 0.5 * (1.0 - factors)
        normals["bitmap"] = mitsuba().Bitmap(np.ascontiguousarray(texels, np.float32))
    if material.follow_v:
        normals = product([normals], follow_v=True)
    return {"type": "normalmap", "normalmap": normals, "bsdf": base, **_tilt(material)}


def parts_of(name: str | None, context: TranslationContext) -> dict[str, Any]:
    """The parts of a shape with material `name`: "bsdf" and, if it is emissive, "emitter".

    Raises as `translate_material` does.
    """
    material: Material = Diffuse() if name is None else context.materials[name]
    parts = {"bsdf": translate_material(material, context)}
    if isinstance(material, Emissive):
        radiance = colour(material.radiance, context)
        parts["emitter"] = {"type": "area", "radiance": radiance}
    return parts


def coloured_parts_of(name: str | None, context: TranslationContext) -> dict[str, Any] | None:
    """The same for a mesh with vertex colours; None if no texture uses them."""
    if not any(isinstance(texture, VertexColours) for texture in context.textures.values()):
        return None
    return parts_of(name, replace(context, has_colours=True))


def is_textured(name: str | None, context: TranslationContext) -> bool:
    """Whether material `name` depends on a surface's uv or tangents."""

    def has_uv(material: Material) -> bool:
        names = texture_names(material).values()
        return any(depends_on_uv(context.textures[t]) for t in names)

    return is_oriented(name, context) or _any_part(name, context, has_uv)


def is_oriented(name: str | None, context: TranslationContext) -> bool:
    """Whether material `name` depends on a surface's tangents."""
    return _any_part(name, context, lambda material: material.oriented)


def _any_part(
    name: str | None, context: TranslationContext, test: Callable[[Material], bool]
) -> bool:
    """Whether a material, or one that is nested in it, passes a test."""
    if name is None:
        return False
    material = context.materials[name]
    inner = [getattr(material, field) for field in getattr(material, "bases", ())]
    if isinstance(material, Emissive):
        inner = [material.base]
    return test(material) or any(_any_part(base, context, test) for base in inner)
