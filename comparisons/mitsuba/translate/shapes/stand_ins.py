"""Fine meshes that stand in for curved surfaces that Mitsuba lacks, with the surface's normals;
their distance from the surface is measured."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from comparisons.mitsuba.stand_ins import Plugin, StandIn
from comparisons.mitsuba.translate.errors import UntranslatableError
from comparisons.mitsuba.translate.shapes.cutting import cut_away
from comparisons.mitsuba.translate.shapes.meshes import Soup, placed
from comparisons.mitsuba.translate.shapes.plugins import Site, with_mesh_light
from reference_rt.core import transform
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.shapes.shape import Shape

Box = tuple[FloatArray, FloatArray]


class Patch(NamedTuple):
    """A parametric patch of a surface, with u, v in [0, 1].

    point(u, v): arrays of one shape -> (..., 3);  cells: their numbers along u and v;  has_uv:
    whether u and v are the texture coordinates of our shape.
    """

    point: Callable[[FloatArray, FloatArray], FloatArray]
    cells: tuple[int, int]
    has_uv: bool = False


class Implicit(NamedTuple):
    """The surface f = 0: f of points (..., 3) -> (...), and its gradient (..., 3)."""

    value: Callable[[FloatArray], FloatArray]
    gradient: Callable[[FloatArray], FloatArray]


def meshed(patches: Sequence[Patch], surface: Implicit, box: Box | None, fineness: float) -> Soup:
    """Patches as triangles that face where f grows, with f's normals, clipped to a box;  fineness:
    factor on the numbers of cells."""
    positions, normals, uvs, faces = [], [], [], []
    count = 0
    for patch in patches:
        cells = tuple(max(1, round(n * fineness)) if n > 1 else 1 for n in patch.cells)
        u, v = np.meshgrid(*(np.linspace(0.0, 1.0, n + 1) for n in cells), indexing="ij")
        grid = patch.point(u, v)
        n = _grid_normals(surface.gradient(grid))
        flat_grid, flat_normals = grid.reshape(-1, 3), n.reshape(-1, 3)
        some = _grid_faces(*cells)
        if box is not None:
            flat_grid, flat_normals, some = clipped(flat_grid, flat_normals, some, box)
        elif patch.has_uv:
            uvs.append(np.column_stack([u.ravel(), v.ravel()]))
        corners = flat_grid[some]
        winding = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        front = flat_normals[some].sum(axis=1)
        some = np.where((np.sum(winding * front, axis=1) < 0.0)[:, None], some[:, ::-1], some)
        some = some[np.linalg.norm(winding, axis=1) > 0.0]
        positions.append(flat_grid)
        normals.append(flat_normals)
        faces.append(some + count)
        count += len(flat_grid)
    uv = np.concatenate(uvs) if len(uvs) == len(positions) else None
    return Soup(np.concatenate(positions), np.concatenate(normals), uv, faces=np.concatenate(faces))


_fineness = ContextVar("fineness", default=1.0)


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
    patches: Sequence[Patch],
    surface: Implicit,
    box: Box | None,
    site: Site,
    with_uv: Callable[[Soup], Soup] | None = None,
) -> Plugin:
    """The mesh that stands in for a shape, and its error in the scene; patches, surface and box are
    in the shape's own coordinates.  with_uv: adds texture coordinates, where there is a texture."""
    if _is_bumped(site.parts):
        # Bump tilts by the derivatives of the position by u and v, which Mitsuba takes as constant
        # on each triangle of a mesh: where a cone narrows by a tenth within a triangle, the slope
        # is a tenth off.
        raise UntranslatableError(f"{type(shape).__name__} under a bump map", "shape")
    own = transform.affine(shape.transform)
    key: tuple[Any, ...] = ("stand-in", id(shape))
    if key not in site.shared:
        fineness = _fineness.get()
        soup = meshed(patches, surface, box, fineness)
        sag, turn = measured_error(soup, surface, own)
        coarse, _ = measured_error(meshed(patches, surface, box, 0.5 * fineness), surface, own)
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
            site.shared[key] = measured_slip(soup, patches[0], box)
        found = found._replace(slip=site.shared[key])
    if site.oriented and soup.uvs is not None:
        twist = measured_twist(soup, patches[0], surface, box)
        if twist > MOST_TWIST:
            raise UntranslatableError(
                f"{type(shape).__name__} whose lines of constant z run towards the axis, under an "
                "anisotropic material",
                "shape",
            )
        found = found._replace(twist=twist)
    site = with_mesh_light(site, normals=True, stands_in=True)
    m = transform.compose(own, site.place.outer)
    # The maps after the shape's own stretch distances, and turn angles, at most by these factors.
    stretch, of_all = (np.linalg.svd(x[:, :3], compute_uv=False) for x in (site.place.outer, m))
    found = found._replace(
        sag=float(found.sag * stretch[0]),
        turn=float(found.turn * stretch[0] / stretch[-1]),
        slip=float(found.slip * of_all[0]),
        twist=float(found.twist * of_all[0] / of_all[-1]),
    )
    mirrored = bool(np.linalg.det(m[:, :3]) < 0.0)
    plugin = placed(soup, key, m, mirrored, site)
    return plugin._replace(
        faces=soup.all_of_face(0), stand_in=found, uv_of_mesh=soup.uvs is not None
    )


def _is_bumped(part: Any) -> bool:
    """Whether a bump map is among the parts of a shape."""
    if not isinstance(part, dict):
        return False
    return part.get("type") in ("bumpmap", "exact_bump") or any(
        _is_bumped(inner) for inner in part.values()
    )


MEASURED = 50_000
"""Most triangles that are measured, evenly strided: on a smooth surface neighbours have nearly the
same error."""

WEIGHTS = np.array([[1, 1, 1], [1, 1, 0], [0, 1, 1], [1, 0, 1]], np.float64)
WEIGHTS /= WEIGHTS.sum(axis=1, keepdims=True)
"""Barycentrics at which a triangle is compared with its surface: its centre and the middles of its
sides."""


def measured_error(soup: Soup, surface: Implicit, m: transform.Affine) -> tuple[float, float]:
    """The largest distance and the largest angle, in radians, between a mesh and its surface.

    The distance is f over its gradient in the scene, exact but for terms of second order.
    """
    inverse = transform.invert(m)[:, :3]
    faces = soup.faces[:: max(1, len(soup.faces) // MEASURED)]
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


def measured_slip(soup: Soup, patch: Patch, box: Box | None) -> float:
    """The largest distance, in the shape's own coordinates, between a point of the mesh and the one
    of the surface that has its interpolated uv: of a patch with these uv, or of a surface around
    the z axis of a box."""
    assert soup.uvs is not None
    faces = soup.faces[:: max(1, len(soup.faces) // MEASURED)]
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


RARE = 1e-3
"""Share of a mesh's area whose tangents may be further off than `measured_twist`: those next to a
pole, where all directions meet."""

MOST_TWIST = 0.05
"""Largest twist of a mesh, in radians; the fuzzer's coarse ones have up to 0.016.  Where the angle
around the axis does not change along a line of constant z, tangents have any direction on a
mesh."""


def measured_twist(soup: Soup, patch: Patch, surface: Implicit, box: Box | None) -> float:
    """The angle, in radians and in the shape's own coordinates, between the derivatives of the
    position by u of mesh and surface: Mitsuba takes that of a mesh as constant on each triangle.

    The surface's is that of a patch with these uv, or for one around the z axis of a box that along
    the surface in the plane of constant z, the way in which the angle grows.
    """
    assert soup.uvs is not None
    assert soup.normals is not None
    faces = soup.faces[:: max(1, len(soup.faces) // MEASURED)]
    corners, uv = soup.positions[faces], soup.uvs[faces]
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    (du1, dv1), (du2, dv2) = (uv[:, k].T - uv[:, 0].T for k in (1, 2))
    of_mesh = (dv2[:, None] * a - dv1[:, None] * b) * np.sign(du1 * dv2 - dv1 * du2)[:, None]
    angles = []
    for weights in WEIGHTS:
        q = weights @ corners
        if box is None:
            u, v = (weights @ uv).T
            exact = patch.point(u + TANGENT_STEP, v) - patch.point(u - TANGENT_STEP, v)
        else:
            gradient = surface.gradient(q)
            exact = np.column_stack([-gradient[:, 1], gradient[:, 0], np.zeros(len(q))])
            half = 0.5 * (box[1] - box[0])
            x, y = ((q - 0.5 * (box[0] + box[1])) / half)[:, :2].T
            grows = x * exact[:, 1] / half[1] - y * exact[:, 0] / half[0] >= 0.0
            exact *= np.where(grows, 1.0, -1.0)[:, None]
        n = weights @ soup.normals[faces]
        n /= np.linalg.norm(n, axis=1)[:, None]
        one, other = (t - n * np.sum(t * n, axis=1)[:, None] for t in (of_mesh, exact))
        cross = np.linalg.norm(np.cross(one, other), axis=1)
        angles.append(np.arctan2(cross, np.sum(one * other, axis=1)))
    angle = np.max(angles, axis=0)
    order = np.argsort(-angle)
    area = np.cumsum(np.linalg.norm(np.cross(a, b), axis=1)[order])
    return float(angle[order][np.searchsorted(area, RARE * area[-1])])


TANGENT_STEP = 1e-5
"""Step in u for the derivative of a patch's position: it is off by a tenth of the step squared."""


def _grid_normals(gradient: FloatArray) -> FloatArray:
    """Unit normals on a grid (a, b, 3); where the gradient vanishes (an apex), a neighbour's."""
    length = np.linalg.norm(gradient, axis=2, keepdims=True)
    n = np.divide(gradient, length, out=np.zeros_like(gradient), where=length > 0.0)
    for axis in (1, 0):
        for step in (-1, 1):
            beside = np.roll(n, step, axis=axis)
            n = np.where(np.any(n != 0.0, axis=2, keepdims=True), n, beside)
    return np.asarray(n)


def _grid_faces(a: int, b: int) -> IntArray:
    """Two triangles for each cell of a grid of (a + 1) (b + 1) points."""
    k = np.arange((a + 1) * (b + 1)).reshape(a + 1, b + 1)
    corners = [k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]]
    p, q, r, s = (c.ravel() for c in corners)
    return np.concatenate([np.column_stack([p, q, r]), np.column_stack([p, r, s])])


def clipped(
    positions: FloatArray, normals: FloatArray, faces: IntArray, box: Box
) -> tuple[FloatArray, FloatArray, IntArray]:
    """Triangles clipped to a box."""
    data = np.hstack([positions, normals])
    for axis in range(3):
        for sign, limit in ((-1.0, box[0][axis]), (1.0, box[1][axis])):
            count = len(data)
            data, faces = cut_away(data, faces, partial(_beyond, axis, sign, limit))
            data[count:, axis] = limit
    n = data[:, 3:]
    length = np.linalg.norm(n, axis=1, keepdims=True)
    return data[:, :3], np.divide(n, length, out=np.zeros_like(n), where=length > 0.0), faces


def _beyond(axis: int, sign: float, limit: float, data: FloatArray) -> FloatArray:
    return np.asarray(sign * (data[:, axis] - limit))
