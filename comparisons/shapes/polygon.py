"""Polygons with holes: triangles by independent code, Clipper2 in manifold3d."""

from pathlib import Path
from typing import Any

import manifold3d
import numpy as np

from comparisons.geometry import affine
from comparisons.geometry.exact.crossings import Crossings, Row, plane_crossing, single
from comparisons.geometry.exact.dyadic import Dyadic
from comparisons.mitsuba.hits import Plugin, same_uv
from comparisons.renderers import NoCounterpartError
from comparisons.renderers.vocabulary import pov_vector
from comparisons.shapes.flat import on_plane
from comparisons.shapes.shape import PovShape, ShapeType, TableType, never, per_face, pov_points
from comparisons.shapes.site import Site, with_mesh_light
from comparisons.shapes.soup import Soup, heights_of
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.shapes import Polygon


def _crossings(row: Row, o: Dyadic, d: Dyadic) -> Crossings:
    """One polygon: inside where its winding number has a bit of `mask` (the fill rule)."""
    m = plane_crossing(row, o, d)
    winding = np.zeros(len(m.meets), np.int64)
    edge = np.zeros(len(m.meets), bool)
    first, size = int(row["first"][0]), int(row["size"][0])
    for ends in np.asarray(row["outline"])[first : first + size]:
        a_x, a_y, b_x, b_y = (Dyadic.of(value) * m.den for value in ends)
        a_x, a_y, b_x, b_y = a_x - m.x, a_y - m.y, b_x - m.x, b_y - m.y
        side = (a_x * b_y - a_y * b_x).sign()
        up, down = (a_y.sign() <= 0) & (b_y.sign() > 0), (b_y.sign() <= 0) & (a_y.sign() > 0)
        winding += np.where(up & (side > 0), 1, 0) - np.where(down & (side < 0), 1, 0)
        between = (a_x * b_x + a_y * b_y).sign() <= 0
        edge |= (side == 0) & between
    return single(m, (winding & int(row["mask"][0])) != 0, edge)


def _to_mitsuba(shape: Polygon, site: Site) -> list[Plugin]:
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
    # Of equal components, but for rounding, the first.
    axis = int(np.flatnonzero(np.abs(n) > (1.0 - 1e-9) * np.abs(n).max())[0])
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


def _lengths(table: Any) -> FloatArray:
    sides = (table.upper - table.lower)[0]
    return np.array([min(sides / np.linalg.norm([table.x_of[0], table.y_of[0]], axis=1))])


def _targets(table: Any) -> FloatArray:
    a, b = table.outline[:, :2], table.outline[:, 2:]
    return np.concatenate([on_plane(table, a), on_plane(table, 0.5 * (a + b))])


def _to_povray(shape: Polygon, folder: Path) -> PovShape:
    """Convex: of others POV-Ray's front may be another one."""
    if len(shape.rings) > 1:
        raise NoCounterpartError("a polygon of several rings: POV-Ray's front may be another one")
    ring = np.array(shape.rings[0])
    sides = np.roll(ring, -1, axis=0) - ring
    turns = np.cross(sides, np.roll(sides, -1, axis=0))
    if not (np.sum(turns * turns.sum(axis=0), axis=1) >= 0.0).all() or _windings(sides) != 1:
        raise NoCounterpartError("a polygon that is not convex: POV-Ray's front may be another one")
    points, place = pov_points(np.array([*shape.rings[0], shape.rings[0][0]]))
    return PovShape(f"polygon {{ {len(points)}, {', '.join(map(pov_vector, points))}", place)


def _windings(sides: FloatArray) -> int:
    """How often a ring whose turns are all to one side goes round."""
    following = np.roll(sides, -1, axis=0)
    turned = np.linalg.norm(np.cross(sides, following), axis=1)
    return round(float(np.arctan2(turned, np.sum(sides * following, axis=1)).sum()) / (2.0 * np.pi))


POLYGON = ShapeType(
    of=Polygon,
    table=TableType(
        field="polygons",
        crossings=_crossings,
        features=lambda table: per_face(_lengths(table)),
        targets=_targets,
    ),
    surface=None,
    to_mitsuba=_to_mitsuba,
    triangles=lambda shape, m: ([polygon_soup(shape)], 0.0),
    encloses=never,
    to_povray=_to_povray,
)
