"""The files of a scene that is written: a scene file, of ours or another renderer's, and beside it
a folder of meshes and images, whole or not at all; and what the format cannot express of it."""

import os
import secrets
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, TypeVar
from xml.sax.saxutils import quoteattr

import numpy as np

from comparisons.mitsuba.parse import LookAt, Step
from reference_rt.core.arrays import FloatArray
from reference_rt.core.transform import Affine
from reference_rt.rendering.scene import Scene
from reference_rt.scene.model import SceneModel
from reference_rt.shapes import Mesh, Shape
from reference_rt.shapes.csg import Solid
from reference_rt.shapes.meshes.files.data import MeshData
from reference_rt.util.errors import ImageError, ReferenceRtError, SceneError, UsageError
from reference_rt.util.files import check_writable, replacing

# ---- elements of a Mitsuba scene file, and their XML with every bit of their numbers -------------


class Rgb(NamedTuple):
    """A colour, linear sRGB."""

    r: float
    g: float
    b: float


class Vector(NamedTuple):
    """A point or a direction."""

    x: float
    y: float
    z: float


class Reference(NamedTuple):
    """Another element, by its id."""

    id: str


@dataclass
class Element:
    """An element: its tag, such as "bsdf", its plugin, its parameters, its nested elements that
    have no name, and its id."""

    tag: str
    plugin: str
    values: dict[str, Any] = field(default_factory=dict)
    children: list["Element | Reference"] = field(default_factory=list)
    id: str = ""

    def lines(self, name: str = "", indent: str = "    ") -> list[str]:
        """The element as XML;  name: of the parameter that it is."""
        attributes = {"type": self.plugin, "id": self.id, "name": name}
        start = self.tag + _attributes({k: v for k, v in attributes.items() if v})
        inside = [line for key, value in self.values.items() for line in _lines(key, value)]
        for child in self.children:
            inside += [_reference(child, "")] if isinstance(child, Reference) else child.lines()
        if not inside:
            return [f"<{start}/>"]
        return [f"<{start}>", *(indent + line for line in inside), f"</{self.tag}>"]


def _lines(name: str, value: Any) -> list[str]:
    """A parameter as XML."""
    match value:
        case bool():
            return [_simple("boolean", name, str(value).lower())]
        case int():
            return [_simple("integer", name, str(value))]
        case float():
            return [_simple("float", name, repr(value))]
        case str():
            return [_simple("string", name, value)]
        case Rgb():
            return [_simple("rgb", name, _numbers(value))]
        case Vector():
            return [_simple("vector", name, _numbers(value))]
        case Reference():
            return [_reference(value, name)]
        case Element():
            return value.lines(name)
        case tuple():
            steps = ("    " + _step(step) for step in value)
            return [f"<transform{_attributes({'name': name})}>", *steps, "</transform>"]
    raise TypeError(f"no XML for {type(value).__name__}")


def _simple(tag: str, name: str, value: str) -> str:
    return f"<{tag}{_attributes({'name': name, 'value': value})}/>"


def _reference(value: Reference, name: str) -> str:
    return f"<ref{_attributes({'id': value.id, **({'name': name} if name else {})})}/>"


def _step(step: Step | LookAt) -> str:
    if isinstance(step, LookAt):
        vectors = {"origin": step.origin, "target": step.target, "up": step.up}
        return f"<lookat{_attributes({key: _numbers(v) for key, v in vectors.items()})}/>"
    if step.kind == "matrix":
        return f"<matrix{_attributes({'value': _numbers((*step.numbers, 0.0, 0.0, 0.0, 1.0))})}/>"
    named = zip("xyz", step.numbers, strict=False)
    values = {key: repr(float(value)) for key, value in named}
    if step.kind == "rotate":
        values["angle"] = repr(float(step.numbers[3]))
    return f"<{step.kind}{_attributes(values)}/>"


def _numbers(values: Any) -> str:
    return " ".join(repr(float(x)) for x in values)


def _attributes(values: dict[str, str]) -> str:
    return "".join(f" {key}={quoteattr(value)}" for key, value in values.items())


def matrix_step(m: Affine) -> Step:
    """A map (3, 4) as a step."""
    return Step("matrix", tuple(float(x) for x in m.ravel()))


# ---- files ---------------------------------------------------------------------------------------


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

    The folder of the scene that it replaces is replaced, too; of a link the folder that it names.
    Raises ImageError, also if the folder holds anything else; SceneError for a file of the scene
    that cannot be read.
    """
    named = folder_of(path)
    _check_folder(path, named)
    folder = Path(os.path.realpath(named))
    mark = secrets.token_hex(4)
    temporary, old = (folder.with_name(f".{mark}-{k}-{folder.name}") for k in ("new", "old"))
    files = Files(scene, temporary, named.name)
    done = False
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        text = text_of(files)
        with replacing(path) as part:
            part.write_text(text, encoding="utf-8")
            if folder.exists():
                folder.rename(old)
            if temporary.exists():
                temporary.rename(folder)
        done = True
    except OSError as error:
        raise ImageError(
            f"{folder}: cannot be written: {error.strerror or error}; expected a writable place"
        ) from None
    finally:
        if not done and old.exists() and not folder.exists():
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
        names = sorted(file.name for file in folder.iterdir()) if folder.is_dir() else [""]
    except OSError as error:
        raise ImageError(f"{folder}: cannot be read: {error.strerror}") from None
    others = [name for name in names if not name or f"{folder.name}/{name}" not in scene]
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


# ---- what a format cannot express ----------------------------------------------------------------

T = TypeVar("T")


class UnwritableError(ReferenceRtError):
    """A part of a scene that another renderer's format cannot express."""


@dataclass
class Losses:
    """What is lost of a scene in a format.  target: its name;  notes: what is not quite the same;
    reasons: why it cannot be written."""

    scene: Scene
    target: str = field(kw_only=True)
    notes: list[str] = field(default_factory=list, kw_only=True)
    reasons: dict[str, SceneError] = field(default_factory=dict, kw_only=True)

    @contextmanager
    def collected(self, *path: str | int) -> Iterator[None]:
        """Collects the reason of an UnwritableError in the part at this key path, so that all of a
        scene are known; writing goes on."""
        try:
            yield
        except UnwritableError as error:
            message = f"{self.target} cannot express {error}; expected a scene without it"
            reason = self.scene.error(message, *path)
            self.reasons.setdefault(str(reason), reason)

    def check(self) -> None:
        """Raises SceneError with all reasons, if there are any."""
        if self.reasons:
            first, *others = self.reasons.values()
            raise SceneError(first.message, first.path, first.file, first.line, others)

    def read(self, make: Callable[[], T], *path: str | int) -> T:
        """What `make` reads for the part at this key path.  Raises SceneError if it cannot."""
        try:
            return make()
        except ValueError as error:
            raise self.scene.error(str(error), *path) from None

    def note(self, text: str) -> None:
        if text not in self.notes:
            self.notes.append(text)


# ---- meshes --------------------------------------------------------------------------------------

COLOURS = ("red", "green", "blue")
"""The names of our reader; Mitsuba's are `ATTRIBUTE`."""

ATTRIBUTE = ("color_0", "color_1", "color_2")
"""Of the attribute "vertex_color" in Mitsuba's files."""


def ply(
    mesh: MeshData | Mesh, of_colours: tuple[str, str, str] = COLOURS, float32: bool = False
) -> bytes:
    """A binary .ply file of doubles, which our reader reads to the same bits.

    mesh: with arrays;  of_colours: the names of colours;  float32: rounded to floats.  Raises
    ValueError for numbers beyond their range.
    """
    assert mesh.vertices is not None
    assert mesh.faces is not None
    columns: list[tuple[str, FloatArray]] = list(zip("xyz", mesh.vertices.T, strict=True))
    sets = 0 if mesh.more_uv is None else mesh.more_uv.shape[1] // 2
    for names, values in (
        (("nx", "ny", "nz"), mesh.normals),
        (("u", "v"), mesh.uv),
        ([f"{c}{k + 1}" for k in range(sets) for c in "uv"], mesh.more_uv),
        (of_colours, mesh.colours),
    ):
        if values is not None:
            columns += zip(names, values.T, strict=True)
    lines = [
        "ply",
        "format binary_little_endian 1.0",
        f"element vertex {len(mesh.vertices)}",
        *(f"property {'float' if float32 else 'double'} {name}" for name, _ in columns),
        f"element face {len(mesh.faces)}",
        "property list uchar int vertex_indices",
        "end_header",
    ]
    faces = np.empty(len(mesh.faces), [("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, mesh.faces
    with np.errstate(over="ignore"):
        table = np.column_stack([x for _, x in columns]).astype("<f4" if float32 else "<f8")
    if not np.isfinite(table).all():
        raise ValueError("has numbers beyond the range of float32; expected smaller ones")
    return "\n".join(lines).encode() + b"\n" + table.tobytes() + faces.tobytes()


# ---- scenes in our own format --------------------------------------------------------------------


SUFFIXES = (".yaml", ".yml", ".json")


def write_scene(scene: SceneModel, path: Path) -> int:
    """Write the scene, and return how many files of its own it has.

    The folder of the scene that it replaces is replaced, too.  Raises ImageError, also if the
    folder holds anything else; UsageError; SceneError for a file of the scene that cannot be read.
    """
    check_name(path, SUFFIXES)

    def text(files: Files) -> str:
        changed = _with_files(scene, files)
        return changed.to_json() if path.suffix.lower() == ".json" else changed.to_yaml()

    return write_files(scene, path, text)


def _with_files(scene: SceneModel, files: Files) -> SceneModel:
    """The scene that names the written files."""
    return scene.changed(
        textures={k: _with_image(t, files, "textures", k) for k, t in scene.textures.items()},
        lights=tuple(_with_image(x, files, "lights", k) for k, x in enumerate(scene.lights)),
        shapes=tuple(_shape(s, files, "shapes", k) for k, s in enumerate(scene.shapes)),
        groups={
            name: tuple(_shape(s, files, "groups", name, k) for k, s in enumerate(members))
            for name, members in scene.groups.items()
        },
    )


def _with_image(part: Any, files: Files, *path: str | int) -> Any:
    """A texture or a light with a copy of its image."""
    if getattr(part, "file", None) is None:
        return part
    return part.model_copy(update={"file": files.copy(part.file, *path, "file")})


def _shape(shape: Shape, files: Files, *path: str | int) -> Shape:
    if isinstance(shape, Solid):
        parts = tuple(_shape(s, files, *path, "of", k) for k, s in enumerate(shape.of))
        return shape.model_copy(update={"of": parts})
    if not isinstance(shape, Mesh):
        return shape
    if shape.file is not None:
        return shape.model_copy(update={"file": files.copy(shape.file, *path, "file")})
    name = files.write("mesh.ply", lambda file: file.write_bytes(ply(shape)))
    arrays = dict.fromkeys(Mesh.array_fields)
    return shape.model_copy(update={**arrays, "file": name})
