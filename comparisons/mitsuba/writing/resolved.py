"""A scene as data for other renderers: everything resolved, shapes as triangles.

`docs/scenes.md` describes the format.  Nothing has a default: each number that determines the
picture is in the file, or in the files beside it.
"""

import json
from pathlib import Path
from typing import Any

from comparisons.geometry.flatten import Leaf, Tree, copies_of
from comparisons.mitsuba.writing.files import Files, check_name, ply, write_files
from comparisons.mitsuba.writing.tessellated import is_closed, tessellated
from reference_rt.cameras import Orthographic, Pinhole, ThinLens
from reference_rt.cameras.view_rectangle import CentralCamera
from reference_rt.core import transform
from reference_rt.lights import EnvironmentMap
from reference_rt.rendering.scene import Scene
from reference_rt.shapes import Plane
from reference_rt.util.errors import ReferenceRtError

FORMAT, VERSION = "reference_rt resolved scene", 1


def write_resolved(scene: Scene, path: Path) -> int:
    """Write a scene as .json, whole or not at all; how many files it has besides.

    Raises SceneError, UsageError, ImageError.
    """
    check_name(path, (".json",))

    def text(files: Files) -> str:
        return json.dumps(_Document(scene, files).whole(), indent=1, allow_nan=False) + "\n"

    return write_files(scene, path, text)


class _Document:
    def __init__(self, scene: Scene, files: Files) -> None:
        self.scene, self.files = scene, files
        self.meshes: list[dict[str, Any]] = []
        self.known: dict[int, int] = {}

    def whole(self) -> dict[str, Any]:
        scene = self.scene
        shapes = self.shapes()
        return {
            "format": FORMAT,
            "version": VERSION,
            "description": scene.description,
            "camera": self.camera(),
            "film": scene.film.model_dump(mode="json"),
            "sampler": scene.resolved_sampler.model_dump(mode="json"),
            "integrator": scene.integrator.model_dump(mode="json"),
            "textures": {name: self.texture(name) for name in scene.textures},
            "materials": {k: m.model_dump(mode="json") for k, m in scene.materials.items()},
            "meshes": self.meshes,
            "shapes": shapes,
            "lights": [self.light(light, k) for k, light in enumerate(scene.lights)],
        }

    def camera(self) -> dict[str, Any]:
        """Position, basis and view rectangle: at distance 1, of an orthographic one through the
        eye."""
        camera, film = self.scene.camera, self.scene.film
        right, up, back = camera.basis.tolist()
        found: dict[str, Any] = {"type": camera.type, "eye": list(camera.eye)}
        if isinstance(camera, Pinhole):
            # What it sees, upside down, as a rectangle in front of it.
            half = camera.film_width / camera.film_distance / 2.0
            tall = half * film.height / film.width
            found["type"], edges = "perspective", [-half, half, -tall, tall]
            right, up = [-x for x in right], [-x for x in up]
        else:
            assert isinstance(camera, CentralCamera | Orthographic)
            edges = list(camera.rectangle(film.width, film.height))
        found |= {"right": right, "up": up, "back": back, "view": edges}
        if isinstance(camera, ThinLens):
            found |= {"aperture_radius": camera.aperture_radius, "focus_distance": camera.focus}
        return found

    def texture(self, name: str) -> dict[str, Any]:
        texture = self.scene.textures[name]
        found = texture.model_dump(mode="json")
        found["uv"] = texture.uv.coefficients().reshape(2, 3).tolist()
        if "file" in found:
            found["file"] = self.files.copy(found["file"], "textures", name, "file")
        return found

    def light(self, light: Any, number: int) -> dict[str, Any]:
        found: dict[str, Any] = light.model_dump(mode="json")
        if isinstance(light, EnvironmentMap):
            found["file"] = self.files.copy(light.file, "lights", number, "file")
            found["transform"] = transform.affine(light.transform).tolist()
        return found

    def shapes(self) -> list[dict[str, Any]]:
        """Every copy of every shape."""
        found = []
        for copy in copies_of(self.scene):
            for member in copy.members:
                place = {"shape": copy.shape, "instance": copy.instance}
                try:
                    if member.tree is None:
                        (leaf,) = member.leaves
                        value = self.leaf(leaf, copy.outer)
                    else:
                        value = self.solid(member.tree, member.leaves, copy.outer)
                except ReferenceRtError:
                    raise
                except ValueError as error:
                    raise self.scene.error(str(error), "shapes", copy.shape) from None
                found.append(place | value)
        return found

    def solid(
        self, tree: Tree | int, leaves: tuple[Leaf, ...], outer: transform.Affine
    ) -> dict[str, Any]:
        """A CSG tree of closed meshes and half-spaces."""
        if isinstance(tree, int):
            return self.leaf(leaves[tree], outer)
        return {
            "operation": tree.operation,
            "of": [self.solid(part, leaves, outer) for part in tree.of],
        }

    def leaf(self, leaf: Leaf, outer: transform.Affine) -> dict[str, Any]:
        """A mesh, or a plane, under a map."""
        m = transform.compose(leaf.outer, outer)
        if isinstance(leaf.shape, Plane):
            m = transform.compose(transform.affine(leaf.shape.transform), m)
            return {"plane": m.tolist(), "material": leaf.material}
        return {
            "mesh": self.mesh(leaf),
            "transform": m.tolist(),
            "material": leaf.material,
        }

    def mesh(self, leaf: Leaf) -> int:
        """The number of a shape's mesh, which is made once."""
        shape = leaf.shape
        if id(shape) not in self.known:
            found = tessellated(shape, self.scene.folder)
            kind = type(shape).__name__.lower()
            file = self.files.write(f"{kind}.ply", lambda path: path.write_bytes(ply(found.mesh)))
            self.known[id(shape)] = len(self.meshes)
            self.meshes.append(
                {
                    "file": file,
                    "of": kind,
                    "triangles": len(found.mesh.faces),
                    "distance": found.distance,
                    "closed": is_closed(found.mesh),
                }
            )
        return self.known[id(shape)]


__all__ = ["write_resolved"]
