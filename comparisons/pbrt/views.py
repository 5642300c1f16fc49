"""Camera, film, sampler, integrator and lights in the words of pbrt-v4's file format."""

import math
from functools import partial
from typing import Any

import numpy as np
from scipy.ndimage import map_coordinates

from comparisons.mitsuba.writing.files import UnwritableError
from comparisons.pbrt.surfaces import Params, Writing, words
from reference_rt import lights
from reference_rt.cameras import Orthographic, Pinhole, ThinLens, film
from reference_rt.cameras.view_rectangle import by_width
from reference_rt.core.arrays import FloatArray
from reference_rt.integrators import Direct
from reference_rt.integrators import Path as PathTracing
from reference_rt.lights.emitters.environment_map import orthogonal
from reference_rt.sampling import Independent, Sobol
from reference_rt.textures.image_file import read_image

ENDLESS = 2**31 - 1
"""Depth of paths without a limit: the largest number that pbrt reads."""


def camera_of(camera: Any, picture: film.Film) -> list[str]:
    """pbrt's camera looks along +z of a left-handed space: x is mirrored; y of a pinhole's picture,
    which is upside down.  With an angle of 90 degrees the screen window is at distance 1."""
    if camera.near or camera.far:
        raise UnwritableError("clipping planes")
    mirror = (1, -1, 1) if isinstance(camera, Pinhole) else (-1, 1, 1)
    if isinstance(camera, Pinhole):
        width = camera.film_width / camera.film_distance
        params: Params = {"float screenwindow": by_width(width, picture.width, picture.height)}
    else:
        params = {"float screenwindow": camera.rectangle(picture.width, picture.height)}
    plugin = "orthographic" if isinstance(camera, Orthographic) else "perspective"
    if plugin == "perspective":
        params["float fov"] = 90.0
    if isinstance(camera, ThinLens):
        params["float lensradius"] = camera.aperture_radius
        params["float focaldistance"] = camera.focus
    place = words("LookAt", numbers=(*camera.eye, *camera.target, *camera.up))
    return [words("Scale", numbers=mirror), place, words("Camera", plugin, params=params)]


def film_of(picture: film.Film, name: str) -> list[str]:
    """The film's values are linear radiance: an exposure of 1 s at ISO 100 makes the sensor's
    factor 1, and the observer of 1931 is not balanced to another white."""
    match picture.filter:
        case film.TentFilter(radius=r):
            plugin, r, more = "triangle", r, Params()
        case film.GaussianFilter(stddev=s):
            plugin, r, more = "gaussian", 4.0 * s, {"float sigma": s}
        case film.MitchellFilter(b=b, c=c):
            plugin, r, more = "mitchell", 2.0, {"float B": b, "float C": c}
        case film.CatmullRomFilter():
            plugin, r, more = "mitchell", 2.0, {"float B": 0.0, "float C": 0.5}
        case film.LanczosFilter(lobes=n):
            plugin, r, more = "sinc", float(n), {"float tau": float(n)}
        case _:
            plugin, r, more = "box", 0.5, {}
    sensor = {"string sensor": "cie1931", "float iso": 100.0, "bool savefp16": False}
    size = {"integer xresolution": picture.width, "integer yresolution": picture.height}
    return [
        words("PixelFilter", plugin, params={"float xradius": r, "float yradius": r, **more}),
        words("Film", "rgb", params={"string filename": name, **size, **sensor}),
    ]


def sampler_of(sampler: Any) -> str:
    if not isinstance(sampler, Sobol | Independent):
        raise UnwritableError(f"light without random numbers, on a '{sampler.type}'")
    values = {"integer pixelsamples": sampler.spp, "integer seed": sampler.seed % 2**31}
    return words("Sampler", sampler.type, params=values)


def integrator_of(integrator: Any) -> str:
    """pbrt counts the surfaces between the camera and a light, we the edges."""
    if getattr(integrator, "hide_emitters", False):
        raise UnwritableError("lamps that cameras do not see")
    match integrator:
        case Direct(shadows=False):
            raise UnwritableError("direct light without shadows")
        case Direct(light_samples=0) | Direct(bsdf_samples=0):
            raise UnwritableError("direct light by one strategy alone")
        case Direct():
            depth = 1
        case PathTracing(max_depth=edges):
            depth = ENDLESS if edges is None else edges - 1
        case _:
            raise UnwritableError(f"the integrator '{integrator.type}'")
    return words("Integrator", "path", params={"integer maxdepth": depth, "bool regularize": False})


# ---- lights --------------------------------------------------------------------------------------


def lights_of(writing: Writing) -> list[str]:
    """Those that are no shapes.  A colour of pbrt's is the light's value: pbrt divides by the
    brightness of its illuminant."""
    found = []
    for k, light in enumerate(writing.scene.lights):
        with writing.collected("lights", k):
            if not isinstance(light, lights.Ambient):  # nothing that is written uses it
                plugin, params = _light(light, k, writing)
                found.append(words("LightSource", plugin, params=params))
    return found


def _light(light: Any, number: int, writing: Writing) -> tuple[str, Params]:
    match light:
        case lights.Point():
            return "point", {"rgb I": light.intensity, "point3 from": light.position}
        case lights.Spot(texture=None) if light.beam_width == light.cutoff_angle:
            place = {"point3 from": light.origin, "point3 to": light.target}
            cone = {"float coneangle": light.cutoff_angle, "float conedeltaangle": 0.0}
            return "spot", {"rgb I": light.intensity, **place, **cone}
        case lights.Spot():
            raise UnwritableError(
                "a spot with a texture, or with a beam_width below its cutoff_angle: its falloff "
                "between them is linear in the angle"
            )
        case lights.Directional():
            place = {"point3 from": (0.0, 0.0, 0.0), "point3 to": light.direction}
            return "distant", {"rgb L": light.irradiance, **place}
        case lights.Constant():
            return "infinite", {"rgb L": light.radiance}
        case lights.EnvironmentMap():
            return "infinite", {"string filename": _environment(light, number, writing)}
    raise UnwritableError(f"a light '{light.type}'")


def _environment(light: lights.EnvironmentMap, number: int, writing: Writing) -> str:
    """The name of an image of all directions on pbrt's square, on which equal areas are equal
    solid angles (Clarberg 2008).  pbrt does not interpolate: ours is sampled again, finer."""
    path = writing.scene.folder / light.file
    read = partial(read_image, path, light.encoding, light.scale, light.layer)
    texels = writing.read(read, "lights", number)
    side = min(2048, 2 ** math.ceil(math.log2(max(256, 1.2 * texels.shape[1]))))
    turned = orthogonal(light.transform)
    total = np.zeros((side, side, 3))
    for offset in FOUR:
        v, u = (np.mgrid[:side, :side] + np.array(offset)[:, None, None]) / side
        total += radiance_of(texels, square_to_sphere(u, v) @ turned)
    writing.note(f"'{light.file}' is sampled again, as an equal-area map of {side} x {side} pixels")
    return writing.image("environment", total / len(FOUR))


FOUR = ((0.25, 0.25), (0.25, 0.75), (0.75, 0.25), (0.75, 0.75))
"""Points of a pixel whose mean it is."""


def square_to_sphere(u: FloatArray, v: FloatArray) -> FloatArray:
    """The direction (..., 3) of a point inside the unit square (PBR 4ed, 3.8.3)."""
    x, y = 2.0 * u - 1.0, 2.0 * v - 1.0
    inside = 1.0 - (np.abs(x) + np.abs(y))
    r = 1.0 - np.abs(inside)
    phi = ((np.abs(y) - np.abs(x)) / r + 1.0) * (math.pi / 4.0)
    across = r * np.sqrt(2.0 - r * r)
    z = np.copysign(1.0 - r * r, inside)
    return np.stack(
        [np.copysign(np.cos(phi), x) * across, np.copysign(np.sin(phi), y) * across, z], axis=-1
    )


def radiance_of(texels: FloatArray, d: FloatArray) -> FloatArray:
    """A map of ours in unit directions (..., 3) of its own space: bilinear between texels, as
    `EnvironmentMaps` says."""
    height, width = texels.shape[:2]
    across = np.arctan2(d[..., 0], -d[..., 2]) * (width / (2.0 * math.pi)) - 0.5
    down = np.arccos(np.clip(d[..., 1], -1.0, 1.0)) * ((height - 1) / math.pi)
    found = np.empty_like(d)
    for k in range(3):
        found[..., k] = map_coordinates(texels[..., k], [down, across], order=1, mode="grid-wrap")
    return found
