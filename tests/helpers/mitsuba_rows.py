"""Dictionaries of Mitsuba's BSDFs and emitters that tests read: a row for each plugin and option.

Names that end with .png are files; functions stand for maps, which exist once Mitsuba runs.
"""

from typing import Any

import numpy as np

from comparisons.mitsuba.backend import mitsuba


def rgb(*values: float) -> dict[str, Any]:
    return {"type": "rgb", "value": list(values)}


def bitmap(name: str, **values: Any) -> dict[str, Any]:
    return {"type": "bitmap", "filename": name, **values}


def to_uv() -> Any:
    return mitsuba().ScalarTransform3f().translate([0.2, 0.3]).rotate(30).scale([2, -3])


def checkers(**values: Any) -> dict[str, Any]:
    return {"type": "checkerboard", **values}


def sheared() -> Any:
    """A map that is no scale, rotation and translation."""
    m = np.array([[2.0, 0.7, 0.1], [0.3, 1.5, 0.4], [0.0, 0.0, 1.0]])
    return mitsuba().ScalarTransform3f(m)


CLAY = {"type": "diffuse", "reflectance": 0.8}
THIN = {"type": "principledthin"}
COPPER = {"type": "roughconductor", "material": "Cu"}
ROUGH = {"type": "roughconductor", "distribution": "ggx", "alpha": 0.4}
PLAIN = {"flip_invalid_normals": False, "use_shadowing_function": False}
GREY = bitmap("grey.png", raw=True)

BSDFS: dict[str, Any] = {
    "default": None,
    "diffuse_rgb": {"type": "diffuse", "reflectance": rgb(0.8, 0.3, 0.1)},
    "diffuse_bitmap": {"type": "diffuse", "reflectance": bitmap("colour.png", to_uv=to_uv)},
    "diffuse_nearest": {
        "type": "diffuse",
        "reflectance": bitmap("colour.png", filter_type="nearest", wrap_mode="mirror", to_uv=to_uv),
    },
    "diffuse_clamp": {
        "type": "diffuse",
        "reflectance": bitmap("colour.png", wrap_mode="clamp", raw=True, to_uv=to_uv),
    },
    "diffuse_checkers": {"type": "diffuse", "reflectance": checkers(color0=0.7, to_uv=to_uv)},
    "diffuse_constant": {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.3}},
    "mirror": {"type": "conductor", "specular_reflectance": rgb(0.9, 0.5, 0.1)},
    "gold": {"type": "conductor", "material": "Au"},
    "metal": {"type": "conductor", "eta": rgb(0.2, 1, 1.5), "k": rgb(3, 2, 1)},
    "rough_mirror": {"type": "roughconductor", "distribution": "ggx"},
    "rough_metal": {**COPPER, "alpha": 0.2},
    "rough_copper": {**COPPER, "distribution": "GGX", "alpha": 0.3},
    "grained": {
        "type": "roughconductor",
        "distribution": "ggx",
        "alpha_u": 0.4,
        "alpha_v": 0.1,
        "eta": 0.3,
        "k": 2.0,
    },
    "rough_textured": {
        "type": "roughconductor",
        "distribution": "ggx",
        "alpha": GREY,
        "material": "Al",
    },
    "glass": {"type": "dielectric"},
    "diamond": {
        "type": "dielectric",
        "int_ior": "diamond",
        "ext_ior": "water",
        "specular_transmittance": rgb(0.9, 0.8, 0.7),
    },
    "pane": {"type": "thindielectric", "specular_reflectance": 0.7},
    "frosted": {"type": "roughdielectric", "distribution": "ggx", "alpha": 0.2},
    "plastic": {"type": "plastic", "diffuse_reflectance": rgb(0.8, 0.3, 0.1)},
    "plastic_nonlinear": {
        "type": "plastic",
        "nonlinear": True,
        "int_ior": 1.6,
        "diffuse_reflectance": bitmap("colour.png"),
    },
    "rough_plastic": {"type": "roughplastic", "diffuse_reflectance": rgb(0.8, 0.3, 0.1)},
    "rough_plastic_ggx": {
        "type": "roughplastic",
        "distribution": "ggx",
        "alpha": 0.25,
        "nonlinear": True,
    },
    "principled": {
        "type": "principled",
        "base_color": rgb(0.8, 0.3, 0.1),
        "roughness": 0.3,
        "metallic": 0.4,
        "specular": 0.6,
        "spec_tint": 0.3,
        "sheen": 0.5,
        "sheen_tint": 0.4,
        "clearcoat": 0.5,
        "clearcoat_gloss": 0.3,
        "flatness": 0.2,
        "anisotropic": 0.5,
    },
    "principled_glass": {
        "type": "principled",
        "base_color": bitmap("colour.png"),
        "roughness": GREY,
        "spec_trans": 0.7,
        "eta": 1.4,
    },
    "blend": {
        "type": "blendbsdf",
        "weight": 0.3,
        "first": CLAY,
        "second": {"type": "roughconductor", "alpha": 0.3, "distribution": "ggx"},
    },
    "blend_checkers": {
        "type": "blendbsdf",
        "weight": checkers(color0=0.9, color1=0.1, to_uv=to_uv),
        "first": CLAY,
        "second": {"type": "diffuse", "reflectance": 0.1},
    },
    "mask": {"type": "mask", "opacity": 0.6, "inside": CLAY},
    "mask_textured": {"type": "mask", "opacity": GREY, "inside": CLAY},
    "two_sided": {"type": "twosided", "inside": CLAY},
    "two_sides": {"type": "twosided", "front": CLAY, "inside": {"type": "plastic"}},
    "null": {"type": "null"},
    "bump": {"type": "bumpmap", "height": GREY, "scale": 0.1, "inside": CLAY, **PLAIN},
    "normals": {
        "type": "normalmap",
        "normalmap": bitmap("colour.png", raw=True, to_uv=to_uv),
        "inside": CLAY,
        **PLAIN,
    },
    "bump_default": {"type": "bumpmap", "height": GREY, "scale": 0.3, "inside": CLAY},
    "bump_flipped": {
        "type": "bumpmap",
        "height": GREY,
        "scale": 1.0,
        "inside": CLAY,
        "use_shadowing_function": False,
    },
    "bump_shadowed": {
        "type": "bumpmap",
        "height": GREY,
        "scale": 1.0,
        "inside": {"type": "principled"},
        "flip_invalid_normals": False,
    },
    "bump_sheet": {
        "type": "twosided",
        "inside": {"type": "bumpmap", "height": GREY, "scale": 0.5, "inside": CLAY},
    },
    "bump_blend": {
        "type": "bumpmap",
        "height": GREY,
        "scale": 0.4,
        "inside": {"type": "blendbsdf", "weight": 0.4, "first": CLAY, "second": ROUGH},
    },
    "bump_mirror": {
        "type": "bumpmap",
        "height": GREY,
        "scale": 0.2,
        "inside": {"type": "conductor"},
    },
    "normals_default": {
        "type": "normalmap",
        "normalmap": bitmap("colour.png", raw=True, to_uv=to_uv),
        "inside": CLAY,
    },
    "normals_blend": {
        "type": "blendbsdf",
        "weight": 0.4,
        "first": ROUGH,
        "second": {
            "type": "normalmap",
            "normalmap": bitmap("colour.png", raw=True),
            "inside": ROUGH,
        },
    },
    "normals_glass": {
        "type": "normalmap",
        "normalmap": bitmap("colour.png", raw=True),
        "inside": {"type": "dielectric"},
    },
    "sheared": {"type": "diffuse", "reflectance": bitmap("colour.png", to_uv=sheared)},
    "sheared_checkers": {"type": "diffuse", "reflectance": checkers(color0=0.9, to_uv=sheared)},
    "grained_textures": {
        "type": "roughconductor",
        "distribution": "ggx",
        "alpha_u": GREY,
        "alpha_v": checkers(color0=0.2, color1=0.5),
        "material": "Al",
    },
    "grained_half": {
        "type": "roughdielectric",
        "distribution": "ggx",
        "alpha_u": 0.4,
        "alpha_v": GREY,
    },
    "thin": {
        "type": "principledthin",
        "base_color": rgb(0.8, 0.3, 0.1),
        "roughness": 0.4,
        "spec_trans": 0.6,
        "eta": 1.33,
        "spec_tint": 0.4,
        "sheen": 0.7,
        "sheen_tint": 0.3,
        "flatness": 0.5,
        "diff_trans": 0.8,
        "anisotropic": 0.5,
    },
    "thin_sheet": {**THIN, "base_color": bitmap("colour.png"), "diff_trans": 2.0},
    "thin_pane": {**THIN, "spec_trans": 1.0, "eta": 0.7, "roughness": GREY},
}

WIDE = ("rough_plastic", "rough_plastic_ggx", "rough_metal")


def place() -> Any:
    return mitsuba().ScalarTransform4f().look_at([1, 1.5, 2], [0.1, 0.2, 0], [0, 1, 0.1])


EMITTERS: dict[str, dict[str, Any]] = {
    "point": {"type": "point", "position": [1, 2, 1], "intensity": rgb(3, 2, 1)},
    "point_placed": {"type": "point", "to_world": place, "intensity": 2.0},
    "spot": {"type": "spot", "to_world": place, "intensity": rgb(5, 7, 6)},
    "spot_wide": {
        "type": "spot",
        "to_world": place,
        "cutoff_angle": 50.0,
        "beam_width": 5.0,
        "intensity": 4.0,
    },
    "spot_textured": {
        "type": "spot",
        "to_world": place,
        "cutoff_angle": 60.0,
        "texture": bitmap("colour.png"),
        "intensity": rgb(20, 30, 25),
    },
    "spot_sheared": {
        "type": "spot",
        "to_world": place,
        "cutoff_angle": 40.0,
        "texture": bitmap("colour.png", raw=True, to_uv=sheared),
        "intensity": 20.0,
    },
    "projector": {
        "type": "projector",
        "to_world": place,
        "irradiance": bitmap("colour.png"),
        "fov": 60.0,
    },
    "projector_tall": {
        "type": "projector",
        "to_world": place,
        "irradiance": bitmap("grey.png", to_uv=to_uv),
        "fov": 40.0,
        "fov_axis": "larger",
        "scale": 3.0,
    },
    "projector_plain": {"type": "projector", "to_world": place, "irradiance": rgb(1, 2, 3)},
    "projector_checkers": {
        "type": "projector",
        "to_world": place,
        "irradiance": checkers(color0=0.9, to_uv=to_uv),
        "fov": 50.0,
    },
    "directional": {"type": "directional", "direction": [1, -2, -1], "irradiance": rgb(2, 1, 3)},
    "directional_placed": {"type": "directional", "to_world": place},
    "constant": {"type": "constant"},
    "constant_spectrum": {
        "type": "constant",
        "radiance": {"type": "spectrum", "value": [(400.0, 1.0), (500.0, 2.0), (700.0, 0.5)]},
    },
    "envmap": {"type": "envmap", "filename": "sky.png"},
    "envmap_placed": {"type": "envmap", "filename": "sky.png", "scale": 2.5, "to_world": place},
}
