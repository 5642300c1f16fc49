"""Infinite planes, for which large finite meshes stand in."""

import numpy as np

from comparisons.geometry import affine
from comparisons.geometry.exact.crossings import Crossings, Row, plane_crossing, single
from comparisons.geometry.exact.dyadic import Dyadic
from comparisons.mitsuba.hits import Extent, Plugin, same_uv
from comparisons.shapes.flat import flat, unit_lengths
from comparisons.shapes.shape import PovShape, RaysectPart, ShapeType, TableType, always, per_face
from comparisons.shapes.site import Site, with_mesh_light
from comparisons.shapes.soup import Soup, heights_of
from comparisons.shapes.surface import Surface
from reference_rt.core.arrays import IntArray
from reference_rt.shapes import Plane

RINGS = (-14, 21)
"""Exponents of two: radii of the first and the last ring of an infinite plane, in units of its
distance from the origin, at least 1.  Each radius is twice the one before: float32 rounds corners
relative to their distance, so that the error at a hit is relative to the hit's distance too."""

SIDES = 16
"""Corners of a ring."""


def surface_of(shape: Plane) -> Surface:
    return flat(1.0)


def _crossings(row: Row, o: Dyadic, d: Dyadic) -> Crossings:
    """An infinite plane; as a solid, the half-space below it."""
    m = plane_crossing(row, o, d)
    everywhere = np.ones(len(m.meets), bool)
    return single(m, everywhere, ~everywhere)


def _to_mitsuba(shape: Plane, site: Site) -> list[Plugin]:
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


PLANE = ShapeType(
    of=Plane,
    table=TableType(
        field="planes",
        crossings=_crossings,
        features=lambda table: per_face(np.array([min(unit_lengths(table))])),
        bends=lambda table: per_face(np.array([np.inf])),
    ),
    surface=surface_of,
    to_mitsuba=_to_mitsuba,
    triangles=None,
    encloses=always,
    to_raysect=lambda shape: [RaysectPart("half_space", ())],
    to_povray=lambda shape, folder: PovShape("plane { z, 0"),
)
