"""Infinite planes, as large finite meshes; polygons, as triangles."""

import manifold3d
import numpy as np

from comparisons.geometry.sizes import heights_of
from comparisons.mitsuba.stand_ins import Extent, Plugin, same_uv
from comparisons.mitsuba.translate.shapes.choice import translate_shape
from comparisons.mitsuba.translate.shapes.meshes import Soup
from comparisons.mitsuba.translate.shapes.plugins import Site, with_mesh_light
from reference_rt.core import transform
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.shapes import Plane, Polygon

RINGS = (-14, 21)
"""Exponents of two: radii of the first and the last ring of an infinite plane, in units of its
distance from the origin, at least 1.  Each radius is twice the one before: float32 rounds corners
relative to their distance, so that the error at a hit is relative to the hit's distance too."""

SIDES = 16
"""Corners of a ring."""


@translate_shape.register
def _(shape: Plane, site: Site) -> list[Plugin]:
    m = shape.map_in(site.place)
    n = transform.apply_normals(m, np.array([[0.0, 0.0, 1.0]]))[0]
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
    inverse = transform.invert(m)
    uvs = transform.apply_points(inverse, positions)[:, :2]
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
    m = transform.compose(transform.affine(shape.transform), site.place.outer)
    placed = soup.moved(m, transform.flips_orientation(m))
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
