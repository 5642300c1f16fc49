"""Boxes.  Mitsuba's cube has other uv, and turns inside out under a mirroring transform."""

from pathlib import Path
from typing import Any

import numpy as np

from comparisons.geometry import affine
from comparisons.geometry.exact.crossings import Crossings, Row, Slabs, in_local, ordered, where
from comparisons.geometry.exact.dyadic import Dyadic
from comparisons.mitsuba.hits import Plugin, same_uv
from comparisons.mitsuba.node import Node, Reading
from comparisons.mitsuba.parse import as_transform
from comparisons.shapes.reading_meshes import Surface as ReadSurface
from comparisons.shapes.reading_meshes import finished, is_normal, placed
from comparisons.shapes.shape import RaysectPart, ShapeType, TableType, always, per_face
from comparisons.shapes.site import Site, to_world, with_mesh_light
from comparisons.shapes.soup import Soup
from comparisons.shapes.surface import Surface
from reference_rt.core.arrays import FloatArray
from reference_rt.shapes import Box, Shape

CUBE_FACES = (1, 4, 3, 5, 0, 2)
"""Our face numbers of the faces of Mitsuba's cube, which are -y +y +x +z -x -z, two triangles each
(src/shapes/cube.cpp)."""


def surface_of(shape: Box) -> Surface:
    def gradient(q: FloatArray) -> FloatArray:
        axis = np.abs(q).argmax(axis=1)
        n = np.zeros_like(q)
        rows = np.arange(len(q))
        n[rows, axis] = np.sign(q[rows, axis])
        return n

    return Surface(
        lambda q: np.asarray(np.abs(q).max(axis=1) - 1.0),
        gradient,
        (0.0, 0.0, 0.0),
        (1.0, 1.0, 1.0),
        is_full=True,
    )


def _crossings(row: Row, o: Dyadic, d: Dyadic) -> Crossings:
    """Codes: the axis, + 3 on the positive side."""
    q, e = in_local(row, o, d)
    one = Dyadic.of(np.ones((1, 3)))
    s = Slabs(q, e, -one, one, np.ones(3))
    t = [where(~s.misses, s.t_in), where(~s.misses, s.t_out)]
    return ordered(t, [np.array(True), np.array(False)], [s.code_in, s.code_out], s.touching)


def _features(table: Any) -> FloatArray:
    return np.array([2.0 / np.linalg.norm(table.to_local.reshape(3, 3), axis=1).max()])


def _targets(table: Any) -> FloatArray:
    ticks = (-1.0, 0.0, 1.0)
    ends = np.array([[x, y, z] for x in ticks for y in ticks for z in ticks])
    q = ends[np.count_nonzero(ends, axis=1) >= 2]
    return np.asarray(table.center[0] + q @ table.edges[0].reshape(3, 3))


def _to_mitsuba(shape: Box, site: Site) -> list[Plugin]:
    m = affine.map_in(shape, site.place)
    if site.textured:
        return [_box_of_triangles(m, site)]
    edges = m[:, :3].copy()
    faces = np.array(CUBE_FACES)
    if np.linalg.det(edges) < 0.0:
        # Mirror it along an axis: the same box.  As a Whitted light its point is in the middle of
        # this axis, and does not move (see comparisons.mitsuba.plugins.whitted).
        turned = _middle_axis(edges)
        edges[:, turned] *= -1.0
        faces = np.where(faces % 3 == turned, (faces + 3) % 6, faces)
    plugin = {"type": "cube", "to_world": to_world(edges, m[:, 3]), **site.parts}
    return [Plugin(plugin, faces=np.repeat(faces, 2))]


def _box_of_triangles(m: affine.Affine, site: Site) -> Plugin:
    """A box with our uv."""
    soup = box_of_triangles(m)
    mesh = soup.mesh(with_mesh_light(site).parts)
    return Plugin(mesh, faces=np.repeat(np.arange(6), 2), uv=same_uv)


def box_of_triangles(m: affine.Affine) -> Soup:
    """The box under a map, with our uv: on each face the two other coordinates in the order x, y,
    z, from 0 to 1."""
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    positions, faces = np.empty((6, 4, 3)), []
    for face in range(6):
        axis, sign = face % 3, 1.0 if face >= 3 else -1.0
        a, b = (k for k in range(3) if k != axis)
        positions[face][:, [a, b]] = 2.0 * square - 1.0
        positions[face][:, axis] = sign
        triangles = np.array([[0, 1, 2], [0, 2, 3]]) + 4 * face
        # a, b and the outward normal are right-handed for +x, -y, +z; a mirroring map reverses all.
        outward = sign * (-1.0 if axis == 1 else 1.0) * np.linalg.det(m[:, :3])
        faces.append(triangles if outward > 0.0 else triangles[:, ::-1])
    uvs = np.tile(square, (6, 1))
    return Soup(
        affine.apply_points(m, positions.reshape(-1, 3)), uvs=uvs, faces=np.concatenate(faces)
    )


def _middle_axis(edges: FloatArray) -> int:
    areas = np.linalg.norm(np.cross(edges.T[[1, 2, 0]], edges.T[[2, 0, 1]]), axis=1)
    return 1 if areas[2] >= areas[0] + areas[1] else 2


SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def _to_cycles(shape: Box, folder: Path) -> Soup:
    front = np.column_stack([SQUARE, np.ones(4)])
    sides = []
    for axis in range(3):
        for sign in (1.0, -1.0):
            side = np.roll(front * [1.0, sign, sign], axis, axis=1)  # turned, not mirrored
            sides.append(side)
    halves = np.array([[0, 1, 2], [0, 2, 3]])
    return Soup(np.concatenate(sides), faces=np.concatenate([halves + 4 * k for k in range(6)]))


def _read(reading: Reading, node: Node, material: str | None) -> Shape:
    node.ignore("face_normals")  # it has vertex normals all the same
    flip = node.flag("flip_normals")
    m, of_normals = node.maps()
    if is_normal(m, of_normals) and not (flip or reading.uses_uv(material)):
        steps: Any = as_transform(node.written(), m)
        return Box(transform=steps, material=material)
    surface = ReadSurface(_CUBE, _CUBE_FACES, _CUBE_NORMALS, _CUBE_UV)
    return finished(placed(surface, m, of_normals, smooth=False), flip, True, material)


_CUBE = np.array(
    [
        *([1, -1, -1], [1, -1, 1], [-1, -1, 1], [-1, -1, -1]),
        *([1, 1, -1], [-1, 1, -1], [-1, 1, 1], [1, 1, 1]),
        *([1, -1, -1], [1, 1, -1], [1, 1, 1], [1, -1, 1]),
        *([1, -1, 1], [1, 1, 1], [-1, 1, 1], [-1, -1, 1]),
        *([-1, -1, 1], [-1, 1, 1], [-1, 1, -1], [-1, -1, -1]),
        *([1, 1, -1], [1, -1, -1], [-1, -1, -1], [-1, 1, -1]),
    ],
    np.float64,
)
_CUBE_NORMALS = np.repeat(
    [[0.0, -1.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0],
     [0.0, 0.0, -1.0]], 4, axis=0,
)  # fmt: skip
_CUBE_UV = np.tile([[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]], (6, 1))
_CUBE_FACES = np.array([[k, k + 1, k + 2] if odd == 0 else [k + 3, k, k + 2]
                        for k in range(0, 24, 4) for odd in (0, 1)])  # fmt: skip
"""Mitsuba's cube (src/shapes/cube.cpp), whose uv are those of no box of ours."""


BOX = ShapeType(
    of=Box,
    table=TableType(
        field="boxes",
        crossings=_crossings,
        features=lambda table: per_face(_features(table)),
        targets=_targets,
    ),
    surface=surface_of,
    to_mitsuba=_to_mitsuba,
    triangles=lambda shape, m: ([box_of_triangles(np.eye(3, 4))], 0.0),
    encloses=always,
    from_mitsuba={"cube": _read},
    own_plugin=lambda shape, linear, textured: None if textured else ("cube", {}),
    to_cycles=_to_cycles,
    to_raysect=lambda shape: [RaysectPart("box", (1.0, 1.0, 1.0))],
    is_sampled=True,
    to_povray=lambda shape, folder: "box { <-1,-1,-1>, <1,1,1>",
)
