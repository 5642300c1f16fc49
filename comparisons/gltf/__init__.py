"""A scene as glTF 2.0 (ISO/IEC 12113), .glb or .gltf: what that format can say of it.

Contract: shapes are triangles, instances of a group are nodes of one mesh, all numbers of vertices
are float32.  Matte surfaces and glTF's own scatter light as ours do; notes name what is only nearly
the same and what is left out, and what cannot be written raises SceneError with all reasons.
Radiant intensities and irradiances stand where glTF has candelas and lux: the factor is 1.
"""

import json
import struct
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from comparisons.geometry import affine
from comparisons.geometry.flatten import Copy, Leaf, copies_of
from comparisons.gltf.surfaces import Surfaces
from comparisons.lights import type_of
from comparisons.lights.light import across
from comparisons.mitsuba.files import (
    Files,
    UnwritableError,
    check_name,
    write_files,
)
from comparisons.renderers.vocabulary import MATTE
from comparisons.translator.resolved import (
    Tessellated,
    camera_of,
    flat_normals,
    is_closed,
    placed,
    tessellated,
)
from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.scene import Scene
from reference_rt.shapes import Plane
from reference_rt.shapes.meshes.files.data import MeshData
from reference_rt.shapes.meshes.topology import unit
from reference_rt.util.files import replacing

SUFFIXES = (".glb", ".gltf")


def write_gltf(scene: Scene, path: Path) -> tuple[int, list[str]]:
    """Write a scene as glTF, whole or not at all; how many files it has besides, and notes on what
    is not quite the same.

    Raises SceneError with all reasons why glTF cannot express it; UsageError, ImageError.
    """
    check_name(path, SUFFIXES)
    document = _Document(scene)
    found = document.whole()
    document.check()
    data = bytes(document.data)
    if path.suffix.lower() == ".glb":
        with replacing(path) as part:
            part.write_bytes(_glb(found, data))
        return 0, document.notes

    def text(files: Files) -> str:
        if data:
            name = files.write("scene.bin", lambda file: file.write_bytes(data))
            # The name as it is, too: by it the folder is known to be this scene's.
            found["buffers"][0] |= {"uri": quote(name), "name": name}
        return json.dumps(found, ensure_ascii=False, allow_nan=False) + "\n"

    return write_files(scene, path, text), document.notes


def _glb(document: dict[str, Any], data: bytes) -> bytes:
    """The header, the JSON and the binary chunk, each padded to four bytes."""
    text = json.dumps(document, ensure_ascii=False, allow_nan=False).encode()
    chunks = [(b"JSON", text + b" " * (-len(text) % 4))]
    if data:
        chunks.append((b"BIN\0", data + b"\0" * (-len(data) % 4)))
    body = b"".join(struct.pack("<I4s", len(x), kind) + x for kind, x in chunks)
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


# ---- the document --------------------------------------------------------------------------------


NEAR = 1e-3
"""Distance of the near plane over that of the farthest vertex: depths of 24 bits then tell points
apart that are 6e-5 of the scene apart."""


class _Document(Surfaces):
    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        self.made: dict[int, Tessellated] = {}
        self.meshes: dict[str | int, int | None] = {}
        self.bounds: dict[int, FloatArray] = {}
        self.off: dict[str, float] = {}
        self.moved, self.reach = 0.0, 0.0

    def whole(self) -> dict[str, Any]:
        for copy in copies_of(self.scene):
            self.copy(copy)
        for k, light in enumerate(self.scene.lights):
            with self.collected("lights", k):
                self.light(light, k)
        with self.collected("camera"):
            self.camera()
        with self.collected("media"):
            if self.scene.media:
                raise UnwritableError("media")
        for kind, distance in self.off.items():
            if distance > 0.0:
                self.note(f"a shape '{kind}' is written as triangles, up to {distance:.1g} off it")
        self.note("the size of the picture, its filter, samples and integrator are left out")
        if self.moved:
            self.note(f"numbers are float32: vertices move by up to {self.moved:.2g}")
        if self.used.intersection(MATTE):
            self.note(
                "matte surfaces are KHR_materials_specular with specularFactor 0: renderers that "
                "do not know this extension give them a highlight"
            )
        punctual = self.lists.pop("lights", [])
        found: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "reference-rt"},
            "scene": 0,
            "scenes": [{"nodes": [*range(len(self.lists["nodes"]))]}],
        }
        if self.used:
            found["extensionsUsed"] = sorted(self.used)
        if punctual:
            found["extensions"] = {"KHR_lights_punctual": {"lights": punctual}}
        if self.data:
            found["buffers"] = [{"byteLength": len(self.data)}]
        return found | {key: some for key, some in self.lists.items() if some}

    # ---- camera and lights -----------------------------------------------------------------------

    def camera(self) -> None:
        camera, film = self.scene.camera, self.scene.film
        seen = camera_of(self.scene)
        left, right, bottom, top = seen["view"]
        axes = np.array([seen["right"], seen["up"], seen["back"]]).T
        eye = np.array(seen["eye"])
        far = self.reach or 1.0
        near = camera.near or NEAR * far
        most: dict[str, float] = {"zfar": camera.far} if camera.far else {}
        if seen["type"] == "orthographic":
            eye = eye + axes @ [0.5 * (left + right), 0.5 * (bottom + top), 0.0]
            size = {"xmag": 0.5 * (right - left), "ymag": 0.5 * (top - bottom)}
            lens = size | {"znear": camera.near, "zfar": camera.near + 2.0 * far} | most
        else:
            if not (np.isclose(-left, right, 1e-9) and np.isclose(-bottom, top, 1e-9)):
                raise UnwritableError("a view off the axis")
            tall = {"yfov": 2.0 * float(np.arctan(top)), "aspectRatio": right / top}
            lens = tall | {"znear": near} | most
            if not camera.near:
                self.note(f"a camera of glTF has a near clipping plane: at {near:.2g}")
            if "aperture_radius" in seen:
                self.note("the camera's lens is left out: everything is sharp")
        kind = "orthographic" if seen["type"] == "orthographic" else "perspective"
        size = {"width": film.width, "height": film.height}
        number = self.add("cameras", {"type": kind, kind: lens, "extras": size})
        self.node(np.column_stack([axes, eye]), camera=number, name="camera")

    def light(self, light: Any, number: int) -> None:
        name, to_gltf = f"lights[{number}]", type_of(light).to_gltf
        if to_gltf is None:
            raise UnwritableError(f"a light '{light.type}'")
        found = to_gltf(light, name, self)
        if found is None:
            return
        axis, most = found.axis, max(found.power)
        colour = [x / most for x in found.power] if most else [0.0] * 3
        data = {"type": light.type, "name": name, **(found.data or {})}
        data |= {"color": colour, "intensity": most}
        self.used.add("KHR_lights_punctual")
        aside = np.cross(axis, across(axis))
        aside /= np.linalg.norm(aside)
        turned = np.column_stack([aside, np.cross(-axis, aside), -axis, found.place])
        which = {"light": self.add("lights", data)}
        self.node(turned, extensions={"KHR_lights_punctual": which}, name=name)

    def node(self, m: affine.Affine, **more: Any) -> None:
        if not np.array_equal(m, affine.IDENTITY):
            more["matrix"] = np.vstack([m, [0.0, 0.0, 0.0, 1.0]]).T.ravel().tolist()
        self.add("nodes", more)

    # ---- shapes ----------------------------------------------------------------------------------

    def copy(self, copy: Copy) -> None:
        """A shape, or an instance: a node whose matrix keeps angles between the axes, or triangles
        that are moved."""
        key: str | int = copy.group or copy.shape
        gram = copy.outer[:, :3].T @ copy.outer[:, :3]
        moved = np.abs(gram - np.diag(np.diag(gram))).max() > 1e-9 * np.abs(gram).max()
        if affine.mirrors(copy.outer):  # renderers compute bitangents in the world
            moved |= any(self.surface(x.material).follow_v for m in copy.members for x in m.leaves)
        if moved:
            number, m = self.mesh(copy, copy.outer), affine.IDENTITY
        else:
            if key not in self.meshes:
                self.meshes[key] = self.mesh(copy, affine.IDENTITY)
            number, m = self.meshes[key], copy.outer
        if number is None:
            return
        self.node(m, mesh=number, name=f"shapes[{copy.shape}]")
        away = affine.apply_points(m, self.bounds[number]) - self.scene.camera.eye
        self.reach = max(self.reach, float(np.linalg.norm(away, axis=1).max()))

    def mesh(self, copy: Copy, outer: affine.Affine) -> int | None:
        """The number of a mesh: a part for each shape of a group; None where one is unwritable."""
        parts = []
        path = ("groups", copy.group) if copy.group else ("shapes", copy.shape)
        for member in copy.members:
            with self.collected(*path):
                if member.tree is not None:
                    raise UnwritableError("a solid (CSG)")
                parts.append(self.part(member.leaves[0], outer, *path))
        if not parts or len(parts) < len(copy.members):
            return None
        number = self.add("meshes", {"primitives": [part for part, _ in parts]})
        corners = np.concatenate([limits for _, limits in parts])
        limits = np.stack([corners.min(axis=0), corners.max(axis=0)])
        self.bounds[number] = np.stack(np.meshgrid(*limits.T), axis=-1).reshape(-1, 3)
        return number

    def part(
        self, leaf: Leaf, outer: affine.Affine, *path: str | int
    ) -> tuple[dict[str, Any], FloatArray]:
        """A primitive of glTF's, and the corners of its box (2, 3)."""
        if isinstance(leaf.shape, Plane):
            raise UnwritableError("an infinite plane")
        kind = type(leaf.shape).__name__.lower()
        if id(leaf.shape) not in self.made:
            read = partial(tessellated, leaf.shape, self.scene.folder)
            self.made[id(leaf.shape)] = self.read(read, *path)
        mesh, distance = self.made[id(leaf.shape)]
        self.off[kind] = max(self.off.get(kind, 0.0), distance)
        surface = self.surface(leaf.material)
        if not surface.both_sides and not is_closed(mesh):
            self.note("open shapes are black from behind; renderers of glTF do not show that side")
        mesh = placed(mesh, affine.compose(leaf.outer, outer))
        if surface.tangents and mesh.normals is None:
            mesh = replace(mesh, normals=unit(flat_normals(mesh.vertices, mesh.faces)))
        attributes = {"POSITION": self.numbers(mesh.vertices, True)}
        if mesh.normals is not None:
            attributes["NORMAL"] = self.numbers(mesh.normals)
        for k, uv in enumerate(surface.maps):
            if mesh.uv is None:
                raise UnwritableError("a mesh without texture coordinates under a texture")
            pairs = mesh.uv
            if uv.uv_set:
                assert mesh.more_uv is not None  # checked where the scene is built
                pairs = mesh.more_uv[:, 2 * uv.uv_set - 2 : 2 * uv.uv_set]
            mapped = np.column_stack([pairs, np.ones(len(mesh.vertices))]) @ uv.matrix[:2].T
            attributes[f"TEXCOORD_{k}"] = self.numbers(mapped * [1.0, -1.0] + [0.0, 1.0])
        if surface.tangents:
            attributes["TANGENT"] = self.numbers(_tangents(mesh, surface.follow_v))
        if (of := surface.colours) is not None:
            plain = np.tile(of.without, (len(mesh.vertices), 1))
            shown = plain if mesh.colours is None else mesh.colours * of.scale
            attributes["COLOR_0"] = self.numbers(shown)
        faces = mesh.faces.astype("<u4")
        accessor = {"componentType": 5125, "count": faces.size, "type": "SCALAR"}
        accessor["bufferView"] = self.view(faces.tobytes(), target=34963)
        indices = self.add("accessors", accessor)
        found = {"attributes": attributes, "indices": indices, "material": surface.number}
        return found, np.stack([mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)])

    def numbers(self, values: FloatArray, positions: bool = False) -> int:
        """The number of an accessor of float32."""
        with np.errstate(over="ignore"):
            rounded = values.astype("<f4")
        if not np.isfinite(rounded).all():
            raise UnwritableError("numbers beyond float32's range")
        accessor: dict[str, Any] = {"componentType": 5126, "count": len(rounded)}
        accessor["type"] = f"VEC{rounded.shape[1]}"
        if positions:
            self.moved = max(self.moved, float(np.abs(rounded - values).max()))
            for key, limit in (("min", rounded.min(axis=0)), ("max", rounded.max(axis=0))):
                accessor[key] = [float(x) for x in limit]
        stride = 4 * rounded.shape[1]
        accessor["bufferView"] = self.view(rounded.tobytes(), target=34962, byteStride=stride)
        return self.add("accessors", accessor)


def _tangents(mesh: MeshData, follow_v: bool) -> FloatArray:
    """(n, 4): dp/du across the normals, and 1, as our frames are right-handed, or where they follow
    v the side of dp/dv."""
    assert mesh.uv is not None
    assert mesh.normals is not None
    p, uv = mesh.vertices[mesh.faces], mesh.uv[mesh.faces]
    (a, b), (s, t) = ((x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]) for x in (p, uv))
    area = s[:, :1] * t[:, 1:] - t[:, :1] * s[:, 1:]
    found, of_v = np.zeros_like(mesh.vertices), np.zeros_like(mesh.vertices)
    for corner in range(3):
        at = mesh.faces[:, corner]
        np.add.at(found, at, np.sign(area) * (a * t[:, 1:] - b * s[:, 1:]))
        np.add.at(of_v, at, np.sign(area) * (b * s[:, :1] - a * t[:, :1]))
    n = mesh.normals
    across = found - n * np.sum(n * found, axis=1, keepdims=True)
    lost = np.linalg.norm(across, axis=1) <= 1e-12 * np.linalg.norm(found, axis=1)
    across[lost] = np.cross(n, np.eye(3)[np.argmin(np.abs(n), axis=1)])[lost]
    side = np.sum(np.cross(n, across) * of_v, axis=1)
    return np.column_stack([unit(across), np.where(follow_v & (side < 0.0), -1.0, 1.0)])
