"""Solids, instances and meshes: areas of outlines, normals, a lens, interpolation."""

import numpy as np

from comparisons.truth.case import Expected, FloatArray, case, derivative
from comparisons.truth.film import (
    coverage,
    drawn_from_above,
    mix,
    seen_from_above,
    swept_from_above,
    turn,
)
from comparisons.truth.optics import floor_irradiance, fresnel

WARM, COLD = np.array([1.0, 0.5, 0.2]), np.array([0.05, 0.1, 0.2])
RHO = np.array([0.8, 0.5, 0.2])
SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def _circle(radius: float, x: float = 0.0, y: float = 0.0) -> FloatArray:
    c, s = turn()
    return np.stack([x + radius * c, y + radius * s], axis=1)


def _drawn(*signed: tuple[float, FloatArray], width: float = 2.4) -> Expected:
    """Areas that shine, over sky, added and taken."""
    share = sum(sign * drawn_from_above(outline, width, 32) for sign, outline in signed)
    return Expected(mix(np.asarray(share), WARM, COLD), 1e-9)


@case(r"$L A$, $A$ the area of a square minus a circle", "the difference of solids")
def drilled_box() -> Expected:
    """A box that a cylinder pierces, seen along it."""
    return _drawn((1.0, 0.9 * SQUARE), (-1.0, _circle(0.55, 0.2, 0.1)))


SWEPT = r"$L \int (v \cdot n) ds$ over the outline in the pixel, $v$ its velocity on the film"


@case(r"$L A$, $A$ the area of two circles' lens", "the intersection of solids")
def two_balls_common() -> Expected:
    """Balls with their centres across the view: the outline of what they share is the lens that
    their outlines share, two arcs of acos(d / r)."""
    reach = np.arccos(0.5)
    angle = np.linspace(-reach, reach, 1 << 16)
    right = np.stack([-0.4 + 0.8 * np.cos(angle), 0.1 + 0.8 * np.sin(angle)], axis=1)
    return _drawn((1.0, np.concatenate([right, right * [-1.0, -1.0] + [0.0, 0.2]])))


@case(r"$L A$, $A$ the area of a square and a circle, minus what they share", "the union of solids")
def ball_and_box() -> Expected:
    """A ball whose middle is the box's corner: they share a quarter of the disk."""
    c, s = turn()
    keep = (c >= 0.0) & (s >= 0.0)
    first = np.stack([c[keep], s[keep]], axis=1)
    quarter = np.concatenate([[[0.0, 0.0]], first, [[0.0, 1.0]]]) * -0.5 + [0.4, 0.4]
    square = 0.6 * SQUARE - 0.2
    return _drawn((1.0, square), (1.0, _circle(0.5, 0.4, 0.4)), (-1.0, quarter))


@case(r"$\frac{\rho E n_z}{\pi}$", "the inner normals of a solid")
def bitten_box() -> Expected:
    """A ball of radius 1.25 whose middle is 0.75 above the top of a box leaves a bowl with a rim of
    radius 1, whose cosine is sqrt(1 - (r / 1.25)^2); the top is level.  Pixels on the rim are not
    stated."""

    def radiance(x: FloatArray, y: FloatArray) -> FloatArray:
        r = np.hypot(x, y)
        bowl = np.sqrt(1.0 - np.minimum(r, 1.0) ** 2 / 1.5625)
        near = np.where(abs(r - 1.0) < 0.06, np.nan, np.where(r < 1.0, bowl, 1.0))
        return np.asarray(near[..., None] * RHO * 4.0 / np.pi)

    return Expected(seen_from_above(radiance, 2.8, 32, 8), 1e-9)


@case(r"$(1 - F_1) (1 - F_2) L$ at the place where Snell's law sends the ray", "a solid's lens")
def solid_lens() -> Expected:
    """A plano-convex lens, the half of a ball of radius 2 below z = 0, index 1.5: rays along the
    axis pass the plane straight, and the ball bends them towards the axis by the difference of
    Snell's angles.  1 unit below its lowest point the lamp shines where x > 0.15: its image on the
    film is where the rays that get there entered.  The glass mirrors nothing."""
    radius, index, screen = 2.0, 1.5, 3.0

    def place(r: FloatArray) -> FloatArray:
        inside = np.arcsin(r / radius)
        outside = np.arcsin(np.minimum(index * r / radius, 1.0))
        z = np.sqrt(radius**2 - r * r)
        return np.asarray(r - (screen - z) * np.tan(outside - inside))

    def radiance(x: FloatArray, y: FloatArray) -> FloatArray:
        r = np.hypot(x, y)
        second = fresnel(np.cos(np.arcsin(np.minimum(index * r / radius, 1.0))), index)
        at = x * place(r) / np.maximum(r, 1e-12)
        close = abs(at - 0.15) < 0.05
        lit = (1.0 - second) * 0.96
        return np.asarray(np.where(close, np.nan, np.where(at > 0.15, lit, 0.0))[..., None] * WARM)

    return Expected(seen_from_above(radiance, 2.0, 32), 1e-8)


@case(
    r"$L A$, $A$ the area of the ellipse that a matrix makes of a circle",
    "an instance under a shear",
)
def sheared_ball(entry: float = 0.4) -> Expected:
    """The outline of the ball A s, seen along z, is the ellipse of the first two rows B of A: the
    root of B B^T takes the unit circle there."""
    rows = np.array([[0.8, 0.2, entry], [-0.1, 0.6, 0.3]])
    return _drawn((1.0, _circle(1.0) @ np.linalg.cholesky(rows @ rows.T).T + [0.1, -0.1]))


@derivative(
    "shapes[0].transform[0].matrix[0][2]", sheared_ball, "entry", SWEPT, spp=8192, step=1 / 32
)
def sheared_ball_by_matrix() -> Expected:
    """The ellipse reaches |B^T n| along its normal n, at the point B B^T n / |B^T n|; by an entry
    of B that is (B^T n) . (B'^T n) / |B^T n|."""
    rows, change = np.array([[0.8, 0.2, 0.4], [-0.1, 0.6, 0.3]]), np.zeros((2, 3))
    change[0, 2] = 1.0
    n = _circle(1.0)
    along = n @ rows
    reach = np.linalg.norm(along, axis=1, keepdims=True)
    velocity = n * (along * (n @ change)).sum(axis=1, keepdims=True) / reach
    rate = swept_from_above(along @ rows.T / reach + [0.1, -0.1], velocity, 2.4, 32)
    return Expected(rate[..., None] * (WARM - COLD), 1e-9)


@case(r"$L A$, $A$ the area of turned and scaled copies", "instances")
def three_copies() -> Expected:
    """A triangle, three times: each transform is applied from the first step to the last."""
    triangle = np.array([[-0.3, -0.4], [0.5, -0.2], [0.0, 0.6]])
    a = np.radians(40.0)
    turned = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
    copies = (
        triangle * 0.9 + [-0.6, 0.5],
        triangle @ turned.T * 0.8 + [0.6, 0.4],
        (triangle + np.array([0.2, 0.0])) * [-1.0, 0.7] + [0.1, -0.7],
    )
    return _drawn(*((1.0, c) for c in copies))


@case(r"$\frac{\rho E n_z}{\pi}$, $n$ interpolated", "vertex normals")
def mesh_normals() -> Expected:
    """A flat square whose vertex normals lean outwards: on each triangle they are linear, then made
    of length 1."""

    def radiance(x: FloatArray, y: FloatArray) -> FloatArray:
        # Linear on both triangles alike: n is (x / 2, y / 2, 1) before it is made of length 1.
        z = 1.0 / np.sqrt(1.0 + (x * x + y * y) / 4.0)
        return np.asarray(z[..., None] * RHO * 4.0 / np.pi)

    return Expected(seen_from_above(radiance, 1.9, 32))


@case(r"$\frac{c E}{\pi}$, $c$ linear", "vertex colours")
def mesh_colours() -> Expected:
    """Barycentric interpolation of colours at corners (0, 0), (1, 0) and (0, 1) is linear in x and
    y.  A mean over a pixel is that at its middle."""

    def radiance(x: FloatArray, y: FloatArray) -> FloatArray:
        u, v = (x + 0.95) / 1.9, (y + 0.95) / 1.9
        c = np.stack([0.1 + 0.8 * u, 0.2 + 0.6 * v, 0.9 - 0.5 * u - 0.3 * v], axis=-1)
        return np.asarray(c * 4.0 / np.pi)

    return Expected(seen_from_above(radiance, 1.9, 32))


def _star() -> FloatArray:
    angle = 2.0 * np.pi * 2.0 * np.arange(5) / 5 + np.pi / 2.0
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def _core() -> FloatArray:
    """The pentagon within a star of five points: its corners are turned, and nearer by cos 72 /
    cos 36."""
    angle = 2.0 * np.pi * np.arange(5) / 5 - np.pi / 2.0
    ratio = np.cos(np.radians(72.0)) / np.cos(np.radians(36.0))
    return np.asarray(ratio * np.stack([np.cos(angle), np.sin(angle)], axis=1))


@case(r"$L A$, $A$ the area of a pentagram without its core", "the even-odd rule of a polygon")
def star_even_odd() -> Expected:
    """The line of a star winds around its core twice, so that a signed area counts it twice: it is
    taken away twice."""
    share = coverage(_film(_star()), 32, 32) - 2.0 * coverage(_film(_core()), 32, 32)
    return Expected(mix(share, WARM, COLD))


@case(r"$L A$, $A$ the area of a pentagram with its core", "the non-zero rule of a polygon")
def star_nonzero() -> Expected:
    """As `star_even_odd`, the core taken away once."""
    share = coverage(_film(_star()), 32, 32) - coverage(_film(_core()), 32, 32)
    return Expected(mix(share, WARM, COLD))


def _film(points: FloatArray) -> FloatArray:
    return np.stack([(points[:, 0] / 2.4 + 0.5) * 32, (0.5 - points[:, 1] / 2.4) * 32], axis=1)


@case(
    r"$L A$, $A$ the area of the fields of a checker in the pixel",
    "surface coordinates and their map",
)
def checker_map() -> Expected:
    """u and v run from 0 to 1 over the square, times (3, 2), plus (0.1, 0): the first colour where
    both are in the same half of their unit intervals."""
    share = np.zeros((32, 32))
    for i in range(8):
        for j in range(5):
            if (i + j) % 2 == 0:
                u = (np.array([i, i + 1]) / 2.0 - 0.1) / 3.0
                v = np.array([j, j + 1]) / 4.0
                u, v = 2.0 * np.clip(u, 0.0, 1.0) - 1.0, 2.0 * np.clip(v, 0.0, 1.0) - 1.0
                share += drawn_from_above(
                    [[u[0], v[0]], [u[1], v[0]], [u[1], v[1]], [u[0], v[1]]], 1.9, 32
                )
    return Expected(mix(share, WARM, COLD))


@case(r"$L (1 + \rho + \rho^2 + \rho^3)$", "paths within a solid, by their length; roulette")
def solid_room() -> Expected:
    """The hollow of a box that a ball has left, whose walls shine and scatter, is a closed room of
    the solid's outside: paths of 4 edges, of which roulette may end all."""
    total = sum(RHO**k for k in range(4))
    return Expected(np.broadcast_to([0.3, 0.5, 1.0] * total, (32, 32, 3)).copy())


@case(r"$\frac{\rho L}{\pi} F_{lamp}$", "the light of a lamp on a solid", "Lambert 1760")
def lamp_on_solid() -> Expected:
    """The top of a box with a hollow beside the view, below a level lamp: light and material may
    both be sampled, and count once."""
    lamp = np.array([[-0.9, -0.7, 1.0], [0.7, -0.7, 1.0], [0.7, 0.9, 1.0], [-0.9, 0.9, 1.0]])
    share = seen_from_above(lambda x, y: floor_irradiance(lamp, x, y), 2.0, 32)
    return Expected(share[..., None] * RHO * WARM / np.pi)
