"""Materials that are not made of others -> Mitsuba's BSDFs."""

from functools import singledispatch
from typing import Any

from comparisons.mitsuba.translate.errors import UntranslatableError
from comparisons.mitsuba.translate.textures import Surroundings, colour, number, rgb
from reference_rt.materials import (
    Conductor,
    Dielectric,
    Diffuse,
    Mirror,
    Phong,
    Plastic,
    Principled,
    RoughConductor,
    RoughDielectric,
    RoughPlastic,
    ThinDielectric,
)


@singledispatch
def translate_material(material: Any, around: Surroundings) -> dict[str, Any]:
    """A BSDF's dict.  Raises UntranslatableError, ValueError for a file that cannot be used."""
    raise UntranslatableError(material, "material")


@translate_material.register
def _(material: Diffuse, around: Surroundings) -> dict[str, Any]:
    return {"type": "diffuse", "reflectance": colour(material.reflectance, around)}


@translate_material.register
def _(material: Mirror, around: Surroundings) -> dict[str, Any]:
    # Without a material Mitsuba's conductor has eta = 0, k = 1, and reflects everything.
    return {"type": "conductor", "specular_reflectance": colour(material.reflectance, around)}


@translate_material.register
def _(material: Conductor, around: Surroundings) -> dict[str, Any]:
    return {"type": "conductor", **_metal(material, around)}


@translate_material.register
def _(material: RoughConductor, around: Surroundings) -> dict[str, Any]:
    return _rough("roughconductor", material, _metal(material, around), around)


def _metal(material: Conductor | RoughConductor, around: Surroundings) -> dict[str, Any]:
    return {
        "eta": rgb(material.eta),
        "k": rgb(material.k),
        "specular_reflectance": colour(material.reflectance, around),
    }


@translate_material.register
def _(material: Dielectric, around: Surroundings) -> dict[str, Any]:
    return {"type": "dielectric", **_glass(material, around)}


@translate_material.register
def _(material: ThinDielectric, around: Surroundings) -> dict[str, Any]:
    return {"type": "thindielectric", **_glass(material, around)}


@translate_material.register
def _(material: RoughDielectric, around: Surroundings) -> dict[str, Any]:
    return _rough("roughdielectric", material, _glass(material, around), around)


def _glass(
    material: Dielectric | ThinDielectric | RoughDielectric, around: Surroundings
) -> dict[str, Any]:
    return {
        **_indices(material),
        "specular_reflectance": colour(material.reflectance, around),
        "specular_transmittance": colour(material.transmittance, around),
    }


def _indices(material: Any) -> dict[str, Any]:
    """Always given: Mitsuba's defaults are BK7 glass and air."""
    return {"int_ior": material.interior_ior, "ext_ior": material.exterior_ior}


def _rough(
    plugin: str,
    material: RoughConductor | RoughDielectric,
    values: dict[str, Any],
    around: Surroundings,
) -> dict[str, Any]:
    alpha = material.alpha
    along_u, along_v = (alpha, alpha) if isinstance(alpha, str) else alpha
    alphas = {"alpha_u": number(along_u, around), "alpha_v": number(along_v, around)}
    bsdf = {"type": plugin, "distribution": material.distribution, **alphas, **values}
    if material.distribution == "ggx" or around.native:
        return bsdf
    # The plugin says why visible normals are not sampled.
    return {"type": "exact_beckmann", "nested": {**bsdf, "sample_visible": False}, **alphas}


@translate_material.register
def _(material: Plastic, around: Surroundings) -> dict[str, Any]:
    return _coated("plastic", material, around, {})


@translate_material.register
def _(material: RoughPlastic, around: Surroundings) -> dict[str, Any]:
    rough = {"distribution": material.distribution, "alpha": material.alpha}
    return _coated("roughplastic", material, around, rough)


def _coated(
    plugin: str, material: Plastic | RoughPlastic, around: Surroundings, rough: dict[str, Any]
) -> dict[str, Any]:
    """Mitsuba's own material, wrapped in `exact_coat`, which corrects its tables."""
    base = colour(material.reflectance, around)
    nested = {
        "type": plugin,
        "diffuse_reflectance": base,
        "specular_reflectance": colour(material.specular, around),
        "nonlinear": material.nonlinear,
        **_indices(material),
        **rough,
    }
    if around.native:
        return nested
    if rough:
        nested["sample_visible"] = rough["distribution"] == "ggx"
    return {
        "type": "exact_coat",
        "nested": nested,
        "reflectance": base,
        "nonlinear": material.nonlinear,
        "eta": material.interior_ior / material.exterior_ior,
        **rough,
    }


@translate_material.register
def _(material: Principled, around: Surroundings) -> dict[str, Any]:
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
        "base_color": colour(material.base_colour, around),
        **index,
        **{name: number(getattr(material, name), around) for name in numbers},
    }


@translate_material.register
def _(material: Phong, around: Surroundings) -> dict[str, Any]:
    """Our plugin `comparisons.mitsuba.plugins.phong`."""
    colours = ("ambient", "diffuse", "specular", "mirror")
    return {
        "type": "textbook_phong",
        **{name: colour(getattr(material, name), around) for name in colours},
        "exponent": material.exponent,
        "half_vector": material.half_vector,
    }
