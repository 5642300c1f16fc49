"""From functions of film positions to pixels: exact means over footprints, and projections.

Film positions are in pixels: x to the right from 0 to the width, y down from 0 to the height."""

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from comparisons.truth.case import FloatArray

# ---- means over pixels --------------------------------------------------------------------------


def pixel_means(
    f: Callable[[FloatArray, FloatArray], FloatArray], width: int, height: int, order: int = 6
) -> FloatArray:
    """Means of f(x, y) over pixels by Gauss's rule with order x order nodes: exact to rounding for
    what is smooth in a pixel.  f returns (...) or (..., 3); NaN in a pixel makes it NaN."""
    nodes, weights = np.polynomial.legendre.leggauss(order)
    nodes, weights = (nodes + 1.0) / 2.0, weights / 2.0
    order = len(nodes)
    x = (np.arange(width)[:, None] + nodes).ravel()
    y = (np.arange(height)[:, None] + nodes).ravel()
    values = np.asarray(f(*np.meshgrid(x, y)))
    shaped = values.reshape(height, order, width, order, *values.shape[2:])
    return np.asarray(np.einsum("iajb...,a,b->ij...", shaped, weights, weights))


def coverage(polygon: npt.ArrayLike, width: int, height: int) -> FloatArray:
    """The share of each pixel inside a polygon (n, 2), exactly; at least 0 whatever its winding.

    Each edge is cut at the lines of the pixel grid.  A piece adds the area between itself and its
    pixel's right border, and its height to all pixels further right (as rasterisers of fonts do).
    """
    p = np.asarray(polygon, float)
    q = np.roll(p, -1, axis=0)
    cells = np.zeros((height, width + 1))
    beyond = np.zeros((height, width + 1))
    for a, b in _pieces(p, q, width, height):
        middle = (a + b) / 2.0
        rise = b[:, 1] - a[:, 1]
        row = np.floor(middle[:, 1]).astype(int)
        column = np.clip(np.floor(middle[:, 0]).astype(int), -1, width)
        inside = (row >= 0) & (row < height) & (column < width)
        row, column, rise, x = row[inside], column[inside], rise[inside], middle[inside, 0]
        left = column < 0
        column, x = np.where(left, 0, column), np.where(left, 0.0, x)
        np.add.at(cells, (row, column), rise * (column + 1.0 - x))
        np.add.at(beyond, (row, column + 1), rise)
    areas = (cells + np.cumsum(beyond, axis=1))[:, :width]
    return np.asarray(areas if areas.sum() >= 0.0 else -areas)


def _pieces(
    p: FloatArray, q: FloatArray, width: int, height: int
) -> list[tuple[FloatArray, FloatArray]]:
    """The edges p to q, cut at whole x and y, the first two of their columns."""
    short = np.all(np.floor(p[:, :2]) == np.floor(q[:, :2]), axis=1)
    pieces = [(p[short], q[short])]
    for a, b in zip(p[~short], q[~short], strict=True):
        cuts = [np.array([0.0, 1.0])]
        for axis, most in ((0, width), (1, height)):
            if a[axis] != b[axis]:
                lines = np.arange(0, most + 1)
                t = (lines - a[axis]) / (b[axis] - a[axis])
                cuts.append(t[(t > 0.0) & (t < 1.0)])
        t = np.unique(np.concatenate(cuts))[:, None]
        points = a + t * (b - a)
        pieces.append((points[:-1], points[1:]))
    return pieces


def swept(polygon: npt.ArrayLike, velocity: npt.ArrayLike, width: int, height: int) -> FloatArray:
    """The derivative of `coverage` as the corners (n, 2) move with a velocity (n, 2): of each pixel
    the integral, over the outline in it, of the velocity along the outer normal (Reynolds 1903).
    Exact where velocities are linear along edges."""
    p = np.hstack([np.asarray(polygon, float), np.broadcast_to(velocity, np.shape(polygon))])
    q = np.roll(p, -1, axis=0)
    rates = np.zeros((height, width))
    for a, b in _pieces(p, q, width, height):
        (x, y, u, v), step = ((a + b) / 2.0).T, b - a
        row, column = np.floor(y).astype(int), np.floor(x).astype(int)
        inside = (row >= 0) & (row < height) & (column >= 0) & (column < width)
        gain = u * step[:, 1] - v * step[:, 0]
        np.add.at(rates, (row[inside], column[inside]), gain[inside])
    turning = float((p[:, 0] * q[:, 1] - q[:, 0] * p[:, 1]).sum())
    return np.asarray(rates if turning >= 0.0 else -rates)


DENSE = 1 << 17
"""Corners of a polygon that stands in for a smooth outline: its area is (2 pi / n)² / 6, a part in
2.6e9, too small."""


def turn(n: int = DENSE) -> tuple[FloatArray, FloatArray]:
    """Cosines and sines of n equal steps around."""
    angle = 2.0 * np.pi * np.arange(n) / n
    return np.cos(angle), np.sin(angle)


def mix(share: FloatArray, inside: npt.ArrayLike, outside: npt.ArrayLike = 0.0) -> FloatArray:
    """(height, width, 3): radiance `inside` where the share is 1, `outside` where it is 0."""
    s = share[..., None]
    return np.asarray(s * np.broadcast_to(inside, 3) + (1.0 - s) * np.broadcast_to(outside, 3))


# ---- views --------------------------------------------------------------------------------------


def level(width: float, pixels: int) -> Callable[[FloatArray, FloatArray], tuple[FloatArray, ...]]:
    """World (x, y) of film positions of the usual view: orthographic, down the z axis, +y up."""

    def place(x: FloatArray, y: FloatArray) -> tuple[FloatArray, ...]:
        return (x / pixels - 0.5) * width, (0.5 - y / pixels) * width

    return place


def seen_from_above(
    f: Callable[[FloatArray, FloatArray], FloatArray], width: float, pixels: int, order: int = 6
) -> FloatArray:
    """Pixel means of f(world x, world y) in the usual view."""
    place = level(width, pixels)
    return pixel_means(lambda x, y: f(*place(x, y)), pixels, pixels, order)


def drawn_from_above(points: npt.ArrayLike, width: float, pixels: int) -> FloatArray:
    """The share of each pixel that a polygon of world (x, y) covers in the usual view."""
    p = np.asarray(points, float)
    film = np.stack([(p[:, 0] / width + 0.5) * pixels, (0.5 - p[:, 1] / width) * pixels], axis=1)
    return coverage(film, pixels, pixels)


def swept_from_above(
    points: npt.ArrayLike, velocity: npt.ArrayLike, width: float, pixels: int
) -> FloatArray:
    """`swept` of a polygon of world (x, y) in the usual view."""
    p, v = np.asarray(points, float), np.broadcast_to(velocity, np.shape(points))
    film = np.stack([(p[:, 0] / width + 0.5) * pixels, (0.5 - p[:, 1] / width) * pixels], axis=1)
    return swept(film, v / width * pixels * [1.0, -1.0], pixels, pixels)


class View:
    """A perspective view: rays through film positions, and the projection of points.

    half: (across, up), half the view rectangle at distance 1;  shift: of its centre, likewise.
    """

    def __init__(
        self,
        eye: Sequence[float],
        target: Sequence[float],
        up: Sequence[float],
        half: tuple[float, float],
        size: tuple[int, int],
        shift: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        self.eye = np.array(eye, float)
        forward = np.array(target, float) - self.eye
        self.forward = forward / np.linalg.norm(forward)
        right = np.cross(self.forward, up)
        self.right = right / np.linalg.norm(right)
        self.up = np.cross(self.right, self.forward)
        self.half, self.size, self.shift = half, size, shift

    def rays(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Directions (..., 3) of length 1 through film positions."""
        a = self.shift[0] + self.half[0] * (2.0 * x / self.size[0] - 1.0)
        b = self.shift[1] + self.half[1] * (1.0 - 2.0 * y / self.size[1])
        d = self.forward + a[..., None] * self.right + b[..., None] * self.up
        return np.asarray(d / np.linalg.norm(d, axis=-1, keepdims=True))

    def project(self, points: npt.ArrayLike) -> FloatArray:
        """Film positions (n, 2) of points (n, 3) in front of the eye."""
        v = np.asarray(points, float) - self.eye
        z = v @ self.forward
        a = (v @ self.right / z - self.shift[0]) / self.half[0]
        b = (v @ self.up / z - self.shift[1]) / self.half[1]
        return np.stack([(a + 1.0) / 2.0 * self.size[0], (1.0 - b) / 2.0 * self.size[1]], axis=1)

    def drawn(self, points: npt.ArrayLike) -> FloatArray:
        """The share of each pixel that a polygon of points (n, 3) covers."""
        return coverage(self.project(points), *self.size)

    def swept(self, points: npt.ArrayLike, velocity: npt.ArrayLike) -> FloatArray:
        """`swept` of a polygon of points (n, 3) with velocities: the quotient rule of `project`."""
        v = np.asarray(points, float) - self.eye
        moves = np.broadcast_to(velocity, v.shape)
        z, along = v @ self.forward, moves @ self.forward
        a, b = (
            (moves @ axis - v @ axis / z * along) / z / half
            for axis, half in zip((self.right, self.up), self.half, strict=True)
        )
        film = np.stack([a / 2.0 * self.size[0], -b / 2.0 * self.size[1]], axis=1)
        return swept(self.project(points), film, *self.size)

    def tangents(self, center: Sequence[float], radius: float) -> tuple[FloatArray, FloatArray]:
        """Points (n, 3) on rays that touch a sphere, and their derivatives by its radius."""
        to = np.array(center, float) - self.eye
        distance = float(np.linalg.norm(to))
        axis = to / distance
        sin = radius / distance
        u = np.cross(axis, self.up)
        u /= np.linalg.norm(u)
        c, s = turn()
        ring = c[:, None] * u + s[:, None] * np.cross(axis, u)
        cos = np.sqrt(1.0 - sin**2)
        return self.eye + cos * axis + sin * ring, (ring - sin / cos * axis) / distance

    def sphere(self, center: Sequence[float], radius: float) -> FloatArray:
        """The share of each pixel that a sphere covers: the cone of its tangents is cut by the film
        in an ellipse."""
        return self.drawn(self.tangents(center, radius)[0])
