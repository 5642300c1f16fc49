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
from comparisons.integrators.ray_cast import CAST, LAYERS
from comparisons.integrators.whitted import AMBIENT
from comparisons.lights import translate_light
from comparisons.lights.constant import ambient_of
from comparisons.materials.translate import translate_material
from comparisons.mitsuba.files import (
    Element,
    Files,
    Reference,
    Rgb,
    Vector,
    matrix_step,
    written_image,
)
from comparisons.mitsuba.parse import FLIP, Step
from comparisons.mitsuba.plugins.whitted import MOST_COMPONENTS
from comparisons.textures.translate import (
    VERTEX_COLOUR,
    TranslationContext,
    UntranslatableError,
    rgb,
)
from reference_rt.integrators import RayCast, Whitted
from reference_rt.materials import most_branches
from reference_rt.rendering.scene import Scene
from reference_rt.textures import Bitmap, Checker, VertexColours
from reference_rt.textures.texture import UvMap

IMAGES = (".exr", ".png", ".jpg", ".jpeg", ".hdr", ".pfm", ".bmp", ".tga")
"""Files that Mitsuba reads, and to the same values as we do."""

OURS = (
    "the {} '{}' is ours: before Mitsuba loads the file, call "
    "comparisons.mitsuba.backend.mitsuba() in Python"
)
"""A note on a plugin."""

TEXTURES = ("bitmap", "checkerboard", "mesh_attribute", "uniform")


class Surfaces:
    """The materials of a scene: each is an element once, which shapes refer to."""

    def __init__(self, scene: Scene, files: Files) -> None:
        self.scene, self.files = scene, files
        self.elements: dict[Any, Element] = {}
        self.textures: dict[str, Element] = {}
        self.ids: set[str] = set()
        self.notes: list[str] = []
        context = TranslationContext.of(scene, native=True)
        self.context = replace(context, in_file=self.texture, files=files)

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
            element = self.element(found)
            element.id = self.id_for(name)
            self.elements[key] = element
        return Reference(self.elements[key].id)

    def _uses_colours(self) -> bool:
        return any(isinstance(t, VertexColours) for t in self.scene.textures.values())

    def element(self, value: dict[str, Any], tag: str = "bsdf") -> Element:
        """A plugin's dictionary as an element, nested ones too."""
        plugin = value["type"]
        if plugin in ("textbook_phong", "gltf_pbr"):
            self.note(OURS.format("BSDF", plugin))
        element = Element(tag, plugin)
        for key, part in value.items():
            if key == "type":
                continue
            if isinstance(part, list):
                element.values[key] = Vector(*part)
            elif not isinstance(part, dict):
                element.values[key] = part
            elif part["type"] == "rgb":
                element.values[key] = Rgb(*part["value"])
            elif part["type"] in TEXTURES:
                element.values[key] = self.shared(part)
            else:
                element.children.append(self.element(part))
        return element

    def shared(self, value: dict[str, Any]) -> Reference:
        """A texture's dictionary as an element, which is one however often it is used."""
        key = repr(value)
        if key not in self.textures:
            self.textures[key] = self.element(value, "texture")
            self.textures[key].id = self.id_for("texture")
        return Reference(self.textures[key].id)

    def note(self, text: str) -> None:
        if text not in self.notes:
            self.notes.append(text)

    # ---- textures -------------------------------------------------------------------------------

    def texture(
        self, name: str, context: TranslationContext, as_number: bool, projected: bool = False
    ) -> dict[str, Any]:
        """A texture's dictionary, with steps as its map.  projected: by a light, whose image has
        v = 0 at the top."""
        texture = self.scene.textures[name]
        first = FLIP if projected else ()
        match texture:
            case Checker():
                return self._checker(texture, first, as_number)
            case Bitmap():
                return self._bitmap(texture, name, first)
            case VertexColours():
                if not context.has_colours:
                    return (
                        {"type": "uniform", "value": texture.without[0]}
                        if as_number
                        else rgb(texture.without)
                    )
                return {"type": "mesh_attribute", "name": VERTEX_COLOUR, "scale": texture.scale}
        raise UntranslatableError(texture, "texture")

    def _checker(
        self, texture: Checker, first: tuple[Step, ...], as_number: bool
    ) -> dict[str, Any]:
        one, two = texture.first, texture.second
        if max(*one, *two) > 1.0:  # Mitsuba's are reflectances; an image of four texels is the same
            texels = np.array([[two, one], [one, two]])
            return self._image(written_image(self.files, "checker", texels), "nearest", "repeat", first, texture)
        if as_number:
            one, two = two, one  # see `translate.textures`
        values = {"color0": rgb(one), "color1": rgb(two)}
        steps = (*first, *steps_of(texture.uv))
        return {"type": "checkerboard", **values, **({"to_uv": steps} if steps else {})}

    def _bitmap(self, texture: Bitmap, name: str, first: tuple[Step, ...]) -> dict[str, Any]:
        along_u, along_v = texture.wraps
        if along_u != along_v or texture.cutoff is not None:
            raise UntranslatableError("Bitmap with two wraps or a cutoff", "texture")
        path = self.scene.folder / texture.file
        suffix = path.suffix.lower()
        is_integer = suffix in (".png", ".jpg", ".jpeg", ".bmp", ".tga")
        is_plain = suffix in IMAGES and (texture.scale, texture.channel) == (1.0, "all")
        if is_plain and (is_integer or texture.encoding not in ("srgb", "radiance")):
            file = self.files.copy(texture.file, "textures", name, "file")
            raw = texture.encoding == "raw" or not is_integer
        else:
            file, raw = written_image(self.files, path.stem, texture.read(self.scene.folder).linear), True
            self.note(f"the image {texture.file} is written as linear float32 values")
        return self._image(file, texture.filter, along_u, first, texture, raw)

    def _image(
        self,
        file: str,
        filter_type: str,
        wrap: str,
        first: tuple[Step, ...],
        texture: Bitmap | Checker,
        raw: bool = True,
    ) -> dict[str, Any]:
        return {
            "type": "bitmap",
            "filename": file,
            "raw": raw,
            "filter_type": filter_type,
            "wrap_mode": wrap,
            "to_uv": (*first, *steps_of(texture.uv), *FLIP),
        }


def steps_of(uv: UvMap) -> tuple[Step, ...]:
    """A map of texture coordinates as steps, none for the identity."""
    if uv.matrix is not None:
        (a, b, c), (d, e, f) = uv.matrix
        rows = np.array([[a, b, 0.0, c], [d, e, 0.0, f], [0.0, 0.0, 1.0, 0.0]])
        return (matrix_step(rows),)
    found = []
    if uv.scale != (1.0, 1.0):
        found.append(Step("scale", (*uv.scale, 1.0)))
    if uv.rotate != 0.0:
        found.append(Step("rotate", (0.0, 0.0, 1.0, uv.rotate)))
    if uv.offset != (0.0, 0.0):
        found.append(Step("translate", (*uv.offset, 0.0)))
    return tuple(found)


# ---- camera, film, sampler, integrator and lights ------------------------------------------------

def sensor(scene: Scene, surfaces: Surfaces) -> Element:
    """The camera, with film and sampler.  Raises UntranslatableError."""
    values = translate_camera(scene.camera, scene.film, in_file=True)
    if values["type"] == "view_rectangle":
        surfaces.note(OURS.format("sensor", values["type"]))
    found = surfaces.element(values, "sensor")
    film = translate_film(scene.film)
    rfilter = film.pop("rfilter")
    found.children += [
        surfaces.element(film, "film"),
        surfaces.element(translate_sampler(scene.resolved_sampler, in_file=True), "sampler"),
    ]
    found.children[0].children.append(surfaces.element(rfilter, "rfilter"))
    return found


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
        ambient = zip(AMBIENT, ambient_of(scene.lights), strict=True)
        values |= {name: x for name, x in ambient if x != 0.0}
        values["components"] = MOST_COMPONENTS * int(most_branches(scene.tables.materials))
        surfaces.note(OURS.format("integrator", "whitted"))
    if getattr(chosen, "sampling", "both") != "both":
        surfaces.note("'sampling' of the integrator is left out: the mean is the same")
    layers = [name for name in scene.film.layers if name in LAYERS]
    for name in [name for name in scene.film.layers if name not in LAYERS]:
        surfaces.note(f"the layer '{name}' is left out: Mitsuba has none")
    if layers:
        aovs = ", ".join(f"{name}:{LAYERS[name]}" for name in layers)
        return Element("integrator", "aov", {"aovs": aovs}, [found])
    return found


def lights(scene: Scene, surfaces: Surfaces) -> list[Element]:
    """Those that are no shapes.  Raises UntranslatableError."""
    found = (translate_light(light, surfaces.context) for light in scene.lights)
    return [surfaces.element(value, "emitter") for value in found if value is not None]
