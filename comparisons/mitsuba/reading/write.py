"""Writing a scene with its files: a .yaml or .json file, and beside it a folder of its meshes and
images, whole or not at all."""

import secrets
import shutil
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from reference_rt.core.arrays import FloatArray
from reference_rt.scene.model import SceneModel
from reference_rt.shapes import Mesh, Shape
from reference_rt.shapes.csg import Solid
from reference_rt.util.errors import ImageError, SceneError, UsageError
from reference_rt.util.files import check_writable, replacing


def folder_of(path: Path) -> Path:
    """The folder of the files of the scene that is written to `path`."""
    return path.with_name(f"{path.stem}_files")


def check_name(path: Path) -> None:
    """Raises UsageError for a name that is not a scene's, ImageError where it cannot be written."""
    if path.suffix.lower() not in (".yaml", ".yml", ".json"):
        raise UsageError(f"{path}: '{path.suffix}' is not supported; expected .yaml or .json")
    check_writable(path)


def write_scene(scene: SceneModel, path: Path) -> int:
    """Write the scene, and return how many files of its own it has.

    The folder of the scene that it replaces is replaced, too.  Raises ImageError, also if the
    folder holds anything else; UsageError; SceneError for a file of the scene that cannot be read.
    """
    check_name(path)
    folder = folder_of(path)
    _check_folder(path, folder)
    mark = secrets.token_hex(4)
    temporary, old = (folder.with_name(f".{mark}-{k}-{folder.name}") for k in ("new", "old"))
    writer = _Writer(scene, temporary, folder.name)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        changed = writer.scene()
        text = changed.to_json() if path.suffix.lower() == ".json" else changed.to_yaml()
        with replacing(path) as part:
            part.write_text(text, encoding="utf-8")
            if folder.exists():
                folder.rename(old)
            if temporary.exists():
                temporary.rename(folder)
    except OSError as error:
        raise ImageError(
            f"{folder}: cannot be written: {error.strerror or error}; expected a writable place"
        ) from None
    finally:
        if old.exists() and not folder.exists():
            with suppress(OSError):
                old.rename(folder)
        for left in (temporary, old):
            shutil.rmtree(left, ignore_errors=True)
    return len(writer.taken)


def _check_folder(path: Path, folder: Path) -> None:
    """Raises ImageError if a folder is there that holds more than the files of the scene that is
    there: it would be lost."""
    if not folder.exists():
        return
    try:
        scene = path.read_text(encoding="utf-8", errors="replace") if path.is_file() else ""
        found = sorted(file.name for file in folder.iterdir()) if folder.is_dir() else [""]
    except OSError as error:
        raise ImageError(f"{folder}: cannot be read: {error.strerror}") from None
    others = [name for name in found if not name or f"{folder.name}/{name}" not in scene]
    if others:
        raise ImageError(
            f"{folder / others[0]}: is not of the scene {path}, and would be lost; expected no "
            "such folder, or another name for the scene"
        )


class _Writer:
    def __init__(self, scene: SceneModel, folder: Path, name: str) -> None:
        self.original, self.folder, self.name = scene, folder, name
        self.taken: set[str] = set()
        self.copied: dict[Path, str] = {}

    def scene(self) -> SceneModel:
        """The scene that names the written files."""
        scene = self.original
        return scene.changed(
            textures={k: self.with_image(t, "textures", k) for k, t in scene.textures.items()},
            lights=tuple(self.with_image(x, "lights", k) for k, x in enumerate(scene.lights)),
            shapes=tuple(self.shape(s, "shapes", k) for k, s in enumerate(scene.shapes)),
            groups={
                name: tuple(self.shape(s, "groups", name, k) for k, s in enumerate(members))
                for name, members in scene.groups.items()
            },
        )

    def with_image(self, part: Any, *path: str | int) -> Any:
        """A texture or a light with a copy of its image."""
        if getattr(part, "file", None) is None:
            return part
        return part.model_copy(update={"file": self.copy(part.file, *path, "file")})

    def shape(self, shape: Shape, *path: str | int) -> Shape:
        if isinstance(shape, Solid):
            parts = tuple(self.shape(s, *path, "of", k) for k, s in enumerate(shape.of))
            return shape.model_copy(update={"of": parts})
        if not isinstance(shape, Mesh):
            return shape
        if shape.file is not None:
            return shape.model_copy(update={"file": self.copy(shape.file, *path, "file")})
        name = self.write("mesh.ply", lambda file: file.write_bytes(ply(shape)))
        arrays = dict.fromkeys(Mesh.array_fields)
        return shape.model_copy(update={**arrays, "file": name})

    def copy(self, file: str, *path: str | int) -> str:
        source = (self.original.folder / file).resolve()
        if source not in self.copied:
            if not source.is_file():
                raise self.original.error(f"there is no file {source}; expected one", *path)
            try:
                self.copied[source] = self.write(
                    source.name, lambda target: shutil.copyfile(source, target)
                )
            except OSError as error:
                raise SceneError(f"{source}: cannot be copied: {error.strerror or error}") from None
        return self.copied[source]

    def write(self, name: str, make: Callable[[Path], Any]) -> str:
        """Write a file under a name that is not taken; its name in the scene."""
        stem, suffix = Path(name).stem, Path(name).suffix
        number = 1
        while name.lower() in self.taken:
            number += 1
            name = f"{stem}_{number}{suffix}"
        self.taken.add(name.lower())
        self.folder.mkdir(exist_ok=True)
        make(self.folder / name)
        return f"{self.name}/{name}"


def ply(mesh: Mesh) -> bytes:
    """A binary .ply file of doubles, which our reader reads to the same bits."""
    assert mesh.vertices is not None
    assert mesh.faces is not None
    columns: list[tuple[str, FloatArray]] = list(zip("xyz", mesh.vertices.T, strict=True))
    for names, values in (
        (("nx", "ny", "nz"), mesh.normals),
        (("u", "v"), mesh.uv),
        (("red", "green", "blue"), mesh.colours),
    ):
        if values is not None:
            columns += zip(names, values.T, strict=True)
    lines = [
        "ply",
        "format binary_little_endian 1.0",
        f"element vertex {len(mesh.vertices)}",
        *(f"property double {name}" for name, _ in columns),
        f"element face {len(mesh.faces)}",
        "property list uchar int vertex_indices",
        "end_header",
    ]
    faces = np.empty(len(mesh.faces), [("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, mesh.faces
    table = np.column_stack([values for _, values in columns]).astype("<f8")
    return "\n".join(lines).encode() + b"\n" + table.tobytes() + faces.tobytes()
