"""Materials that are not made of others -> Mitsuba's BSDFs."""

from functools import singledispatch
from typing import Any

import reference_rt as rt
from comparisons.mitsuba.plugins.exact_coat import COLOURS, SUBSTITUTE, accepted
from comparisons.mitsuba.translate.errors import UntranslatableError
from comparisons.mitsuba.translate.textures import TranslationContext, colour, number, rgb


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
    """Our plugin `comparisons.mitsuba.plugins.phong`."""
    colours = ("ambient", "diffuse", "specular", "mirror")
    return {
        "type": "textbook_phong",
        **{name: colour(getattr(material, name), context) for name in colours},
        "exponent": material.exponent,
        "half_vector": material.half_vector,
    }
