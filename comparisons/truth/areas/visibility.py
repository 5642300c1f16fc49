"""Visibility: shadows, penumbrae, and what a floor sees of a sky.  The usual view, from below what
throws the shadow."""

from collections.abc import Callable

import numpy as np

from comparisons.truth.areas.photometry import disk, disk_rate
from comparisons.truth.case import Expected, FloatArray, case, derivative
from comparisons.truth.film import (
    View,
    drawn_from_above,
    mix,
    pixel_means,
    seen_from_above,
    swept_from_above,
    turn,
)
from comparisons.truth.optics import floor_irradiance

RHO = np.array([0.8, 0.5, 0.2])
LIGHT = np.array([3.0, 2.0, 1.0])
SKY = np.array([0.5, 1.0, 2.0])
SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def _at(corners: FloatArray, z: float) -> FloatArray:
    return np.column_stack([corners, np.full(len(corners), z)])


@case(
    r"$\frac{\rho E \cos\theta}{\pi} (1 - A)$, $A$ the shadow's area in the pixel",
    "the shadow of a sphere",
)
def shadow_of_sphere(radius: float = 0.5) -> Expected:
    """Parallel light makes a cylinder of shadow, which a floor cuts in an ellipse: it is longer by
    1 / cos along the light, and moved by height times tangent."""
    ring, place, cosine = _shadow()
    share = drawn_from_above(radius * ring + place, 3.0, 32)
    return Expected(mix(share, 0.0, RHO * LIGHT * cosine / np.pi), 1e-9)


@derivative(
    "shapes[1].radius", shadow_of_sphere, "radius",
    r"$-\frac{\rho E \cos\theta}{\pi} \int (v \cdot n) ds$ over the shadow's outline in the pixel",
    spp=4096, step=1 / 64,
)  # fmt: skip
def shadow_of_sphere_by_radius() -> Expected:
    """The shadow grows about its middle."""
    ring, place, cosine = _shadow()
    rate = swept_from_above(0.5 * ring + place, ring, 3.0, 32)
    return Expected(rate[..., None] * -RHO * LIGHT * cosine / np.pi, 1e-9)


def _shadow() -> tuple[FloatArray, FloatArray, float]:
    """The outline of the shadow of a unit sphere about its middle, that place, and the cosine."""
    to = np.array([1.0, 0.5, 1.5])
    cosine = to[2] / np.linalg.norm(to)
    along = to[:2] / np.linalg.norm(to[:2])
    c, s = turn()
    ring = c[:, None] / cosine * along + s[:, None] * [-along[1], along[0]]
    return ring, [0.7, 0.4] - 1.5 * to[:2] / to[2], float(cosine)


@case(
    r"$\frac{\rho E}{\pi d^2} (1 - A)$, $A$ the shadow's area in the pixel", "a shadow from a point"
)
def shadow_of_triangle() -> Expected:
    """A projector at height 2 lights the floor evenly, and shows a triangle at height 0.8 larger by
    2 / 1.2, away from the point below it."""
    corners = np.array([[-0.4, -0.5], [0.6, -0.1], [0.0, 0.5]])
    share = drawn_from_above((corners - 0.1) * 2.0 / 1.2 + 0.1, 3.0, 32)
    return Expected(mix(share, 0.0, RHO * LIGHT / 4.0 / np.pi))


@case(
    r"$\frac{\rho L}{2 \pi} \sum_k \beta_k \cos\gamma_k$ over the edges of the part that is seen",
    "a penumbra",
)
def penumbra_of_edge(place: float = 30.0) -> Expected:
    """A square lamp at height 2, a screen x > 0 at height 1: from x the lamp is seen up to -x.
    Umbra and penumbra end at borders of pixels."""

    def irradiance(x: FloatArray, y: FloatArray) -> FloatArray:
        end = np.clip(2.0 * (place - 30.0) - x, -0.5, 0.5)
        low, z = np.full_like(x, -0.5), np.full_like(x, 2.0)
        corners = [(low, low, z), (end, low, z), (end, -low, z), (low, -low, z)]
        part = np.stack([np.stack(c, axis=-1) for c in corners], axis=-2)
        return np.where(end > -0.5, floor_irradiance(part, x, y), 0.0)

    share = seen_from_above(irradiance, 2.0, 32)
    return Expected(share[..., None] * RHO * LIGHT / np.pi)


@derivative(
    "shapes[1].transform[1].translate[0]", penumbra_of_edge, "place",
    r"$\frac{2 \rho L h^2}{\pi} \int \frac{1}{d^4} dv$ over the lamp's line at the edge",
    spp=4096, step=1 / 64,
)  # fmt: skip
def penumbra_of_edge_by_place() -> Expected:
    """The screen's edge, half way to the lamp, uncovers it twice as fast as it moves: the boundary
    term of an integral over what is seen.  The integral along the line is elementary.  Where the
    penumbra ends the derivative jumps; a step h moves that by 2 h: pixels there are not stated."""

    def rate(x: FloatArray, y: FloatArray) -> FloatArray:
        b = 4.0 * x * x + 4.0
        total = np.zeros_like(x)
        for end in (-0.5, 0.5):
            v = end - y
            part = v / (2.0 * b * (b + v * v)) + np.arctan(v / np.sqrt(b)) / (2.0 * b**1.5)
            total += np.sign(end) * part
        seen = np.where(np.abs(x) < 0.5, 8.0 * total, 0.0)
        return np.where(abs(np.abs(x) - 0.5) < 1 / 16, np.nan, seen)

    return Expected(seen_from_above(rate, 2.0, 32)[..., None] * RHO * LIGHT / np.pi)


@case(
    r"$\frac{\rho L h^2}{\pi} \int \frac{1}{d^4} dA$ over the segment that is seen",
    "a penumbra of a disk",
)
def penumbra_of_disk() -> Expected:
    """As `penumbra_of_edge` for a disk.  The integral along y is elementary; that along x = -a
    cos t is Gauss's with 24 nodes."""
    nodes, weights = np.polynomial.legendre.leggauss(24)
    a, h = 0.5, 2.0

    def irradiance(x: FloatArray, y: FloatArray) -> FloatArray:
        end = np.arccos(np.clip(x / a, -1.0, 1.0))[..., None]
        t = end * (nodes + 1.0) / 2.0
        b = h * h + (-a * np.cos(t) - x[..., None]) ** 2
        total = np.zeros_like(t)
        for side in (-1.0, 1.0):
            v = a * np.sin(t) * side - y[..., None]
            total += side * (
                v / (2.0 * b * (b + v * v)) + np.arctan(v / np.sqrt(b)) / (2.0 * b**1.5)
            )
        return np.asarray(h * h * (total * a * np.sin(t)) @ weights * end[..., 0] / 2.0)

    # Where the segment vanishes it does as the power 1.5: 1e-7 of a pixel.
    share = seen_from_above(irradiance, 2.0, 32)
    return Expected(share[..., None] * RHO * LIGHT / np.pi, 1e-6)


@case(
    r"$\rho L (1 - \frac{1}{2 \pi} \sum_k \beta_k \cos\gamma_k)$ over the wall's edges",
    "occlusion at a wall",
)
def wall_under_sky() -> Expected:
    """A black wall takes its form factor from the sky: half of the sine of the angle under which
    it is seen, if it is long."""
    wall = np.array(
        [[-1.0, -900.0, 0.0], [-1.0, 900.0, 0.0], [-1.0, 900.0, 1.5], [-1.0, -900.0, 1.5]]
    )
    share = seen_from_above(lambda x, y: 1.0 - floor_irradiance(wall, x, y) / np.pi, 1.8, 32)
    return Expected(share[..., None] * RHO * SKY)


@case(r"$\rho L (1 - \frac{r^3}{d^3})$", "occlusion by a sphere that stands on the floor")
def sphere_under_sky(place: float = -1.1) -> Expected:
    """A black sphere takes (r / d)^2 cos from the sky; its centre is at the height r, so that the
    cosine is r / d."""

    def irradiance(x: FloatArray, y: FloatArray) -> FloatArray:
        return np.asarray(1.0 - (0.5 / np.sqrt((x - place) ** 2 + y**2 + 0.25)) ** 3)

    return Expected(seen_from_above(irradiance, 1.0, 32)[..., None] * RHO * SKY)


@derivative(
    "shapes[1].center[0]", sphere_under_sky, "place", r"$-\rho L \frac{3 r^3 (x - x_0)}{d^5}$",
    spp=32768, step=1 / 64
)  # fmt: skip
def sphere_under_sky_by_place() -> Expected:
    """r^3 / d^3 by the place x_0: as the sphere comes nearer the floor sees less sky."""

    def rate(x: FloatArray, y: FloatArray) -> FloatArray:
        d2 = (x + 1.1) ** 2 + y**2 + 0.25
        return np.asarray(-3.0 * 0.125 * (x + 1.1) / d2**2.5)

    return Expected(seen_from_above(rate, 1.0, 32)[..., None] * RHO * SKY)


@case(
    r"$\rho L \frac{1}{2} (1 + \frac{h^2 + r^2 - a^2}{\sqrt{(h^2 + r^2 + a^2)^2 - 4 a^2 r^2}})$",
    "occlusion by a disk",
    "Howell & Mengüç, A Catalog of Radiation Transfer Configuration Factors, B-13",
)
def disk_under_sky(radius: float = 0.5) -> Expected:
    """A black disk takes its form factor from the sky, as `disk_lamp` gives it."""
    return _below_disk(lambda r2: np.pi - disk(r2, 1.0, radius))


@derivative(
    "shapes[1].transform[0].scale", disk_under_sky, "radius",
    r"$-\rho L a (\frac{1}{S} + \frac{(z - 2 a^2) (z - 2 r^2)}{S^3})$, $z = h^2 + r^2 + a^2$, "
    r"$S^2 = z^2 - 4 a^2 r^2$", spp=8192, step=1 / 32
)  # fmt: skip
def disk_under_sky_by_radius() -> Expected:
    """Only the disk's edge changes what the floor sees: the sky's radiance and the disk's are
    constant, so that the integral of their derivatives is 0."""
    return _below_disk(lambda r2: -disk_rate(r2, 1.0, 0.5))


def _below_disk(irradiance: Callable[[FloatArray], FloatArray]) -> Expected:
    half = np.tan(np.radians(30.0))
    view = View((0, 0, 0.9), (0, 0, 0), (0, 1, 0), (half, half), (32, 32))

    def radiance(x: FloatArray, y: FloatArray) -> FloatArray:
        return irradiance(0.81 * (1.0 / view.rays(x, y)[..., 2] ** 2 - 1.0))

    return Expected(pixel_means(radiance, 32, 32) * 0.8 / np.pi)


@case(r"$\rho L (1 - F_{screen} + F_{hole})$, form factors by Lambert", "the sky through a hole")
def hole_in_screen() -> Expected:
    """A black screen at height 1, 60 wide, with a square hole of 0.8: what is seen of the sky is
    the hole, and the little around the screen."""
    screen, hole = _at(30.0 * SQUARE, 1.0), _at(0.4 * SQUARE, 1.0)

    def seen(x: FloatArray, y: FloatArray) -> FloatArray:
        closed = floor_irradiance(screen, x, y) - floor_irradiance(hole, x, y)
        return 1.0 - closed / np.pi

    return Expected(seen_from_above(seen, 2.0, 32)[..., None] * RHO * SKY)


@case(r"$\frac{\rho E}{\pi}$, and 0 below the screen", "a shadow across a gap of 5e-5")
def narrow_gap() -> Expected:
    """A screen x > 0 hovers 5e-5 above the floor, and the camera is in the gap.  Rays that start a
    fixed distance off their surface to avoid hitting it start beyond the screen."""
    pixels = np.zeros((32, 32, 3))
    pixels[:, :16] = RHO * LIGHT / np.pi
    return Expected(pixels)
