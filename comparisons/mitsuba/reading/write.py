"""Writing a scene in our own format with its files: a .yaml or .json file, and beside it a folder
of its meshes and images, whole or not at all."""

from pathlib import Path
from typing import Any

from comparisons.mitsuba.writing import files
from comparisons.mitsuba.writing.files import Files, ply, write_files
from reference_rt.scene.model import SceneModel
from reference_rt.shapes import Mesh, Shape
from reference_rt.shapes.csg import Solid

SUFFIXES = (".yaml", ".yml", ".json")


def check_name(path: Path) -> None:
    """Raises UsageError for a name that is not a scene's, ImageError where it cannot be written."""
    files.check_name(path, (".yaml", ".json") if path.suffix.lower() != ".yml" else SUFFIXES)


def write_scene(scene: SceneModel, path: Path) -> int:
    """Write the scene, and return how many files of its own it has.

    The folder of the scene that it replaces is replaced, too.  Raises ImageError, also if the
    folder holds anything else; UsageError; SceneError for a file of the scene that cannot be read.
    """
    check_name(path)

    def text(found: Files) -> str:
        changed = _with_files(scene, found)
        return changed.to_json() if path.suffix.lower() == ".json" else changed.to_yaml()

    return write_files(scene, path, text)


def _with_files(scene: SceneModel, found: Files) -> SceneModel:
    """The scene that names the written files."""
    return scene.changed(
        textures={k: _with_image(t, found, "textures", k) for k, t in scene.textures.items()},
        lights=tuple(_with_image(x, found, "lights", k) for k, x in enumerate(scene.lights)),
        shapes=tuple(_shape(s, found, "shapes", k) for k, s in enumerate(scene.shapes)),
        groups={
            name: tuple(_shape(s, found, "groups", name, k) for k, s in enumerate(members))
            for name, members in scene.groups.items()
        },
    )


def _with_image(part: Any, found: Files, *path: str | int) -> Any:
    """A texture or a light with a copy of its image."""
    if getattr(part, "file", None) is None:
        return part
    return part.model_copy(update={"file": found.copy(part.file, *path, "file")})


def _shape(shape: Shape, found: Files, *path: str | int) -> Shape:
    if isinstance(shape, Solid):
        parts = tuple(_shape(s, found, *path, "of", k) for k, s in enumerate(shape.of))
        return shape.model_copy(update={"of": parts})
    if not isinstance(shape, Mesh):
        return shape
    if shape.file is not None:
        return shape.model_copy(update={"file": found.copy(shape.file, *path, "file")})
    name = found.write("mesh.ply", lambda file: file.write_bytes(ply(shape)))
    arrays = dict.fromkeys(Mesh.array_fields)
    return shape.model_copy(update={**arrays, "file": name})
