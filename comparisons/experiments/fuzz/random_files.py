"""`fuzz --rungs files`: random valid meshes and images of every format that a second reader reads.

Texts and bytes are written here, line by line, in the many ways that a format allows: what a
library writes would show one of them.
"""

import base64
import io
import json
import struct
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.experiments.fuzz.data import Data
from reference_rt.core.arrays import FloatArray

ALONE = ("files",)
"""The rungs of a run whose scenes are these."""

Random = np.random.Generator
Faces = list[list[int]]


def scene(seed: int, number: int, folder: Path) -> Data:
    """A scene of a mesh of each format and an image of each, written into the folder."""
    rng = np.random.default_rng((seed, number))
    shapes, textures = [], {}
    for suffix, write in MESHES.items():
        name = f"{number}{suffix}"
        (folder / name).write_bytes(write(rng))
        steps: list[Any] = [{"scale": (rng.choice([-1, 1], 3) * rng.uniform(0.2, 3, 3)).tolist()}]
        axis = rng.normal(size=3).tolist()
        steps.append({"rotate": {"axis": axis, "degrees": rng.uniform(-400, 400)}})
        more = ("smooth", "face_normals")[: rng.integers(3)]
        options = {} if not more else {more[-1]: True}
        shapes.append({"type": "mesh", "file": name, "transform": steps, **options})
    for suffix, write_image in IMAGES.items():
        name = f"{number}{suffix}"
        write_image(rng, folder / name)
        encoding = rng.choice(["auto", "raw", "srgb"]).item()
        scale = rng.uniform(0.3, 3.0)
        textures[f"image{suffix[1:]}"] = {
            "type": "bitmap", "file": name, "encoding": encoding, "scale": scale,
        }  # fmt: skip
    return {"textures": textures, "shapes": shapes}


# ---- meshes --------------------------------------------------------------------------------------


def _surface(rng: Random, largest: int) -> tuple[FloatArray, Faces]:
    """Points (n, 3) of a wavy grid, and its faces, some of them cut: convex and flat, up to
    `largest` corners."""
    rows, columns = rng.integers(2, 6, 2)
    x, y = np.meshgrid(np.arange(columns), np.arange(rows))
    heights = np.repeat(rng.normal(size=rows)[:, None], columns, axis=1)  # so that cells are flat
    points = np.stack([x, y, heights], axis=-1).reshape(-1, 3).astype(float)
    points = (points + rng.normal(size=3)) * 10.0 ** rng.integers(-2, 3)
    faces: Faces = []
    for j in range(rows - 1):
        for i in range(columns - 1):
            a = int(j * columns + i)
            cell = [a, a + 1, a + 1 + int(columns), a + int(columns)]
            turn = int(rng.integers(4))
            cell = cell[turn:] + cell[:turn]
            whole = largest > 3 and rng.random() < 0.5
            faces += [cell] if whole else [cell[:3], [cell[0], *cell[2:]]]
    return points, faces


def _number(rng: Random, value: float) -> str:
    return f"{value:{rng.choice(['.6f', '.9g', '.4e', '+.7g'])}}"


def _obj(rng: Random) -> bytes:
    points, faces = _surface(rng, 4)
    kind = int(rng.integers(4))  # 1: uv, 2: normals, 3: both
    lines = ["# random", "o thing"]
    for p in points:
        lines.append("v " + " ".join(_number(rng, x) for x in p))
        if kind & 1:
            lines.append("vt " + " ".join(_number(rng, x) for x in rng.uniform(-1, 2, 2)))
        if kind & 2:
            lines.append("vn " + " ".join(_number(rng, x) for x in rng.normal(size=3)))
    back = rng.random() < 0.3  # indices count backwards
    separator = rng.choice([" ", "  ", "\t"])
    for face in faces:
        texts = []
        for v in face:
            k = v - len(points) if back else v + 1
            texts.append((f"{k}", f"{k}/{k}", f"{k}//{k}", f"{k}/{k}/{k}")[kind])
        lines.append("f " + separator.join(texts))
        if rng.random() < 0.2:
            lines.append(rng.choice(["", "g part", "# remark", "usemtl red"]))
    return str(rng.choice(["\n", "\r\n"])).join([*lines, ""]).encode()


def _ply(rng: Random) -> bytes:
    points, faces = _surface(rng, int(rng.choice([3, 4])))
    form = rng.choice(["ascii", "binary_little_endian", "binary_big_endian"])
    real = str(rng.choice(["float", "double"]))
    columns: list[tuple[str, str, Any]] = [
        (real, f"{x}", points[:, k]) for k, x in enumerate("xyz")
    ]
    n = len(points)
    if rng.random() < 0.5:
        columns += [(real, f"n{x}", rng.normal(size=n)) for x in "xyz"]
    if rng.random() < 0.5:
        names = [("u", "v"), ("s", "t")][int(rng.integers(2))]
        columns += [(real, name, rng.uniform(-1, 2, n)) for name in names]
    if rng.random() < 0.5:
        columns += [("uchar", c, rng.integers(0, 256, n)) for c in ("red", "green", "blue")]
    index = str(rng.choice(["int", "uint"]))
    header = [
        "ply", f"format {form} 1.0", "comment random", f"element vertex {n}",
        *(f"property {kind} {name}" for kind, name, _ in columns),
        f"element face {len(faces)}", f"property list uchar {index} vertex_indices", "end_header",
        "",
    ]  # fmt: skip
    codes = {"float": "f", "double": "d", "uchar": "B", "int": "i", "uint": "I"}
    end = ">" if form == "binary_big_endian" else "<"
    rows = [[column[k] for _, _, column in columns] for k in range(n)]
    if form == "ascii":
        lines = [" ".join(f"{float(x):.9g}" for x in row) for row in rows]
        lines += [" ".join(map(str, [len(face), *face])) for face in faces]
        return ("\n".join(header) + "\n".join([*lines, ""])).encode()
    row_form = end + "".join(codes[kind] for kind, _, _ in columns)
    kinds = [kind == "uchar" for kind, _, _ in columns]
    body = b"".join(
        struct.pack(row_form, *(int(x) if k else x for x, k in zip(row, kinds, strict=True)))
        for row in rows
    )
    for face in faces:
        body += struct.pack(f"{end}B{len(face)}{codes[index]}", len(face), *face)
    return "\n".join(header).encode() + body


def _stl(rng: Random) -> bytes:
    points, faces = _surface(rng, 3)
    corners = points[np.array(faces)]
    if rng.random() < 0.5:
        body = b"".join(struct.pack("<12fH", 0, 0, 1, *c.ravel(), 0) for c in corners)
        return b"binary".ljust(80) + struct.pack("<I", len(corners)) + body
    lines = ["solid thing"]
    for triangle in corners:
        lines += ["facet normal 0 0 1", "outer loop"]
        lines += ["vertex " + " ".join(f"{x:.9g}" for x in p) for p in triangle]
        lines += ["endloop", "endfacet"]
    return "\n".join([*lines, "endsolid thing", ""]).encode()


def _off(rng: Random) -> bytes:
    points, faces = _surface(rng, 4)
    lines = ["OFF", f"{len(points)} {len(faces)} 0"]
    lines += [" ".join(_number(rng, x) for x in p) for p in points]
    lines += [" ".join(map(str, [len(face), *face])) for face in faces]
    return "\n".join([*lines, ""]).encode()


def _gltf_parts(rng: Random) -> tuple[dict[str, Any], bytes]:
    points, faces = _surface(rng, 3)
    views: list[Any] = []
    accessors: list[Any] = []
    data = b""

    def add(array: Any, kind: str) -> int:
        nonlocal data
        data = data.ljust(-(-len(data) // 4) * 4, b"\0")
        code = {"f4": 5126, "u1": 5121, "u2": 5123, "u4": 5125}[array.dtype.str[1:]]
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": array.nbytes})
        data += array.tobytes()
        bounds = {"min": array.min(axis=0).tolist(), "max": array.max(axis=0).tolist()}
        accessors.append({
            "bufferView": len(views) - 1, "componentType": code, "count": len(array), "type": kind,
            **(bounds if kind == "VEC3" else {}),
        })  # fmt: skip
        return len(accessors) - 1

    attributes = {"POSITION": add(points.astype("<f4"), "VEC3")}
    if rng.random() < 0.5:
        normals = rng.normal(size=points.shape)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        attributes["NORMAL"] = add(normals.astype("<f4"), "VEC3")
    if rng.random() < 0.5:
        uv = rng.uniform(-1, 2, (len(points), 2)).astype("<f4")
        attributes["TEXCOORD_0"] = add(uv, "VEC2")
    index = str(rng.choice(["<u2", "<u4"]))
    primitive: dict[str, Any] = {
        "attributes": attributes, "indices": add(np.array(faces).ravel().astype(index), "SCALAR"),
    }  # fmt: skip
    if rng.random() < 0.7:
        primitive["material"] = 0
    turn = rng.normal(size=4)
    node = {
        "mesh": 0, "translation": rng.normal(size=3).tolist(),
        "rotation": (turn / np.linalg.norm(turn)).tolist(),
        "scale": rng.uniform(0.5, 2.0, 3).tolist(),
    }  # fmt: skip
    root = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [{"children": [1], "scale": [2.0, 1.0, 0.5]}, node],
        "meshes": [{"primitives": [primitive]}], "accessors": accessors, "bufferViews": views,
        "materials": [{}],
        "buffers": [{"byteLength": len(data)}],
    }  # fmt: skip
    return root, data


def _gltf(rng: Random) -> bytes:
    root, data = _gltf_parts(rng)
    uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    root["buffers"][0]["uri"] = uri
    return json.dumps(root, indent=int(rng.integers(3))).encode()


def _glb(rng: Random) -> bytes:
    root, data = _gltf_parts(rng)
    text = json.dumps(root).encode()
    text = text.ljust(-(-len(text) // 4) * 4)
    data = data.ljust(-(-len(data) // 4) * 4, b"\0")
    size = 12 + 8 + len(text) + 8 + len(data)
    return (
        struct.pack("<4sII", b"glTF", 2, size)
        + struct.pack("<II", len(text), 0x4E4F534A) + text
        + struct.pack("<II", len(data), 0x004E4942) + data
    )  # fmt: skip


_OF = "http://schemas.microsoft.com/3dmanufacturing"
_PACKAGE = "http://schemas.openxmlformats.org/package/2006"
_UNITS = ("micron", "millimeter", "centimeter", "inch", "foot", "meter")


def _3mf(rng: Random) -> bytes:
    """A mesh in some unit, an object that has it once or twice, and one to three items of either,
    some of them moved."""
    points, faces = _surface(rng, 3)

    def place() -> str:
        if rng.random() < 0.3:
            return ""
        numbers = (np.vstack([np.eye(3), np.zeros(3)]) + rng.normal(size=(4, 3)) / 4.0).ravel()
        return f' transform="{" ".join(_number(rng, x) for x in numbers.tolist())}"'

    def row(name: str, keys: str, values: list[str]) -> str:
        texts = (f'{k}="{v}"' for k, v in zip(keys.split(), values, strict=True))
        return f"<{name} {' '.join(texts)}/>"

    vertices = "".join(
        row("vertex", "x y z", [_number(rng, x) for x in p]) for p in points.tolist()
    )
    triangles = "".join(row("triangle", "v1 v2 v3", [str(k) for k in f]) for f in faces)
    parts = "".join(f'<component objectid="4"{place()}/>' for _ in range(rng.integers(1, 3)))
    items = "".join(
        f'<item objectid="{rng.choice([4, 7])}"{place()}/>' for _ in range(rng.integers(1, 4))
    )
    unit = f' unit="{rng.choice(_UNITS)}"' if rng.random() < 0.8 else ""
    texts = {
        "[Content_Types].xml": f'<Types xmlns="{_PACKAGE}/content-types">'
        '<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.'
        'relationships+xml"/><Default Extension="model" ContentType="application/vnd.ms-package.'
        '3dmanufacturing-3dmodel+xml"/></Types>',
        "_rels/.rels": f'<Relationships xmlns="{_PACKAGE}/relationships"><Relationship Id="r" '
        f'Type="{_OF}/2013/01/3dmodel" Target="/3D/thing.model"/></Relationships>',
        "3D/thing.model": f'<model xmlns="{_OF}/core/2015/02"{unit}><resources>'
        f'<object id="4"><mesh><vertices>{vertices}</vertices>'
        f"<triangles>{triangles}</triangles></mesh></object>"
        f'<object id="7"><components>{parts}</components></object></resources>'
        f"<build>{items}</build></model>",
    }
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in texts.items():
            archive.writestr(name, text)
    return stream.getvalue()


MESHES: dict[str, Callable[[Random], bytes]] = {
    ".obj": _obj, ".ply": _ply, ".stl": _stl, ".off": _off, ".gltf": _gltf, ".glb": _glb,
    ".3mf": _3mf,
}  # fmt: skip


# ---- images --------------------------------------------------------------------------------------


def _codes(rng: Random, path: Path) -> None:
    """Codes of 8 or 16 bits, grey or coloured."""
    from PIL import Image

    height, width = rng.integers(1, 9, 2)
    grey = rng.random() < 0.4
    shape = (height, width) if grey else (height, width, 3)
    if path.suffix == ".png" and grey and rng.random() < 0.5:
        image = Image.fromarray(rng.integers(0, 1 << 16, shape).astype(np.uint16))
    else:
        image = Image.fromarray(rng.integers(0, 256, shape).astype(np.uint8))
    image.save(path)


def _exr(rng: Random, path: Path) -> None:
    import OpenEXR

    height, width = rng.integers(1, 9, 2)
    kind = str(rng.choice(["float16", "float32"]))
    kinds = [OpenEXR.NO_COMPRESSION, OpenEXR.ZIP_COMPRESSION, OpenEXR.PIZ_COMPRESSION]
    header = {"compression": kinds[int(rng.integers(3))], "type": OpenEXR.scanlineimage}
    pixels = rng.exponential(size=(height, width, 3)).astype(kind)
    OpenEXR.File(header, {"RGB": pixels}).write(str(path))


def _hdr(rng: Random, path: Path) -> None:
    height, width = rng.integers(1, 9, 2)
    pixels = rng.integers(0, 256, (height, width, 4)).astype(np.uint8)
    pixels[..., 3] = rng.integers(110, 140, (height, width))
    # Three equal codes in front of a length would be a run of the old kind.
    pixels[..., 0] |= 1
    pixels[..., 1] &= 254
    size = f"-Y {height} +X {width}\n"
    path.write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n" + size.encode() + pixels.tobytes())


def _pfm(rng: Random, path: Path) -> None:
    height, width = rng.integers(1, 9, 2)
    end = rng.choice(["<", ">"])
    pixels = rng.exponential(size=(height, width, 3)).astype(f"{end}f4")
    scale = "-1.0" if end == "<" else "1.0"
    path.write_bytes(f"PF\n{width} {height}\n{scale}\n".encode() + pixels.tobytes())


IMAGES: dict[str, Callable[[Random, Path], None]] = {
    ".png": _codes, ".bmp": _codes, ".tga": _codes, ".exr": _exr, ".hdr": _hdr, ".pfm": _pfm,
}  # fmt: skip
