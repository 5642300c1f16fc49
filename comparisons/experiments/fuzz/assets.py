"""Files that random scenes name: small images, environment maps and meshes."""

import base64
import io
import json
import shutil
import zipfile
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.experiments.fuzz.data import Data
from reference_rt.core.exr import write_exr
from reference_rt.util.files import replacing, temporary_folder

MESHES = ("ball.obj", "ball.ply", "ball_ascii.ply", "ball.stl", "ball.off", "ball.glb")
COPIES = "copies.npy"
SOUND_IMAGES = (
    *("tiles.png", "sky.exr", "sky.hdr", "sky.pfm", "sky.npy", "grey.tif", "photo.jpg"),
    *("chroma.exr", "deep.exr"),
)


IMAGES = ("square.png", "wide.png", "grey.png")
NORMALS = "normals.png"
"""An image of normals that lean by up to 40 degrees: of others, some would point below the surface,
where Mitsuba's normal maps reflect no ambient light."""

SKIES = ("sky.exr", "low_sky.exr")

FINE = "fine.ply"
"""A ball of 5,120 triangles: few faults of a hierarchy show in small ones."""

FILES: dict[str, tuple[str, ...]] = {
    "bitmap": IMAGES,
    "environment_map": SKIES,
    "mesh": (*MESHES, FINE),
    "instance": (COPIES,),
}
"""Names of files by the type whose `file` they can be."""


@cache
def write(folder: Path) -> Path:
    """Write the files into a folder unless they are there; returns the folder."""
    import trimesh
    from PIL import Image

    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(0)
    sizes = {"square.png": (8, 8, 3), "wide.png": (4, 6, 3), "grey.png": (8, 8)}
    for name, size in sizes.items():
        pixels = rng.integers(30, 225, size).astype(np.uint8)
        if not (folder / name).exists():
            with replacing(folder / name) as temporary:
                Image.fromarray(pixels).save(temporary, "PNG")
    for name, height in zip(SKIES, (8, 3), strict=True):
        sky = rng.uniform(0.05, 1.0, (height, 2 * height, 3))
        sky[height // 3, height // 2] = 8.0
        if not (folder / name).exists():
            write_exr(folder / name, {c: sky[..., k] for k, c in enumerate("RGB")}, {})
    if not (folder / NORMALS).exists():
        low, high = np.array([80, 80, 200]), np.array([175, 175, 255])
        with replacing(folder / NORMALS) as temporary:
            Image.fromarray(rng.integers(low, high, (6, 6, 3)).astype(np.uint8)).save(
                temporary, "PNG"
            )
    for name in (*MESHES, COPIES):
        if not (folder / name).exists():
            with replacing(folder / name) as temporary:
                temporary.write_bytes(files()[name])
    if not (folder / FINE).exists():
        with replacing(folder / FINE) as temporary:
            ball = trimesh.creation.icosphere(subdivisions=4)
            temporary.write_bytes(ball.export(file_type="ply"))
    return folder


def bring(scene: Data, folder: Path, to: Path) -> None:
    """Copy the files that a scene names from its own folder to another one."""
    to.mkdir(parents=True, exist_ok=True)
    for name in named(scene):
        source, target = folder / name, to / name
        if source.exists() and source.resolve() != target.resolve():
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, target)


def named(part: Any) -> Iterator[str]:
    """The files that a scene names."""
    if isinstance(part, dict):
        for key, value in part.items():
            if key == "file" and isinstance(value, str):
                yield value
            else:
                yield from named(value)
    elif isinstance(part, list):
        for value in part:
            yield from named(value)


@cache
def files() -> dict[str, bytes]:
    """The sound files by name: a ball of twenty triangles, and images of a few pixels."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=0)
    found = {}
    for name in MESHES:
        kind = Path(name).suffix[1:]
        options = {"encoding": "ascii"} if "ascii" in name else {}
        content = ball.export(file_type=kind, **options)
        found[name] = content.encode() if isinstance(content, str) else bytes(content)
    more = {"ball.gltf": _gltf(ball), "ball.3mf": _3mf(ball), COPIES: _copies()}
    return found | _images() | more


def _3mf(ball: Any) -> bytes:
    """An archive of one part; not one of `MESHES`, which random scenes for Mitsuba name."""
    points = "".join('<vertex x="{}" y="{}" z="{}"/>'.format(*p) for p in ball.vertices.tolist())
    faces = "".join('<triangle v1="{}" v2="{}" v3="{}"/>'.format(*f) for f in ball.faces.tolist())
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(
            "3D/3dmodel.model",
            '<model xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"><resources>'
            f'<object id="1"><mesh><vertices>{points}</vertices><triangles>{faces}</triangles>'
            '</mesh></object></resources><build><item objectid="1"/></build></model>',
        )
    return stream.getvalue()


def _copies() -> bytes:
    """Three maps, one of which mirrors, near the origin."""
    maps = np.zeros((3, 3, 4))
    maps[:, :, :3] = [
        np.diag(scales) for scales in ((1.0, 1.0, 1.0), (0.5, 0.8, 0.6), (-0.7, 1, 1))
    ]
    maps[1:, :, 3] = [0.9, 0.3, 0.0], [-0.8, 0.0, 0.4]
    stream = io.BytesIO()
    np.save(stream, maps)
    return stream.getvalue()


def _images() -> dict[str, bytes]:
    from PIL import Image

    rng = np.random.default_rng(0)
    pixels = rng.integers(0, 256, (4, 8, 3)).astype(np.uint8)
    found = {}
    for name, kind in (("tiles.png", "PNG"), ("grey.tif", "TIFF"), ("photo.jpg", "JPEG")):
        stream = io.BytesIO()
        Image.fromarray(pixels).save(stream, kind)
        found[name] = stream.getvalue()
    stream = io.BytesIO()
    np.save(stream, pixels / 255.0)
    # Each row of the .hdr as runs, so that the marks and lengths of runs are damaged, too.
    rows = np.concatenate([pixels, np.full((4, 8, 1), 128, np.uint8)], axis=2).transpose(0, 2, 1)
    runs = b"".join(b"\2\2\0\x08" + b"".join(b"\x08" + bytes(c) for c in row) for row in rows)
    return found | {
        "sky.exr": _exr(pixels / 255.0),
        "chroma.exr": _exr(
            np.stack([pixels[..., 0] / 255.0, *np.full((2, 4, 8), 0.1)], axis=-1), _CHROMA
        ),
        "deep.exr": _deep(pixels / 255.0),
        "sky.hdr": b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 8\n" + runs,
        "sky.pfm": b"PF\n8 4\n-1\n" + (pixels / 255.0).astype("<f4").tobytes(),
        "sky.npy": stream.getvalue(),
    }


_CHROMA = ("Y", "RY", "BY")


def _exr(pixels: Any, names: Sequence[str] = "RGB") -> bytes:
    with temporary_folder() as folder:
        path = folder / "sky.exr"
        write_exr(path, {name: pixels[..., k] for k, name in enumerate(names)}, {})
        return path.read_bytes()


def _deep(pixels: Any) -> bytes:
    """One to three samples of each pixel."""
    import OpenEXR

    planes = {name: np.empty(pixels.shape[:2], object) for name in "RGB"}
    for y, x in np.ndindex(pixels.shape[:2]):
        for k, name in enumerate("RGB"):
            planes[name][y, x] = np.full(1 + (x + y) % 3, pixels[y, x, k], np.float32)
    settings = {"type": OpenEXR.deepscanline, "compression": OpenEXR.NO_COMPRESSION}
    with temporary_folder() as folder:
        path = folder / "deep.exr"
        OpenEXR.File(settings, planes).write(str(path))
        return path.read_bytes()


def _gltf(ball: Any) -> bytes:
    """One primitive, its buffer in the text."""
    points = np.asarray(ball.vertices, np.float32).tobytes()
    faces = np.asarray(ball.faces, np.uint32).tobytes()
    data = base64.b64encode(points + faces).decode()
    views = [{"buffer": 0, "byteOffset": 0, "byteLength": len(points)},
             {"buffer": 0, "byteOffset": len(points), "byteLength": len(faces)}]  # fmt: skip
    accessors = [
        {"bufferView": 0, "componentType": 5126, "count": len(ball.vertices), "type": "VEC3"},
        {"bufferView": 1, "componentType": 5125, "count": ball.faces.size, "type": "SCALAR"},
    ]
    root = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "buffers": [{"byteLength": len(points) + len(faces),
                     "uri": "data:application/octet-stream;base64," + data}],
        "bufferViews": views,
        "accessors": accessors,
    }  # fmt: skip
    return json.dumps(root).encode()


def write_files(folder: Path) -> None:
    """The sound files, for scenes there to name."""
    for name, content in files().items():
        (folder / name).write_bytes(content)
