"""`translate_shape`, the translation of a shape by its type; `Site`, the placement of a leaf;
shapes that are exact as triangles: meshes and polygons; infinite planes as large finite meshes.

A mesh has the triangles of its file, as a second reader reads it, in the order of the file, so that
Mitsuba's prim_index tells our face number.  Triangles without area are left out.
"""

from functools import singledispatch
from pathlib import Path
from typing import Any, NamedTuple

import manifold3d
import numpy as np

from comparisons.geometry import affine
from comparisons.geometry.sizes import heights_of
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.context import UntranslatableError
from comparisons.mitsuba.hits import Extent, Plugin, ShapeGroup, same_uv
from comparisons.mitsuba.second import described
from comparisons.textures.vertex_colours import VERTEX_COLOUR, VERTEX_LUMINANCE
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.vec3 import Vec3, luminance
from reference_rt.shapes import Mesh, Plane, Polygon, Triangle
from reference_rt.shapes.shape import TabulationContext


class Site(NamedTuple):
    """The placement and the material of a leaf.

    place: the maps of its solid and its instance, applied after its own transform;  parts: the BSDF
    and, if it is emissive, the emitter;  coloured: the same for a mesh with vertex colours;
    textured: whether the material depends on uv or tangents;  oriented: on tangents;  material: its
    name;  copies: the number of copies of the leaf;  shared: data shared by the leaves of one
    scene, by key (a group, the triangles of a file);  reach: about the largest coordinate of the
    scene;  native: whether Mitsuba's own materials are used.
    """

    place: TabulationContext
    parts: dict[str, Any]
    coloured: dict[str, Any]
    textured: bool
    oriented: bool
    material: str | None
    copies: int
    shared: dict[Any, Any]
    reach: float
    native: bool = False

    @property
    def mirrored(self) -> bool:
        """Whether its solids and its instance mirror space: triangles then keep their front, but
        reverse their corners."""
        return bool(np.linalg.det(self.place.outer[:, :3]) < 0.0)


def to_world(linear: FloatArray, offset: FloatArray) -> Any:
    """p -> linear p + offset, in float64; Mitsuba rounds it when it makes the shape."""
    matrix = np.eye(4)
    matrix[:3] = np.column_stack([linear, offset])
    return mitsuba().ScalarTransform4d(matrix)


def with_mesh_light(site: Site, normals: bool = False, stands_in: bool = False) -> Site:
    """The site with our plugin `comparisons.mitsuba.plugins.mesh_area` for a mesh that emits, where
    Mitsuba's own emitter is not exact: with a texture, or with vertex normals.  stands_in: whether
    these are a curved surface's."""
    if "emitter" not in site.parts:
        return site
    more = {"type": "mesh_area", "by_normals": stands_in}

    def exact(parts: dict[str, Any]) -> dict[str, Any]:
        emitter = parts["emitter"]
        plain = emitter["radiance"]["type"] == "rgb" and not normals
        return parts if plain else {**parts, "emitter": {**emitter, **more}}

    return site._replace(parts=exact(site.parts), coloured=exact(site.coloured))


def instance_of(name: str, member: Any, m: affine.Affine, site: Site) -> Plugin:
    """A Mitsuba shape (see `ShapeGroup.member`) under any affine map: an instance of a group of its
    own, one for each `name` and material."""
    if "emitter" in site.parts:
        raise UntranslatableError("emissive material of an instance", "material")
    key = (name, site.material)
    if key not in site.shared:
        if isinstance(member, dict):
            member = {**member, **site.parts}
        site.shared[key] = ShapeGroup(f"group_{len(site.shared)}", member)
    group: ShapeGroup = site.shared[key]
    reference = {"type": "ref", "id": group.name}
    value = {"type": "instance", "to_world": to_world(m[:, :3], m[:, 3]), "group": reference}
    return Plugin(value, group=group)


@singledispatch
def translate_shape(shape: Any, site: Site) -> list[Plugin]:
    """The Mitsuba shapes that represent one of ours, in order.

    Raises UntranslatableError, and ValueError for a file that cannot be used.
    """
    raise UntranslatableError(shape, "shape")


# ---- triangles -----------------------------------------------------------------------------------

MOST_TRIANGLES = 4_000_000
"""Most triangles of all copies of a mesh together, 0.3 kB each.  With more Mitsuba gets instances,
which it traces less exactly: in groups it ignores the flag for watertight intersections (of 100,000
rays at edges 7,226 passed between triangles; without a group, 15)."""

MOST_INSTANCES = 32
"""Most instances in a scene of Mitsuba's fast variants: see `counterpart.InstancedGroup`."""


class Soup:
    """A mesh: positions (v, 3) of its vertices, and of each vertex, or None, unit normals (v, 3),
    uv (v, 2), colours (v, 3).

    faces (n, 3): indices of vertices, None if every three vertices are a triangle;  numbers (n,):
    our face numbers, None if they count from 0.
    """

    def __init__(
        self,
        positions: FloatArray,
        normals: FloatArray | None = None,
        uvs: FloatArray | None = None,
        colours: FloatArray | None = None,
        faces: IntArray | None = None,
        numbers: IntArray | None = None,
    ) -> None:
        self.numbers = numbers
        self.positions, self.normals, self.uvs, self.colours = positions, normals, uvs, colours
        self.faces = np.arange(len(positions)).reshape(-1, 3) if faces is None else faces

    def moved(self, m: affine.Affine, mirrored: bool) -> "Soup":
        """The mesh under an affine map;  mirrored: reverse the corners, and so the front.

        Normals are not made unit again: between vertices they are interpolated, and an instance
        interpolates before it maps them.
        """
        normals = None
        if self.normals is not None:
            normals = self.normals @ affine.invert(m)[:, :3]
            normals /= np.abs(normals).max()
        positions = affine.apply_points(m, self.positions)
        if not mirrored:
            return Soup(positions, normals, self.uvs, self.colours, self.faces)
        uvs = self.uvs
        if uvs is None and len(positions) == 3 * len(self.faces):
            # Mitsuba's default uv are the barycentrics in its order of the corners.
            uvs = np.tile([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], (len(self.faces), 1))
        return Soup(positions, normals, uvs, self.colours, self.faces[:, [0, 2, 1]])

    def at_corners(self) -> "Soup":
        """The same with a vertex for each corner."""
        at = self.faces.ravel()
        normals, uvs, colours = (
            None if column is None else column[at]
            for column in (self.normals, self.uvs, self.colours)
        )
        return Soup(self.positions[at], normals, uvs, colours, numbers=self.numbers)

    def is_like(self, other: "Soup") -> bool:
        """Whether another one has the same numbers, but for some roundings of float64."""
        for name in ("numbers", "positions", "normals", "uvs", "colours"):
            a, b = getattr(self, name), getattr(other, name)
            if a is None or b is None:
                if a is not b:
                    return False
            elif a.shape != b.shape or np.abs(a - b).max() > 2.0**-44 * np.abs(a).max():
                return False
        return True

    def all_of_face(self, number: int) -> IntArray:
        """`Plugin.faces` of a mesh whose triangles are all one face of ours."""
        return np.full(len(self.faces), number)

    def mesh(self, parts: dict[str, Any]) -> Any:
        """Mitsuba's mesh object;  parts: its BSDF and emitter."""
        mi = mitsuba()
        properties = mi.Properties()
        for name, part in parts.items():
            properties[name] = mi.load_dict(part)
        mesh = mi.Mesh(
            "mesh",
            len(self.positions),
            len(self.faces),
            has_vertex_normals=self.normals is not None,
            has_vertex_texcoords=self.uvs is not None,
            props=properties,
        )
        values = mi.traverse(mesh)
        values["vertex_positions"] = self.positions.astype(np.float32).ravel()
        values["faces"] = self.faces.astype(np.uint32).ravel()
        if self.normals is not None:
            values["vertex_normals"] = self.normals.astype(np.float32).ravel()
        if self.uvs is not None:
            values["vertex_texcoords"] = self.uvs.astype(np.float32).ravel()
        values.update()
        if self.colours is not None:
            grey = np.asarray(luminance(Vec3(*self.colours.T)))
            for name, column in ((VERTEX_COLOUR, self.colours), (VERTEX_LUMINANCE, grey)):
                mesh.add_attribute(
                    name, column.size // len(grey), column.astype(np.float32).ravel()
                )
        return mesh


@translate_shape.register(Triangle)
@translate_shape.register(Mesh)
def _(shape: Triangle | Mesh, site: Site) -> list[Plugin]:
    key = ("triangles", id(shape))
    if key not in site.shared:
        site.shared[key] = soup_of(shape, site.place.folder)
    soup: Soup = site.shared[key]
    site = with_mesh_light(site, normals=soup.normals is not None)
    key = ("mesh", id(shape))
    plugin = placed(soup, key, site.place.outer, site.mirrored, site)
    return [plugin._replace(uv=same_uv, faces=soup.numbers)]


def placed(soup: Soup, key: Any, m: affine.Affine, mirrored: bool, site: Site) -> Plugin:
    """Triangles under the map m: a mesh, or, with many copies that do not emit, an instance of the
    one mesh for `key`.  `mirrored`: see `Soup.moved`."""
    parts = site.parts if soup.colours is None else site.coloured
    few = site.copies * len(soup.faces) <= MOST_TRIANGLES
    if site.copies == 1 or few or "emitter" in site.parts:
        return Plugin(soup.moved(m, mirrored).mesh(parts))
    # Mitsuba transforms normals of instances as we do: the front stays the front.
    return instance_of(str(key), lambda: soup.mesh(parts), m, site)


def soup_of(shape: Triangle | Mesh, folder: Path) -> Soup:
    """The triangles of a description under its own transform, but for those without area."""
    mesh = described(shape, folder)
    edges = np.diff(mesh.points, axis=1)
    edges /= np.maximum(np.abs(edges).max(axis=(1, 2), keepdims=True), np.finfo(float).tiny)
    numbers = np.flatnonzero(np.cross(edges[:, 0], edges[:, 1]).any(axis=1))
    points, normals, uv, colours = (
        None if c is None else c[numbers].reshape(-1, c.shape[2])
        for c in (mesh.points, mesh.normals, mesh.uv, mesh.colours)
    )
    assert points is not None
    m = affine.of_steps(shape.transform)
    soup = Soup(points, None, uv, colours).moved(m, affine.mirrors(m))
    soup.numbers = numbers
    if normals is not None:  # under its own transform they are unit at the vertices
        soup.normals = affine.apply_normals(m, normals)
    return soup


# ---- infinite planes and polygons ----------------------------------------------------------------


RINGS = (-14, 21)
"""Exponents of two: radii of the first and the last ring of an infinite plane, in units of its
distance from the origin, at least 1.  Each radius is twice the one before: float32 rounds corners
relative to their distance, so that the error at a hit is relative to the hit's distance too."""

SIDES = 16
"""Corners of a ring."""


@translate_shape.register
def _(shape: Plane, site: Site) -> list[Plugin]:
    m = affine.map_in(shape, site.place)
    n = affine.apply_normals(m, np.array([[0.0, 0.0, 1.0]]))[0]
    middle = (n @ m[:, 3]) * n  # the point nearest to the origin
    unit = max(1.0, float(np.linalg.norm(middle)))
    across = np.linalg.svd(n[None])[2][1:]
    if np.linalg.det(np.vstack([across, n])) < 0.0:
        across = across[::-1]
    radii = unit * 2.0 ** np.arange(RINGS[0], RINGS[1] + 1)
    phi = 2.0 * np.pi * np.arange(SIDES) / SIDES
    spokes = np.cos(phi)[:, None] * across[0] + np.sin(phi)[:, None] * across[1]
    rings = (radii[:, None, None] * spokes).reshape(-1, 3)
    positions = middle + np.vstack([np.zeros(3), rings])
    inverse = affine.invert(m)
    uvs = affine.apply_points(inverse, positions)[:, :2]
    soup = Soup(positions, uvs=uvs, faces=_web(len(radii)))
    extent = Extent(middle, float(radii[-1] * np.cos(np.pi / SIDES)))
    heights = heights_of(soup.positions[soup.faces])
    mesh = soup.mesh(with_mesh_light(site).parts)
    return [Plugin(mesh, faces=soup.all_of_face(0), uv=same_uv, extent=extent, heights=heights)]


def _web(rings: int) -> IntArray:
    """The counter-clockwise triangles of a centre, vertex 0, and `rings` rings of SIDES vertices
    around it."""
    k = np.arange(SIDES)
    following = (k + 1) % SIDES
    faces = [np.column_stack([np.zeros_like(k), 1 + k, 1 + following])]
    for ring in range(rings - 1):
        a, b = 1 + SIDES * ring + k, 1 + SIDES * ring + following
        faces += [np.column_stack([a, a + SIDES, b + SIDES]), np.column_stack([a, b + SIDES, b])]
    return np.concatenate(faces)


@translate_shape.register
def _(shape: Polygon, site: Site) -> list[Plugin]:
    soup = polygon_soup(shape)
    m = affine.map_in(shape, site.place)
    placed = soup.moved(m, affine.mirrors(m))
    heights = heights_of(placed.positions[placed.faces])
    mesh = placed.mesh(with_mesh_light(site).parts)
    return [Plugin(mesh, faces=soup.all_of_face(0), uv=same_uv, heights=heights)]


def polygon_soup(shape: Polygon) -> Soup:
    """The polygon in its own coordinates: the fill rule is applied by independent code, Clipper2 in
    manifold3d."""
    points = np.array([p for ring in shape.rings for p in ring])
    middle = points.mean(axis=0)
    # The normal is the direction in which the points spread least.
    n = np.linalg.svd(points - middle)[2][2]
    axis = int(np.argmax(np.abs(n)))
    kept = [(axis + 1) % 3, (axis + 2) % 3]
    corner, size = points[:, kept].min(axis=0), np.ptp(points[:, kept], axis=0)
    rings = [(np.array(ring)[:, kept] - corner) / size for ring in shape.rings]
    filled, faces = triangulated(rings, shape.fill)
    if _is_clockwise(rings):
        faces = faces[:, ::-1]
    flat = corner + size * filled
    positions = np.empty((len(filled), 3))
    positions[:, kept] = flat
    positions[:, axis] = middle[axis] - (flat - middle[kept]) @ n[kept] / n[axis]
    return Soup(positions, uvs=filled, faces=faces)


DIGITS = 2.0**20
"""Scale of the coordinates: Clipper2 rounds to 1e-8, which is 1e-14 of numbers this large."""


def triangulated(rings: list[FloatArray], fill: str) -> tuple[FloatArray, IntArray]:
    """Vertices (n, 2) and counter-clockwise triangles (m, 3) of the area that rings (k, 2) enclose,
    with coordinates in [0, 1]; `fill` is "even_odd" or "nonzero"."""
    rule = {"even_odd": manifold3d.FillRule.EvenOdd, "nonzero": manifold3d.FillRule.NonZero}[fill]
    # The winding numbers change sign with mirrored coordinates, which the rules ignore.
    section = manifold3d.CrossSection([ring * DIGITS for ring in rings], rule)
    outlines = [np.asarray(ring, np.float64) for ring in section.to_polygons()]
    faces = np.asarray(manifold3d.triangulate(outlines), np.int64).reshape(-1, 3)
    return np.concatenate(outlines) / DIGITS, faces


def _is_clockwise(rings: list[FloatArray]) -> bool:
    """Whether rings enclose more area clockwise; if the areas cancel, whether the first turn is
    clockwise."""
    area = sum(_doubled_area(ring) for ring in rings)
    # The halves of a figure eight cancel, but for rounding.
    if abs(area) > 1e-12:
        return bool(area < 0.0)
    steps = np.diff(np.vstack([rings[0], rings[0][:2]]), axis=0)
    turns = steps[:-1, 0] * steps[1:, 1] - steps[:-1, 1] * steps[1:, 0]
    return bool(turns[turns != 0.0][0] < 0.0)


def _doubled_area(ring: FloatArray) -> float:
    following = np.roll(ring, -1, axis=0)
    return float(np.sum(ring[:, 0] * following[:, 1] - ring[:, 1] * following[:, 0]))
