"""`SceneModel`, the description of a scene: fields, checks, reading and writing YAML and JSON."""

import hashlib
import importlib.metadata
import json
import warnings
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, PrivateAttr, model_validator

from reference_rt.cameras import AnyCamera
from reference_rt.cameras.film import Film
from reference_rt.cameras.perspective import Perspective
from reference_rt.core.diagnosis import what_else
from reference_rt.core.model import AS_DIGEST, Description, as_linear, name_of
from reference_rt.integrators import AnyIntegrator, Direct, RayCast
from reference_rt.integrators import Path as PathTracing
from reference_rt.lights import TABLES as LIGHT_TABLES
from reference_rt.lights import Ambient, AnyLight, Constant, EnvironmentMap, Projector
from reference_rt.materials import (
    AnyMaterial,
    Bump,
    Emissive,
    Material,
    NormalMap,
    NoSurface,
    Wrapper,
)
from reference_rt.materials.nested.paths import material_paths
from reference_rt.media import AnyMedium
from reference_rt.sampling import AnySampler, Grid, Sobol
from reference_rt.shapes import Shape
from reference_rt.shapes.csg import AnyShape, Solid
from reference_rt.shapes.instances import Instance
from reference_rt.textures import AnyTexture, Product, texture_names
from reference_rt.textures.tables import largest_uv_set
from reference_rt.util import yaml_text
from reference_rt.util.errors import (
    MOST_TOLD,
    ReferenceUnavailableError,
    SceneError,
    SceneWarning,
    meant,
    meant_by,
    printable,
    together,
)
from reference_rt.util.files import not_utf8, read_text
from reference_rt.util.yaml_text import line_of

MOST_NESTED = 100
"""Nesting depth of set operations: pydantic serialises at most 255 levels of lists and keys, of
which each operation takes two."""


WITHOUT_LINES = "]"
"""The text of a scene of another program's file: it is no YAML, so that no error names a line."""

_NAMES = (str, str | None)
"""The types of fields that only name something."""


_ALONG = "expected 0: tilted normals follow the mesh's 'uv', along which its tangents are"
_OWN_UV = {
    NormalMap: _ALONG,
    Bump: _ALONG,
    Projector: "expected 0: an image that a light projects has no mesh",
}
"""What has textures by no other coordinates than the surface's own, and why."""


def no_such(kind: str, name: str, known: Iterable[str], instead: str = "") -> str:
    """The message for a name that the scene does not define.  instead: what might be in its place,
    with ", or "."""
    known = [*known]
    listed = ", ".join(f"'{k}'" for k in known) or "none"
    key = {"medium": "media"}.get(kind, f"{kind}s")
    text = f"there is no {kind} '{name}'; expected {instead}one of: {listed}{meant(name, known)}"
    return text if known else f"{text}; '{key}' describes them by name"


class SceneModel(Description):
    """Everything that determines a picture.  Right-handed world; linear sRGB; scene units."""

    description: str = ""
    """One line about the scene, for people."""
    camera: AnyCamera = Perspective()
    """The view.  Default: in perspective from [0, 0, 1] to the origin, 45 degrees wide."""
    film: Film = Film()
    """Size of the picture, reconstruction filter and additional layers."""
    sampler: AnySampler | None = None
    """The samples of each pixel.  Default: `sobol` for `path` and `direct`, `grid` (pixel centres)
    for `whitted` and `ray_cast`."""
    integrator: AnyIntegrator = PathTracing()
    """How light is computed.  Default: path tracing."""
    textures: dict[str, AnyTexture] = Field(default_factory=dict)
    """Textures by name, which parameters of materials refer to."""
    materials: dict[str, AnyMaterial] = Field(default_factory=dict)
    """Materials by name, which shapes and other materials refer to."""
    media: dict[str, AnyMedium] = Field(default_factory=dict)
    """Media by name, which shapes and the camera refer to.  For path tracing."""
    shapes: tuple[AnyShape, ...] = Field(default=(), strict=False)
    """All surfaces and solids; the index of a shape is its place in this list, from 0."""
    groups: dict[str, Annotated[tuple[AnyShape, ...], Field(strict=False, min_length=1)]] = Field(
        default_factory=dict
    )
    """Lists of shapes by name, stored once, which shapes of type `instance` draw."""
    hierarchy: Literal["auto", "sah", "median", "spatial", "none"] = "auto"
    """The acceleration structure: a BVH by surface area heuristic, median split or spatial splits,
    or none.  Default: `sah`, but `none` for a few shapes.  The picture does not depend on it."""
    lights: tuple[AnyLight, ...] = Field(default=(), strict=False)
    """Lights that are not shapes; a shape with an emissive material is a light, too."""

    _folder: Path = PrivateAttr(default_factory=Path)
    _source: "tuple[str, str] | None" = PrivateAttr(default=None)
    _defaults: dict[str, str] = PrivateAttr(default_factory=dict)
    _allows_missing: bool = PrivateAttr(default=False)
    _warned: set[str] = PrivateAttr(default_factory=set)

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        found = [*islice(self._wrong_parts(), MOST_TOLD)]
        found = found or [*islice(self._wrong_in_nesting(), MOST_TOLD)]
        if found:
            raise together(found)
        return self

    @property
    def has_media(self) -> bool:
        """Whether there are media, or boundaries without a surface, so that rays do not end at the
        first surface that they meet."""
        return bool(self.media) or any(isinstance(m, NoSurface) for m in self.materials.values())

    def _wrong_parts(self) -> Iterator[SceneError]:
        """Of each part: names of nothing, and what does not fit to what is named."""
        for i, shape in enumerate(self.shapes):
            yield from self._wrong_in_shape(shape, "shapes", i)
        for name, shapes in self.groups.items():
            for i, shape in enumerate(shapes):
                yield from self._wrong_in_shape(shape, "groups", name, i)
        for name in self.textures:
            yield from self._wrong_in_texture(name)
        for name, material in self.materials.items():
            yield from self._wrong_in_material(name, material)
        for i, light in enumerate(self.lights):
            yield from self._wrong_textures(light, "lights", i)
        yield from self._wrong_medium(self.camera.medium, "camera", "medium")
        yield from self._wrong_beside_media()
        yield from self._wrong_environments()
        yield from self._wrong_on_grid()

    def _wrong_in_nesting(self) -> Iterator[SceneError]:
        """Of what is named, and is there: textures that do not fit, materials of themselves."""
        for i, light in enumerate(self.lights):
            yield from self._wrong_uv_set(light, "lights", i)
        for name, material in self.materials.items():
            yield from self._wrong_uv_set(material, "materials", name)
            if isinstance(material, Wrapper):
                try:
                    material_paths(name, self.materials)
                except ValueError as error:
                    yield SceneError(str(error), ("materials", name))

    def _wrong_beside_media(self) -> Iterator[SceneError]:
        if self.has_media and not isinstance(self.integrator, PathTracing | RayCast):
            what = "media" if self.media else "the material 'none'"
            yield SceneError(
                f"'{self.integrator.type}' knows no {what}; expected 'path', or 'ray_cast', which "
                "shows the first surfaces",
                ("integrator", "type"),
            )

    def _wrong_environments(self) -> Iterator[SceneError]:
        if sum(isinstance(light, Constant | EnvironmentMap) for light in self.lights) > 1:
            yield SceneError("more than one environment; expected at most one", ("lights",))

    def _wrong_on_grid(self) -> Iterator[SceneError]:
        """An integrator that may need random numbers must have no use for them, on a grid."""
        if not isinstance(self.sampler, Grid) or self.integrator.deterministic:
            return
        kind = self.integrator.type
        if not isinstance(self.integrator, Direct):
            yield SceneError(
                f"'{kind}' needs random numbers, which 'grid' does not have; "
                "expected 'sobol' or 'independent'",
                ("sampler", "type"),
            )
            return
        points = tuple(description for _, _, description, _ in LIGHT_TABLES)
        extended: list[tuple[tuple[str | int, ...], str]] = [
            (("lights", i), light.type)
            for i, light in enumerate(self.lights)
            if not isinstance(light, (*points, Ambient))
        ]
        extended += [
            (("materials", name), "emissive")
            for name, material in self.materials.items()
            if isinstance(material, Emissive)
        ]
        for path, light in extended:
            yield SceneError(
                f"'{kind}' needs random numbers for the light '{light}', which 'grid' does not "
                "have; expected 'sobol' or 'independent', or lights without extent alone "
                f"({', '.join(map(name_of, points))})",
                path,
            )

    def _wrong_in_texture(self, name: str) -> Iterator[SceneError]:
        """A product's factors must exist, and be no products."""
        texture = self.textures[name]
        yield from self._wrong_textures(texture, "textures", name)
        for k, of in enumerate(texture.of if isinstance(texture, Product) else ()):
            if isinstance(self.textures.get(of), Product):
                message = f"'{of}' is a product itself; expected textures of other types"
                yield SceneError(message, ("textures", name, "of", k))

    def _wrong_textures(self, part: Description, *path: str | int) -> Iterator[SceneError]:
        """The textures that a material, a light or a texture names must exist."""
        for field, texture in texture_names(part).items():
            if texture not in self.textures:
                only_names = type(part).__pydantic_fields__[str(field[0])].annotation in _NAMES
                instead = "" if only_names else f"numbers{as_linear(texture)}, or "
                message = no_such("texture", texture, self.textures, instead)
                yield SceneError(message, (*path, *field))

    def _wrong_uv_set(self, part: Description, *path: str | int) -> Iterator[SceneError]:
        why = _OWN_UV.get(type(part))
        for field, texture in texture_names(part).items() if why else ():
            if largest_uv_set(texture, self.textures):
                yield SceneError(f"'{texture}' has another 'uv_set' than 0; {why}", (*path, *field))

    def _wrong_in_material(self, name: str, material: Material) -> Iterator[SceneError]:
        """The textures and materials that a material names must exist and fit."""
        yield from self._wrong_textures(material, "materials", name)
        bases: tuple[str, ...] = ()
        if isinstance(material, Emissive):
            bases = ("base",)
        elif isinstance(material, Wrapper):
            bases = material.bases
        for field in bases:
            base = getattr(material, field)
            yield from self._wrong_name_of_material(base, "materials", name, field)
            if isinstance(self.materials.get(base), Emissive):
                yield SceneError(
                    f"'{base}' is emissive itself; expected a material that only scatters",
                    ("materials", name, field),
                )
            if isinstance(self.materials.get(base), NoSurface):
                yield SceneError(
                    f"'{base}' is no surface; expected a material that scatters",
                    ("materials", name, field),
                )

    def _wrong_in_shape(self, shape: Shape, *path: str | int) -> Iterator[SceneError]:
        sides = {side: getattr(shape, side) for side in ("interior", "exterior")}
        if isinstance(shape, Instance):
            if shape.group not in self.groups:
                yield SceneError(no_such("group", shape.group, self.groups), (*path, "group"))
            if shape.material is not None:
                yield SceneError(
                    "an instance has the materials of its group; expected none here",
                    (*path, "material"),
                )
            for side in [side for side, medium in sides.items() if medium is not None]:
                message = "an instance has the media of its group's shapes; expected none here"
                yield SceneError(message, (*path, side))
            return
        yield from self._wrong_name_of_material(shape.material, *path, "material")
        for side, medium in sides.items():
            if medium is not None and "of" in path:
                message = "an operand bounds no medium; expected it on the whole solid"
                yield SceneError(message, (*path, side))
            else:
                yield from self._wrong_medium(medium, *path, side)
        if isinstance(shape, Solid):
            if path.count("of") >= MOST_NESTED:
                yield SceneError(
                    f"set operations nest deeper than {MOST_NESTED}; expected fewer levels: one "
                    "operation may have any number of operands",
                    path,
                )
                return
            for k, operand in enumerate(shape.of):
                yield from self._wrong_in_shape(operand, *path, "of", k)

    def _wrong_name_of_material(self, name: str | None, *path: str | int) -> Iterator[SceneError]:
        if name is not None and name not in self.materials:
            yield SceneError(no_such("material", name, self.materials), path)

    def _wrong_medium(self, name: str | None, *path: str | int) -> Iterator[SceneError]:
        if name is not None and name not in self.media:
            yield SceneError(no_such("medium", name, self.media), path)

    def __eq__(self, other: object) -> bool:
        """Equality of descriptions; file names do not count."""
        return isinstance(other, SceneModel) and self._key() == other._key()

    def __hash__(self) -> int:
        return hash(self._key())

    def _key(self) -> str:
        """The JSON of `to_json`, with a digest in place of each array."""
        return self.model_dump_json(exclude_none=True, indent=1, context=AS_DIGEST)

    # ---- where it comes from --------------------------------------------------------------------

    @property
    def folder(self) -> Path:
        """The folder that file names in the scene are relative to."""
        return self._folder

    @property
    def name(self) -> str:
        """The scene file's name without its suffix; unprintable characters are escaped."""
        return printable(Path(self._source[0]).stem) if self._source else "scene"

    @property
    def is_from_file(self) -> bool:
        """Whether the scene was read from a file or from text."""
        return self._source is not None

    @property
    def source_file(self) -> Path | None:
        """The file that the scene was read from; None for a scene of Python."""
        return None if self._source is None else Path(self._source[0])

    @property
    def source_text(self) -> str | None:
        """The YAML or JSON that the scene was read from; None for a scene of Python, and for one of
        another program's file."""
        if self._source is None or self._source[1] == WITHOUT_LINES:
            return None
        return self._source[1]

    @property
    def defaults(self) -> dict[str, str]:
        """The values of `load` for the <default> elements of its file."""
        return dict(self._defaults)

    @property
    def allows_missing(self) -> bool:
        """Whether `load` was asked to leave out what it does not support."""
        return self._allows_missing

    def error(self, message: str, *path: str | int) -> SceneError:
        """An error about the part at the key path, with file and line if the scene was read."""
        if self._source is None:
            return SceneError(message, path)
        name, text = self._source
        return SceneError(message, path, name, line_of(text, path))

    def warn(self, message: str, *path: str | int) -> None:
        """Issue a `SceneWarning` about the part at the key path, with file and line as in `error`.

        Each warning is issued once, also if tables are built again or for a `changed` scene.
        """
        text = str(self.error(message, *path))
        if text not in self._warned:
            self._warned.add(text)
            warnings.warn(SceneWarning(text), stacklevel=3)

    @property
    def resolved_sampler(self) -> AnySampler:
        """The sampler, or the default one for the integrator."""
        if self.sampler is not None:
            return self.sampler
        return Grid() if self.integrator.deterministic else Sobol()

    def digest(self) -> str:
        """SHA-256 of the description, which pictures record as their source."""
        return hashlib.sha256(self._key().encode()).hexdigest()

    # ---- in -------------------------------------------------------------------------------------

    @classmethod
    def load(
        cls,
        path: str | Path,
        defaults: Mapping[str, str] | None = None,
        allow_missing: bool = False,
    ) -> Self:
        """Read a .yaml, .yml, .json, .gltf or .glb file, or with Mitsuba an .xml file of its own.

        defaults: values for the <default> elements of an .xml file; of glTF `camera` (a name or a
        number), `environment` (a file or a radiance) and `scene` (a number);  allow_missing: leave
        out what of it is not supported, with a warning for each.  Raises SceneError (file, line,
        key path, reason), ReferenceUnavailableError where Mitsuba is needed and missing.
        """
        path = Path(path)
        if path.suffix.lower() not in OWN:
            read_file = reader_of(path).read_file
            return read_file(path, cls, defaults or {}, allow_missing)  # type: ignore[no-any-return]
        if defaults:
            raise SceneError("has no defaults; expected a scene of Mitsuba or glTF", file=str(path))
        try:
            text = read_text(path)
        except OSError as error:
            near = ""
            with suppress(OSError):
                scenes = {
                    p.stem: p.name for p in path.parent.iterdir() if p.suffix in OWN and p.is_file()
                }
                stem = "".join(meant_by(path.stem, scenes))
                near = f"; did you mean '{scenes[stem]}'?" if stem else ""
            message = f"cannot be read: {error.strerror}; expected a scene file{near}"
            raise SceneError(message, file=str(path)) from None
        except UnicodeDecodeError as error:
            raise SceneError(not_utf8(error), file=str(path)) from None
        return cls.parse(text, str(path), path.parent)

    @classmethod
    def parse(cls, text: str, name: str = "<scene>", folder: Path | None = None) -> Self:
        """A scene from YAML or JSON text.  name: for errors;  folder: of the files it refers to."""
        try:
            data = yaml_text.load_any(text)
        except yaml_text.MalformedError as error:
            raise SceneError(f"malformed: {error}", file=name, line=error.line) from None
        except RecursionError:
            raise SceneError("malformed: nested too deeply", file=name) from None
        if (other := what_else(data)) is not None:
            raise SceneError(other, file=name, line=1)
        try:
            scene = cls._checked(data)
        except SceneError as error:
            first, *others = (
                SceneError(one.message, one.path, name, line_of(text, one.path))
                for one in (error, *error.others)
            )
            raise SceneError(first.message, first.path, name, first.line, others) from None
        scene._folder = Path() if folder is None else folder
        scene._source = (name, text)
        return scene

    @classmethod
    def from_mitsuba(cls, scene: Mapping[str, Any], folder: str | Path = ".") -> Self:
        """A scene from a dictionary for `mitsuba.load_dict`;  folder: of the files that it names.
        Raises as `load` does."""
        read_dict = reader_of(Path("scene.xml")).read_dict
        return read_dict(scene, cls, Path(folder))  # type: ignore[no-any-return]

    def changed(self, **parts: Any) -> Self:
        """A copy of the scene with other parts (film=..., sampler=...), checked again."""
        fields = {name: getattr(self, name) for name in self.model_fields_set} | parts
        scene = type(self)(**fields)
        scene._folder, scene._source = self._folder, self._source
        scene._defaults, scene._allows_missing = self._defaults, self._allows_missing
        scene._warned = self._warned
        return scene

    # ---- out ------------------------------------------------------------------------------------

    def to_json(self) -> str:
        """The scene as JSON text, which `parse` reads."""
        return self.model_dump_json(exclude_defaults=False, exclude_none=True, indent=1)

    def to_yaml(self) -> str:
        """The scene as YAML text, which `parse` reads."""
        return yaml_text.dump(json.loads(self.to_json()))


def json_schema() -> dict[str, Any]:
    """The JSON Schema of scene files."""
    return SceneModel.model_json_schema(by_alias=True) | {"title": "Scene"}


# ---- readers of other programs' scenes -----------------------------------------------------------
# Installed packages add them.  A package names a module in the entry-point group
# `reference_rt.scene_readers`, under the suffix without its dot.  The module has
#
# - `read_file(path, cls, defaults, allow_missing)`: the scene in a file, an object of `cls`;
#   `defaults`: the values of `-D name=value`, by name; `allow_missing`: whether to leave out what
#   is not supported;
# - `read_dict(scene, cls, folder)`: the same from the program's own dictionaries.

GROUP = "reference_rt.scene_readers"

OWN = (".yaml", ".yml", ".json")
"""The suffixes of our own scenes."""

_PACKAGES = {".xml": "scenes of Mitsuba need Mitsuba: pip install 'reference-rt[compare]'"}
"""What to do about a suffix that nobody reads."""


def reader_of(path: Path) -> Any:
    """The module that reads a file of this suffix.  Raises SceneError, and
    ReferenceUnavailableError where a package is missing."""
    suffix = path.suffix.lower()
    for entry in importlib.metadata.entry_points(group=GROUP, name=suffix.removeprefix(".")):
        try:
            return entry.load()
        except ImportError as error:
            advice = _PACKAGES.get(suffix, f"{error.name} is not installed")
            raise ReferenceUnavailableError(f"{path}: {advice}") from None
    if suffix in _PACKAGES:
        raise ReferenceUnavailableError(f"{path}: {_PACKAGES[suffix]}")
    raise SceneError("is not a scene file; expected .yaml, .json, .gltf or .glb", file=str(path))
