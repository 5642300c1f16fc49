"""Parts of a scene as elements of a Mitsuba scene file: materials and textures; camera, film,
sampler, integrator and lights.

Materials are those of `comparisons.translator`, but that Mitsuba's own plugins are taken
wherever it has one.  Textures name files.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from comparisons.cameras import translate_camera
from comparisons.cameras.film import translate_film
from comparisons.cameras.samplers import translate_sampler
from comparisons.integrators import translate_integrator
from comparisons.integrators.ray_cast import LAYERS, shown_by
from comparisons.integrators.whitted import AMBIENT
from comparisons.lights import translate_light
from comparisons.lights.constant import ambient_of
from comparisons.materials.translate import translate_material
from comparisons.media.homogeneous import SIDES, translate_medium
from comparisons.mitsuba.context import TranslationContext
from comparisons.mitsuba.files import Element, Files, Reference, Rgb, Vector, matrix_step
from comparisons.mitsuba.plugins.whitted import MOST_COMPONENTS
from comparisons.textures import READERS
from reference_rt.integrators import RayCast, Whitted
from reference_rt.materials import most_branches
from reference_rt.rendering.scene import Scene
from reference_rt.textures import VertexColours

OURS = (
    "the {} '{}' is ours: before Mitsuba loads the file, call "
    "comparisons.mitsuba.backend.mitsuba() in Python"
)
"""A note on a plugin."""

OUR_PLUGINS = (
    *("textbook_phong", "gltf_pbr", "goniometric", "view_rectangle", "whitted", "mesh_area"),
)

TEXTURES = (*READERS, "uniform")
"""Plugins that are elements of their own, however often they are used."""

TAGS = ("film", "rfilter", "sampler", "integrator", "emitter", "phase")
"""Names of nested plugins that are their elements' tags, too."""


class Surfaces:
    """The materials and media of a scene: each is an element once, which shapes refer to."""

    def __init__(self, scene: Scene, files: Files) -> None:
        self.scene, self.files = scene, files
        self.elements: dict[Any, Element] = {}
        self.textures: dict[str, Element] = {}
        self.media: dict[str, Element] = {}
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

    def medium(self, name: str) -> Reference:
        """The medium with this name."""
        if name not in self.media:
            element = self.element(translate_medium(self.scene.media[name]), "medium")
            element.id = self.id_for(name)
            self.media[name] = element
        return Reference(self.media[name].id)

    def media_of(self, shape: Any) -> dict[str, Reference]:
        """The media that a shape bounds, by side."""
        names = {side: getattr(shape, side) for side in SIDES}
        return {side: self.medium(name) for side, name in names.items() if name is not None}

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
                inner = "phase" if tag == "phase" else "bsdf"
                element.children.append(self.element(part, key if key in TAGS else inner))
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


# ---- camera, film, sampler, integrator and lights ------------------------------------------------


def sensor(scene: Scene, surfaces: Surfaces) -> Element:
    """The camera, with film and sampler.  Raises UntranslatableError."""
    values = translate_camera(scene.camera, scene.film, surfaces.context)
    values["film"] = translate_film(scene.film)
    values["sampler"] = translate_sampler(scene.resolved_sampler, True, scene.has_media)
    found = surfaces.element(values, "sensor")
    if scene.camera.medium is not None:
        found.values["medium"] = surfaces.medium(scene.camera.medium)
    return found


def integrator(scene: Scene, surfaces: Surfaces) -> Element:
    """The integrator, inside another one for layers.  Raises UntranslatableError."""
    chosen = scene.integrator
    if isinstance(chosen, RayCast):
        return surfaces.element(shown_by(chosen), "integrator")
    found = dict(translate_integrator(chosen, scene.has_media) or {})
    if isinstance(chosen, Whitted):
        ambient = zip(AMBIENT, ambient_of(scene.lights), strict=True)
        found |= {name: x for name, x in ambient if x != 0.0}
        found["components"] = MOST_COMPONENTS * int(most_branches(scene.tables.materials))
    if getattr(chosen, "sampling", "both") != "both":
        surfaces.note("'sampling' of the integrator is left out: the mean is the same")
    layers = [name for name in scene.film.layers if name in LAYERS]
    for name in [name for name in scene.film.layers if name not in LAYERS]:
        surfaces.note(f"the layer '{name}' is left out: Mitsuba has none")
    if layers:
        aovs = ", ".join(f"{name}:{LAYERS[name]}" for name in layers)
        found = {"type": "aov", "aovs": aovs, "integrator": found}
    return surfaces.element(found, "integrator")


def lights(scene: Scene, surfaces: Surfaces) -> list[Element]:
    """Those that are no shapes.  Raises UntranslatableError, SceneError."""
    found = []
    for k, light in enumerate(scene.lights):
        try:
            value = translate_light(light, surfaces.context)
        except ValueError as error:
            raise scene.error(str(error), "lights", k) from None
        if value is not None:
            found.append(surfaces.element(value, "emitter"))
    return found
