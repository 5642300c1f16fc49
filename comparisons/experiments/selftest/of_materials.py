"""Faults of scenes, of materials and textures: a parameter that is read or applied wrongly."""

from collections.abc import Callable
from typing import Any

from comparisons.experiments.selftest.fault import SceneFault
from comparisons.experiments.selftest.of_scenes import material
from reference_rt.rendering.scene import Scene


def texture(name: str, **fields: Any) -> Callable[[Scene], Scene]:
    """Change fields of a texture."""

    def change(scene: Scene) -> Scene:
        changed = scene.textures[name].model_copy(update=fields)
        return scene.changed(textures={**scene.textures, name: changed})

    return change


def uv(name: str, **fields: Any) -> Callable[[Scene], Scene]:
    """Change fields of a texture's map of uv."""

    def change(scene: Scene) -> Scene:
        place = scene.textures[name].uv.model_copy(update=fields)
        return texture(name, uv=place)(scene)

    return change


FAULTS = (
    SceneFault("k of a metal 5 % up", "material_conductor",
               material("sample", k=(4.1076, 2.5746, 2.2491))),
    SceneFault("eta and k exchanged", "material_conductor",
               material("sample", eta=(3.912, 2.452, 2.142), k=(0.2, 0.924, 1.102))),
    SceneFault("eta of a metal in the order b, g, r", "material_conductor",
               material("sample", eta=(1.102, 0.924, 0.2))),
    SceneFault("coat of 1.45 for 1.5", "material_plastic", material("sample", interior_ior=1.45)),
    SceneFault("plastic nonlinear", "material_plastic", material("sample", nonlinear=True)),
    SceneFault("rough plastic linear", "material_rough_plastic",
               material("sample", nonlinear=False)),
    SceneFault("roughness squared once more", "material_rough_dielectric",
               material("sample", alpha=(0.0625, 0.0625))),
    SceneFault("Beckmann for GGX in glass", "material_rough_dielectric",
               material("sample", distribution="beckmann")),
    SceneFault("GGX for Beckmann in metal", "material_rough_conductor_beckmann",
               material("sample", distribution="ggx")),
    SceneFault("pane of 1.6 for 1.5", "material_thin_dielectric",
               material("sample", interior_ior=1.6)),
    SceneFault("both sides alike", "material_two_sided", material("strip", back=None)),
    SceneFault("sides exchanged", "material_two_sided",
               material("strip", base="silver", back="green")),
    SceneFault("blend exchanged", "material_blend", material("worn", first="rust", second="steel")),
    SceneFault("weight of a blend turned upside down", "material_blend",
               uv("patches", scale=(2.0, -1.0))),
    SceneFault("mask ignored", "material_mask", material("shell", opacity=1.0)),
    SceneFault("holes shifted by a hundredth", "material_mask", uv("holes", offset=(0.01, 0.0))),
    SceneFault("bump 10 % too high", "material_bump", material("hammered", scale=0.088)),
    SceneFault("dents for bumps", "material_bump", material("hammered", scale=-0.08)),
    SceneFault("normal map read as sRGB", "material_normal_map", texture("dents", encoding="srgb")),
    SceneFault("normal map upside down", "material_normal_map", uv("dents", scale=(1.0, -1.0))),
    SceneFault("clear coat lost", "material_principled", material("paint", clearcoat=0.0)),
    SceneFault("sheen without tint", "material_principled", material("cloth", sheen_tint=0.0)),
    SceneFault("metallic 0.45 for 0.4", "material_principled", material("paint", metallic=0.45)),
    SceneFault("exponent 40 for 32", "phong_spheres", material("p2", exponent=40.0)),
    SceneFault("half vector for mirrored direction", "phong_spheres",
               material("p1", half_vector=True)),
    SceneFault("nearest for bilinear", "texture_filters", texture("smooth", filter="nearest")),
    SceneFault("repeat for mirror", "texture_filters", texture("flipped", wrap="repeat")),
    SceneFault("repeat for clamp", "texture_filters", texture("blocks", wrap="repeat")),
    SceneFault("texture turned by a degree", "texture_filters", uv("smooth", rotate=31.0)),
    SceneFault("texture upside down", "texture_filters", uv("smooth", scale=(2.0, -2.0))),
    SceneFault("image read as linear", "texture_filters", texture("smooth", encoding="raw")),
    SceneFault("colours of a checker exchanged", "whitted_classic",
               texture("squares", first=(0.9, 0.8, 0.1), second=(0.9, 0.1, 0.05))),
    SceneFault("texture of roughness ignored", "texture_roughness",
               uv("wear", scale=(1.0, 1.0))),
)  # fmt: skip
