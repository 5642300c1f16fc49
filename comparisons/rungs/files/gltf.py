"""The numbers of a glTF file against a second reading of its JSON, with glTF's own defaults.

Mitsuba reads no glTF: it gets the scene that we read.  What each surface, lamp and camera is made
of is compared here, and by which texture coordinates each image is shown; where meshes stand is
not."""

import base64
import json
import math
import struct
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import numpy.typing as npt

from comparisons.rungs.files.findings import Findings, text

DEFAULTS: dict[str, Any] = {
    "pbrMetallicRoughness/baseColorFactor": [1.0, 1.0, 1.0, 1.0],
    "pbrMetallicRoughness/metallicFactor": 1.0,
    "pbrMetallicRoughness/roughnessFactor": 1.0,
    "normalTexture/scale": 1.0,
    "emissiveFactor": [0.0, 0.0, 0.0],
    "alphaMode": "OPAQUE",
    "alphaCutoff": 0.5,
    "doubleSided": False,
    "extensions/KHR_materials_ior/ior": 1.5,
    "extensions/KHR_materials_specular/specularFactor": 1.0,
    "extensions/KHR_materials_specular/specularColorFactor": [1.0, 1.0, 1.0],
    "extensions/KHR_materials_emissive_strength/emissiveStrength": 1.0,
    "color": [1.0, 1.0, 1.0],
    "intensity": 1.0,
    "spot/innerConeAngle": 0.0,
    "spot/outerConeAngle": math.pi / 4.0,
    "perspective/zfar": None,
}
"""The defaults of glTF 2.0's specification and of the extensions: of materials, lights, cameras."""

PBR, SPECULAR = "pbrMetallicRoughness", "extensions/KHR_materials_specular"

RELATIVE = 1e-12
"""Products of a few numbers, and degrees of radians."""

Value = tuple[str, Any, Any]
"""A place, what the file says, and what the scene has."""


def check_gltf(path: Path, scene: Any, findings: Findings) -> list[str]:
    """What the scene has otherwise than the file;  path: that it was read from."""
    try:
        root, binary = _parts(path)
        shown = [*_coordinates(root, _Buffers(root, binary, path.parent), scene)]
    except (OSError, ValueError, struct.error):  # it was changed after it was read
        findings.unread.append(f"{path.suffix.lower()} that cannot be read again")
        return []
    values = [*_materials(root, scene), *shown, *_lamps(root, scene), *_camera(root, scene)]
    findings.count("values of glTF", len(values))
    return [
        f"{place}: {path.name} says {_words(said)}, the rendered scene has {_words(ours)}"
        for place, said, ours in values
        if not _same(said, ours)
    ]


def _parts(path: Path) -> tuple[Any, bytes]:
    """The JSON, and the bytes of the binary chunk."""
    content, binary = path.read_bytes(), b""
    if content[:4] == b"glTF":
        (length,) = struct.unpack("<I", content[12:16])
        content, binary = content[20 : 20 + length], content[28 + length :]
    return json.loads(content), binary


def _get(part: Any, place: str) -> Any:
    """What a part has at a place, or its default."""
    for key in place.split("/"):
        part = part.get(key) if isinstance(part, dict) else None
    return DEFAULTS.get(place) if part is None else part


def _same(a: Any, b: Any) -> bool:
    if isinstance(a, list | tuple) and isinstance(b, list | tuple):
        return len(a) == len(b) and all(map(_same, a, b))
    if isinstance(a, int | float) and isinstance(b, int | float):
        return math.isclose(a, b, rel_tol=RELATIVE, abs_tol=0.0)
    return bool(a == b)


def _words(value: Any) -> str:
    if isinstance(value, int | float | list | tuple) and not isinstance(value, bool):
        return text(value)
    return {True: "yes", False: "no", None: "nothing"}.get(value, str(value))


# ---- materials -----------------------------------------------------------------------------------


def _materials(root: Any, scene: Any) -> Iterator[Value]:
    """Of those that shapes have, and whose names tell which they are."""
    materials = [*root.get("materials", [])]
    primitives = [one for mesh in root.get("meshes", []) for one in mesh["primitives"]]
    if any("material" not in one for one in primitives):
        materials.append({"name": "default"})
    names = [m.get("name") or f"material {k}" for k, m in enumerate(materials)]
    once = Counter(names)
    for k, (name, material) in enumerate(zip(names, materials, strict=True)):
        if name in scene.materials and once[name] == 1:
            for place, said, ours in _of_material(material, _layers(scene, name), scene):
                yield f"materials[{k}] '{name}', {place}", said, ours


def _layers(scene: Any, name: str) -> dict[str, Any]:
    """The material and those it is made of, by type."""
    found: dict[str, Any] = {}
    inner: Any = name
    while inner in scene.materials:
        found[scene.materials[inner].type] = scene.materials[inner]
        inner = getattr(scene.materials[inner], "base", None)
    return found


def _of_material(said: Any, layers: dict[str, Any], scene: Any) -> Iterator[Value]:
    base, mode = _get(said, f"{PBR}/baseColorFactor"), _get(said, "alphaMode")
    image = _get(said, f"{PBR}/baseColorTexture") is not None
    opacity: Any = 1.0
    if mode == "BLEND":
        opacity = base[3]
    elif mode == "MASK" and base[3] < _get(said, "alphaCutoff"):
        opacity = 0.0
    if not image:
        yield "opacity", opacity, layers["mask"].opacity if "mask" in layers else 1.0
    yield "doubleSided", _get(said, "doubleSided"), "two_sided" in layers
    if _get(said, "extensions/KHR_materials_unlit") is not None:
        return
    leaf = layers.get("gltf_pbr")
    if leaf is None:
        yield "the material", "a gltf_pbr", "none"
        return
    for name, place in (
        ("base_color", f"{PBR}/baseColorFactor"),
        ("metallic", f"{PBR}/metallicFactor"),
        ("roughness", f"{PBR}/roughnessFactor"),
        ("ior", "extensions/KHR_materials_ior/ior"),
        ("specular", f"{SPECULAR}/specularFactor"),
        ("specular_color", f"{SPECULAR}/specularColorFactor"),
    ):
        value = _get(said, place)
        value = value[:3] if isinstance(value, list) else value
        yield place, value, _factor(getattr(leaf, name), value, scene)
    if "normal_map" in layers:
        place = "normalTexture/scale"
        yield place, _get(said, place), layers["normal_map"].scale
    if not (image and mode != "OPAQUE"):
        strength = _get(said, "extensions/KHR_materials_emissive_strength/emissiveStrength")
        radiance = [x * strength * opacity for x in _get(said, "emissiveFactor")]
        lamp = layers.get("emissive")
        ours = (0.0, 0.0, 0.0) if lamp is None else _factor(lamp.radiance, radiance, scene)
        yield "emissiveFactor", radiance, ours


def _factor(ours: Any, said: Any, scene: Any) -> Any:
    """A number or a colour; of a texture what it is multiplied with."""
    if not isinstance(ours, str):
        return ours
    texture = scene.textures[ours]
    if isinstance(said, list):
        return texture.factor if texture.type == "product" else (1.0, 1.0, 1.0)
    return texture.scale


# ---- texture coordinates -------------------------------------------------------------------------

SLOTS = (
    (f"{PBR}/baseColorTexture", "gltf_pbr", "base_color"),
    (f"{PBR}/metallicRoughnessTexture", "gltf_pbr", "roughness"),
    (f"{PBR}/metallicRoughnessTexture", "gltf_pbr", "metallic"),
    (f"{SPECULAR}/specularTexture", "gltf_pbr", "specular"),
    (f"{SPECULAR}/specularColorTexture", "gltf_pbr", "specular_color"),
    ("normalTexture", "normal_map", "normals"),
    ("emissiveTexture", "emissive", "radiance"),
)
"""Where an image is in glTF, and in which field of which of our materials."""

Pairs = npt.NDArray[np.float64]

COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5126: "<f4"}


class _Buffers:
    """The buffers of a file, by their numbers."""

    def __init__(self, root: Any, binary: bytes, folder: Path) -> None:
        self.root, self.binary, self.folder = root, binary, folder

    def data(self, number: int) -> bytes:
        uri = self.root["buffers"][number].get("uri")
        if uri is None:
            return self.binary
        if uri.startswith("data:"):
            return base64.b64decode(uri.partition(",")[2])
        return (self.folder / unquote(uri)).read_bytes()

    def pairs(self, number: int) -> Pairs | None:
        """An accessor's rows (n, 2); None where they are sparse, compressed or without data."""
        accessor = self.root["accessors"][number]
        if "sparse" in accessor or "bufferView" not in accessor:
            return None
        view = self.root["bufferViews"][accessor["bufferView"]]
        if "extensions" in view:
            return None
        kind = np.dtype(COMPONENTS[accessor["componentType"]])
        begin = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        steps = (view.get("byteStride", 2 * kind.itemsize), kind.itemsize)
        size, data = (accessor["count"], 2), self.data(view["buffer"])
        rows = np.ndarray(size, kind, data, begin, steps).astype(np.float64)
        if kind.kind != "f" and accessor.get("normalized", False):
            rows = np.maximum(rows / np.iinfo(kind).max, -1.0)
        return rows


def _coordinates(root: Any, buffers: _Buffers, scene: Any) -> Iterator[Value]:
    """Of each image of a material and each mesh that it is on, the pair that differs most."""
    meshes = [*scene.shapes, *(one for some in scene.groups.values() for one in some)]
    primitives = [one for mesh in root.get("meshes", []) for one in mesh["primitives"]]
    materials = root.get("materials", [])
    names = [m.get("name") or f"material {k}" for k, m in enumerate(materials)]
    for k, name in enumerate(names):
        if names.count(name) > 1 or name not in scene.materials:
            continue
        on = [one for one in meshes if one.type == "mesh" and one.material == name]
        parts = [p for p in primitives if p.get("material") == k and p.get("mode", 4) > 3]
        layers = _layers(scene, name)
        for place, layer, field in SLOTS:
            info = _get(materials[k], place)
            images = _images(getattr(layers.get(layer), field, None), scene)
            if info is None or not images:
                continue
            said = [one for p in parts if (one := _said(p, info, buffers)) is not None]
            for mesh in on:
                ours = _of_set(mesh, images[0].uv_set)
                rows = [one for one in said if ours is not None and len(one) == len(ours)]
                if ours is not None and len(rows) == len(parts):
                    off = [np.abs(one - ours).max(axis=1) for one in rows]
                    best = min(range(len(rows)), key=lambda n: float(off[n].max()))
                    most = int(off[best].argmax())
                    where = f"materials[{k}] '{name}', {place}, coordinates {most}"
                    yield where, rows[best][most].tolist(), ours[most].tolist()


def _said(primitive: Any, info: Any, buffers: _Buffers) -> Pairs | None:
    """The coordinates (n, 2) of an image on a primitive, v from the bottom."""
    own = _get(info, "extensions/KHR_texture_transform/texCoord")
    name = f"TEXCOORD_{info.get('texCoord', 0) if own is None else own}"
    if "extensions" in primitive or name not in primitive["attributes"]:
        return None
    rows = buffers.pairs(primitive["attributes"][name])
    return None if rows is None else rows * [1.0, -1.0] + [0.0, 1.0]


def _of_set(mesh: Any, uv_set: int) -> Pairs | None:
    if uv_set == 0:
        return mesh.uv  # type: ignore[no-any-return]
    return mesh.more_uv[:, 2 * uv_set - 2 : 2 * uv_set]  # type: ignore[no-any-return]


def _images(name: Any, scene: Any) -> list[Any]:
    """The bitmaps of a parameter."""
    if not isinstance(name, str):
        return []
    texture = scene.textures[name]
    if texture.type == "product":
        return [one for of in texture.of for one in _images(of, scene)]
    return [texture] if texture.type == "bitmap" else []


# ---- lamps and cameras ---------------------------------------------------------------------------


def _lamps(root: Any, scene: Any) -> Iterator[Value]:
    """Each of ours is one of the file's: only they are counted, since nodes place them."""
    lights = root.get("extensions", {}).get("KHR_lights_punctual", {}).get("lights", [])
    for k, ours in enumerate(scene.lights):
        if ours.type not in ("point", "spot", "directional"):
            continue
        found = ours.irradiance if ours.type == "directional" else ours.intensity
        numbers = [*found]
        if ours.type == "spot":
            numbers += [ours.cutoff_angle, ours.beam_width]
        said = [_of_light(light) for light in lights if light.get("type") == ours.type]
        right = next((one for one in said if _same(one, numbers)), said[0] if said else [])
        yield f"lights[{k}], colour times intensity, and cone", right, numbers


def _of_light(light: Any) -> list[float]:
    found = [x * _get(light, "intensity") for x in _get(light, "color")]
    if light.get("type") == "spot":
        places = "spot/outerConeAngle", "spot/innerConeAngle"
        found += [math.degrees(_get(light, place)) for place in places]
    return found


def _camera(root: Any, scene: Any) -> Iterator[Value]:
    """The only one of a file."""
    cameras = root.get("cameras", [])
    used = [node for node in root.get("nodes", []) if "camera" in node]
    if len(cameras) != 1 or len(used) != 1 or scene.camera.type not in cameras[0]:
        return
    view = cameras[0][scene.camera.type]
    yield "cameras[0], znear", view["znear"], scene.camera.near
    yield "cameras[0], zfar", view.get("zfar"), scene.camera.far
    if "yfov" in view:
        yield "cameras[0], yfov in degrees", math.degrees(view["yfov"]), scene.camera.fov
        yield "cameras[0], axis of yfov", "y", scene.camera.fov_axis
    elif scene.camera.width is not None:
        yield "cameras[0], width", 2.0 * abs(view["xmag"]), scene.camera.width
