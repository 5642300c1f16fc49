"""BSDFs of Mitsuba scenes.  Defaults are Mitsuba's, and are always written out."""

from collections.abc import Callable
from typing import Any

from comparisons.mitsuba.node import Node, Reading
from comparisons.mitsuba.plugins.materials import GLTF_COLOURS, GLTF_NUMBERS
from comparisons.textures.reading import (
    colour_or_texture,
    fields_of,
    index_of_refraction,
    is_checker_of_textures,
    metal,
    number_or_texture,
    texture_name,
)
from reference_rt.materials import (
    Blend,
    Bump,
    Conductor,
    Dielectric,
    Diffuse,
    GltfPbr,
    Mask,
    Material,
    Mirror,
    NormalMap,
    Phong,
    Plastic,
    Principled,
    PrincipledThin,
    RoughConductor,
    RoughDielectric,
    RoughPlastic,
    ThinDielectric,
    TwoSided,
)

# ---- principled BSDFs, and those of our own plugins ----------------------------------------------


_NUMBERS = (
    "roughness", "metallic", "spec_tint", "anisotropic", "sheen", "sheen_tint", "clearcoat",
    "clearcoat_gloss", "spec_trans", "flatness",
)  # fmt: skip


def principled(reading: Reading, node: Node) -> Material:
    # How lobes are sampled does not change the picture.
    node.ignore(
        "main_specular_sampling_rate",
        "clearcoat_sampling_rate",
        "diffuse_reflectance_sampling_rate",
    )
    values: dict[str, Any] = {}
    if node.has("eta") and node.has("specular"):
        raise node.error("has both 'eta' and 'specular'; expected one of them")
    if node.has("eta"):
        values["eta"] = node.number("eta", 1.5)
    else:
        values["specular"] = node.number("specular", 0.5)
    for name in _NUMBERS:
        values[name] = number_or_texture(reading, node, name, 0.5 if name == "roughness" else 0.0)
    return Principled(base_colour=colour_or_texture(reading, node, "base_color", 0.5), **values)


_THIN_NUMBERS = (
    "roughness", "anisotropic", "spec_trans", "spec_tint", "sheen", "sheen_tint", "flatness",
    "diff_trans",
)  # fmt: skip


def principled_thin(reading: Reading, node: Node) -> Material:
    # How lobes are sampled does not change the picture.
    kinds = (f"{lobe}_{way}" for lobe in ("specular", "diffuse") for way in _WAYS)
    node.ignore(*(f"{kind}_sampling_rate" for kind in kinds))
    values: dict[str, Any] = {"eta": node.number("eta", 1.5)}
    for name in _THIN_NUMBERS:
        values[name] = number_or_texture(reading, node, name, 0.5 if name == "roughness" else 0.0)
    return PrincipledThin(base_colour=colour_or_texture(reading, node, "base_color", 0.5), **values)


_WAYS = ("reflectance", "transmittance")


def phong(reading: Reading, node: Node) -> Material:
    """Of our plugin, in files that we have written."""
    colours: dict[str, Any] = {
        key: colour_or_texture(reading, node, key, 0.0)
        for key in ("ambient", "diffuse", "specular", "mirror")
    }
    if node.has("exponent"):
        colours["exponent"] = node.number("exponent", 1.0)
    return Phong(**colours, half_vector=node.flag("half_vector"))


def gltf_pbr(reading: Reading, node: Node) -> Material:
    """Of our plugin, in files that we have written."""
    values: dict[str, Any] = {"ior": node.number("ior", 1.5)}
    values |= {name: colour_or_texture(reading, node, name, 1.0) for name in GLTF_COLOURS}
    values |= {name: number_or_texture(reading, node, name, 1.0) for name in GLTF_NUMBERS}
    return GltfPbr(**values)


# ---- the other BSDFs -----------------------------------------------------------------------------


Reader = Callable[[Reading, Node], Material]

BLACK = "black"
"""The name of the material that scatters nothing."""

NO_INDEX = 1e-12
"""The index of refraction of Mitsuba's metal without a name, whose 0 ours cannot have: it reflects
all but 4e-12 of the light, with k = 1."""


def material_name(reading: Reading, node: Node) -> str:
    """The name of a BSDF among the materials of `reading`, which is read if it is not yet."""
    key = ("bsdf", node.index)
    if key not in reading.names:
        if node.plugin not in _READERS:
            raise node.unsupported(f"expected one of: {', '.join(sorted(_READERS))}")
        material = _of_checkers(reading, node)
        name = reading.unused(node.name, node.plugin, reading.materials)
        reading.materials[name] = material
        reading.names[key] = name
    return reading.names[key]


def _read(reading: Reading, node: Node) -> Material:
    with node.checking():
        material = _READERS[node.plugin](reading, node)
    node.finish()
    return material


def _of_checkers(reading: Reading, node: Node) -> Material:
    """The material of a BSDF: where a checkerboard has textures for its fields, a blend of one
    material for each kind of field."""
    for texture in node.clone().children("Texture"):
        if texture.index in reading.fields or not is_checker_of_textures(texture):
            continue
        names = []
        for field in ("color0", "color1"):
            reading.fields[texture.index] = field
            part = _of_checkers(reading, node.clone())
            names.append(
                reading.unused(f"{node.name or node.plugin}_{field}", "", reading.materials)
            )
            reading.materials[names[-1]] = part
        del reading.fields[texture.index]
        weight = reading.unused(texture.name, texture.plugin, reading.textures)
        reading.textures[weight] = fields_of(texture)
        return Blend(first=names[0], second=names[1], weight=weight)
    return _read(reading, node)


def black(reading: Reading) -> str:
    """The name of a material that scatters nothing."""
    if "black" not in reading.names:
        name = reading.unused(BLACK, BLACK, reading.materials)
        reading.materials[name] = Diffuse(reflectance=(0.0, 0.0, 0.0))
        reading.names["black"] = name
    return reading.names["black"]


def _nested(reading: Reading, node: Node, least: int, most: int) -> list[str]:
    """The names of nested BSDFs."""
    found = node.children("BSDF")
    if not least <= len(found) <= most:
        expected = str(least) if least == most else f"{least} or {most}"
        raise node.error(f"has {len(found)} nested BSDFs; expected {expected}")
    return [material_name(reading, child) for child in found]


def _diffuse(reading: Reading, node: Node) -> Material:
    return Diffuse(reflectance=colour_or_texture(reading, node, "reflectance", 0.5))


def _metal(reading: Reading, node: Node) -> dict[str, Any]:
    """eta, k and reflectance; eta = 0 and k = 1 for a metal that is not named."""
    reflectance = colour_or_texture(reading, node, "specular_reflectance", 1.0)
    name = node.text("material", "none")
    if node.has("eta") or name == "none":
        if name != "none":
            raise node.error("has both 'material' and 'eta'; expected one of them")
        eta = colour_or_texture(reading, node, "eta", 0.0, "unbounded")
        k = colour_or_texture(reading, node, "k", 1.0, "unbounded")
        if isinstance(eta, str) or isinstance(k, str):
            raise node.error("'eta' or 'k' is a texture; expected colours")
    else:
        eta, k = metal(node, name)
    return {"eta": eta, "k": k, "reflectance": reflectance}


def _without_zeros(values: dict[str, Any]) -> dict[str, Any]:
    return values | {"eta": tuple(max(x, NO_INDEX) for x in values["eta"])}


def _conductor(reading: Reading, node: Node) -> Material:
    values = _metal(reading, node)
    if max(values["eta"]) == 0.0:
        if min(values["k"]) > 0.0:
            return Mirror(reflectance=values["reflectance"])
        raise node.error("'eta' and 'k' are 0; expected an index of refraction")
    return Conductor(**_without_zeros(values))


def _rough_conductor(reading: Reading, node: Node) -> Material:
    values = _without_zeros(_metal(reading, node))
    return RoughConductor(**values, **_roughness(reading, node))


def _roughness(reading: Reading, node: Node) -> dict[str, Any]:
    distribution = node.choice("distribution", "beckmann", ("beckmann", "ggx"))
    # How it is sampled does not change the picture; but see `reference.sample_visible`.
    node.ignore("sample_visible")
    if node.has("alpha_u") or node.has("alpha_v"):
        if not (node.has("alpha_u") and node.has("alpha_v")) or node.has("alpha"):
            raise node.error("expected 'alpha', or 'alpha_u' and 'alpha_v'")
        along_u = number_or_texture(reading, node, "alpha_u", 0.1)
        along_v = number_or_texture(reading, node, "alpha_v", 0.1)
        return {"distribution": distribution, "alpha": (along_u, along_v)}
    alpha = number_or_texture(reading, node, "alpha", 0.1)
    return {"distribution": distribution, "alpha": alpha}


def _indices(node: Node, inside: str = "bk7") -> dict[str, float]:
    return {
        "interior_ior": index_of_refraction(node, "int_ior", inside),
        "exterior_ior": index_of_refraction(node, "ext_ior", "air"),
    }


def _glass(reading: Reading, node: Node) -> dict[str, Any]:
    return {
        **_indices(node),
        "reflectance": colour_or_texture(reading, node, "specular_reflectance", 1.0),
        "transmittance": colour_or_texture(reading, node, "specular_transmittance", 1.0),
    }


def _dielectric(reading: Reading, node: Node) -> Material:
    return Dielectric(**_glass(reading, node))


def _thin_dielectric(reading: Reading, node: Node) -> Material:
    return ThinDielectric(**_glass(reading, node))


def _rough_dielectric(reading: Reading, node: Node) -> Material:
    return RoughDielectric(**_glass(reading, node), **_roughness(reading, node))


def _coat(reading: Reading, node: Node) -> dict[str, Any]:
    return {
        **_indices(node, "polypropylene"),
        "reflectance": colour_or_texture(reading, node, "diffuse_reflectance", 0.5),
        "specular": colour_or_texture(reading, node, "specular_reflectance", 1.0),
        "nonlinear": node.flag("nonlinear"),
    }


def _plastic(reading: Reading, node: Node) -> Material:
    return Plastic(**_coat(reading, node))


def _rough_plastic(reading: Reading, node: Node) -> Material:
    roughness = _roughness(reading, node)
    alpha = roughness.pop("alpha")
    if isinstance(alpha, tuple):
        if alpha[0] != alpha[1]:
            raise node.error("is anisotropic, which Mitsuba refuses, too; expected one 'alpha'")
        alpha = alpha[0]
    if isinstance(alpha, str):
        raise node.error("'alpha' is a texture, which Mitsuba refuses, too; expected a number")
    return RoughPlastic(**_coat(reading, node), **roughness, alpha=alpha)


def _blend(reading: Reading, node: Node) -> Material:
    if not node.has("weight"):
        raise node.error("has no 'weight'; expected a number or a texture")
    weight = number_or_texture(reading, node, "weight", 0.5)
    first, second = _nested(reading, node, 2, 2)
    return Blend(first=first, second=second, weight=weight)


def _mask(reading: Reading, node: Node) -> Material:
    opacity = number_or_texture(reading, node, "opacity", 0.5)
    (base,) = _nested(reading, node, 1, 1)
    return Mask(base=base, opacity=opacity)


def _two_sided(reading: Reading, node: Node) -> Material:
    if node.flag("allow_transmission"):
        raise node.error("'allow_transmission' is not supported; expected false")
    base, *back = _nested(reading, node, 1, 2)
    transmits = [name for name in (base, *back) if reading.materials[name].transmits]
    if transmits:
        raise node.error(
            f"'{transmits[0]}' transmits light; expected materials that only reflect, as Mitsuba "
            "does"
        )
    return TwoSided(base=base, back=back[0] if back else None)


def _null(reading: Reading, node: Node) -> Material:
    return Mask(base=black(reading), opacity=0.0)


def _tilt(node: Node) -> dict[str, Any]:
    """The options of bump and normal maps: on by default, unlike ours."""
    return {key: node.flag(key, True) for key in ("flip_invalid_normals", "use_shadowing_function")}


def _bump(reading: Reading, node: Node) -> Material:
    (base,) = _nested(reading, node, 1, 1)
    texture = node.only("Texture")
    if texture is None:
        raise node.error("has no texture; expected one")
    height = texture_name(reading, texture, as_number=True)
    return Bump(base=base, height=height, scale=node.number("scale", 1.0), **_tilt(node))


def _normal_map(reading: Reading, node: Node) -> Material:
    (base,) = _nested(reading, node, 1, 1)
    normals = colour_or_texture(reading, node, "normalmap", 0.5)
    if normals == (0.5, 0.5, 1.0):  # the surface's own normals: no law applies
        node.ignore("flip_invalid_normals", "use_shadowing_function")
        found: Material = reading.materials[base]
        return found
    if not isinstance(normals, str):
        raise node.error("'normalmap' is a colour, or not given; expected a texture")
    return NormalMap(base=base, normals=normals, **_tilt(node))


_READERS: dict[str, Reader] = {
    "diffuse": _diffuse,
    "conductor": _conductor,
    "roughconductor": _rough_conductor,
    "dielectric": _dielectric,
    "thindielectric": _thin_dielectric,
    "roughdielectric": _rough_dielectric,
    "plastic": _plastic,
    "roughplastic": _rough_plastic,
    "principled": principled,
    "principledthin": principled_thin,
    "blendbsdf": _blend,
    "mask": _mask,
    "textbook_phong": phong,
    "gltf_pbr": gltf_pbr,
    "twosided": _two_sided,
    "null": _null,
    "bumpmap": _bump,
    "normalmap": _normal_map,
}
