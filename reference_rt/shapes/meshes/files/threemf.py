"""3D Manufacturing Format, .3mf (3MF Consortium, Core Specification 1.3): a zip archive of XML.

The objects of the build items, and through components those that they are made of, each where its
transforms put it, become one mesh.  Its numbers are millimetres, the default of the format: those
of a file in another unit are multiplied.  Objects in other parts of the archive, as the production
extension has them, are read.  Colours, materials, slices, lattices and everything else are ignored,
and named; a file that requires an extension that changes the shape is refused.

Memory and time are bounded before anything is unpacked or repeated, and a document type, which
could define entities, is an error, as the specification says.
"""

import io
import zipfile
from array import array
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple
from xml.parsers import expat

import numpy as np

from reference_rt.core import transform
from reference_rt.shapes.meshes.files.data import NotReadError, RawMesh, joined
from reference_rt.util.memory import check_unpacked

_SPACE = "http://schemas.microsoft.com/3dmanufacturing/"
_PRODUCTION = f"{_SPACE}production/2015/06"
_SLICE = f"{_SPACE}slice/2015/07"
_HARMLESS = (
    _PRODUCTION,
    f"{_SPACE}material/2015/02",
    _SLICE,
    f"{_SPACE}trianglesets/2021/07",
)
"""Extensions that a file may require: read, or without another shape."""

_START = "3dmanufacturing/2013/01/3dmodel"
"""How the kind of relationship ends that names the first model."""

_UNITS = {
    "micron": 1e-3,
    "millimeter": 1.0,
    "centimeter": 10.0,
    "inch": 25.4,
    "foot": 304.8,
    "meter": 1000.0,
}

PARSED = 8
"""The most bytes of memory per byte of an unpacked part: 4.5 (measured with half a million of the
shortest vertices, 3.8 with triangles, 2026-11-28)."""

MOST_USES = 1 << 16
"""The most items and components, each as often as it is used: few bytes can name any number."""

DEEPEST = 100
"""Components within components."""


class _Use(NamedTuple):
    """An object where something puts it.  part: the name of the part that has it, "" for the same
    one."""

    part: str
    number: str
    place: transform.Affine


class _Object(NamedTuple):
    vertices: "array[float]"
    corners: "array[int]"
    components: list[_Use]

    def mesh(self) -> RawMesh:
        return RawMesh(
            np.array(self.vertices, np.float64).reshape(-1, 3),
            np.array(self.corners, np.int64).reshape(-1, 3),
        )


class _Model(NamedTuple):
    """A part: its unit in millimetres, objects by number, items of the build, names of what is
    ignored."""

    unit: float
    objects: dict[str, _Object]
    items: list[_Use]
    ignored: dict[str, None]


def read(content: bytes) -> RawMesh:
    """The mesh of an archive's content.  Raises ValueError."""
    archive = _Archive(content)
    first = archive.first()
    root = archive.model(first)
    found = joined(_parts(archive, first, root))
    ignored = dict.fromkeys(found.ignored)
    for model in archive.models.values():
        ignored |= model.ignored
    return found._replace(ignored=tuple(ignored))


def _parts(
    archive: "_Archive", first: str, root: _Model
) -> Iterator[tuple[RawMesh, transform.Affine]]:
    scale = transform.identity()
    scale[:, :3] *= root.unit
    waiting = [(use, first, scale, 0) for use in reversed(root.items)]
    meshes: dict[tuple[str, str], RawMesh] = {}
    count = 0
    while waiting:
        use, beside, outer, depth = waiting.pop()
        count += 1
        if count > MOST_USES or depth > DEEPEST:
            raise ValueError(
                f"its components are more than {MOST_USES}, or more than {DEEPEST} within each "
                "other; expected fewer"
            )
        part, place = use.part or beside, transform.compose(use.place, outer)
        objects = archive.model(part).objects
        if use.number not in objects:
            raise ValueError(f"{part[:60]} has no object {use.number[:20]!r}")
        found = objects[use.number]
        if found.corners:
            key = part, use.number
            if key not in meshes:
                meshes[key] = found.mesh()
            yield meshes[key], place
        waiting += [(inner, part, place, depth + 1) for inner in reversed(found.components)]


class _Archive:
    """The parts of a file, of which each is read once.  Raises ValueError."""

    def __init__(self, content: bytes) -> None:
        self.content, self.unpacked = content, 0
        self.models: dict[str, _Model] = {}
        try:
            self.zip = zipfile.ZipFile(io.BytesIO(content))
        except zipfile.BadZipFile:
            raise ValueError("it is no zip archive, or its end is missing") from None
        # Names of parts are the same in capitals.
        self.entries = {f"/{i.filename.lower().lstrip('/')}": i for i in self.zip.infolist()}

    def part(self, name: str) -> bytes:
        entry = self.entries.get(name.lower())
        if entry is None:
            raise ValueError(f"it has no part {name[:60]!r}")
        self.unpacked += entry.file_size
        check_unpacked(len(self.content), self.unpacked, "it", PARSED)
        try:
            return self.zip.read(entry)
        except MemoryError:
            raise
        except Exception as error:  # of the library, or of the one that unpacks
            raise ValueError(f"its part {name[:60]!r} is damaged: {error}") from None

    def first(self) -> str:
        """The name of the model that the archive begins with."""
        targets: list[str] = []

        def start(name: str, values: dict[str, str]) -> None:
            if name.endswith(" Relationship") and values.get("Type", "").endswith(_START):
                targets.append("/" + values["Target"].lstrip("/"))

        if "/_rels/.rels" in self.entries:
            _parse(self.part("/_rels/.rels"), "_rels/.rels", start)
        return targets[0] if targets else "/3D/3dmodel.model"

    def model(self, name: str) -> _Model:
        if name not in self.models:
            self.models[name] = _Reader().read(self.part(name), name)
        return self.models[name]


def _parse(
    content: bytes,
    name: str,
    start: Callable[[str, dict[str, str]], None],
    end: Callable[[str], None] | None = None,
    prefixes: dict[str, str] | None = None,
) -> None:
    """Calls `start` and `end` for each element: "namespace name", attributes by such names.  Raises
    ValueError with the part and its line."""
    parser = expat.ParserCreate(namespace_separator=" ")
    parser.StartElementHandler = start
    if end is not None:
        parser.EndElementHandler = end
    if prefixes is not None:
        parser.StartNamespaceDeclHandler = lambda prefix, space: prefixes.update({prefix: space})
    parser.StartDoctypeDeclHandler = _refuse
    try:
        parser.Parse(content, True)
    except NotReadError:
        raise
    except (expat.ExpatError, KeyError, ValueError, OverflowError) as error:
        what = str(error)
        if isinstance(error, KeyError):
            what = f"it lacks {what}"
        elif isinstance(error, expat.ExpatError):
            what = expat.ErrorString(error.code)
        raise ValueError(f"{name[:60]}, line {parser.CurrentLineNumber}: {what}") from None


def _refuse(*_: Any) -> None:
    raise ValueError("it has a document type; expected none")


class _Reader:
    """The elements of a model's part, one after another."""

    def __init__(self) -> None:
        self.model = _Model(1.0, {}, [], {})
        self.prefixes: dict[str, str] = {}
        self.above: list[str] = []
        self.object = _Object(array("d"), array("q"), [])  # the one that is being read
        self.core = ""

    def read(self, content: bytes, name: str) -> _Model:
        _parse(content, name, self.start, self.end, self.prefixes)
        return self.model

    def end(self, _: str) -> None:
        self.above.pop()

    def start(self, name: str, values: dict[str, str]) -> None:
        space, _, own = name.rpartition(" ")
        parent = self.above[-1] if self.above else None
        self.above.append(own if space == self.core else name)
        if parent == "vertices" and own == "vertex":
            self.object.vertices.extend(
                (float(values["x"]), float(values["y"]), float(values["z"]))
            )
        elif parent == "triangles" and own == "triangle":
            self.object.corners.extend((int(values["v1"]), int(values["v2"]), int(values["v3"])))
            if "pid" in values:
                self.model.ignored["pid of triangles (materials)"] = None
        elif parent is None:
            self.begin(space, own, values)
        elif parent == "resources" and own == "object":
            number = values["id"]
            if values.get(f"{_SLICE} meshresolution") == "lowres":
                raise NotReadError(
                    f"the shape of object {number[:20]!r} is in slices; expected one in triangles"
                )
            if number in self.model.objects:
                raise ValueError(f"object {number[:20]!r} is there twice; expected once")
            self.object = _Object(array("d"), array("q"), [])
            self.model.objects[number] = self.object
        elif parent == "components" and own == "component":
            self.object.components.append(_use(values))
        elif parent == "build" and own == "item":
            self.model.items.append(_use(values))
        elif parent in ("resources", "mesh", "object") and own not in _PARTS_OF[parent]:
            self.model.ignored[own[:40]] = None

    def begin(self, space: str, own: str, values: dict[str, str]) -> None:
        if own != "model":
            raise ValueError(f"its first element is {own[:40]!r}; expected 'model'")
        self.core = space
        self.above[-1] = own
        unit = values.get("unit", "millimeter")
        if unit not in _UNITS:
            raise ValueError(f"its unit is {unit[:20]!r}; expected one of {', '.join(_UNITS)}")
        self.model = self.model._replace(unit=_UNITS[unit])
        for prefix in values.get("requiredextensions", "").split():
            extension = self.prefixes.get(prefix, prefix)
            if extension not in _HARMLESS:
                raise NotReadError(
                    f"it requires the extension {extension[:80]!r}, which may change the shape; "
                    "expected materials, production, slices or sets of triangles"
                )


_PARTS_OF = {
    "resources": ("object",),
    "object": ("mesh", "components", "metadatagroup"),
    "mesh": ("vertices", "triangles"),
}
"""The elements within others that are read, or say nothing of the shape."""


def _use(values: dict[str, str]) -> _Use:
    path = values.get(f"{_PRODUCTION} path", "")
    place = transform.identity()
    if "transform" in values:
        numbers = [float(word) for word in values["transform"].split()]
        if len(numbers) != 12 or not np.all(np.isfinite(numbers)):
            raise ValueError("it has a transform that is not twelve finite numbers")
        place[:] = np.array(numbers).reshape(4, 3).T  # of rows on the left
    return _Use(path and "/" + path.lstrip("/"), values["objectid"], place)
