"""Parts of a scene as elements of a Mitsuba scene file: materials and textures; camera, film,
sampler, integrator and lights.

Materials are those of `comparisons.translator`, but that Mitsuba's own plugins are taken
wherever it has one.  Textures name files.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.cameras.translate import clipping, translate_camera, translate_film
from comparisons.lights.translate import ambient_of, translate_integrator
from comparisons.materials.translate import translate_material
from comparisons.mitsuba.context import TranslationContext, UntranslatableError, transform_steps
from comparisons.mitsuba.files import Element, Files, Reference, Rgb, Vector, matrix_step
from comparisons.mitsuba.parse import LookAt, Step
from comparisons.mitsuba.plugins.whitted import MOST_COMPONENTS
from comparisons.textures.translate import projected
from reference_rt.cameras import Orthographic, Perspective, ThinLens
from reference_rt.cameras.film import Film
from reference_rt.core.image_files import open_image
from reference_rt.integrators import RayCast, Whitted
from reference_rt.lights import (
    Ambient,
    Constant,
    Directional,
    EnvironmentMap,
    Point,
    Projector,
    Spot,
)
from reference_rt.materials import most_branches
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import Grid, Sobol
from reference_rt.textures import Bitmap, VertexColours
from reference_rt.textures.image_file import read_image

OURS = (
    "the {} '{}' is ours: before Mitsuba loads the file, call "
    "comparisons.mitsuba.backend.mitsuba() in Python"
)
"""A note on a plugin."""

OUR_PLUGINS = ("textbook_phong", "gltf_pbr", "view_rectangle", "whitted", "mesh_area")

TEXTURES = ("bitmap", "checkerboard", "mesh_attribute", "uniform")

TAGS = ("film", "rfilter", "sampler", "integrator", "emitter")
"""Names of nested plugins that are their elements' tags, too."""


class Surfaces:
    """The materials of a scene: each is an element once, which shapes refer to."""

    def __init__(self, scene: Scene, files: Files) -> None:
        self.scene, self.files = scene, files
        self.elements: dict[Any, Element] = {}
        self.textures: dict[str, Element] = {}
        self.ids: set[str] = set()
        self.context = TranslationContext.of(scene, native=True, files=files)

    def id_for(self, name: str) -> str:
        """An id that no element has: the name, if Mitsuba takes it for one."""
        plain = "".join(c if c.isascii() and (c.isalnum() or c in "_-") else "_" for c in name)
        plain = plain or "_"
        found, number = plain, 1
        while found in self.ids:
            number += 1
            found = f"{plain}_{number}"
        self.ids.add(found)
        return found

    def bsdf(self, name: str, has_colours: bool = False) -> Reference:
        """The material with this name;  has_colours: on a mesh with vertex colours.  Raises
        UntranslatableError, SceneError."""
        key = name, has_colours and self._uses_colours()
        if key not in self.elements:
            context = replace(self.context, has_colours=has_colours)
            try:
                found = translate_material(self.scene.materials[name], context)
            except ValueError as error:
                raise self.scene.error(str(error), "materials", name) from None
            element = self.element(found, "bsdf")
            element.id = self.id_for(name)
            self.elements[key] = element
        return Reference(self.elements[key].id)

    def _uses_colours(self) -> bool:
        return any(isinstance(t, VertexColours) for t in self.scene.textures.values())

    def element(self, value: dict[str, Any], tag: str) -> Element:
        """A plugin's dictionary as an element, nested ones too: textures as elements of their own,
        others by the names of their parameters, which are tags but for BSDFs."""
        plugin = value["type"]
        if plugin in OUR_PLUGINS:
            self.context.note(OURS.format("BSDF" if tag == "bsdf" else tag, plugin))
        element = Element(tag, plugin)
        for key, part in value.items():
            if isinstance(part, dict) and part["type"] not in ("rgb", *TEXTURES):
                element.children.append(self.element(part, key if key in TAGS else "bsdf"))
            elif key != "type":
                element.values[key] = self.value(part)
        return element

    def value(self, value: Any) -> Any:
        """A parameter as an element has it."""
        if isinstance(value, list):
            return Vector(*value)
        if isinstance(value, dict):
            return Rgb(*value["value"]) if value["type"] == "rgb" else self.shared(value)
        if hasattr(value, "matrix"):
            return (matrix_step(np.array(value.matrix, np.float64)[:3]),)
        return value

    def shared(self, value: dict[str, Any]) -> Reference:
        """A texture's dictionary as an element, which is one however often it is used."""
        key = repr(value)
        if key not in self.textures:
            self.textures[key] = self.element(value, "texture")
            self.textures[key].id = self.id_for("texture")
        return Reference(self.textures[key].id)

    def note(self, text: str) -> None:
        self.context.note(text)

    def pixels_of(self, name: str) -> tuple[int, int]:
        """Width and height of a texture's image; (1, 1) for others."""
        texture = self.scene.textures[name]
        if not isinstance(texture, Bitmap):
            return 1, 1
        image = open_image(self.scene.folder / texture.file)
        return image.width, image.height


# ---- camera, film, sampler, integrator and lights ------------------------------------------------

AOVS = {
    "depth": "depth", "normal": "sh_normal", "albedo": "albedo", "position": "position",
    "id": "shape_index",
}  # fmt: skip
"""Mitsuba's AOV for a layer of our film."""

CAST = {"colour": "albedo", "normal": "geo_normal", "id": "shape_index", "uv": "uv"}
"""Mitsuba's AOV for what ray casting shows, but for distances."""


def sensor(scene: Scene, surfaces: Surfaces) -> Element:
    """The camera, with film and sampler.  Raises UntranslatableError."""
    camera = scene.camera
    look = LookAt(camera.eye, camera.target, camera.up)
    clip = clipping(camera)
    is_plain = isinstance(camera, Perspective | ThinLens) and camera.view is None
    if is_plain:
        assert isinstance(camera, Perspective | ThinLens)
        fov, axis = camera.angle
        values: dict[str, Any] = {"fov": float(fov), "fov_axis": axis, "to_world": (look,), **clip}
        if isinstance(camera, ThinLens):
            values["aperture_radius"] = camera.aperture_radius
            values["focus_distance"] = camera.focus
        plugin = "thinlens" if isinstance(camera, ThinLens) else "perspective"
    elif isinstance(camera, Orthographic) and camera.view is None:
        half = (2.0 if camera.width is None else camera.width) / 2.0
        plugin, values = "orthographic", {"to_world": (_scaled(half), look), **clip}
    else:
        found = translate_camera(camera, scene.film)
        plugin = found.pop("type")
        if plugin == "view_rectangle":
            surfaces.note(OURS.format("sensor", plugin))
        place: Step | LookAt = look
        if plugin != "view_rectangle" or not isinstance(camera, Perspective | ThinLens):
            place = matrix_step(np.array(found["to_world"].matrix, np.float64)[:3])
        values = {**found, "to_world": (place,)}
    return Element("sensor", plugin, values, [_film(scene.film), _sampler(scene)])


def _scaled(half: float) -> Step:
    return Step("scale", (half, half, 1.0))


def _film(film: Film) -> Element:
    found = translate_film(film)
    rfilter = found.pop("rfilter")
    plugin, name = found.pop("type"), rfilter.pop("type")
    return Element("film", plugin, found, [Element("rfilter", name, rfilter)])


def _sampler(scene: Scene) -> Element:
    sampler = scene.resolved_sampler
    if isinstance(sampler, Grid):
        values = {"sample_count": sampler.spp, "jitter": False}
        return Element("sampler", "stratified", values)
    # Mitsuba's sequence of the kind that Sobol' points are.
    plugin = "ldsampler" if isinstance(sampler, Sobol) else "independent"
    values = {"sample_count": sampler.spp, "seed": sampler.seed}
    return Element("sampler", plugin, values)


def integrator(scene: Scene, surfaces: Surfaces) -> Element:
    """The integrator, inside another one for layers.  Raises UntranslatableError."""
    chosen = scene.integrator
    if isinstance(chosen, RayCast):
        if chosen.show == "distance":
            return Element("integrator", "depth")
        return Element("integrator", "aov", {"aovs": f"{chosen.show}:{CAST[chosen.show]}"})
    values = dict(translate_integrator(chosen) or {})
    found = Element("integrator", values.pop("type"), values)
    if isinstance(chosen, Whitted):
        ambient = ambient_of(scene.lights)
        names = ("ambient_r", "ambient_g", "ambient_b")
        values |= {k: x for k, x in zip(names, ambient, strict=True) if x != 0.0}
        values["components"] = MOST_COMPONENTS * int(most_branches(scene.tables.materials))
        surfaces.note(OURS.format("integrator", "whitted"))
    if getattr(chosen, "sampling", "both") != "both":
        surfaces.note("'sampling' of the integrator is left out: the mean is the same")
    layers = [name for name in scene.film.layers if name in AOVS]
    for name in [name for name in scene.film.layers if name not in AOVS]:
        surfaces.note(f"the layer '{name}' is left out: Mitsuba has none")
    if layers:
        aovs = ", ".join(f"{name}:{AOVS[name]}" for name in layers)
        return Element("integrator", "aov", {"aovs": aovs}, [found])
    return found


def lights(scene: Scene, surfaces: Surfaces) -> list[Element]:
    """Those that are no shapes.  Raises UntranslatableError."""
    found = []
    for k, light in enumerate(scene.lights):
        if not isinstance(light, Ambient):  # a parameter of our integrator
            found.append(_light(light, k, surfaces))
    return found


def _light(light: Any, number: int, surfaces: Surfaces) -> Element:
    match light:
        case Point():
            values: dict[str, Any] = {
                "position": Vector(*light.position),
                "intensity": Rgb(*light.intensity),
            }
        case Directional():
            values = {
                "direction": Vector(*light.direction),
                "irradiance": Rgb(*light.irradiance),
            }
        case Constant():
            values = {"radiance": Rgb(*light.radiance)}
        case EnvironmentMap():
            values = {"scale": light.scale}
            if light.encoding == "radiance":
                texels = read_image(surfaces.scene.folder / light.file, "radiance")
                values |= surfaces.context.image(Path(light.file).stem, texels)
            else:
                values["filename"] = surfaces.files.copy(light.file, "lights", number, "file")
            if light.transform:
                values["to_world"] = transform_steps(light.transform)
            return Element("emitter", "envmap", values)
        case Spot():
            values = _spot(light, surfaces)
        case Projector():
            values = _projector(light, surfaces)
        case _:
            raise UntranslatableError(light, "light")
    return Element("emitter", str(light.type), values)


def _spot(light: Spot, surfaces: Surfaces) -> dict[str, Any]:
    beam = 0.75 * light.cutoff_angle if light.beam_width is None else light.beam_width
    # Mitsuba's images hang upside down.
    x, y, z = (-c for c in light.up)
    up = (x, y, z)
    found: dict[str, Any] = {}
    if light.texture is None:
        x, y, z = np.eye(3)[int(np.argmin(np.abs(light.axis)))].tolist()
        up = (x, y, z)
    else:
        found["texture"] = surfaces.shared(projected(light.texture, surfaces.context))
    return {
        "to_world": (LookAt(light.origin, light.target, up),),
        "intensity": Rgb(*light.intensity),
        "cutoff_angle": float(light.cutoff_angle),
        "beam_width": float(beam),
        **found,
    }


def _projector(light: Projector, surfaces: Surfaces) -> dict[str, Any]:
    pixels, irradiance = (1, 1), light.irradiance
    value: Any
    if isinstance(irradiance, str):
        pixels = surfaces.pixels_of(irradiance)
        value = surfaces.shared(projected(irradiance, surfaces.context))
    else:
        value = Rgb(*irradiance)
    shape = pixels[0] / pixels[1]
    stretch = _such_that(shape / light.aspect, lambda x: shape / x == light.aspect)
    look = LookAt(light.origin, light.target, light.up)
    steps = (look,) if stretch == 1.0 else (Step("scale", (1.0, stretch, 1.0)), look)
    scale = _such_that(light.scale / math.pi, lambda x: math.pi * x == light.scale)
    return {
        "to_world": steps,
        "irradiance": value,
        "scale": scale,
        "fov": float(light.fov),
        "fov_axis": "x",
    }


def _such_that(x: float, is_exact: Callable[[float], bool]) -> float:
    """x, or a number next to it that the reader turns into exactly what we have."""
    near = (x, math.nextafter(x, 0.0), math.nextafter(x, math.inf))
    return next((y for y in near if is_exact(y)), x)
