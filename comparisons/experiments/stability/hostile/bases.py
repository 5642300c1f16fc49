"""Sound scenes, out of which hostile ones are made."""

from comparisons.experiments.fuzz.assets import COPIES
from comparisons.experiments.fuzz.data import Data

_TURN = {"rotate": {"axis": [1.0, 2.0, 3.0], "degrees": 33.0}}

SHAPES: Data = {
    "camera": {"type": "perspective", "eye": [0.0, 1.0, 9.0], "target": [0.0, 0.0, 0.0],
               "up": [0.0, 1.0, 0.0], "fov": 50.0},
    "integrator": {"type": "ray_cast", "show": "normal"},
    "groups": {"pair": [{"type": "sphere", "radius": 0.3},
                        {"type": "mesh", "file": "ball.ply", "transform": [{"scale": 0.3}]}]},
    "shapes": [
        {"type": "sphere", "center": [-3.0, 1.0, 0.0], "radius": 0.6},
        {"type": "sphere", "radius": 0.6, "transform": [{"scale": [1.5, 0.6, 1.0]}, _TURN]},
        {"type": "box", "transform": [
            {"scale": [0.5, 0.4, 0.3]},
            {"matrix": [[1.0, 0.7, 0.0, 0.0], [0.0, 1.0, 0.0, 0.5], [0.0, 0.4, 1.0, 0.0]]},
            {"translate": [1.0, 1.3, 0.0]}]},
        {"type": "plane", "transform": [{"translate": [0.0, 0.0, -5.0]}]},
        {"type": "disk", "transform": [{"translate": [2.0, -1.0, 0.0]}]},
        {"type": "rectangle", "transform": [{"scale": [1.0, 0.5, 1.0]}, _TURN]},
        {"type": "triangle", "v0": [0.0, 0.0, 1.0], "v1": [1.0, 0.0, 1.0], "v2": [0.0, 1.0, 1.0]},
        {"type": "polygon", "rings": [[[0.0, 0.0], [2.0, 0.0], [0.0, 1.0], [1.0, -1.0]]]},
        {"type": "cylinder", "radius": 0.5, "z_min": -0.5, "z_max": 0.5, "capped": True,
         "transform": [_TURN, {"translate": [-2.0, -1.0, 0.0]}]},
        {"type": "cone", "radius": 0.5, "height": 1.0, "top_radius": 0.2,
         "transform": [{"translate": [-1.0, 2.0, 0.0]}]},
        {"type": "quadric", "coefficients": [1.0, 1.0, 0.0, 0.1, 0.0, 0.2, 0.0, 0.0, -1.0, 0.1],
         "lower": [-1.0, -1.0, 0.0], "upper": [1.0, 1.0, 1.0], "capped": True},
        {"type": "torus", "major_radius": 1.0, "minor_radius": 0.3,
         "transform": [{"scale": [1.0, -1.5, 1.0]}]},
        {"type": "instance", "group": "pair", "file": COPIES, "transform": [_TURN]},
        {"type": "mesh", "file": "ball.obj", "transform": [{"translate": [3.0, 1.0, 0.0]}]},
        {"type": "difference", "of": [
            {"type": "box", "transform": [{"scale": 0.5}]},
            {"type": "sphere", "radius": 0.6},
            {"type": "mesh", "file": "ball.ply", "transform": [{"scale": 0.5}]}],
         "transform": [{"translate": [3.0, -1.0, 0.0]}]},
        {"type": "instance", "group": "pair", "transform": [{"scale": 2.0}]},
    ],
}  # fmt: skip
"""Every kind of shape, seen by ray casting."""

_GREY = {"type": "diffuse", "reflectance": [0.5, 0.4, 0.3]}

LIGHT: Data = {
    "camera": {"type": "thin_lens", "eye": [0.0, 1.0, 6.0], "target": [0.0, 0.0, 0.0],
               "fov": 50.0, "aperture_radius": 0.1, "focus_distance": 6.0},
    "film": {"filter": {"type": "gaussian", "stddev": 0.5}},
    "sampler": {"type": "independent", "seed": 7},
    "integrator": {"type": "path", "max_depth": 8, "rr_depth": 5},
    "textures": {
        "squares": {"type": "checker", "first": 0.6, "second": [0.5, 0.1, 0.1],
                    "uv": {"scale": 8.0, "rotate": 30.0, "offset": [0.1, 0.2]}},
        "tiles": {"type": "bitmap", "file": "tiles.png", "scale": 0.9}},
    "materials": {
        "floor": {"type": "diffuse", "reflectance": "squares"},
        "glass": {"type": "dielectric", "interior_ior": 1.5, "exterior_ior": 1.0},
        "metal": {"type": "rough_conductor", "eta": [0.2, 0.9, 1.1], "k": [3.9, 2.4, 2.2],
                  "alpha": [0.1, 0.3]},
        "paint": {"type": "plastic", "reflectance": "tiles", "interior_ior": 1.5},
        "cloth": {"type": "principled", "base_colour": [0.2, 0.3, 0.5], "roughness": 0.5,
                  "metallic": 0.3, "sheen": 0.5, "clearcoat": 0.5, "spec_trans": 0.3},
        "bumps": {"type": "bump", "base": "paint", "height": "tiles", "scale": 0.2},
        "lamp": {"type": "emissive", "radiance": [9.0, 8.0, 7.0]}},
    "shapes": [
        {"type": "rectangle", "material": "floor", "transform": [
            {"scale": 5.0}, {"rotate": {"axis": [1.0, 0.0, 0.0], "degrees": -90.0}}]},
        {"type": "sphere", "material": "glass", "center": [0.0, 0.6, 0.0], "radius": 0.5},
        {"type": "sphere", "material": "metal", "center": [-1.2, 0.6, 0.0], "radius": 0.5},
        {"type": "sphere", "material": "cloth", "center": [1.2, 0.6, 0.0], "radius": 0.5},
        {"type": "box", "material": "bumps", "transform": [{"scale": 0.3}, _TURN]},
        {"type": "sphere", "material": "lamp", "center": [2.0, 3.0, 1.0], "radius": 0.4},
        {"type": "triangle", "material": "lamp", "v0": [0.0, 3.0, 0.0], "v1": [1.0, 3.0, 0.0],
         "v2": [0.0, 3.0, 1.0]}],
    "lights": [
        {"type": "point", "position": [1.0, 2.0, 3.0], "intensity": [3.0, 2.0, 1.0]},
        {"type": "spot", "origin": [-1.0, 2.0, 3.0], "target": [0.0, 0.0, 0.0], "intensity": 5.0,
         "cutoff_angle": 20.0, "beam_width": 15.0},
        {"type": "directional", "direction": [0.0, -1.0, 1.0], "irradiance": 1.0},
        {"type": "environment_map", "file": "sky.exr", "scale": 1.0}],
}  # fmt: skip
"""Materials, textures, lights, a filter and a lens, seen by path tracing."""

RECURSIVE: Data = {
    "camera": {"type": "orthographic", "eye": [0.0, 1.0, 6.0], "target": [0.0, 0.0, 0.0],
               "width": 6.0},
    "integrator": {"type": "whitted", "max_depth": 8, "min_contribution": 0.001},
    "materials": {
        "grey": _GREY,
        "mirror": {"type": "mirror", "reflectance": 0.9},
        "glass": {"type": "dielectric", "interior_ior": 1.5},
        "classic": {"type": "phong", "ambient": 0.1, "diffuse": 0.6, "specular": 0.3,
                    "exponent": 20.0, "mirror": 0.2}},
    "shapes": [
        {"type": "plane", "material": "grey", "transform": [
            {"rotate": {"axis": [1.0, 0.0, 0.0], "degrees": -90.0}}]},
        {"type": "sphere", "material": "glass", "center": [0.0, 0.6, 0.0], "radius": 0.5},
        {"type": "sphere", "material": "mirror", "center": [-1.2, 0.6, 0.0], "radius": 0.5},
        {"type": "sphere", "material": "classic", "center": [1.2, 0.6, 0.0], "radius": 0.5}],
    "lights": [
        {"type": "point", "position": [1.0, 2.0, 3.0], "intensity": 9.0},
        {"type": "ambient", "radiance": 0.2},
        {"type": "constant", "radiance": [0.2, 0.3, 0.4]}],
}  # fmt: skip
"""Recursive ray tracing."""

LAYERS: Data = {
    "camera": {"type": "perspective", "eye": [0.0, 1.0, 6.0], "target": [0.0, 0.0, 0.0],
               "view": [-0.5, 0.5, -0.4, 0.4], "distance": 1.0},
    "film": {"filter": {"type": "mitchell", "b": 0.3, "c": 0.3},
             "layers": ["albedo", "normal", "depth", "id"]},
    "integrator": {"type": "direct", "light_samples": 2, "bsdf_samples": 2},
    "textures": {"tiles": {"type": "bitmap", "file": "tiles.png", "encoding": "raw"}},
    "materials": {
        "grey": _GREY,
        "coat": {"type": "rough_plastic", "reflectance": "tiles", "alpha": 0.2,
                 "interior_ior": 1.5},
        "frosted": {"type": "rough_dielectric", "interior_ior": 1.5, "exterior_ior": 1.0,
                    "alpha": [0.1, 0.2]},
        "gold": {"type": "conductor", "eta": [0.2, 0.9, 1.1], "k": [3.9, 2.4, 2.2]},
        "pane": {"type": "thin_dielectric", "interior_ior": 1.5},
        "holes": {"type": "mask", "base": "coat", "opacity": 0.7},
        "both": {"type": "blend", "first": "coat", "second": "frosted", "weight": 0.4},
        "tilted": {"type": "normal_map", "base": "grey", "normals": "tiles"},
        "twice": {"type": "two_sided", "base": "tilted"},
        "lamp": {"type": "emissive", "radiance": [9.0, 8.0, 7.0], "base": "grey"}},
    "shapes": [
        {"type": "rectangle", "material": "twice", "transform": [
            {"scale": 5.0}, {"rotate": {"axis": [1.0, 0.0, 0.0], "degrees": -90.0}}]},
        {"type": "box", "material": "holes", "transform": [{"scale": 0.4}, _TURN]},
        {"type": "sphere", "material": "both", "center": [-1.2, 0.6, 0.0], "radius": 0.5},
        {"type": "sphere", "material": "gold", "center": [1.2, 0.6, 0.0], "radius": 0.5},
        {"type": "sphere", "material": "pane", "center": [0.0, 0.6, 1.0], "radius": 0.5},
        {"type": "rectangle", "material": "lamp", "transform": [
            {"rotate": {"axis": [1.0, 0.0, 0.0], "degrees": 90.0}},
            {"translate": [0.0, 4.0, 0.0]}]},
        {"type": "disk", "material": "lamp", "transform": [{"translate": [0.0, 1.0, -3.0]}]}],
    "lights": [{"type": "constant", "radiance": 0.1}],
}  # fmt: skip
"""Materials made of others, and what else takes long to set up in plain Python."""

BASES = {"shapes": SHAPES, "light": LIGHT, "recursive": RECURSIVE, "layers": LAYERS}

PLAIN = ("shapes", "light", "recursive")
"""Those that plain Python sets up in milliseconds."""
