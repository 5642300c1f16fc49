"""Meshes and single triangles.

A mesh has the triangles of its file, as a second reader reads it, in the order of the file, so that
Mitsuba's prim_index tells our face number.  Triangles without area are left out.
"""

from pathlib import Path
from typing import Any

import numpy as np

from comparisons.geometry import affine
from comparisons.geometry.exact.crossings import Crossings, Row, column, ordered, where
from comparisons.geometry.exact.dyadic import Dyadic, cross, dot, quotient
from comparisons.mitsuba.hits import Plugin, same_uv
from comparisons.mitsuba.second import described
from comparisons.renderers import NoCounterpartError
from comparisons.renderers.vocabulary import pov_vector
from comparisons.shapes.reading_meshes import mesh as read
from comparisons.shapes.shape import Features, ShapeType, TableType, never
from comparisons.shapes.site import Site, placed, with_mesh_light
from comparisons.shapes.soup import Soup, heights_of
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.shapes import Mesh, Triangle


def _crossings(row: Row, o: Dyadic, d: Dyadic) -> Crossings:
    """Triangles; edges and corners count as inside, and as touching."""
    v = column(row, "vertices")
    corners = [v[..., 3 * k : 3 * k + 3] - o for k in range(3)]
    n = cross(corners[1] - corners[0], corners[2] - corners[0])
    num, den = dot(corners[0], n), dot(d, n)
    signs = np.array([dot(d, cross(corners[k], corners[(k + 1) % 3])).sign() for k in range(3)])
    meets = den.sign() != 0
    inside = (signs >= 0).all(axis=0) | (signs <= 0).all(axis=0)
    edge = inside & (signs == 0).any(axis=0)
    in_plane = ~meets & (num.sign() == 0)
    code = np.broadcast_to(row.get("face", 0), inside.shape)
    t = where(meets & inside, quotient(num, den))
    return ordered([t], [den.sign() < 0], [code], (meets & edge) | in_plane)


def _near(row: Row, o: FloatArray, d: FloatArray) -> IntArray:
    """Indices of the triangles that a line may pass through: conservative, in floats."""
    v = row["vertices"].reshape(-1, 3, 3) - o
    size = np.linalg.norm(v, axis=2) + np.abs(o).max()
    volumes, slack = np.empty((2, 3, len(v)))
    for k in range(3):
        a, b = v[:, k], v[:, (k + 1) % 3]
        volumes[k] = np.cross(a, b) @ d
        slack[k] = 1e-13 * np.linalg.norm(d) * size[:, k] * size[:, (k + 1) % 3]
    return np.flatnonzero((volumes >= -slack).all(axis=0) | (volumes <= slack).all(axis=0))


def _features(table: Any) -> Features:
    heights = heights_of(table.vertices.reshape(-1, 3, 3))

    def features(p: FloatArray, faces: IntArray) -> FloatArray:
        """Faces are numbered as in the file, and the table lacks those without area."""
        rows = np.searchsorted(table.face, faces)
        return np.asarray(heights[np.clip(rows, 0, len(heights) - 1)])

    return features


def _targets(table: Any) -> FloatArray:
    v = table.vertices.reshape(-1, 3, 3)
    middles = 0.5 * (v + np.roll(v, 1, axis=1))
    return np.concatenate([v.reshape(-1, 3), middles.reshape(-1, 3)])


def _to_mitsuba(shape: Triangle | Mesh, site: Site) -> list[Plugin]:
    key = ("triangles", id(shape))
    if key not in site.shared:
        site.shared[key] = soup_of(shape, site.place.folder)
    soup: Soup = site.shared[key]
    site = with_mesh_light(site, normals=soup.normals is not None)
    key = ("mesh", id(shape))
    plugin = placed(soup, key, site.place.outer, site.mirrored, site)
    return [plugin._replace(uv=same_uv, faces=soup.numbers)]


def soup_of(shape: Triangle | Mesh, folder: Path) -> Soup:
    """The triangles of a description under its own transform, but for those without area."""
    mesh = described(shape, folder)
    edges = np.diff(mesh.points, axis=1)
    edges /= np.maximum(np.abs(edges).max(axis=(1, 2), keepdims=True), np.finfo(float).tiny)
    numbers = np.flatnonzero(np.cross(edges[:, 0], edges[:, 1]).any(axis=1))
    points, normals, uv, colours, more = (
        None if c is None else c[numbers].reshape(-1, c.shape[2])
        for c in (mesh.points, mesh.normals, mesh.uv, mesh.colours, mesh.more_uv)
    )
    assert points is not None
    m = affine.of_steps(shape.transform)
    soup = Soup(points, None, uv, colours, more_uvs=more).moved(m, affine.mirrors(m))
    soup.numbers = numbers
    if normals is not None:  # under its own transform they are unit at the vertices
        soup.normals = affine.apply_normals(m, normals)
    return soup


def _to_cycles(shape: Triangle | Mesh, folder: Path) -> Soup:
    mesh = described(shape, folder)
    n = 3 * len(mesh.points)
    normals, uv = (None if c is None else c.reshape(n, -1) for c in (mesh.normals, mesh.uv))
    return Soup(mesh.points.reshape(-1, 3), normals, uv)


MOST_TRIANGLES = 200_000
"""Of a mesh for POV-Ray, which reads them as text, some 100,000 a second."""


def _to_povray(shape: Triangle | Mesh, folder: Path) -> str:
    """POV-Ray's front is the side from which corners go round clockwise."""
    corners = described(shape, folder).points.reshape(-1, 3)
    if len(corners) > 3 * MOST_TRIANGLES:
        raise NoCounterpartError(f"a mesh of more than {MOST_TRIANGLES:,} triangles")
    faces = (f"<{k},{k + 2},{k + 1}>" for k in range(0, len(corners), 3))
    return (
        f"mesh2 {{ vertex_vectors {{ {len(corners)}, {', '.join(map(pov_vector, corners))} }} "
        f"face_indices {{ {len(corners) // 3}, {', '.join(faces)} }} inside_vector <0.1,0.2,1>"
    )


TRIANGLES = TableType(
    field="triangles", crossings=_crossings, features=_features, targets=_targets, near=_near
)

MESH = ShapeType(
    of=Mesh,
    table=TRIANGLES,
    surface=None,
    to_mitsuba=_to_mitsuba,
    triangles=None,
    encloses=never,
    from_mitsuba={"obj": read, "ply": read, "serialized": read},
    to_cycles=_to_cycles,
    to_povray=_to_povray,
    is_sampled=True,
)

TRIANGLE = ShapeType(
    of=Triangle,
    table=TRIANGLES,
    surface=None,
    to_mitsuba=_to_mitsuba,
    triangles=None,
    encloses=never,
    to_cycles=_to_cycles,
    to_povray=_to_povray,
    is_sampled=True,
)
