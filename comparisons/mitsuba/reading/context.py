"""`Reading`: the parts of our scene as they are found, and names for them."""

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from comparisons.mitsuba.reading.node import Node
from comparisons.mitsuba.reading.parse import Parsed
from reference_rt.materials import Emissive, Material, Wrapper
from reference_rt.textures import VertexColours, texture_names


@dataclass
class Reading:
    """What has been read of a scene so far; notes: what the reader should know of it."""

    parsed: Parsed
    textures: dict[str, Any] = field(default_factory=dict)
    materials: dict[str, Any] = field(default_factory=dict)
    groups: dict[str, Any] = field(default_factory=dict)
    shapes: list[Any] = field(default_factory=list)
    lights: list[Any] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    names: dict[Any, str] = field(default_factory=dict)
    """The names of what has been read, by index of its element and what it is read for."""
    attributes: dict[str, str] = field(default_factory=dict)
    """Which attribute of meshes a texture shows, by the texture's name."""
    meshes: dict[Any, Any] = field(default_factory=dict)
    """Files of meshes, as read."""
    numbers: dict[Any, Iterator[int]] = field(default_factory=dict)
    """The numbers that `unused` appends next, by table and name: "diffuse_2", "diffuse_3"."""

    def file(self, node: Node, key: str = "filename") -> Path:
        """The file that an element names.  Raises SceneError if there is none."""
        name = node.text(key, "")
        if not name:
            raise node.error(f"has no '{key}'; expected a file")
        if "\0" in name:
            raise node.error(f"'{key}' has a null character; expected the name of a file")
        path = self.parsed.resolve(name)
        if not path.is_file():
            raise node.error(f"'{key}': there is no file {path}; expected one")
        return path

    def relative(self, path: Path) -> str:
        """The name of a file as the scene has it: relative to its folder, if it is below it."""
        path, folder = path.resolve(), self.parsed.folder.resolve()
        return str(path.relative_to(folder) if path.is_relative_to(folder) else path)

    def parts(self, material: str | None) -> list[Material]:
        """The materials that one is made of, itself included."""
        if material is None:
            return []
        found = self.materials[material]
        inner = ["base"] if isinstance(found, Emissive) else []
        if isinstance(found, Wrapper):
            inner = list(found.bases)
        return [found, *(part for name in inner for part in self.parts(getattr(found, name)))]

    def textures_of(self, material: str | None) -> set[str]:
        """The names of the textures that a material uses."""
        return {t for part in self.parts(material) for t in texture_names(part).values()}

    def uses_uv(self, material: str | None) -> bool:
        """Whether the material depends on texture coordinates or on the tangents along them."""
        if any(part.oriented for part in self.parts(material)):
            return True
        return any(
            not isinstance(self.textures[name], VertexColours)
            for name in self.textures_of(material)
        )

    def note(self, node: Node, message: str) -> None:
        """Keep a note about an element, each once."""
        text = str(node.error(message))
        if text not in self.notes:
            self.notes.append(text)

    def unused(self, name: str, plugin: str, taken: Mapping[str, object]) -> str:
        """A name that is not in `taken`: the element's own, or one after its plugin."""
        wanted = name or plugin
        if wanted not in taken:
            return wanted
        # Numbers go on where they ended: searching from 2 would take minutes for 10,000 materials.
        numbers = self.numbers.setdefault((id(taken), wanted), itertools.count(2))
        return next(found for k in numbers if (found := f"{wanted}_{k}") not in taken)
