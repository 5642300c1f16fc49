"""A scene as data for other renderers: everything resolved, shapes as triangles.

`docs/scenes.md` describes the format.  Nothing has a default: each number that determines the
picture is in the file, or in the files beside it."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from comparisons.cameras import type_of as type_of_camera
from comparisons.geometry import affine
from comparisons.geometry.affine import Affine
from comparisons.geometry.flatten import Leaf, Tree, copies_of
from comparisons.mitsuba.files import Files, check_name, ply, write_files
from comparisons.shapes import type_of
from comparisons.shapes.soup import Soup
from reference_rt.cameras import Orthographic
from reference_rt.cameras.view_rectangle import CentralCamera
from reference_rt.core import transform
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.diagnosis import RESOLVED
from reference_rt.lights import EnvironmentMap
from reference_rt.rendering.scene import Scene
from reference_rt.shapes import Mesh, Plane, Shape, Triangle
from reference_rt.shapes.meshes.files.data import MeshData
from reference_rt.shapes.meshes.topology import unit
from reference_rt.shapes.meshes.triangle_table import geometric_normals
from reference_rt.shapes.shape import TabulationContext
from reference_rt.util.errors import ReferenceRtError

# ---- shapes as triangles: exact for flat shapes, the error of curved ones measured ---------------


class Tessellated(NamedTuple):
    """mesh: under the shape's own transform, its front counter-clockwise;  distance: the largest
    one from the surface, 0 for flat shapes but for a disk's rim."""

    mesh: MeshData
    distance: float


def tessellated(shape: Shape, folder: Path) -> Tessellated:
    """The triangles of a primitive.  Raises ValueError; TypeError for planes."""
    if isinstance(shape, Triangle | Mesh):
        table = shape.tabulate(TabulationContext(folder=folder))
        return Tessellated(
            MeshData(
                table.vertices.reshape(-1, 3),
                np.arange(3 * len(table.vertices)).reshape(-1, 3),
                None if table.normals is None else table.normals.reshape(-1, 3),
                None if table.uvs is None else table.uvs.reshape(-1, 2),
                None if table.colours is None else table.colours.reshape(-1, 3),
                more_uv=None
                if table.more_uvs is None
                else table.more_uvs.reshape(3 * len(table.vertices), -1),
            ),
            0.0,
        )
    triangles = type_of(shape).triangles
    if triangles is None:
        raise TypeError(f"no triangles for {type(shape).__name__}")
    m = transform.affine(shape.transform)
    soups, distance = triangles(shape, m)
    mirrored = transform.flips_orientation(m)
    return Tessellated(_joined([soup.moved(m, mirrored) for soup in soups]), distance)


def is_closed(mesh: MeshData) -> bool:
    """Whether each edge of a triangle is, the other way round, that of another; by position."""
    _, number = np.unique(mesh.vertices, axis=0, return_inverse=True)
    corners = number.ravel()[mesh.faces]
    a, b = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    n = int(corners.max()) + 1
    return np.array_equal(np.sort(a * n + b), np.sort(b * n + a))


def _joined(soups: Sequence[Soup]) -> MeshData:
    """One mesh.  Where only some parts have normals, the others get those of their triangles."""
    if not soups:
        raise ValueError("has no surface")
    any_normals = any(soup.normals is not None for soup in soups)
    vertices, faces, normals, uvs = [], [], [], []
    count = 0
    for soup in soups:
        vertices.append(soup.positions)
        faces.append(soup.faces + count)
        uvs.append(np.zeros((len(soup.positions), 2)) if soup.uvs is None else soup.uvs)
        if any_normals:
            flat = flat_normals(soup.positions, soup.faces)
            normals.append(unit(flat if soup.normals is None else soup.normals))
        count += len(soup.positions)
    return MeshData(
        np.concatenate(vertices),
        np.concatenate(faces),
        np.concatenate(normals) if any_normals else None,
        np.concatenate(uvs) if all(soup.uvs is not None for soup in soups) else None,
    )


def flat_normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """(n, 3) at the vertices of a part whose neighbouring triangles are in one plane."""
    found = np.zeros((len(vertices), 3))
    of_faces = geometric_normals(vertices[faces].reshape(-1, 9))
    for corner in range(3):
        found[faces[:, corner]] = of_faces
    return found


def placed(mesh: MeshData, outer: Affine) -> MeshData:
    """A mesh under a map; its front stays its front."""
    faces = mesh.faces[:, ::-1] if affine.mirrors(outer) else mesh.faces
    normals = None if mesh.normals is None else affine.apply_normals(outer, mesh.normals)
    vertices = affine.apply_points(outer, mesh.vertices)
    return replace(mesh, vertices=vertices, faces=faces, normals=normals)


# ---- the document --------------------------------------------------------------------------------


VERSION = 1


def write_resolved(scene: Scene, path: Path, float32: bool = False) -> int:
    """Write a scene as .json, whole or not at all; how many files it has besides.

    float32: meshes are rounded to it, since readers for browsers take no doubles.  Raises
    SceneError, UsageError, ImageError.
    """
    check_name(path, (".json",))

    def text(files: Files) -> str:
        return (
            json.dumps(_Document(scene, files, float32).whole(), indent=1, allow_nan=False) + "\n"
        )

    return write_files(scene, path, text)


def camera_of(scene: Scene) -> dict[str, Any]:
    """Position, basis and view rectangle: at distance 1, of an orthographic one through the
    eye."""
    camera, film = scene.camera, scene.film
    right, up, back = camera.basis.tolist()
    of = type_of_camera(camera)
    found: dict[str, Any] = {"type": camera.type, "eye": list(camera.eye)}
    if of.is_upside_down:  # what it sees as a rectangle in front of it
        found["type"] = "perspective"
        right, up = [-x for x in right], [-x for x in up]
        edges = of.edges(camera, film)
    else:
        assert isinstance(camera, CentralCamera | Orthographic)
        edges = camera.rectangle(film.width, film.height)
    found |= {"right": right, "up": up, "back": back, "view": list(edges)}
    if lens := of.lens(camera):
        found |= {"aperture_radius": lens.radius, "focus_distance": lens.focus}
        found["type"] = "thin_lens"
        if lens.exposure is not None:
            found["exposure"] = lens.exposure
    return found


class _Document:
    def __init__(self, scene: Scene, files: Files, float32: bool) -> None:
        self.scene, self.files, self.float32 = scene, files, float32
        self.meshes: list[dict[str, Any]] = []
        self.known: dict[int, int] = {}

    def whole(self) -> dict[str, Any]:
        scene = self.scene
        shapes = self.shapes()
        return {
            "format": RESOLVED,
            "version": VERSION,
            "description": scene.description,
            "camera": self.camera(),
            "film": scene.film.model_dump(mode="json"),
            "sampler": scene.resolved_sampler.model_dump(mode="json"),
            "integrator": scene.integrator.model_dump(mode="json"),
            "textures": {name: self.texture(name) for name in scene.textures},
            "materials": {k: m.model_dump(mode="json") for k, m in scene.materials.items()},
            "media": {k: m.model_dump(mode="json") for k, m in scene.media.items()},
            "meshes": self.meshes,
            "shapes": shapes,
            "lights": [self.light(light, k) for k, light in enumerate(scene.lights)],
        }

    def texture(self, name: str) -> dict[str, Any]:
        texture = self.scene.textures[name]
        found = texture.model_dump(mode="json")
        found["uv"] = texture.uv.coefficients().reshape(2, 3).tolist()
        if "file" in found:
            found["file"] = self.files.copy(found["file"], "textures", name, "file")
        return found

    def light(self, light: Any, number: int) -> dict[str, Any]:
        found: dict[str, Any] = light.model_dump(mode="json")
        if found.get("file") is not None:
            found["file"] = self.files.copy(light.file, "lights", number, "file")
        if isinstance(light, EnvironmentMap):
            found["transform"] = transform.affine(light.transform).tolist()
        return found

    def camera(self) -> dict[str, Any]:
        medium = self.scene.camera.medium
        return camera_of(self.scene) | ({} if medium is None else {"medium": medium})

    def shapes(self) -> list[dict[str, Any]]:
        """Every copy of every shape."""
        found = []
        for copy in copies_of(self.scene):
            for member in copy.members:
                place = {"shape": copy.shape, "instance": copy.instance}
                try:
                    if member.tree is None:
                        (leaf,) = member.leaves
                        value = self.leaf(leaf, copy.outer)
                    else:
                        value = self.solid(member.tree, member.leaves, copy.outer)
                except ReferenceRtError:
                    raise
                except ValueError as error:
                    raise self.scene.error(str(error), "shapes", copy.shape) from None
                found.append(place | value)
        return found

    def solid(
        self, tree: Tree | int, leaves: tuple[Leaf, ...], outer: transform.Affine
    ) -> dict[str, Any]:
        """A CSG tree of closed meshes and half-spaces."""
        if isinstance(tree, int):
            return self.leaf(leaves[tree], outer)
        return {
            "operation": tree.operation,
            "of": [self.solid(part, leaves, outer) for part in tree.of],
        }

    def leaf(self, leaf: Leaf, outer: transform.Affine) -> dict[str, Any]:
        """A mesh, or a plane, under a map."""
        m = transform.compose(leaf.outer, outer)
        if isinstance(leaf.shape, Plane):
            m = transform.compose(transform.affine(leaf.shape.transform), m)
            found = {"plane": m.tolist(), "material": leaf.material}
        else:
            place = m.tolist()
            found = {"mesh": self.mesh(leaf), "transform": place, "material": leaf.material}
        sides = {"interior": leaf.interior, "exterior": leaf.exterior}
        return found | {side: name for side, name in sides.items() if name is not None}

    def mesh(self, leaf: Leaf) -> int:
        """The number of a shape's mesh, which is made once."""
        shape = leaf.shape
        if id(shape) not in self.known:
            found = tessellated(shape, self.scene.folder)
            kind = type(shape).__name__.lower()
            content = ply(found.mesh, float32=self.float32)
            file = self.files.write(f"{kind}.ply", lambda path: path.write_bytes(content))
            self.known[id(shape)] = len(self.meshes)
            self.meshes.append(
                {
                    "file": file,
                    "of": kind,
                    "triangles": len(found.mesh.faces),
                    "distance": found.distance,
                    "closed": is_closed(found.mesh),
                }
            )
        return self.known[id(shape)]
