"""Any quadric as parametric patches, from its canonical form along its principal axes."""

from collections.abc import Callable
from functools import partial

import numpy as np

from comparisons.mitsuba.translate.shapes.stand_ins import Box, Patch
from reference_rt.core.arrays import FloatArray, IntArray

CURVED = (768, 384)
STRAIGHT = (2048, 4)
"""Cells of a patch that is curved along u and v, and of one that is straight along v: see
`quadrics.SIDE` for why that has more than one."""

ZERO = 1e-12
"""An eigenvalue below this fraction of the largest counts as 0."""

Coordinates = tuple[FloatArray, FloatArray, FloatArray]
Shape = Callable[[FloatArray, FloatArray], Coordinates]


def patches_of(matrix: FloatArray, linear: FloatArray, constant: float, box: Box) -> list[Patch]:
    """Patches of x^T M x + l x + c = 0 that cover its part in a box; they may reach beyond it."""
    eigenvalues, axes = np.linalg.eigh(matrix)
    eigenvalues[np.abs(eigenvalues) <= ZERO * np.abs(eigenvalues).max(initial=0.0)] = 0.0
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
    middle = 0.5 * (box[0] + box[1])
    reach = float(np.abs(axes.T @ middle - origin).max() + np.linalg.norm(box[1] - middle))
    shapes = _shapes(eigenvalues, slope, flat, constant, reach)

    def place(shape: Shape, u: FloatArray, v: FloatArray) -> FloatArray:
        return np.asarray((np.stack(shape(u, v), axis=-1) + origin) @ axes.T)

    found = [narrowed(Patch(partial(place, shape), cells), box) for shape, cells in shapes]
    return [patch for patch in found if patch is not None]


def narrowed(patch: Patch, box: Box) -> Patch | None:
    """The patch, limited to parameters near the box; None if it does not come near."""
    low, high = np.zeros(2), np.ones(2)
    for _ in range(6):
        sides = [np.linspace(a, b, 65) for a, b in zip(low, high, strict=True)]
        p = patch.point(*np.meshgrid(*sides, indexing="ij"))
        corners = np.stack([p[:-1, :-1], p[1:, :-1], p[:-1, 1:], p[1:, 1:]])
        lower, upper = corners.min(axis=0), corners.max(axis=0)
        # A cell's diagonal: more than its surface bulges out.
        margin = np.linalg.norm(upper - lower, axis=-1, keepdims=True)
        near = np.all((lower - margin <= box[1]) & (upper + margin >= box[0]), axis=-1)
        if not near.any():
            return None
        before = high - low
        for axis in (0, 1):
            kept = np.flatnonzero(near.any(axis=1 - axis))
            low[axis], high[axis] = sides[axis][kept[0]], sides[axis][kept[-1] + 1]
        if np.all(high - low > 0.9 * before):
            break
    size = high - low

    def point(u: FloatArray, v: FloatArray) -> FloatArray:
        return patch.point(low[0] + size[0] * u, low[1] + size[1] * v)

    return Patch(point, patch.cells)


def _shapes(
    eigenvalues: FloatArray, slope: float, flat: IntArray, constant: float, reach: float
) -> list[tuple[Shape, tuple[int, int]]]:
    """Patches of sum e_k z_k² + slope z_flat[0] + constant = 0 for |z_k| <= reach."""
    square = np.flatnonzero(eigenvalues)
    if len(square) == 0:
        return [(_ordered((flat[0], flat[1], flat[2]), _plane(0.0, reach)), (1, 1))]
    if len(square) == 1:
        return _of_one(eigenvalues[square[0]], slope, int(square[0]), flat, constant, reach)
    e = eigenvalues[square]
    if len(square) == 2 and slope != 0.0:
        order = (int(square[0]), int(square[1]), int(flat[0]))
        return [(_ordered(order, _paraboloid(e / -slope, reach)), CURVED)]
    if constant == 0.0:
        return _cones(eigenvalues, square, reach)
    mu = np.zeros(3)
    mu[square] = -e / constant  # sum mu z² = 1
    return _with_center(mu, reach)


def _ordered(order: tuple[int, int, int], shape: Shape) -> Shape:
    """A shape with its coordinates permuted to the axes `order`."""

    def placed(u: FloatArray, v: FloatArray) -> Coordinates:
        found = shape(u, v)
        x, y, z = (found[order.index(k)] for k in range(3))
        return x, y, z

    return placed


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


def _paraboloid(k: FloatArray, reach: float) -> Shape:
    """z = k_0 x² + k_1 y²."""
    if k[0] * k[1] < 0.0:

        def saddle(u: FloatArray, v: FloatArray) -> Coordinates:
            x, y = reach * (2.0 * u - 1.0), reach * (2.0 * v - 1.0)
            return x, y, k[0] * x * x + k[1] * y * y

        return saddle
    a = 1.0 / np.sqrt(np.abs(k))
    end = min(np.sqrt(reach), reach / a.min())

    def bowl(u: FloatArray, v: FloatArray) -> Coordinates:
        phi, s = 2.0 * np.pi * u, end * v
        return a[0] * s * np.cos(phi), a[1] * s * np.sin(phi), np.sign(k[0]) * s * s

    return bowl


def _cones(
    eigenvalues: FloatArray, square: IntArray, reach: float
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
            phi, s = 2.0 * np.pi * u, reach * v
            return a * s * np.cos(phi), b * s * np.sin(phi), sign * s

        nappes.append((_ordered((i, j, alone), nappe), STRAIGHT))
    return nappes


def _with_center(mu: FloatArray, reach: float) -> list[tuple[Shape, tuple[int, int]]]:
    """sum mu z² = 1, where at most one mu is zero: ellipsoids, hyperboloids, and cylinders."""
    positive = np.flatnonzero(mu > 0.0)
    rest = np.flatnonzero(mu <= 0.0)
    a = 1.0 / np.sqrt(np.where(mu != 0.0, np.abs(mu), 1.0))
    if len(positive) == 3:

        def ellipsoid(u: FloatArray, v: FloatArray) -> Coordinates:
            phi, theta = 2.0 * np.pi * u, np.pi * v
            s = np.sin(theta)
            return a[0] * s * np.cos(phi), a[1] * s * np.sin(phi), a[2] * np.cos(theta)

        return [(ellipsoid, CURVED)]
    if len(positive) == 2:
        i, j, k = int(positive[0]), int(positive[1]), int(rest[0])
        straight = mu[k] == 0.0
        end = reach if straight else np.arcsinh(reach / a[k])

        def hyperboloid(u: FloatArray, v: FloatArray) -> Coordinates:
            phi, s = 2.0 * np.pi * u, end * (2.0 * v - 1.0)
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
        phi, s = 2.0 * np.pi * u, end * v
        y, z = a[j] * np.sinh(s) * np.cos(phi), a[k] * np.sinh(s) * np.sin(phi)
        return sign * a[i] * np.cosh(s), y, z

    cells = STRAIGHT if straight else CURVED
    return [(_ordered((i, j, k), partial(sheet, sign)), cells) for sign in (-1.0, 1.0)]
