"""`Node`: one element of a Mitsuba scene, whose parameters are taken one by one; `Reading`: the
parts of our scene as they are found, and names for them.

What no reader has taken at the end is an error: nothing of a file is silently left out.
"""

import itertools
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.mitsuba.parse import LookAt, Parsed, Step, Written, module
from reference_rt.core.arrays import FloatArray
from reference_rt.core.transform import Affine, invert
from reference_rt.materials import Emissive, Material, Wrapper
from reference_rt.textures import VertexColours, texture_names
from reference_rt.util.errors import SceneError

_PLACE = re.compile(r"^(?P<file>.*) \(line (?P<line>\d+), col (?P<col>\d+)\)$", re.DOTALL)


Triple = tuple[float, float, float]


def triple(vector: FloatArray) -> Triple:
    """Three numbers of Python."""
    x, y, z = vector.tolist()
    return x, y, z


class MissingError(SceneError):
    """A scene has what ours lack.  index: of the element;  key: of its parameter, "" for the
    element itself."""

    def __init__(self, error: SceneError, index: int, key: str = "") -> None:
        super().__init__(error.message, (), error.file, error.line)
        self.index, self.key = index, key


class Node:
    """An element of the scene: `kind`, such as "BSDF", `plugin`, such as "diffuse", and `name`, its
    id or an empty text."""

    def __init__(self, parsed: Parsed, index: int) -> None:
        self._parsed, self.index = parsed, index
        self._props = parsed.state.nodes[index].props
        self.kind = parsed.state.nodes[index].type.name
        self.plugin = str(self._props.plugin_name())
        self.name = str(self._props.id())
        self._keys = [str(key) for key in self._props.keys()]  # noqa: SIM118
        self._left = dict.fromkeys(self._keys)

    def clone(self) -> "Node":
        """The element as if nothing of it were taken."""
        return Node(self._parsed, self.index)

    # ---- errors ---------------------------------------------------------------------------------

    @property
    def _place(self) -> str:
        state = self._parsed.state
        return str(module().parser.file_location(state, state.nodes[self.index]))

    def error(self, message: str) -> SceneError:
        """An error about this element, with file, line, column and plugin."""
        what = f"{self.kind.lower()} '{self.plugin}'"
        place = self._place
        match = _PLACE.match(place)
        if match is None:
            return SceneError(f"{what}: {message}", file=place)
        return SceneError(
            f"column {match['col']}: {what}: {message}",
            file=match["file"].strip('"'),
            line=int(match["line"]),
        )

    def unsupported(self, advice: str = "") -> "MissingError":
        """The error that this plugin has no place in our scenes."""
        text = "is not supported" + (f"; {advice}" if advice else "")
        return MissingError(self.error(text), self.index)

    @contextmanager
    def checking(self) -> Iterator[None]:
        """Errors of our own descriptions become errors about this element."""
        try:
            yield
        except SceneError as error:
            if error.file is not None:
                raise
            keys = ".".join(map(str, error.path))
            raise self.error(f"{keys}: {error.message}" if keys else error.message) from None
        except (ValueError, OverflowError) as error:
            raise self.error(str(error)) from None

    def finish(self) -> None:
        """Raises SceneError for a parameter that nobody has taken."""
        for key in self._left:
            value = self._props[key]
            what = "a nested element" if key.startswith("_arg_") else f"the parameter '{key}'"
            if type(value).__name__ == "ResolvedReference":
                other = Node(self._parsed, value.index())
                what += f" ({other.kind.lower()} '{other.plugin}')"
            text = f"{what} is not supported here, or unknown; expected none"
            raise MissingError(self.error(text), self.index, key)

    # ---- parameters -----------------------------------------------------------------------------

    def has(self, key: str) -> bool:
        """Whether the parameter is given."""
        return key in self._keys

    def ignore(self, *keys: str) -> None:
        """Take parameters that have no effect on the expected picture."""
        for key in keys:
            self._left.pop(key, None)

    def take(self, key: str) -> Any:
        """The value as Mitsuba's parser has it, a nested element as `Node`; None if not given."""
        if not self.has(key):
            return None
        self._left.pop(key, None)
        value = self._props[key]
        if type(value).__name__ == "ResolvedReference":
            return Node(self._parsed, value.index())
        return value

    def kind_of(self, key: str) -> str:
        """The type of a value: "Float", "Color", "Spectrum" and so on."""
        return str(self._props.type(key).name)

    @property
    def properties(self) -> Any:
        """Mitsuba's own `Properties`."""
        return self._props

    @property
    def keys(self) -> list[str]:
        """The names of all parameters."""
        return list(self._keys)

    def number(self, key: str, default: float) -> float:
        """A finite number."""
        value = self.take(key)
        if value is None:
            return default
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.error(f"'{key}' is no number; expected one")
        if not math.isfinite(value):
            raise self.error(f"'{key}' is {value}; expected a finite number")
        return float(value)

    def integer(self, key: str, default: int) -> int:
        value = self.take(key)
        if value is None:
            return default
        if isinstance(value, bool) or not isinstance(value, int):
            raise self.error(f"'{key}' is no integer; expected one")
        return value

    def flag(self, key: str, default: bool = False) -> bool:
        value = self.take(key)
        if value is None:
            return default
        if not isinstance(value, bool):
            raise self.error(f"'{key}' is not true or false; expected one of them")
        return value

    def text(self, key: str, default: str) -> str:
        value = self.take(key)
        if value is None:
            return default
        if not isinstance(value, str):
            raise self.error(f"'{key}' is no text; expected one")
        return value

    def choice(self, key: str, default: str, known: Iterable[str]) -> Any:
        """One of the known words, in any case: a string."""
        word = self.text(key, default).lower()
        if word not in known:
            raise self.error(f"'{key}' is '{word}'; expected one of: {', '.join(known)}")
        return word

    def vector(self, key: str, default: Triple) -> Triple:
        """[x, y, z], finite."""
        value = self.take(key)
        if value is None:
            return default
        try:
            numbers = np.array(value, np.float64).reshape(3)
        except (TypeError, ValueError):
            raise self.error(f"'{key}' is no vector; expected three numbers") from None
        if not np.isfinite(numbers).all():
            raise self.error(f"'{key}' is not finite; expected three finite numbers")
        return triple(numbers)

    def transform(self, key: str = "to_world") -> Affine:
        """(3, 4), the identity by default."""
        m, of_normals = self.maps(key)
        product = m[:, :3] @ of_normals.T
        scales = np.abs(m[:, :3]) @ np.abs(of_normals.T)
        if (np.abs(product - np.eye(3)) > 1e-4 * np.maximum(scales, 1.0)).any():
            raise self.error(
                f"'{key}': Mitsuba's map and its inverse differ, as after a rotation about an axis "
                "that is no unit vector; expected axes of length 1"
            )
        return m

    def maps(self, key: str = "to_world", may_flatten: bool = False) -> tuple[Affine, FloatArray]:
        """The map of points (3, 4), and Mitsuba's map of normals (3, 3), which is not
        finite for a map that flattens space.

        The second is the inverse transpose of the first, but where a rotation's axis is no unit
        vector: Mitsuba takes it for one.
        """
        value = self.take(key)
        if value is None:
            return np.eye(3, 4), np.eye(3)
        try:
            m = np.array(value.matrix, np.float64)
            of_normals = np.array(value.inverse_transpose, np.float64)[:3, :3]
        except (AttributeError, TypeError, ValueError):
            raise self.error(f"'{key}' is no transform; expected one") from None
        if m.shape != (4, 4) or not np.isfinite(m).all():
            raise self.error(f"'{key}' is not finite; expected a finite transform")
        if np.abs(m[3] - [0.0, 0.0, 0.0, 1.0]).max() > 0.0:
            raise self.error(f"'{key}' is a perspective map; expected an affine one")
        try:
            if not may_flatten:
                invert(m[:3])
        except ValueError as error:
            raise self.error(f"'{key}': {error}") from None
        return m[:3], of_normals

    def written(self, key: str = "to_world") -> Written | None:
        """The steps of a transform as the file has them; None for a dictionary, and for what is not
        known."""
        files, node = self._parsed.state.files, self._parsed.state.nodes[self.index]
        if not files:
            return None
        # By the offset: `file_location` reads the file up to there, every time.
        return self._parsed.transforms(str(files[node.file_index])).get(node.offset, {}).get(key)

    def looks(self) -> tuple[LookAt | None, tuple[float, ...]]:
        """The <lookat> of to_world, and the scale before it, (1, 1, 1) for none; None for any other
        transform."""
        steps = self.written() or ()
        first = steps[0] if len(steps) == 2 else Step("scale", (1.0, 1.0, 1.0))
        last = steps[-1] if 1 <= len(steps) <= 2 else None
        if isinstance(last, LookAt) and isinstance(first, Step) and first.kind == "scale":
            return last, first.numbers
        return None, (1.0, 1.0, 1.0)

    # ---- nested elements ------------------------------------------------------------------------

    def children(self, *kinds: str) -> list["Node"]:
        """The nested elements of these kinds that are not taken yet, in order."""
        return [node for _, node in self.named_children(*kinds)]

    def named_children(self, *kinds: str) -> list[tuple[str, "Node"]]:
        """The same with the names of the parameters that hold them."""
        children = []
        for key in list(self._left):
            value = self._props[key]
            if type(value).__name__ == "ResolvedReference":
                node = Node(self._parsed, value.index())
                if node.kind in kinds:
                    self._left.pop(key)
                    children.append((key, node))
            elif self._props.type(key).name == "Object":
                raise self.error(
                    f"'{key}' is an object of Mitsuba's already; expected its dictionary"
                )
        return children

    def has_children(self, kind: str) -> bool:
        """Whether there is a nested element of this kind."""
        values = (self._props[key] for key in self._keys)
        references = (v for v in values if type(v).__name__ == "ResolvedReference")
        return any(Node(self._parsed, v.index()).kind == kind for v in references)

    def only(self, *kinds: str) -> "Node | None":
        """The nested element of these kinds, if there is one.  Raises SceneError for several."""
        nodes = self.children(*kinds)
        if len(nodes) > 1:
            raise self.error(f"has {len(nodes)} elements of kind {kinds[0]}; expected one at most")
        return nodes[0] if nodes else None


# ---- what has been read --------------------------------------------------------------------------


@dataclass
class Reading:
    """What has been read of a scene so far; material_name: reads a BSDF, if it is not yet, and says
    its name; notes: what the reader should know of the scene."""

    parsed: Parsed
    material_name: Callable[["Reading", Node], str]
    textures: dict[str, Any] = field(default_factory=dict)
    materials: dict[str, Any] = field(default_factory=dict)
    media: dict[str, Any] = field(default_factory=dict)
    groups: dict[str, Any] = field(default_factory=dict)
    shapes: list[Any] = field(default_factory=list)
    lights: list[Any] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    follows_media: bool = False
    """Whether Mitsuba's integrator follows light through media, and through what is no surface."""
    mirrored_for: Node | None = None
    """The sensor that mirrors the picture, if there is one."""
    names: dict[Any, str] = field(default_factory=dict)
    """The names of what has been read, by index of its element and what it is read for."""
    attributes: dict[str, str] = field(default_factory=dict)
    """Which attribute of meshes a texture shows, by the texture's name."""
    fields: dict[int, str] = field(default_factory=dict)
    """By index of a checkerboard of textures which field is being read: "color0" or "color1"."""
    meshes: dict[Any, Any] = field(default_factory=dict)
    """Files of meshes, as read."""
    numbers: dict[Any, Iterator[int]] = field(default_factory=dict)
    """The numbers that `unused` appends next, by table and name: "diffuse_2", "diffuse_3"."""

    def bsdf(self, node: Node) -> str:
        """The name of a BSDF among `materials`.  Raises SceneError."""
        return self.material_name(self, node)

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
