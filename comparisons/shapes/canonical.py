"""Any quadric as parametric patches, from its canonical form along its principal axes."""

from collections.abc import Callable
from functools import partial

import numpy as np

from comparisons.mitsuba.hits import BoolArray
from comparisons.shapes.surface import Limits, Patch
from reference_rt.core.arrays import FloatArray, IntArray

CURVED = (768, 384)
STRAIGHT = (2048, 4)
"""Cells of a patch that is curved along u and v, and of one that is straight along v: see
`tubes.SIDE` for why that has more than one."""

ZERO = 1e-12
"""A slope below this fraction of the largest counts as 0."""

FLAT = 1e-7
"""An eigenvalue below this fraction of the largest counts as 0: that moves the surface by as much
of the box's size, less than the mesh is off; the center would be too far away for float64."""

Coordinates = tuple[FloatArray, FloatArray, FloatArray]
Shape = Callable[[FloatArray, FloatArray], Coordinates]


def patches_of(matrix: FloatArray, linear: FloatArray, constant: float, box: Limits) -> list[Patch]:
    """Patches of x^T M x + l x + c = 0 that cover its part in a box; they may reach beyond it."""
    middle = 0.5 * (box[0] + box[1])
    constant = constant + float(middle @ matrix @ middle + linear @ middle)
    linear = linear + 2.0 * matrix @ middle
    eigenvalues, axes = np.linalg.eigh(matrix)
    eigenvalues[np.abs(eigenvalues) <= FLAT * np.abs(eigenvalues).max(initial=0.0)] = 0.0
    slopes = axes.T @ linear
    origin = np.zeros(3)
    square = eigenvalues != 0.0
    origin[square] = -slopes[square] / (2.0 * eigenvalues[square])
    constant = constant - float(np.sum(eigenvalues[square] * origin[square] ** 2))
    slopes[square] = 0.0
    flat = np.flatnonzero(~square)
    slope = float(np.linalg.norm(slopes))
    if slope <= ZERO * float(np.abs(linear).max(initial=0.0)):
        slope = 0.0
    if slope > 0.0:
        # Turn the axes of zero eigenvalues: f rises along one of them only.
        rising = axes @ slopes / slope
        others = axes[:, flat] - np.outer(rising, rising @ axes[:, flat])
        basis = np.linalg.svd(others)[0][:, : len(flat) - 1]
        axes[:, flat] = np.column_stack([rising, basis])
        origin[flat[0]] = -constant / slope
        constant = 0.0
    reach = float(np.abs(origin).max() + np.linalg.norm(box[1] - middle))
    shapes = _shapes(eigenvalues, slope, flat, constant, reach, -origin)

    def place(shape: Shape, u: FloatArray, v: FloatArray) -> FloatArray:
        return np.asarray((np.stack(shape(u, v), axis=-1) + origin) @ axes.T + middle)

    found = [narrowed(Patch(partial(place, shape), cells), box) for shape, cells in shapes]
    return [patch for patch in found if patch is not None]


MOST_CELLS = 300_000
"""Most cells of a patch that are tested for being near a box."""


def narrowed(patch: Patch, box: Limits) -> Patch | None:
    """The patch, limited to parameters near the box; None if it does not come near.

    The cells of the patch that are near are split until most of their parts are near, too.  Of a
    quadric whose center is far they may be 1e-6 of the patch, and first seem to be along all of its
    straight lines.
    """
    size = 1.0 / 64.0
    cells = size * np.stack(np.meshgrid(*2 * [np.arange(64.0)]), axis=-1).reshape(-1, 2)
    split = 0.25 * np.stack(np.meshgrid(*2 * [np.arange(4.0)]), axis=-1).reshape(-1, 2)
    while True:
        near = _near(patch, cells, size, box)
        cells = cells[near]
        if len(cells) == 0:
            return None
        if near.mean() > 0.5 or len(split) * len(cells) > MOST_CELLS:
            break
        cells = (cells[:, None] + size * split).reshape(-1, 2)
        size *= 0.25
    low = cells.min(axis=0)
    sides = cells.max(axis=0) + size - low

    def point(u: FloatArray, v: FloatArray) -> FloatArray:
        return patch.point(low[0] + sides[0] * u, low[1] + sides[1] * v)

    return Patch(point, patch.cells)


def _near(patch: Patch, cells: FloatArray, size: float, box: Limits) -> BoolArray:
    """Which of the cells, from (u, v) to (u, v) + size, may come near the box."""
    halves = 0.5 * size * np.arange(3.0)
    u, v = (
        cells[:, k, None, None] + halves.reshape(shape) for k, shape in enumerate([(3, 1), (1, 3)])
    )
    p = patch.point(*np.broadcast_arrays(u, v)).reshape(len(cells), 9, 3)
    lower, upper = p.min(axis=1), p.max(axis=1)
    # Corners and middles of each cell have an extent along each axis: more than its surface bulges
    # out between them.
    margin = upper - lower
    return np.asarray(np.all((lower - margin <= box[1]) & (upper + margin >= box[0]), axis=1))


def _shapes(
    eigenvalues: FloatArray,
    slope: float,
    flat: IntArray,
    constant: float,
    reach: float,
    seen: FloatArray,
) -> list[tuple[Shape, tuple[int, int]]]:
    """Patches of sum e_k z_k² + slope z_flat[0] + constant = 0 for |z_k| <= reach;  seen (3,): the
    middle of what they must cover."""
    square = np.flatnonzero(eigenvalues)
    if len(square) == 0:
        return [(_ordered((flat[0], flat[1], flat[2]), _plane(0.0, reach)), (1, 1))]
    if len(square) == 1:
        return _of_one(eigenvalues[square[0]], slope, int(square[0]), flat, constant, reach)
    e = eigenvalues[square]
    if len(square) == 2 and slope != 0.0:
        order = (int(square[0]), int(square[1]), int(flat[0]))
        return [(_ordered(order, _paraboloid(e / -slope, reach, seen[list(order)])), CURVED)]
    if constant == 0.0:
        return _cones(eigenvalues, square, reach, seen)
    mu = np.zeros(3)
    mu[square] = -e / constant  # sum mu z² = 1
    return _with_center(mu, reach, seen)


def _ordered(order: tuple[int, int, int], shape: Shape) -> Shape:
    """A shape with its coordinates permuted to the axes `order`."""

    def placed(u: FloatArray, v: FloatArray) -> Coordinates:
        found = shape(u, v)
        x, y, z = (found[order.index(k)] for k in range(3))
        return x, y, z

    return placed


def _angle(u: FloatArray, x: float, y: float) -> FloatArray:
    """The angle of a turn, that of (x, y) in its middle: a patch that is narrowed to a part around
    there must not be cut in two by the seam."""
    return np.asarray(np.arctan2(y, x) + 2.0 * np.pi * (u - 0.5))


def _plane(height: float, reach: float) -> Shape:
    return lambda u, v: (
        np.full(u.shape, height),
        reach * (2.0 * u - 1.0),
        reach * (2.0 * v - 1.0),
    )


def _of_one(
    e: float, slope: float, square: int, flat: IntArray, constant: float, reach: float
) -> list[tuple[Shape, tuple[int, int]]]:
    """e z² + slope x + constant = 0: a parabolic cylinder, or parallel planes."""
    if slope != 0.0:
        order = (square, int(flat[0]), int(flat[1]))

        def parabola(u: FloatArray, v: FloatArray) -> Coordinates:
            z = reach * (2.0 * u - 1.0)
            return z, -e / slope * z * z, reach * (2.0 * v - 1.0)

        return [(_ordered(order, parabola), STRAIGHT)]
    height2 = -constant / e
    order = (square, int(flat[0]), int(flat[1]))
    heights = (np.sqrt(height2), -np.sqrt(height2)) if height2 > 0.0 else ()
    return [(_ordered(order, _plane(h, reach)), (1, 1)) for h in heights]


def _paraboloid(k: FloatArray, reach: float, seen: FloatArray) -> Shape:
    """z = k_0 x² + k_1 y²."""
    if k[0] * k[1] < 0.0:

        def saddle(u: FloatArray, v: FloatArray) -> Coordinates:
            x, y = reach * (2.0 * u - 1.0), reach * (2.0 * v - 1.0)
            return x, y, k[0] * x * x + k[1] * y * y

        return saddle
    a = 1.0 / np.sqrt(np.abs(k))
    end = min(np.sqrt(reach), reach / a.min())

    def bowl(u: FloatArray, v: FloatArray) -> Coordinates:
        phi, s = _angle(u, seen[0] / a[0], seen[1] / a[1]), end * v
        return a[0] * s * np.cos(phi), a[1] * s * np.sin(phi), np.sign(k[0]) * s * s

    return bowl


def _cones(
    eigenvalues: FloatArray, square: IntArray, reach: float, seen: FloatArray
) -> list[tuple[Shape, tuple[int, int]]]:
    """sum e z² = 0: two nappes, or two planes that cross."""
    positive = eigenvalues[square] > 0.0
    if positive.all() or not positive.any():
        return []
    if len(square) == 2:
        i, j = int(square[0]), int(square[1])
        ratio = np.sqrt(-eigenvalues[i] / eigenvalues[j])
        order = (i, j, 3 - i - j)
        halves = []
        # In halves: where the planes cross, f's gradient, and so the front, changes sides.
        for side, sign in ((-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)):

            def half(
                u: FloatArray, v: FloatArray, side: float = side, sign: float = sign
            ) -> Coordinates:
                z = side * reach * u
                return z, sign * ratio * z, reach * (2.0 * v - 1.0)

            halves.append((_ordered(order, half), (1, 1)))
        return halves
    alone = int(square[np.flatnonzero(positive if positive.sum() == 1 else ~positive)[0]])
    i, j = (k for k in range(3) if k != alone)
    a, b = (np.sqrt(-eigenvalues[alone] / eigenvalues[k]) for k in (i, j))
    nappes = []
    for sign in (-1.0, 1.0):

        def nappe(u: FloatArray, v: FloatArray, sign: float = sign) -> Coordinates:
            phi, s = _angle(u, seen[i] / a, seen[j] / b), reach * v
            return a * s * np.cos(phi), b * s * np.sin(phi), sign * s

        nappes.append((_ordered((i, j, alone), nappe), STRAIGHT))
    return nappes


def _with_center(
    mu: FloatArray, reach: float, seen: FloatArray
) -> list[tuple[Shape, tuple[int, int]]]:
    """sum mu z² = 1, where at most one mu is zero: ellipsoids, hyperboloids, and cylinders."""
    positive = np.flatnonzero(mu > 0.0)
    rest = np.flatnonzero(mu <= 0.0)
    a = 1.0 / np.sqrt(np.where(mu != 0.0, np.abs(mu), 1.0))
    if len(positive) == 3:

        def ellipsoid(u: FloatArray, v: FloatArray) -> Coordinates:
            phi, theta = _angle(u, seen[0] / a[0], seen[1] / a[1]), np.pi * v
            s = np.sin(theta)
            return a[0] * s * np.cos(phi), a[1] * s * np.sin(phi), a[2] * np.cos(theta)

        return [(ellipsoid, CURVED)]
    if len(positive) == 2:
        i, j, k = int(positive[0]), int(positive[1]), int(rest[0])
        straight = mu[k] == 0.0
        end = reach if straight else np.arcsinh(reach / a[k])

        def hyperboloid(u: FloatArray, v: FloatArray) -> Coordinates:
            phi = _angle(u, seen[i] / a[i], seen[j] / a[j])
            s = end * (2.0 * v - 1.0)
            wide, high = (1.0, s) if straight else (np.cosh(s), a[k] * np.sinh(s))
            return a[i] * wide * np.cos(phi), a[j] * wide * np.sin(phi), high

        return [(_ordered((i, j, k), hyperboloid), STRAIGHT if straight else CURVED)]
    if len(positive) == 0:
        return []
    i, (j, k) = int(positive[0]), (int(x) for x in sorted(rest, key=lambda x: mu[x]))
    straight = mu[k] == 0.0  # the axis along which nothing changes
    end = np.arccosh(max(1.0, reach / a[i]))

    def sheet(sign: float, u: FloatArray, v: FloatArray) -> Coordinates:
        if straight:
            s = end * (2.0 * u - 1.0)
            return sign * a[i] * np.cosh(s), a[j] * np.sinh(s), reach * (2.0 * v - 1.0)
        phi, s = _angle(u, seen[j] / a[j], seen[k] / a[k]), end * v
        y, z = a[j] * np.sinh(s) * np.cos(phi), a[k] * np.sinh(s) * np.sin(phi)
        return sign * a[i] * np.cosh(s), y, z

    cells = STRAIGHT if straight else CURVED
    return [(_ordered((i, j, k), partial(sheet, sign)), cells) for sign in (-1.0, 1.0)]
