"""Writers of mesh files, and what must hold of whatever is read from one."""

import base64
import json
import struct
import zipfile
import zlib

import numpy as np

from reference_rt.shapes.meshes.files import MeshData, read_mesh

V = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
FORMS = ("ascii", "binary_little_endian", "binary_big_endian")


def written(folder, content, name="mesh.obj"):
    (folder / name).write_bytes(content.encode() if isinstance(content, str) else content)
    return folder / name


def read(folder, content, name="mesh.obj"):
    mesh = read_mesh(written(folder, content, name))
    check(mesh)
    return mesh


def check(mesh):
    """What `MeshData` promises."""
    n = len(mesh.vertices)
    assert isinstance(mesh, MeshData)
    for array, shape, dtype in (
        (mesh.vertices, (n, 3), np.float64),
        (mesh.faces, (len(mesh.faces), 3), np.int64),
        (mesh.normals, (n, 3), np.float64),
        (mesh.uv, (n, 2), np.float64),
        (mesh.colours, (n, 3), np.float64),
    ):
        if array is not None:
            assert type(array) is np.ndarray
            assert array.shape == shape
            assert array.dtype == dtype
            assert array.flags.c_contiguous
            assert np.all(np.isfinite(array))
    assert len(mesh.faces) > 0
    assert 0 <= mesh.faces.min() <= mesh.faces.max() < n
    if mesh.normals is not None:
        # Three squares, two sums, a root and a division: some roundings of 1.
        assert np.allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, rtol=0, atol=1e-15)
    if mesh.colours is not None:
        assert mesh.colours.min() >= 0.0


def corners(mesh):
    return mesh.vertices[mesh.faces]


CODES = {"char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I"}
CODES |= {"float": "f", "double": "d", "int8": "b", "uint8": "B", "int32": "i", "float64": "d"}


def ply(form, *elements, newline="\n"):
    """elements: (name, [properties as in the header], rows); a list is one entry of its row."""
    header, body = ["ply", f"format {form} 1.0", "comment of nothing"], b""
    for name, properties, rows in elements:
        header += [f"element {name} {len(rows)}", *(f"property {p}" for p in properties)]
        for row in rows:
            for entry, p in zip(row, properties, strict=True):
                words = p.split()
                values = list(entry) if words[0] == "list" else [entry]
                codes = CODES[words[-2]] * len(values)
                if words[0] == "list":
                    values, codes = [len(values), *values], CODES[words[1]] + codes
                if form == "ascii":
                    body += " ".join(map(repr, values)).encode() + b" "
                else:
                    body += struct.pack((">" if "big" in form else "<") + codes, *values)
            body += b"\n" if form == "ascii" else b""
    return newline.join([*header, "end_header", ""]).encode() + body


XYZ = ["double x", "double y", "double z"]
FACES = ["list uchar int vertex_indices"]


def square(form, faces=((0, 1, 2),), properties=FACES):
    return ply(form, ("vertex", XYZ, SQUARE.tolist()), ("face", properties, [[f] for f in faces]))


TRIANGLES = np.random.default_rng(3).normal(size=(5, 3, 3)).astype("<f4")


def binary_stl(triangles, header=b"solid of nothing", attribute=9):
    rows = (struct.pack("<12fH", 0, 0, 0, *t.ravel(), attribute) for t in triangles)
    return header.ljust(80, b"\0") + struct.pack("<I", len(triangles)) + b"".join(rows)


def ascii_stl(triangles, name="a facet normal"):
    facets = "".join(
        "  facet normal 0 0 nan\n outer loop\n"
        + "".join(f"    vertex {x!r} {y!r} {z!r}\n" for x, y, z in t)
        + "  endloop\nendfacet\n"
        for t in triangles.astype(float).tolist()
    )
    return f"solid {name}\n{facets}endsolid {name}\n"


POINTS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [3, 5, 7]], np.float32)


class Gltf:
    """A file of one mesh with one primitive; `add` makes an accessor of an array."""

    def __init__(self):
        self.data, self.accessors, self.views = b"", [], []
        self.primitive = {"attributes": {"POSITION": self.add(POINTS)}}
        self.root = {
            "asset": {"version": "2.0"},
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [self.primitive]}],
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{}],
        }
        self.primitive["indices"] = self.add(np.array([0, 1, 2], np.uint16))

    def add(self, array, **more):
        codes = {"f4": 5126, "u1": 5121, "u2": 5123, "u4": 5125, "i1": 5120, "i2": 5122}
        kind = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}[array[0].size]
        raw = array.tobytes()
        self.views.append({"buffer": 0, "byteOffset": len(self.data), "byteLength": len(raw)})
        self.data += raw
        self.accessors.append(
            {
                "bufferView": len(self.views) - 1,
                "componentType": codes[array.dtype.str[1:]],
                "count": len(array),
                "type": kind,
                **more,
            }
        )
        return len(self.accessors) - 1

    def gltf(self, uri=None):
        if uri is None:
            uri = "data:application/octet-stream;base64," + base64.b64encode(self.data).decode()
        self.root["buffers"] = [{"byteLength": len(self.data), "uri": uri}]
        return json.dumps(self.root).encode()

    def glb(self):
        self.root["buffers"] = [{"byteLength": len(self.data)}]
        text = json.dumps(self.root).encode()
        data = self.data
        chunks = b"".join(
            struct.pack("<II", len(c), kind) + c
            for c, kind in ((text, 0x4E4F534A), (data, 0x004E4942), (b"else", 7))
        )
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def changed(change, form="gltf"):
    file = Gltf()
    change(file)
    return getattr(file, form)()


def model_3mf(folder, vertices, faces, unit="millimeter"):
    of = "http://schemas.microsoft.com/3dmanufacturing"
    package = "http://schemas.openxmlformats.org/package/2006"
    space = f"{of}/core/2015/02"
    points = "".join('<vertex x="{}" y="{}" z="{}"/>'.format(*v) for v in vertices)
    corners_ = "".join('<triangle v1="{}" v2="{}" v3="{}"/>'.format(*f) for f in faces)
    with zipfile.ZipFile(folder / "a.3mf", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(
            "[Content_Types].xml",
            f'<Types xmlns="{package}/content-types"><Default Extension="rels" ContentType='
            '"application/vnd.openxmlformats-package.relationships+xml"/><Default Extension="model"'
            ' ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>',
        )
        archive.writestr(
            "_rels/.rels",
            f'<Relationships xmlns="{package}/relationships"><Relationship Id="a" '
            f'Type="{of}/2013/01/3dmodel" Target="/3D/3dmodel.model"/></Relationships>',
        )
        archive.writestr(
            "3D/3dmodel.model",
            f'<?xml version="1.0"?><model unit="{unit}" xmlns="{space}"><resources>'
            f'<object id="1"><mesh><vertices>{points}</vertices>'
            f"<triangles>{corners_}</triangles></mesh></object>"
            '</resources><build><item objectid="1" transform="1 0 0 0 1 0 0 0 1 9 0 0"/></build>'
            "</model>",
        )
    return folder / "a.3mf"


def expect_one_line(error, start):
    assert str(error).startswith(start)
    assert "\n" not in str(error)


def packed(version, *meshes):
    """A .serialized file of meshes: vertices, triangles, normals, whether in double precision."""
    content, offsets = b"", []
    for vertices, faces, normals, double in meshes:
        offsets.append(len(content))
        kind = "<f8" if double else "<f4"
        flags = (1 if normals is not None else 0) | 0x0002 | 0x0008 | (0x2000 if double else 0x1000)
        body = struct.pack("<I", flags) + (b"name\0" if version == 4 else b"")
        body += struct.pack("<QQ", len(vertices), len(faces)) + vertices.astype(kind).tobytes()
        if normals is not None:
            body += normals.astype(kind).tobytes()
        body += vertices[:, :2].astype(kind).tobytes()  # uv
        body += vertices.astype(kind).tobytes()  # colours
        body += np.asarray(faces, "<u4").tobytes()
        content += struct.pack("<HH", 0x041C, version) + zlib.compress(body)
    table = "<Q" if version == 4 else "<I"
    content += b"".join(struct.pack(table, x) for x in offsets)
    return content + struct.pack("<I", len(offsets))
