"""glTF 2.0 (ISO/IEC 12113), .gltf and .glb: the triangles of its scene, as one mesh.

It reads POSITION, NORMAL, TEXCOORD_0 and COLOR_0 (linear, as the format says), without animations,
skins and morphing.  It ignores points, lines, materials, images and everything else, and names
them.  A buffer may be a file, in the mesh's folder or below it.

`GltfFile` is for `reference_rt.gltf`, too, which reads such files as whole scenes.
"""

import base64
import json
import struct
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import numpy.typing as npt

from reference_rt.core import transform
from reference_rt.core.arrays import IntArray
from reference_rt.shapes.meshes.files import gltf_compression as compression
from reference_rt.shapes.meshes.files.data import NotReadError, RawMesh, joined
from reference_rt.shapes.meshes.files.polygons import fans
from reference_rt.util.files import read_input
from reference_rt.util.memory import check_unpacked

_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_TRIANGLES, _STRIP, _FAN = 4, 5, 6  # points and lines are 0 to 3
_READ = ("POSITION", "NORMAL", "TEXCOORD_0", "COLOR_0")
_JSON, _BIN = 0x4E4F534A, 0x004E4942

_QUANTIZED = "KHR_mesh_quantization"  # texture coordinates may be integers that are no fractions

# Extensions that a file may require although they are unknown here: they do not change the shape.
_HARMLESS = (
    "KHR_materials_",
    "KHR_texture_",
    "KHR_lights_",
    "EXT_texture_",
    _QUANTIZED,
    compression.DRACO,
    *compression.MESHOPT,
)

Rows = npt.NDArray[Any]


def read_gltf(content: bytes, folder: Path) -> RawMesh:
    return _joined(GltfFile(content, None, folder))


def read_glb(content: bytes, folder: Path) -> RawMesh:
    return _joined(open_glb(content, folder))


def open_glb(content: bytes, folder: Path) -> "GltfFile":
    """The JSON and the binary chunk of a .glb file.  Raises ValueError."""
    if len(content) < 12 or content[:4] != b"glTF":
        raise ValueError("it does not begin with 'glTF' and a header")
    version, length = struct.unpack_from("<II", content, 4)
    if version != 2 or length != len(content):
        raise ValueError(
            f"its header says version {version}, {length} bytes; expected 2, {len(content)}"
        )
    chunks: dict[int, bytes] = {}
    position = 12
    while position < length:
        if position + 8 > length:
            raise ValueError("it ends within the header of a chunk")
        size, kind = struct.unpack_from("<II", content, position)
        position += 8 + size
        if position > length:
            raise ValueError("it ends within a chunk")
        chunks.setdefault(kind, content[position - size : position])
    if _JSON not in chunks:
        raise ValueError("it has no JSON chunk")
    return GltfFile(chunks[_JSON], chunks.get(_BIN), folder)


def _joined(file: "GltfFile") -> RawMesh:
    version = str(file.root.get("asset", {}).get("version", "2.0"))[:20]
    if version.partition(".")[0] != "2":
        raise NotReadError(f"it has version {version!r} of glTF; expected 2.0")
    for name in file.root.get("extensionsRequired", []):
        if not str(name).startswith(_HARMLESS):
            raise NotReadError(
                f"it requires the extension {str(name)[:60]!r}, which is unknown; expected one "
                "that does not change the shape"
            )
    found = joined(file.parts())
    return found._replace(ignored=(*found.ignored, *file.ignored()))


class GltfFile:
    """The JSON of a file, its binary chunk if it has one, and its folder.

    Everything raises ValueError for a malformed file, or another exception where the JSON has other
    types than expected.
    """

    def __init__(self, text: bytes, binary: bytes | None, folder: Path) -> None:
        self.root, self.binary, self.folder = json.loads(text), binary, folder
        self.buffers: dict[int, bytes] = {}
        self.files: dict[Path, bytes] = {}
        self.unpacked: dict[int, bytes] = {}  # views that meshopt compressed
        self.draco: dict[int, compression.DracoMesh] = {}  # by the view of their data
        self.zeros = 0  # bytes of all accessors without data
        self.has_lines = False
        if not isinstance(self.root, dict):
            raise ValueError("its JSON is no object")

    def item(self, kind: str, index: Any) -> dict[str, Any]:
        items = self.root.get(kind)
        if not (isinstance(items, list) and type(index) is int and 0 <= index < len(items)):
            raise ValueError(f"it has no {kind}[{str(index)[:20]}]")
        found = items[index]
        if not isinstance(found, dict):
            raise ValueError(f"{kind}[{index}] is no object")
        return found

    def parts(self) -> Iterator[tuple[RawMesh, transform.Affine]]:
        """The primitives of all nodes of the scene, with the nodes' maps to the world."""
        for index, m in self.placed_nodes():
            node = self.item("nodes", index)
            if "mesh" in node:
                for primitive in self.item("meshes", node["mesh"])["primitives"]:
                    if primitive.get("mode", _TRIANGLES) in (_TRIANGLES, _STRIP, _FAN):
                        yield self.primitive(primitive), m
                    else:
                        self.has_lines = True

    def placed_nodes(self, scene: int | None = None) -> Iterator[tuple[int, transform.Affine]]:
        """All nodes of a scene, by default the file's own, with their maps to the world."""
        if "scenes" in self.root:
            number = self.root.get("scene", 0) if scene is None else scene
            roots = self.item("scenes", number).get("nodes", [])
        else:  # a library of nodes: all of them, where their trees begin
            nodes = self.root.get("nodes", [])
            children = {child for node in nodes for child in node.get("children", [])}
            roots = [k for k in range(len(nodes)) if k not in children]
        waiting = [(node, transform.identity()) for node in reversed(roots)]
        seen = set()
        while waiting:
            index, to_world = waiting.pop()
            node = self.item("nodes", index)
            if index in seen:
                raise ValueError(f"nodes[{index}] has two parents; expected a tree")
            seen.add(index)
            m = transform.compose(local_map(node), to_world)
            waiting += [(child, m) for child in reversed(node.get("children", []))]
            yield index, m

    def ignored(self) -> tuple[str, ...]:
        """Ignored parts of the file that would change the image."""
        names = [key for key in ("materials", "animations", "skins") if self.root.get(key)]
        return (*names, *(["points or lines"] if self.has_lines else []))

    def primitive(self, primitive: dict[str, Any], uv_sets: Sequence[int] = (0,)) -> RawMesh:
        """The triangles of a primitive.  uv_sets: the numbers of its texture coordinates, those of
        our mesh's `uv` first; of the others what it lacks is (0, 0)."""
        attributes, packed = primitive["attributes"], self.packed(primitive)
        of_draco = {} if packed is None else packed[1]
        points = self.accessor(attributes.get("POSITION"), (3,), packed=of_draco.get("POSITION"))
        fractions = _QUANTIZED not in self.root.get("extensionsUsed", [])  # else they say so
        normals, colours, *sets = (
            self.accessor(attributes[name], widths, fraction, of_draco.get(name))
            if name in attributes
            else None
            for name, widths, fraction in (
                ("NORMAL", (3,), False),
                ("COLOR_0", (3, 4), True),
                *((f"TEXCOORD_{n}", (2,), fractions) for n in uv_sets),
            )
        )
        if any(a is not None and len(a) != len(points) for a in (normals, colours, *sets)):
            raise ValueError("the attributes of a primitive have different lengths")
        uv, *more = (None if one is None else _from_below(one) for one in sets)
        nothing = np.zeros((len(points), 2))
        if packed is None:
            corners = np.arange(len(points))
            if "indices" in primitive:
                corners = self.accessor(primitive["indices"], (1,))[:, 0].astype(np.int64)
            faces = _faces(corners, primitive.get("mode", _TRIANGLES))
        else:
            faces = packed[0]
        ignored = [name for name in attributes if name not in _READ]
        if primitive.get("targets"):
            ignored.append("targets")
        if colours is not None and colours.shape[1] == 4 and np.any(colours[:, 3] < 1.0):
            ignored.append("alpha of COLOR_0")
        rgb = None if colours is None else colours[:, :3]
        return RawMesh(
            points,
            faces,
            normals,
            uv,
            rgb,
            tuple(map(str, ignored)),
            more_uv=np.hstack([nothing if m is None else m for m in more]) if more else None,
        )

    def packed(self, primitive: dict[str, Any]) -> tuple[IntArray, dict[str, Rows]] | None:
        """Triangles and attributes that Draco compressed; None where there are none, or where the
        file has the plain ones beside them, which need no library and no rounding."""
        extension = primitive.get("extensions", {}).get(compression.DRACO)
        if extension is None:
            return None
        numbers, attributes = extension["attributes"], primitive["attributes"]
        used = [attributes[name] for name in numbers if name in attributes]
        used += [primitive["indices"]] if "indices" in primitive else []
        if all({"bufferView", "sparse"} & self.item("accessors", k).keys() for k in used):
            return None
        view = extension.get("bufferView")
        if view not in self.draco:
            self.draco[view] = compression.draco(self.view(view))
        mesh = self.draco[view]
        if missing := [name for name, number in numbers.items() if number not in mesh.attributes]:
            raise ValueError(f"its data of {compression.DRACO} have no {str(missing[0])[:40]!r}")
        return mesh.faces, {name: mesh.attributes[number] for name, number in numbers.items()}

    def accessor(
        self,
        index: Any,
        widths: tuple[int, ...],
        fraction: bool = False,
        packed: Rows | None = None,
    ) -> Rows:
        """Rows (count, one of `widths`); fraction: integers stand for numbers of [0, 1] or [-1,
        1];  packed: the rows that Draco has for it."""
        accessor = self.item("accessors", index)
        width = _WIDTHS.get(str(accessor.get("type")))
        component = _COMPONENTS.get(accessor.get("componentType", 0))
        if width not in widths or component is None:
            raise ValueError(f"accessors[{index}] has the wrong type")
        dtype, count, name = np.dtype(component), _natural(accessor, "count"), f"accessors[{index}]"
        sparse = accessor.get("sparse")
        if packed is not None:
            if packed.shape != (count, width):
                raise ValueError(f"{name} has {count} rows; its data have shape {packed.shape}")
            rows = packed.astype(dtype)
        elif "bufferView" in accessor:
            rows = self.rows(accessor, name, count, width, dtype)
        else:  # zeros, says the specification (3.6.2)
            if count < 1:
                raise ValueError(f"{name} is empty")
            self.zeros += count * width * dtype.itemsize
            check_unpacked(len(self.binary or b""), self.zeros, name)
            rows = np.zeros((count, width), dtype)
        if sparse is not None:
            rows = self.replaced(rows, sparse, name)
        if dtype.kind != "f" and (fraction or accessor.get("normalized", False)):
            return np.maximum(rows / np.iinfo(dtype).max, -1.0)
        return rows

    def rows(
        self, part: dict[str, Any], name: str, count: int, width: int, dtype: np.dtype[Any]
    ) -> Rows:
        """Rows (count, width) of a view.  part: names the view and the offset in it."""
        view, data, begin = self.stored(part.get("bufferView"))
        row = width * dtype.itemsize
        stride, size = _natural(view, "byteStride", row), _natural(view, "byteLength")
        within = _natural(part, "byteOffset", 0)
        if begin + size > len(data):
            raise ValueError(f"the view of {name} reaches beyond its buffer")
        if count < 1 or stride < row or within + (count - 1) * stride + row > size:
            raise ValueError(f"{name} reaches beyond its view, or is empty")
        return np.ndarray((count, width), dtype, data, begin + within, (stride, dtype.itemsize))

    def stored(self, index: Any) -> tuple[dict[str, Any], bytes, int]:
        """A view, the bytes in which it is, and where it begins in them."""
        view = self.item("bufferViews", index)
        found = view.get("extensions", {})
        extension = next((name for name in compression.MESHOPT if name in found), None)
        if extension is not None and self.is_placeholder(view.get("buffer")):
            if index not in self.unpacked:
                part, name = found[extension], f"bufferViews[{index}]"
                data = self.buffer(part.get("buffer"))
                begin, size = _natural(part, "byteOffset", 0), _natural(part, "byteLength")
                if begin + size > len(data):
                    raise ValueError(f"the data of {name} reach beyond their buffer")
                data = data[begin : begin + size]
                self.unpacked[index] = compression.meshopt(data, part, extension, name)
            return view, self.unpacked[index], 0
        return view, self.buffer(view.get("buffer")), _natural(view, "byteOffset", 0)

    def is_placeholder(self, index: Any) -> bool:
        """Whether a buffer is there for views that meshopt compressed, without data of its own."""
        buffer = self.item("buffers", index)
        is_marked = any(
            buffer.get("extensions", {}).get(name, {}).get("fallback", False)
            for name in compression.MESHOPT
        )
        return is_marked or ("uri" not in buffer and not (index == 0 and self.binary is not None))

    def replaced(self, rows: Rows, sparse: dict[str, Any], name: str) -> Rows:
        """The rows with those that a sparse accessor lists in place of others."""
        count = _natural(sparse, "count")
        kind = np.dtype(_COMPONENTS.get(sparse["indices"].get("componentType", 0), "f4"))
        if kind.kind != "u":
            raise ValueError(f"the indices of {name} have the wrong type")
        places = self.rows(sparse["indices"], f"the indices of {name}", count, 1, kind)[:, 0]
        if places.max() >= len(rows):
            raise ValueError(f"{name} has {len(rows)} rows; its indices reach {places.max()}")
        found = rows.copy()
        found[places] = self.rows(sparse["values"], name, count, rows.shape[1], rows.dtype)
        return found

    def buffer(self, index: Any) -> bytes:
        entry = self.item("buffers", index)
        if index not in self.buffers:
            self.buffers[index] = self.load(entry.get("uri"), index)
        if _natural(entry, "byteLength") > len(self.buffers[index]):
            raise ValueError(f"buffers[{index}] has only {len(self.buffers[index])} bytes")
        return self.buffers[index]

    def view(self, index: Any) -> bytes:
        """All bytes of a view."""
        name, view = f"bufferViews[{index}]", self.item("bufferViews", index)
        size = _natural(view, "byteLength")
        return self.rows({"bufferView": index}, name, 1, size, np.dtype("u1")).tobytes()

    def load(self, uri: Any, index: int) -> bytes:
        if uri is None and index == 0 and self.binary is not None:
            return self.binary
        name = f"buffers[{index}]"
        if not isinstance(uri, str):
            raise ValueError(f"{name} has no data")
        if (data := inline(uri)) is not None:
            return data
        try:
            path = self.located(uri, name)
            if path not in self.files:  # many buffers may be the same file
                self.files[path] = read_input(path)
            return self.files[path]
        except OSError as error:
            raise ValueError(
                f"{name}, {uri[:60]!r}: {error.strerror}; expected a file in its folder"
            ) from None

    def located(self, uri: str, name: str) -> Path:
        """The file that `name` refers to, which is in the folder of this one or below it."""
        path, folder = (self.folder / unquote(uri)).resolve(), self.folder.resolve()
        if not path.is_relative_to(folder):
            raise ValueError(f"{name} is {uri[:60]!r}; expected a file in its folder")
        return path


def inline(uri: str) -> bytes | None:
    """The bytes in a data: URI; None for a name of a file."""
    head, _, payload = uri.partition(",")
    if not (head.startswith("data:") and head.endswith(";base64")):
        return None
    return base64.b64decode(payload, validate=True)


def _natural(values: dict[str, Any], key: str, default: int | None = None) -> int:
    value = values.get(key, default)
    if type(value) is not int or value < 0:
        raise ValueError(f"'{key}' is {str(value)[:20]}; expected an integer of at least 0")
    return value


def _from_below(uv: Rows) -> Rows:
    """Texture coordinates whose v counts from the bottom: glTF's counts from the top."""
    return np.column_stack([uv[:, 0], 1.0 - uv[:, 1].astype(np.float64)])


def _faces(corners: npt.NDArray[np.int64], mode: int) -> npt.NDArray[Any]:
    if len(corners) < 3 or (mode == _TRIANGLES and len(corners) % 3 != 0):
        raise ValueError(f"a primitive of {len(corners)} corners; expected whole triangles")
    if mode == _TRIANGLES:
        return corners.reshape(-1, 3)
    if mode == _FAN:
        return fans(corners, np.array([len(corners)]))
    i = np.arange(len(corners) - 2)
    odd = i % 2  # every other triangle of a strip has the reverse winding
    return np.stack([corners[i], corners[i + 1 + odd], corners[i + 2 - odd]], axis=1)


def local_map(node: dict[str, Any]) -> transform.Affine:
    """A node's map to its parent: a matrix, by columns; or a scale, a rotation, a translation."""

    def vector(key: str, default: list[float]) -> npt.NDArray[np.float64]:
        found = np.array(node.get(key, default), np.float64)
        if found.shape != (len(default),) or not np.all(np.isfinite(found)):
            raise ValueError(f"a node's '{key}' is not {len(default)} finite numbers")
        return found

    if "matrix" in node:
        return vector("matrix", [0.0] * 16).reshape(4, 4).T[:3]
    x, y, z, w = q = vector("rotation", [0.0, 0.0, 0.0, 1.0])
    norm2 = float(q @ q)
    if norm2 == 0.0:
        raise ValueError("a node's 'rotation' is zero; expected a unit quaternion")
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turn = np.eye(3) + 2.0 / norm2 * (w * cross + cross @ cross)
    return np.column_stack([turn * vector("scale", [1.0] * 3), vector("translation", [0.0] * 3)])
