"""The files of a scene that is written: a scene file, and beside it a folder of meshes and images,
whole or not at all."""

import secrets
import shutil
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from reference_rt.core.arrays import FloatArray
from reference_rt.scene.model import SceneModel
from reference_rt.shapes import Mesh
from reference_rt.shapes.meshes.files.data import MeshData
from reference_rt.util.errors import ImageError, SceneError, UsageError
from reference_rt.util.files import check_writable, replacing


def folder_of(path: Path) -> Path:
    """The folder of the files of the scene that is written to `path`."""
    return path.with_name(f"{path.stem}_files")


def check_name(path: Path, suffixes: tuple[str, ...]) -> None:
    """Raises UsageError for a name without one of these suffixes, ImageError where it cannot be
    written."""
    if path.suffix.lower() not in suffixes:
        expected = f"{', '.join(suffixes[:-1])} or {suffixes[-1]}" if suffixes[1:] else suffixes[0]
        raise UsageError(f"{path}: '{path.suffix}' is not supported; expected {expected}")
    check_writable(path)


def write_files(scene: SceneModel, path: Path, text_of: Callable[["Files"], str]) -> int:
    """Write the text that `text_of` makes of a scene, and what it puts into the `Files` that it is
    given; returns how many these are.

    The folder of the scene that it replaces is replaced, too.  Raises ImageError, also if the
    folder holds anything else; SceneError for a file of the scene that cannot be read.
    """
    folder = folder_of(path)
    _check_folder(path, folder)
    mark = secrets.token_hex(4)
    temporary, old = (folder.with_name(f".{mark}-{k}-{folder.name}") for k in ("new", "old"))
    files = Files(scene, temporary, folder.name)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        text = text_of(files)
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
    return len(files.taken)


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


class Files:
    """The folder of a scene that is being written, made when its first file is."""

    def __init__(self, scene: SceneModel, folder: Path, name: str) -> None:
        """scene: whose files are copied;  name: the folder's, in the scene file."""
        self.scene, self.folder, self.name = scene, folder, name
        self.taken: set[str] = set()
        self.copied: dict[Path, str] = {}

    def copy(self, file: str, *path: str | int) -> str:
        """Copy a file of the scene, which the part at this key path names; its new name."""
        source = (self.scene.folder / file).resolve()
        if source not in self.copied:
            if not source.is_file():
                raise self.scene.error(f"there is no file {source}; expected one", *path)
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


COLOURS = ("red", "green", "blue")
"""The names of our reader; Mitsuba's are `ATTRIBUTE`."""

ATTRIBUTE = ("color_0", "color_1", "color_2")
"""Of the attribute "vertex_color" in Mitsuba's files."""


def ply(mesh: MeshData | Mesh, of_colours: tuple[str, str, str] = COLOURS) -> bytes:
    """A binary .ply file of doubles, which our reader reads to the same bits.

    mesh: with arrays;  of_colours: the names of colours.
    """
    assert mesh.vertices is not None
    assert mesh.faces is not None
    columns: list[tuple[str, FloatArray]] = list(zip("xyz", mesh.vertices.T, strict=True))
    for names, values in (
        (("nx", "ny", "nz"), mesh.normals),
        (("u", "v"), mesh.uv),
        (of_colours, mesh.colours),
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


__all__ = ["Files", "check_name", "folder_of", "ply", "write_files"]
