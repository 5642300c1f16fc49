"""Rectangles.

Under a mirroring transform Mitsuba's turn inside out (its geometric normal follows the winding, its
shading normal the transform); ours keep their front.  So these get no mirroring transform.
"""

import numpy as np

from comparisons.geometry import affine
from comparisons.geometry.exact.crossings import Crossings, Row, plane_crossing, single
from comparisons.geometry.exact.dyadic import Dyadic
from comparisons.mitsuba.hits import Plugin, same_uv
from comparisons.mitsuba.node import Node, Reading
from comparisons.shapes.flat import as_written, flat, flat_transform, on_plane, unit_lengths
from comparisons.shapes.shape import ShapeType, TableType, never, per_face
from comparisons.shapes.site import Site, to_world, with_mesh_light
from comparisons.shapes.soup import Soup
from comparisons.shapes.surface import Surface
from reference_rt.shapes import Rectangle, Shape


def surface_of(shape: Rectangle) -> Surface:
    return flat(1.0, lambda q: np.asarray(np.abs(q[:, :2]).max(axis=1) - 1.0))


def _crossings(row: Row, o: Dyadic, d: Dyadic) -> Crossings:
    m = plane_crossing(row, o, d)
    sides = [(m.den - m.x), (m.den + m.x), (m.den - m.y), (m.den + m.y)]
    least = np.min([side.sign() for side in sides], axis=0)
    return single(m, least >= 0, least == 0)


def _to_mitsuba(shape: Rectangle, site: Site) -> list[Plugin]:
    m = affine.map_in(shape, site.place)
    mirrored = bool(np.linalg.det(m[:, :3]) < 0.0)
    if mirrored and "emitter" in site.parts and site.parts["emitter"]["radiance"]["type"] != "rgb":
        # Mitsuba samples the texture's light on the back of a rectangle with `flip_normals`.
        mesh = _soup().moved(m, mirrored).mesh(with_mesh_light(site).parts)
        return [Plugin(mesh, faces=np.zeros(2, np.int64), uv=same_uv)]
    # The third column has no effect but on orientation.
    columns = np.column_stack([m[:, 0], m[:, 1], -m[:, 2] if mirrored else m[:, 2]])
    plugin = {
        "type": "rectangle",
        "to_world": to_world(columns, m[:, 3]),
        "flip_normals": mirrored,
        **site.parts,
    }
    return [Plugin(plugin, faces=np.zeros(2, np.int64), uv=same_uv)]  # two triangles


def _soup() -> Soup:
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    corners = np.column_stack([2.0 * square - 1.0, np.zeros(4)])
    return Soup(corners, uvs=square, faces=np.array([[0, 1, 2], [0, 2, 3]]))


def _read(reading: Reading, node: Node, material: str | None) -> Shape:
    node.ignore("face_normals")
    return Rectangle(transform=flat_transform(node), material=material)


TICKS = (-1.0, 0.0, 1.0)

RECTANGLE = ShapeType(
    of=Rectangle,
    table=TableType(
        field="rectangles",
        crossings=_crossings,
        features=lambda table: per_face(np.array([2.0 * min(unit_lengths(table))])),
        targets=lambda table: on_plane(
            table, np.array([[x, y] for x in TICKS for y in TICKS if x or y])
        ),
    ),
    surface=surface_of,
    to_mitsuba=_to_mitsuba,
    triangles=lambda shape, m: ([_soup()], 0.0),
    encloses=never,
    from_mitsuba={"rectangle": _read},
    own_plugin=as_written("rectangle"),
    to_cycles=lambda shape, folder: _soup(),
    is_sampled=True,
    to_povray=lambda shape, folder: "polygon { 5, <-1,-1,0>,<1,-1,0>,<1,1,0>,<-1,1,0>,<-1,-1,0>",
    flat_uv=np.array([[2.0, 0.0, 0.0, -1.0], [0.0, 2.0, 0.0, -1.0], [0.0, 0.0, 1.0, 0.0]]),
)
