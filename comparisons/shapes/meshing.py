"""Triangles of parametric surfaces, clipped to boxes, and of a quadric's caps on a box's faces."""

from collections.abc import Callable
from functools import partial

import numpy as np

from comparisons.geometry import affine
from comparisons.shapes.soup import Soup, heights_of
from comparisons.shapes.surface import Limits, Surface
from reference_rt.core.arrays import FloatArray, IntArray

# ---- triangles clipped along the zeros of a function ---------------------------------------------


def cut_away(
    data: FloatArray, faces: IntArray, height: Callable[[FloatArray], FloatArray]
) -> tuple[FloatArray, IntArray]:
    """Triangles (m, 3) of vertices (n, k), clipped to where `height` of the vertices is at most 0
    (Sutherland & Hodgman 1974).

    An edge is cut at the zero of the quadratic through its heights at both ends and the middle.
    """
    h = height(data)
    inside = h[faces] <= 0.0
    count = inside.sum(axis=1)
    kept, added = [faces[count == 3]], [data]
    start = len(data)
    for lone_inside in (True, False):
        mine = count == (1 if lone_inside else 2)
        if not mine.any():
            continue
        # Rotated so that the corner that is alone on its side comes first.
        first = np.argmax(inside[mine] if lone_inside else ~inside[mine], axis=1)
        turned = np.take_along_axis(faces[mine], (first[:, None] + [0, 1, 2]) % 3, axis=1)
        a, b, c = turned.T
        ends = []
        for other in (b, c):
            middle = height(0.5 * (data[a] + data[other]))
            t = _zero(h[a], middle, h[other])[:, None]
            added.append(data[a] + (data[other] - data[a]) * t)
            ends.append(start + np.arange(len(a)))
            start += len(a)
        on_ab, on_ac = ends
        if lone_inside:
            kept.append(np.column_stack([a, on_ab, on_ac]))
        else:
            kept += [np.column_stack([on_ab, b, c]), np.column_stack([on_ab, c, on_ac])]
    return np.concatenate(added), np.concatenate(kept)


def _zero(at0: FloatArray, middle: FloatArray, at1: FloatArray) -> FloatArray:
    """The zero in [0, 1] of the quadratic with these values at 0, 1/2 and 1; the values at the ends
    have opposite signs."""
    a = 2.0 * (at0 - 2.0 * middle + at1)
    b, c = at1 - at0 - a, at0
    with np.errstate(divide="ignore", invalid="ignore"):
        q = -0.5 * (b + np.copysign(np.sqrt(np.maximum(b * b - 4.0 * a * c, 0.0)), b))
        roots = np.stack([q / a, c / q])
    # Of the two roots the one in [0, 1], or the nearest.
    outside = np.abs(np.nan_to_num(roots, nan=np.inf) - 0.5)
    chosen = np.take_along_axis(roots, outside.argmin(axis=0)[None], axis=0)[0]
    return np.asarray(np.clip(np.nan_to_num(chosen, nan=0.5), 0.0, 1.0))


# ---- parametric surfaces -------------------------------------------------------------------------


FEWEST = 4
"""Fewest cells along the side of a patch, unless it asks for less itself: hits slide along
triangles that are long and thin (see `tubes.SIDE`)."""


def meshed(surface: Surface, fineness: float) -> Soup:
    """A surface as triangles that face where f grows, with f's normals, clipped to its ends unless
    its patches have our uv;  fineness: factor on the numbers of cells."""
    positions, normals, uvs, faces = [], [], [], []
    count = 0
    for patch in surface.patches():
        cells = tuple(max(min(n, FEWEST), round(n * fineness)) for n in patch.cells)
        u, v = np.meshgrid(*(np.linspace(0.0, 1.0, n + 1) for n in cells), indexing="ij")
        grid = patch.point(u, v)
        n = _grid_normals(surface.gradient(grid))
        flat_grid, flat_normals = grid.reshape(-1, 3), n.reshape(-1, 3)
        some = _grid_faces(*cells)
        if patch.has_uv:
            uvs.append(np.column_stack([u.ravel(), v.ravel()]))
        elif surface.ends is not None:
            flat_grid, flat_normals, some = clipped(flat_grid, flat_normals, some, surface.ends)
        a, b, c = (flat_grid[some[:, k]] for k in range(3))
        winding = np.cross(b - a, c - a)
        front = sum(flat_normals[some[:, k]] for k in range(3))
        some = np.where((np.sum(winding * front, axis=1) < 0.0)[:, None], some[:, ::-1], some)
        some = some[np.linalg.norm(winding, axis=1) > 0.0]
        positions.append(flat_grid)
        normals.append(flat_normals)
        faces.append(some + count)
        count += len(flat_grid)
    uv = np.concatenate(uvs) if len(uvs) == len(positions) else None
    return Soup(np.concatenate(positions), np.concatenate(normals), uv, faces=np.concatenate(faces))


def _grid_normals(gradient: FloatArray) -> FloatArray:
    """Unit normals on a grid (a, b, 3); where the gradient vanishes (an apex), a neighbour's."""
    length = np.linalg.norm(gradient, axis=2, keepdims=True)
    n = np.divide(gradient, length, out=np.zeros_like(gradient), where=length > 0.0)
    if (length > 0.0).all():
        return np.asarray(n)
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
    positions: FloatArray, normals: FloatArray, faces: IntArray, box: Limits
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


# ---- caps: the parts of a box's faces where a quadratic is <= 0 ----------------------------------


LEVELS = 10
"""Subdivisions of a face into the squares that the outline passes through: their chords are off by
less than 1e-6 of the face, for an outline as curved as the inscribed circle."""

OVERLAP = 1e-6
"""Overlap of neighbouring squares, as a fraction of their side: rays would pass through T-junctions
between larger and smaller squares."""

Form = Callable[[FloatArray], FloatArray]


def cap_faces(value: Form, box: Limits) -> tuple[Soup, IntArray]:
    """Outward triangles of all six faces, with normals, and uv from 0 to 1 across each face; and
    our face numbers: 1 + the axis, + 3 on the positive side."""
    positions, normals, uvs, numbers = [], [], [], []
    for axis in range(3):
        for side in (0, 1):
            triangles = _cap(value, box, axis, side)
            positions.append(_on_face(triangles, box, axis, side).reshape(-1, 3))
            outward = np.where(np.arange(3) == axis, 2.0 * side - 1.0, 0.0)
            normals.append(np.tile(outward, (3 * len(triangles), 1)))
            uvs.append(triangles.reshape(-1, 2))
            numbers.append(np.full(len(triangles), 1 + axis + 3 * side))
    soup = Soup(np.concatenate(positions), np.concatenate(normals), np.concatenate(uvs))
    return soup, np.concatenate(numbers)


def heights_over_uv(soup: Soup, m: affine.Affine) -> FloatArray:
    """(faces,): the smallest height of each triangle, mapped by m, over its longest side in uv.

    Float32 moves a hit by e across the triangle, and so its barycentrics by e over the height:
    e over this length is by how much uv change.
    """
    assert soup.uvs is not None
    uv = soup.uvs[soup.faces]
    sides = np.linalg.norm(uv - np.roll(uv, 1, axis=1), axis=2).max(axis=1)
    heights = heights_of(affine.apply_points(m, soup.positions)[soup.faces])
    return np.asarray(np.divide(heights, sides, out=np.zeros_like(heights), where=sides > 0.0))


def _on_face(xy: FloatArray, box: Limits, axis: int, side: int) -> FloatArray:
    """Points (..., 3) of a face of the box; x, y (..., 2) from 0 to 1."""
    across = [k for k in range(3) if k != axis]
    p = np.empty((*xy.shape[:-1], 3))
    p[..., across] = box[0][across] + (box[1] - box[0])[across] * xy
    p[..., axis] = box[side][axis]
    return p


def _cap(value: Form, box: Limits, axis: int, side: int) -> FloatArray:
    """Outward triangles (n, 3, 2) of the solid's part of a face."""

    def on_face(xy: FloatArray) -> FloatArray:
        return value(_on_face(xy, box, axis, side))

    triangles = region(on_face)
    # Counter-clockwise in x, y faces +x of (y, z), -y of (x, z) and +z of (x, y).
    inward = (axis != 1) == (side == 0)
    return triangles[:, ::-1] if inward else triangles


def region(f: Form) -> FloatArray:
    """Counter-clockwise triangles (n, 3, 2) of the part of the unit square where a quadratic f of
    (..., 2) is at most 0: squares, subdivided at the outline, and the smallest cut along it."""
    corners, size = np.zeros((1, 2)), 1.0
    triangles = []
    for level in range(LEVELS + 1):
        ticks = np.linspace(0.0, size, 3)
        offsets = np.array([[x, y] for x in ticks for y in ticks])
        values = f(corners[:, None] + offsets)
        # A quadratic is within its values on a 3 x 3 grid, extended by their spread: its second
        # differences, of which there are four, are at most as large.
        low, high = values.min(axis=1), values.max(axis=1)
        spread = np.abs(_second_differences(values)).sum(axis=1)
        inside = high + spread <= 0.0
        triangles.append(_halves(corners[inside], size))
        corners = corners[~inside & (low - spread <= 0.0)]
        if level < LEVELS:
            size /= 2.0
            steps = size * np.array([[0, 0], [1, 0], [0, 1], [1, 1]])
            corners = (corners[:, None] + steps).reshape(-1, 2)
    last = _halves(corners, size)
    data, faces = cut_away(last.reshape(-1, 2), np.arange(3 * len(last)).reshape(-1, 3), f)
    return np.concatenate([*triangles, data[faces]])


def _second_differences(values: FloatArray) -> FloatArray:
    """(n, 3): second differences of values (n, 9) on a 3 x 3 grid: xx, yy and xy."""
    v = values.reshape(-1, 3, 3)
    xx = v[:, 0, 1] - 2.0 * v[:, 1, 1] + v[:, 2, 1]
    yy = v[:, 1, 0] - 2.0 * v[:, 1, 1] + v[:, 1, 2]
    xy = 0.25 * (v[:, 0, 0] - v[:, 0, 2] - v[:, 2, 0] + v[:, 2, 2])
    return np.stack([xx, yy, xy], axis=1)


def _halves(corners: FloatArray, size: float) -> FloatArray:
    """Two triangles (2 n, 3, 2) for each square, enlarged by OVERLAP within the unit square."""
    grown = size * OVERLAP
    low, high = np.clip(corners - grown, 0.0, 1.0), np.clip(corners + size + grown, 0.0, 1.0)
    a, c = low, high
    b, d = np.column_stack([high[:, 0], low[:, 1]]), np.column_stack([low[:, 0], high[:, 1]])
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
