"""Fine meshes that stand in for curved surfaces that Mitsuba lacks, with the surface's normals, and
how far they are off: in distance, normals, texture coordinates and tangents."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import partial
from typing import Any

import numpy as np

from comparisons.geometry import affine
from comparisons.geometry.frame import round32
from comparisons.mitsuba.context import UntranslatableError
from comparisons.mitsuba.hits import Plugin, StandIn
from comparisons.mitsuba.plugins.exact_coordinates import Coordinates, derivatives_at
from comparisons.shapes.meshing import meshed
from comparisons.shapes.site import MOST_INSTANCES, MOST_TRIANGLES, Site, placed, with_mesh_light
from comparisons.shapes.soup import Soup, heights_of
from comparisons.shapes.surface import Limits, Patch, Surface
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.shapes.shape import Shape

# ---- errors --------------------------------------------------------------------------------------


MEASURED = 50_000
"""Most triangles that are measured, evenly strided: on a smooth surface neighbours have nearly the
same error.  Of coarser meshes (`coarser`) fewer in proportion to the cells along a side, so that as
much of the surface lies between two."""

ROUGHLY = 5_000
"""The same where two digits of the distance are enough."""

WEIGHTS = np.array([[1, 1, 1], [1, 1, 0], [0, 1, 1], [1, 0, 1]], np.float64)
WEIGHTS /= WEIGHTS.sum(axis=1, keepdims=True)
"""Barycentrics at which a triangle is compared with its surface: its centre and the middles of its
sides."""


_fineness = ContextVar("fineness", default=1.0)


def _some_faces(soup: Soup, most: int = MEASURED) -> IntArray:
    """Those of a mesh's triangles that are measured."""
    return soup.faces[:: max(1, int(len(soup.faces) / (most * _fineness.get())))]


def measured_error(
    soup: Soup, surface: Surface, m: affine.Affine, most: int = MEASURED
) -> tuple[float, float]:
    """The largest distance and the largest angle, in radians, between a mesh and its surface.

    The distance is f over its gradient in the scene, exact but for terms of second order.
    """
    inverse = affine.invert(m)[:, :3]
    faces = _some_faces(soup, most)
    assert soup.normals is not None
    corners, normals = soup.positions[faces], soup.normals[faces]
    sag = turn = 0.0
    for weights in WEIGHTS:
        q = weights @ corners
        n = weights @ normals @ inverse
        gradient = surface.gradient(q) @ inverse
        steepness = np.linalg.norm(gradient, axis=1)
        known = steepness > 0.0
        distance = np.abs(surface.value(q))[known] / steepness[known]
        cross = np.linalg.norm(np.cross(n, gradient), axis=1)[known]
        angle = np.arctan2(cross, np.sum(n * gradient, axis=1)[known])
        sag, turn = max(sag, distance.max(initial=0.0)), max(turn, angle.max(initial=0.0))
    return float(sag), float(turn)


def measured_slip(soup: Soup, patch: Patch, box: Limits | None) -> float:
    """The largest distance, in the shape's own coordinates, between a point of the mesh and the one
    of the surface that has its interpolated uv: of a patch with these uv, or of a surface around
    the z axis of a box."""
    assert soup.uvs is not None
    faces = _some_faces(soup)
    largest = 0.0
    for weights in WEIGHTS:
        q = weights @ soup.positions[faces]
        u, v = (weights @ soup.uvs[faces]).T
        if box is None:
            off = np.linalg.norm(patch.point(u, v) - q, axis=1)
        else:
            half = 0.5 * (box[1] - box[0])
            x, y = ((q - 0.5 * (box[0] + box[1])) / half)[:, :2].T
            turn = np.abs(np.arctan2(y, x) / (2.0 * np.pi) - u) % 1.0
            turn = np.minimum(turn, 1.0 - turn)
            off = 2.0 * np.pi * turn * np.hypot(x, y) * half[:2].max()
        largest = max(largest, float(off.max(initial=0.0)))
    return largest


INNER = np.array([np.roll([0.57721, 0.11803, 0.30476], k) for k in range(3)])
"""Barycentrics at which exact tangents are compared.  They are no simple fractions: on a regular
grid of triangles such points lie in rows, perhaps on the very line along which tangents jump."""

RARE = 1e-3
"""Share of a mesh's area whose tangents may be further off than `measured_twist`: those next to a
pole, where all directions meet."""

MOST_TWIST = 0.05
"""Largest twist of a mesh with Mitsuba's tangents, in radians; the fuzzer's coarse ones have up to
0.016.  Where the angle around the axis does not change along a line of constant z, tangents have
any direction on a mesh."""


def measured_twist(
    soup: Soup, of: Coordinates, surface: Surface, m: affine.Affine, exact: bool
) -> float:
    """The angle in the scene, in radians, between the derivatives of the position by u of mesh and
    surface.

    exact: the mesh's are those of `of` at its points, which lie off the surface.  Otherwise they
    are Mitsuba's own, constant on each triangle.  On the mesh of a cylinder, for example, the
    derivative is then a chord, which is off along the normal alone.  A shear turns that error into
    the surface, and the triangles are so long that rounding turns the chord by 1e-4.  So angles
    are measured behind the map m, for vertices in float32.
    """
    assert soup.uvs is not None
    assert soup.normals is not None
    linear, inverse = m[:, :3], affine.invert(m)
    faces = _some_faces(soup)
    uv = round32(soup.uvs)[faces]
    mapped = round32(affine.apply_points(m, soup.positions))[faces]
    a, b = mapped[:, 1] - mapped[:, 0], mapped[:, 2] - mapped[:, 0]
    (du1, dv1), (du2, dv2) = (uv[:, k].T - uv[:, 0].T for k in (1, 2))
    of_triangle = (dv2[:, None] * a - dv1[:, None] * b) * np.sign(du1 * dv2 - dv1 * du2)[:, None]
    angles = []
    for weights in INNER if exact else WEIGHTS:
        q = affine.apply_points(inverse, weights @ mapped)
        gradient = surface.gradient(q)
        steepness = np.sum(gradient * gradient, axis=1)
        step = np.divide(
            surface.value(q), steepness, out=np.zeros_like(steepness), where=steepness > 0.0
        )
        right = derivatives_at(of, q - step[:, None] * gradient)[0] @ linear.T
        of_mesh = derivatives_at(of, q)[0] @ linear.T if exact else of_triangle
        n = weights @ soup.normals[faces] @ inverse[:, :3]
        n /= np.linalg.norm(n, axis=1)[:, None]
        one, other = (t - n * np.sum(t * n, axis=1)[:, None] for t in (of_mesh, right))
        cross = np.linalg.norm(np.cross(one, other), axis=1)
        angles.append(np.nan_to_num(np.arctan2(cross, np.sum(one * other, axis=1)), nan=np.pi))
    angle = np.max(angles, axis=0)
    order = np.argsort(-angle)
    area = np.cumsum(np.linalg.norm(np.cross(a, b), axis=1)[order])
    return float(angle[order][np.searchsorted(area, RARE * area[-1])])


def aspects(soup: Soup, m: affine.Affine, faces: IntArray) -> FloatArray:
    """(n,): the longest side of triangles `faces` (n,), mapped by m, over its height on it.

    Float32's error of the barycentric coordinates moves a point along the surface by its common
    error times this: by hundreds of times on the long triangles of a cylinder.
    """
    points = soup.positions[soup.faces[faces]].reshape(-1, 3)
    corners = affine.apply_points(m, points).reshape(-1, 3, 3)
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    heights = heights_of(corners)
    return np.asarray(np.divide(longest, heights, out=np.zeros_like(heights), where=heights > 0.0))


# ---- meshes --------------------------------------------------------------------------------------


@contextmanager
def coarser(factor: float) -> Iterator[None]:
    """Meshes with `factor` times as many cells along each side are made inside the block: for many
    scenes of few rays each, whose meshes would take most of the time.  Their larger error is
    measured as that of any others."""
    token = _fineness.set(factor)
    try:
        yield
    finally:
        _fineness.reset(token)


def stand_in(
    shape: Shape,
    surface: Surface,
    site: Site,
    of: Coordinates,
    with_uv: Callable[[Soup], Soup] | None = None,
) -> Plugin:
    """The mesh that stands in for a shape, and its error in the scene; surface and `of` are in the
    shape's own coordinates.  with_uv: adds texture coordinates, where there is a texture."""
    own, patches = affine.of_steps(shape.transform), surface.patches()
    most = 2.0 * sum(patch.cells[0] * patch.cells[1] for patch in patches) * _fineness.get() ** 2
    exact = _has_exact_coordinates(site, most)
    fineness = _fineness.get()
    if exact:
        # Not instances, in which the plugin does not know the place of the surface.
        fineness *= min(1.0, (MOST_TRIANGLES / (site.copies * most)) ** 0.5)
    key: tuple[Any, ...] = ("stand-in", id(shape), fineness)
    if key not in site.shared:
        soup = meshed(surface, fineness)
        sag, turn = measured_error(soup, surface, own)
        half = meshed(surface, 0.5 * fineness)
        coarse, _ = measured_error(half, surface, own, ROUGHLY)
        name, ratio = type(shape).__name__.lower(), coarse / sag if sag > 0.0 else 1.0
        site.shared[key] = soup, StandIn(name, len(soup.faces), sag, turn, ratio)
    soup, found = site.shared[key]
    if with_uv is not None and site.textured:
        key = (*key, "uv")
        if key not in site.shared:
            site.shared[key] = with_uv(soup)
        soup = site.shared[key]
    if site.textured and soup.uvs is not None:
        key = (*key, "slip")
        if key not in site.shared:
            box = None if patches[0].has_uv else surface.ends
            site.shared[key] = measured_slip(soup, patches[0], box)
        found = found._replace(slip=site.shared[key], shift=0.0 if exact else site.shared[key])
    m = affine.compose(own, site.place.outer)
    if site.oriented and soup.uvs is not None:
        twist = measured_twist(soup, of, surface, m, exact)
        if not exact and (_is_bumped(site.parts) or twist > MOST_TWIST):
            raise UntranslatableError(
                f"{type(shape).__name__} under a bump map, or an anisotropic material where lines "
                f"of constant z run towards the axis, in a group with {site.copies} copies,",
                "shape",
            )
        found = found._replace(twist=twist)
    site = with_mesh_light(site, normals=True, stands_in=True)
    if exact:
        parts = {**site.parts, "bsdf": _with_coordinates(site.parts["bsdf"], of, m)}
        site = site._replace(parts=parts, copies=1)
    # The maps after the shape's own stretch distances, and turn angles, at most by these factors.
    stretch, of_all = (np.linalg.svd(x[:, :3], compute_uv=False) for x in (site.place.outer, m))
    found = found._replace(
        sag=float(found.sag * stretch[0]),
        turn=float(found.turn * stretch[0] / stretch[-1]),
        slip=float(found.slip * of_all[0]),
        shift=float(found.shift * of_all[0]),
    )
    mirrored = bool(np.linalg.det(m[:, :3]) < 0.0)
    plugin = placed(soup, key, m, mirrored, site)
    return plugin._replace(
        faces=soup.all_of_face(0),
        stand_in=found,
        aspects=partial(aspects, soup, m),
        uv_of_mesh=soup.uvs is not None,
    )


def _has_exact_coordinates(site: Site, triangles: float) -> bool:
    """Whether a mesh of so many triangles has the surface's own uv and tangents: if its material
    depends on them, unless there are so many copies that they are instances, or Mitsuba's own
    materials are asked for."""
    if not site.textured or site.native:
        return False
    few = site.copies <= MOST_INSTANCES or site.copies * triangles <= MOST_TRIANGLES
    return few or "emitter" in site.parts


def _with_coordinates(bsdf: dict[str, Any], of: Coordinates, m: affine.Affine) -> dict[str, Any]:
    """A BSDF inside the plugin `comparisons.mitsuba.plugins.exact_coordinates`, on a surface under
    the map m."""
    linear, inverse = m[:, :3], np.linalg.inv(m[:, :3])
    found = {"type": "exact_coordinates", "nested": bsdf, **of.numbers()}
    for letter, matrix in (("m", linear), ("i", inverse)):
        found |= {f"{letter}_{j}{k}": float(matrix[j, k]) for j in range(3) for k in range(3)}
    place = affine.apply_points(m, np.array([of.origin]))[0]
    return {**found, **{f"o_{k}": float(place[k]) for k in range(3)}}


def _is_bumped(part: Any) -> bool:
    """Whether a bump map is among the parts of a shape."""
    if not isinstance(part, dict):
        return False
    return part.get("type") in ("bumpmap", "exact_bump") or any(
        _is_bumped(inner) for inner in part.values()
    )


# ---- closed meshes, for files --------------------------------------------------------------------


GRID = 1e-9
"""Vertices of one place, over the size of the mesh: apart by rounding where a patch meets itself.
"""


def _welded(soup: Soup) -> Soup:
    """The mesh with vertices of one place at the very same place, so that it is closed, and without
    the triangles that lose their area."""
    size = float(np.ptp(soup.positions, axis=0).max())
    places = np.round(soup.positions / (GRID * size)).astype(np.int64)
    _, first, number = np.unique(places, axis=0, return_index=True, return_inverse=True)
    number = number.ravel()
    corners = number[soup.faces]
    kept = (corners != np.roll(corners, 1, axis=1)).all(axis=1)
    return Soup(
        soup.positions[first][number], soup.normals, soup.uvs, soup.colours, soup.faces[kept]
    )


def tessellated(surface: Surface, m: affine.Affine) -> tuple[list[Soup], float]:
    """A surface as a closed mesh, and its error under the map m."""
    soup = meshed(surface, 1.0)
    return [_welded(soup)], measured_error(soup, surface, m)[0]
