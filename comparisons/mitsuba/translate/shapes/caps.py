"""The caps of a quadric: the parts of a box's faces where a quadratic is <= 0, as triangles."""

from collections.abc import Callable

import numpy as np

from comparisons.geometry.sizes import heights_of
from comparisons.mitsuba.translate.shapes.cutting import cut_away
from comparisons.mitsuba.translate.shapes.meshes import Soup
from comparisons.mitsuba.translate.shapes.patches import Box
from reference_rt.core import transform
from reference_rt.core.arrays import FloatArray, IntArray

LEVELS = 10
"""Subdivisions of a face into the squares that the outline passes through: their chords are off by
less than 1e-6 of the face, for an outline as curved as the inscribed circle."""

OVERLAP = 1e-6
"""Overlap of neighbouring squares, as a fraction of their side: rays would pass through T-junctions
between larger and smaller squares."""

Form = Callable[[FloatArray], FloatArray]


def cap_faces(value: Form, box: Box) -> tuple[Soup, IntArray]:
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


def heights_over_uv(soup: Soup, m: transform.Affine) -> FloatArray:
    """(faces,): the smallest height of each triangle, mapped by m, over its longest side in uv.

    Float32 moves a hit by e across the triangle, and so its barycentrics by e over the height:
    e over this length is by how much uv change.
    """
    assert soup.uvs is not None
    uv = soup.uvs[soup.faces]
    sides = np.linalg.norm(uv - np.roll(uv, 1, axis=1), axis=2).max(axis=1)
    heights = heights_of(transform.apply_points(m, soup.positions)[soup.faces])
    return np.asarray(np.divide(heights, sides, out=np.zeros_like(heights), where=sides > 0.0))


def _on_face(xy: FloatArray, box: Box, axis: int, side: int) -> FloatArray:
    """Points (..., 3) of a face of the box; x, y (..., 2) from 0 to 1."""
    across = [k for k in range(3) if k != axis]
    p = np.empty((*xy.shape[:-1], 3))
    p[..., across] = box[0][across] + (box[1] - box[0])[across] * xy
    p[..., axis] = box[side][axis]
    return p


def _cap(value: Form, box: Box, axis: int, side: int) -> FloatArray:
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
