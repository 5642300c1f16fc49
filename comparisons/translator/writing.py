"""Scene -> a Mitsuba scene file, .xml, with its meshes and images in a folder beside it.

Contract: Mitsuba loads the file and renders the same picture, and `comparisons.translator.reading`
reads it to a scene with the same picture, to the same bits where Mitsuba has the shapes and
materials.  Numbers have all their digits; transforms are the steps that the scene has.  Where
Mitsuba has no plugin, ours is named, or a mesh stands in: notes say so.

Materials and textures are the dictionaries that Mitsuba gets in memory, printed by `elements`.  To
write another camera or light: a case there; another shape: one in `Shapes`.
"""

from pathlib import Path
from typing import Any

import numpy as np

from comparisons.geometry.flatten import Copy, Leaf, copies_of, place_of
from comparisons.materials.translate import is_textured
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.context import UntranslatableError, transform_steps
from comparisons.mitsuba.files import (
    ATTRIBUTE,
    Element,
    Files,
    Reference,
    check_name,
    matrix_step,
    ply,
    write_files,
)
from comparisons.mitsuba.hits import Plugin
from comparisons.shapes import translate_shape, type_of
from comparisons.shapes.site import Site
from comparisons.textures.translate import colour
from comparisons.translator import elements
from comparisons.translator.elements import OURS, Surfaces
from reference_rt.core import transform
from reference_rt.materials import Emissive
from reference_rt.rendering.scene import Scene
from reference_rt.shapes import Mesh, Shape
from reference_rt.shapes.instances import Instance
from reference_rt.shapes.meshes.files.data import MeshData
from reference_rt.shapes.meshes.topology import smooth_normals
from reference_rt.shapes.shape import Solid
from reference_rt.util.errors import SceneError


class Shapes:
    """The elements of a scene's shapes, and of the groups of those that are instances."""

    def __init__(self, surfaces: Surfaces) -> None:
        self.surfaces, self.scene = surfaces, surfaces.scene
        self.groups: dict[str, Element] = {}
        self.meshes: dict[int, str] = {}
        self.copies: dict[int, list[Copy]] | None = None

    def elements(self) -> list[Element]:
        """All shapes.  Raises UntranslatableError, SceneError."""
        found: list[Element] = []
        for k, shape in enumerate(self.scene.shapes):
            own = None if isinstance(shape, Instance) else self._own(shape)
            if own is not None:
                found.append(own)
                continue
            try:
                for copy in self._copies_of(k):
                    found += self._instance(shape, copy) or self._stand_ins(copy)
            except ValueError as error:
                raise self.scene.error(str(error), "shapes", k) from None
        return [*self.groups.values(), *found]

    def _copies_of(self, k: int) -> list[Copy]:
        if self.copies is None:
            self.copies = {}
            for copy in copies_of(self.scene):
                self.copies.setdefault(copy.shape, []).append(copy)
        return self.copies[k]

    # ---- Mitsuba's own shapes -------------------------------------------------------------------

    def _own(self, shape: Shape) -> Element | None:
        """The shape as Mitsuba's of its kind; None if there is none."""
        to_world = transform_steps(shape.transform)
        values: dict[str, Any] = {"to_world": to_world} if to_world else {}
        textured = is_textured(shape.material, self.surfaces.context)
        linear = transform.affine(shape.transform)[:, :3]
        if isinstance(shape, Mesh) and np.linalg.det(linear) > 0.0:
            return self._mesh(shape, values)
        own_plugin = None if isinstance(shape, Solid) else type_of(shape).own_plugin
        own = None if own_plugin is None else own_plugin(shape, linear, textured)
        if own is None:
            return None
        plugin, numbers = own
        found = Element("shape", plugin, {**numbers, **values})
        return self._with_material(found, shape)

    def _with_material(
        self,
        element: Element,
        shape: Shape | Leaf,
        has_colours: bool = False,
        has_normals: bool = False,
    ) -> Element:
        """The shape with its BSDF, its emitter, and the media that it bounds;  has_colours,
        has_normals: of a mesh's vertices."""
        name = shape.material
        element.values |= self.surfaces.media_of(shape)
        if name is None:
            return element
        material = self.scene.materials[name]
        if not isinstance(material, Emissive):
            element.children.append(self.surfaces.bsdf(name, has_colours))
            return element
        if material.base is not None:
            element.children.append(self.surfaces.bsdf(material.base, has_colours))
        radiance = self.surfaces.value(colour(material.radiance, self.surfaces.context))
        plugin = "area"
        if has_normals or (element.plugin == "ply" and isinstance(radiance, Reference)):
            plugin = "mesh_area"  # Mitsuba's own is not exact there
            self.surfaces.note(OURS.format("emitter", plugin))
        element.children.append(Element("emitter", plugin, {"radiance": radiance}))
        return element

    def _mesh(self, shape: Mesh, values: dict[str, Any]) -> Element:
        if id(shape) not in self.meshes:
            self.meshes[id(shape)] = self._mesh_file(shape)
        values = {"filename": self.meshes[id(shape)], **values}
        data = shape.data(self.scene.folder)
        if shape.face_normals or (data.normals is None and not shape.smooth):
            values["face_normals"] = True
        found = Element("shape", "ply", values)
        has_normals = "face_normals" not in values
        return self._with_material(found, shape, data.colours is not None, has_normals)

    def _mesh_file(self, shape: Mesh) -> str:
        data = shape.data(self.scene.folder)
        name = "mesh.ply" if shape.file is None else f"{_stem(shape.file)}.ply"
        if shape.makes_normals(data):
            corners = data.faces.ravel()
            made = smooth_normals(data.vertices, data.faces, data.uv).reshape(-1, 3)
            data = MeshData(
                data.vertices[corners],
                np.arange(len(corners)).reshape(-1, 3),
                made,
                None if data.uv is None else data.uv[corners],
                None if data.colours is None else data.colours[corners],
            )
        return self.surfaces.files.write(name, lambda file: file.write_bytes(ply(data, ATTRIBUTE)))

    def _instance(self, shape: Shape, copy: Copy) -> list[Element]:
        """A copy of a group as an instance of a group of Mitsuba's own shapes; none where Mitsuba
        cannot have it: of other shapes, and of those that shine."""
        if not isinstance(shape, Instance):
            return []
        if copy.group not in self.groups:
            found = []
            for member in self.scene.groups[copy.group]:
                if isinstance(member, Instance):  # its copies come by themselves
                    continue
                material = member.material
                lit = isinstance(self.scene.materials.get(material or ""), Emissive)
                own = None if lit else self._own(member)
                if own is None:
                    return []
                found.append(own)
            name = self.surfaces.id_for(copy.group)
            self.groups[copy.group] = Element("shape", "shapegroup", {}, [*found], name)
        steps = transform_steps(shape.transform)
        others = len(self._copies_of(copy.shape)) > 1 or shape.file is not None
        if copy.group != shape.group or others:
            steps = (matrix_step(copy.outer),)
        values = {"to_world": steps} if steps else {}
        group = Reference(self.groups[copy.group].id)
        return [Element("shape", "instance", values, [group])]

    # ---- meshes that stand in -------------------------------------------------------------------

    def _stand_ins(self, copy: Copy) -> list[Element]:
        """The shapes of one copy, as Mitsuba's plugins in the comparison."""
        found = []
        for member in copy.members:
            if member.tree is not None:
                raise UntranslatableError("Solid (CSG)", "shape")
            (leaf,) = member.leaves
            site = self._site(leaf.material, place_of(self.scene, leaf, copy.outer), copy)
            for plugin in translate_shape(leaf.shape, site):
                if site.textured and not plugin.has_our_uv:
                    kind = type(leaf.shape).__name__
                    raise UntranslatableError(f"{kind} under a texture, with other uv,", "shape")
                name = type(leaf.shape).__name__.lower()
                found.append(self._of_plugin(plugin, name, leaf))
        return found

    def _site(self, material: str | None, place: Any, copy: Copy) -> Site:
        parts: dict[str, Any] = {"bsdf": {"type": "diffuse"}}
        if material is not None and isinstance(self.scene.materials[material], Emissive):
            parts["emitter"] = {"type": "area", "radiance": {"type": "rgb", "value": [1.0] * 3}}
        return Site(
            place=place,
            parts=parts,
            coloured=parts,
            textured=is_textured(material, self.surfaces.context),
            oriented=False,  # what it is for, errors of tangents, is not asked here
            material=material,
            copies=1,
            shared={},
            reach=0.0,
        )

    def _of_plugin(self, plugin: Plugin, name: str, leaf: Leaf) -> Element:
        if plugin.stand_in is not None:
            self.surfaces.note(
                f"a mesh of {plugin.stand_in.triangles:,} triangles stands in for a {name}; it is "
                f"at most {plugin.stand_in.sag:.2g} off"
            )
        if plugin.group is not None:
            return self._of_group(plugin, leaf)
        if not isinstance(plugin.value, dict):
            file = self.surfaces.files.write(
                f"{name}.ply", lambda path: plugin.value.write_ply(str(path))
            )
            values: dict[str, Any] = {"filename": file}
            if not plugin.value.has_vertex_normals():
                values["face_normals"] = True
            return self._with_material(Element("shape", "ply", values), leaf)
        return self._with_material(_of_dict(plugin.value), leaf)

    def _of_group(self, plugin: Plugin, leaf: Leaf) -> Element:
        """An instance of a group with one shape: Mitsuba's own only have similar ones."""
        assert plugin.group is not None
        member = plugin.group.member
        assert isinstance(member, dict)
        name = self.surfaces.id_for(plugin.group.name)
        inside = self._with_material(_of_dict(member), leaf)
        self.groups[name] = Element("shape", "shapegroup", {}, [inside], name)
        found = _of_dict({key: x for key, x in plugin.value.items() if key != "group"})
        found.children.append(Reference(name))
        return found


def _of_dict(value: dict[str, Any]) -> Element:
    found = {key: part for key, part in value.items() if key not in ("type", "bsdf", "emitter")}
    if "to_world" in found:
        found["to_world"] = (matrix_step(np.array(found["to_world"].matrix, np.float64)[:3]),)
    return Element("shape", value["type"], found)


def _stem(file: str) -> str:
    return file.replace("\\", "/").rpartition("/")[2].rpartition(".")[0] or "mesh"


VERSION = "3.0.0"
"""The version of Mitsuba's format."""


def write_xml(scene: Scene, path: Path) -> tuple[int, list[str]]:
    """Write a scene as .xml, whole or not at all; how many files it has besides, and notes on what
    is not quite the same.

    Raises SceneError, also for what Mitsuba lacks; UsageError, ImageError,
    ReferenceUnavailableError.
    """
    check_name(path, (".xml",))
    mitsuba()
    notes: list[str] = []

    def text(files: Files) -> str:
        surfaces = Surfaces(scene, files)
        shapes = Shapes(surfaces).elements()
        integrator = elements.integrator(scene, surfaces)
        lights = elements.lights(scene, surfaces)
        parts = [
            integrator,
            elements.sensor(scene, surfaces),
            *surfaces.textures.values(),
            *surfaces.elements.values(),
            *surfaces.media.values(),
            *shapes,
            *lights,
        ]
        notes.extend(surfaces.context.notes)
        head = [f"<!-- {' '.join(_plain(line).split())} -->" for line in _comments(scene, notes)]
        body = ["    " + line for part in parts for line in part.lines()]
        return "\n".join([*head, f'<scene version="{VERSION}">', *body, "</scene>", ""])

    try:
        return write_files(scene, path, text), notes
    except UntranslatableError as error:
        raise SceneError(
            f"{scene.name}: the {error.kind} {error.part} has no counterpart among Mitsuba's; "
            "expected a scene without it"
        ) from None


def _comments(scene: Scene, notes: list[str]) -> list[str]:
    found = [f"Written by reference-rt from the scene {scene.name}."]
    return found + [f"Note: {note}." for note in notes]


def _plain(text: str) -> str:
    """Text that a comment may hold."""
    return text.replace("--", "- -")
