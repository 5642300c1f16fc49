"""Materials: to BSDFs; what an emissive one emits is the shape's emitter."""

from functools import singledispatch
from typing import Any

from comparisons.translate.errors import UntranslatableError
from reference_rt.materials import Dielectric, Diffuse, Emissive, Mirror


def rgb(colour: tuple[float, float, float]) -> dict[str, Any]:
    """Linear sRGB, which the rgb variants use as it is."""
    return {"type": "rgb", "value": list(colour)}


@singledispatch
def translate_material(material: Any, materials: dict[str, Any]) -> dict[str, Any]:
    """A BSDF's dict; `materials` are the scene's, by name.  Raises UntranslatableError."""
    raise UntranslatableError(material, "material")


@translate_material.register
def _(material: Diffuse, materials: dict[str, Any]) -> dict[str, Any]:
    return {"type": "diffuse", "reflectance": rgb(material.reflectance)}


@translate_material.register
def _(material: Mirror, materials: dict[str, Any]) -> dict[str, Any]:
    # Without a material Mitsuba's conductor has eta = 0, k = 1, and reflects everything.
    return {"type": "conductor", "specular_reflectance": rgb(material.reflectance)}


@translate_material.register
def _(material: Dielectric, materials: dict[str, Any]) -> dict[str, Any]:
    return {
        "type": "dielectric",
        "int_ior": material.interior_ior,
        "ext_ior": material.exterior_ior,
    }


@translate_material.register
def _(material: Emissive, materials: dict[str, Any]) -> dict[str, Any]:
    if material.base is None:
        return {"type": "diffuse", "reflectance": rgb((0.0, 0.0, 0.0))}
    return translate_material(materials[material.base], materials)


def parts_of(name: str | None, materials: dict[str, Any]) -> dict[str, Any]:
    """What a shape of material `name` carries: "bsdf" and, where it shines, "emitter"."""
    material = Diffuse() if name is None else materials[name]
    parts = {"bsdf": translate_material(material, materials)}
    if isinstance(material, Emissive):
        parts["emitter"] = {"type": "area", "radiance": rgb(material.radiance)}
    return parts
