"""Visibility: shadows, penumbrae, and what a floor sees of a sky.  The usual view, from below what
throws the shadow."""

import numpy as np

from comparisons.truth.case import Expected, FloatArray, case
from comparisons.truth.film import drawn_from_above, mix, seen_from_above, turn
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
def shadow_of_sphere() -> Expected:
    """Parallel light makes a cylinder of shadow, which a floor cuts in an ellipse: it is longer by
    1 / cos along the light, and moved by height times tangent."""
    to = np.array([1.0, 0.5, 1.5])
    cosine = to[2] / np.linalg.norm(to)
    along = to[:2] / np.linalg.norm(to[:2])
    c, s = turn()
    ring = 0.5 * (c[:, None] / cosine * along + s[:, None] * [-along[1], along[0]])
    share = drawn_from_above(ring - 1.5 * to[:2] / to[2] + [0.7, 0.4], 3.0, 32)
    return Expected(mix(share, 0.0, RHO * LIGHT * cosine / np.pi), 1e-9)


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
def penumbra_of_edge() -> Expected:
    """A square lamp at height 2, a screen x > 0 at height 1: from x the lamp is seen up to -x.
    Umbra and penumbra end at borders of pixels."""

    def irradiance(x: FloatArray, y: FloatArray) -> FloatArray:
        end = np.clip(-x, -0.5, 0.5)
        low, z = np.full_like(x, -0.5), np.full_like(x, 2.0)
        corners = [(low, low, z), (end, low, z), (end, -low, z), (low, -low, z)]
        part = np.stack([np.stack(c, axis=-1) for c in corners], axis=-2)
        return np.where(end > -0.5, floor_irradiance(part, x, y), 0.0)

    share = seen_from_above(irradiance, 2.0, 32)
    return Expected(share[..., None] * RHO * LIGHT / np.pi)


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
def sphere_under_sky() -> Expected:
    """A black sphere takes (r / d)^2 cos from the sky; its centre is at the height r, so that the
    cosine is r / d."""

    def irradiance(x: FloatArray, y: FloatArray) -> FloatArray:
        return np.asarray(1.0 - (0.5 / np.sqrt((x + 1.1) ** 2 + y**2 + 0.25)) ** 3)

    return Expected(seen_from_above(irradiance, 1.0, 32)[..., None] * RHO * SKY)


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
