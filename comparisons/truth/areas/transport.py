"""Transport: light that is scattered more than once."""

import numpy as np

from comparisons.truth.case import Expected, FloatArray, case, derivative
from comparisons.truth.film import View, mix, seen_from_above
from comparisons.truth.optics import floor_irradiance, fresnel

RHO = np.array([0.8, 0.5, 0.2])
LAMP = np.array([3.0, 2.0, 1.0])
SHINE = np.array([0.3, 0.5, 1.0])


@case(r"$\frac{L}{1 - \rho}$", "a closed room that shines and scatters")
def closed_room(rho: FloatArray = RHO) -> Expected:
    """Every point sees the same radiance B from everywhere: B = L + rho B."""
    return Expected(np.broadcast_to(SHINE / (1.0 - rho), (32, 32, 3)).copy())


@derivative(
    "materials.matte.reflectance", closed_room, "rho", r"$\frac{L}{(1 - \rho)^2}$", spp=2048
)  # fmt: skip
def closed_room_by_reflectance() -> Expected:
    """B' = B + rho B': the derivative is a radiance as well, of a room that shines with B."""
    return Expected(np.broadcast_to(SHINE / (1.0 - RHO) ** 2, (32, 32, 3)).copy())


@case(r"$L (1 + \rho + \rho^2 + \rho^3)$", "paths by their length")
def path_lengths(rho: FloatArray = RHO) -> Expected:
    """As `closed_room`, cut after 4 edges."""
    total = sum(rho**k for k in range(4))
    return Expected(np.broadcast_to(SHINE * total, (32, 32, 3)).copy())


@derivative("materials.matte.reflectance", path_lengths, "rho", r"$L (1 + 2 \rho + 3 \rho^2)$")
def path_lengths_by_reflectance() -> Expected:
    """A path of k bounces has k reflectances, each of which may move."""
    total = sum(k * RHO ** (k - 1) for k in range(1, 4))
    return Expected(np.broadcast_to(SHINE * total, (32, 32, 3)).copy())


@case(
    r"$L_1 = L + \rho_1 L_2$, $L_2 = \rho_2 (F L_1 + (1 - F) L_2)$, $F = \frac{r^2}{R^2}$",
    "a sphere in a sphere",
)
def sphere_in_sphere(radius: float = 3.0) -> Expected:
    """The inner sphere sees the outer one alone; of the light that leaves the outer one, the share
    F meets the inner one, by reciprocity of the areas."""
    rho1, rho2, f = np.array([0.1, 0.4, 0.7]), RHO, 1.0 / radius**2
    outer = rho2 * f * LAMP / (1.0 - rho2 * (1.0 - f) - rho2 * f * rho1)
    return Expected(mix(_inner_sphere(), LAMP + rho1 * outer, outer), 1e-9)


def _inner_sphere() -> FloatArray:
    half = np.tan(np.radians(35.0))
    view = View((0, 0, 2.5), (0.5, 0.3, 0), (0, 1, 0), (half, half), (32, 32))
    return view.sphere((0, 0, 0), 1.0)


@derivative(
    "shapes[1].radius", sphere_in_sphere, "radius",
    r"$L_2' = -\frac{2 F}{R} \frac{\rho_2 (1 - \rho_2) L}"
    r"{(1 - \rho_2 (1 - F) - \rho_2 F \rho_1)^2}$, $L_1' = \rho_1 L_2'$", spp=2048, step=1 / 16
)  # fmt: skip
def sphere_in_sphere_by_radius() -> Expected:
    """The quotient rule by F, which is r^2 / R^2: F' = -2 F / R."""
    rho1, rho2, f = np.array([0.1, 0.4, 0.7]), RHO, 1.0 / 9.0
    below = 1.0 - rho2 * (1.0 - f) - rho2 * f * rho1
    outer = rho2 * (1.0 - rho2) * LAMP / below**2 * -2.0 * f / 3.0
    return Expected(mix(_inner_sphere(), rho1 * outer, outer), 1e-9)


@case(r"$L_1 = L + \rho_1 L_2$, $L_2 = \rho_2 L_1$", "an infinite canyon")
def canyon() -> Expected:
    """All light that leaves a wall meets the other one, but for 1e-10: the walls are 2e5 times as
    wide as their distance.  The middle of the picture sees past their ends, by 1e-4 of a column."""
    rho1, rho2 = np.array([0.7, 0.5, 0.3]), RHO
    left = LAMP / (1.0 - rho1 * rho2)
    pixels = np.empty((32, 32, 3))
    pixels[:, :16], pixels[:, 16:] = left, rho2 * left
    return Expected(pixels, 5e-5)


@case(
    r"$\rho \rho_m L \frac{1}{\pi} \int \frac{h^2}{d^4} dA$ over the mirror's outline",
    "the caustic of a mirror on its axis",
)
def caustic() -> Expected:
    """An ellipsoid sends rays from near one focus to near the other, where the ball is larger than
    their spread: 0.04 off the focus they miss the ball's centre by at most 0.12 of 0.3.  So a point
    of the floor sees the radiance rho_m L in the whole mirror, whose outline is an ellipse of half
    axes 1 and 0.8 at the height 0.6; radiance does not tell an ellipse from the mirror in it.
    Gauss's rule along the radius and 32 angles: 1e-14."""
    radius, weight = np.polynomial.legendre.leggauss(16)
    radius, weight = (radius + 1.0) / 2.0, weight / 2.0
    angle = np.arange(32) * 2.0 * np.pi / 32
    r, a = np.meshgrid(radius, angle, indexing="ij")
    across, up = r * np.cos(a) - 0.75, 0.8 * r * np.sin(a)
    area = 0.8 * r * weight[:, None] * 2.0 * np.pi / 32

    def irradiance(x: FloatArray, y: FloatArray) -> FloatArray:
        d2 = (across - x[..., None, None]) ** 2 + (up - y[..., None, None]) ** 2 + 0.36
        return np.asarray((0.36 / d2**2 * area).sum(axis=(-2, -1)))

    share = seen_from_above(irradiance, 0.06, 32, 2)
    return Expected(share[..., None] * RHO * np.array([0.9, 0.8, 0.7]) * LAMP / np.pi)


@case(
    r"$\rho \frac{\rho_w E}{\pi} F_w$, $F_w$ the wall's form factor", "light of a wall on a floor"
)
def wall_to_floor() -> Expected:
    """Parallel light along the floor meets a wall alone, which then is a lamp of one radiance,
    rho_w E / pi.  Paths of three edges."""
    wall = np.array([[-1.0, -1.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, 1.0, 2.0], [-1.0, -1.0, 2.0]])
    share = seen_from_above(lambda x, y: floor_irradiance(wall, x, y), 1.0, 32)
    return Expected(share[..., None] * RHO * np.array([0.4, 0.6, 0.9]) * LAMP / np.pi**2)


@case(r"$\rho L (F_{lamp} + \rho_m F_{image})$", "the image of a lamp in a mirror")
def mirror_image() -> Expected:
    """A mirror at x = -1 makes of the lamp at x = 0.5 one at x = -2.5, dimmer by its reflectance:
    the caustic of a flat mirror."""
    lamp = np.array([[-0.8, -0.8, 1.5], [0.8, -0.8, 1.5], [0.8, 0.8, 1.5], [-0.8, 0.8, 1.5]])

    def share(x: FloatArray, y: FloatArray) -> FloatArray:
        direct = floor_irradiance(lamp + np.array([0.5, 0.0, 0.0]), x, y)[..., None]
        image = floor_irradiance(lamp - np.array([2.5, 0.0, 0.0]), x, y)[..., None]
        return np.asarray(direct + image * [0.9, 0.8, 0.7])

    return Expected(seen_from_above(share, 1.8, 32) * RHO * LAMP / np.pi)


@case(r"$\frac{\rho L h^2}{\pi} \int \frac{1 - F}{(1 + F) d^4} dA$ over the lamp", "a window")
def window() -> Expected:
    """A level lamp through a level pane.  Gauss's rule over the lamp, 16 x 16."""
    nodes, weights = np.polynomial.legendre.leggauss(16)

    def irradiance(x: FloatArray, y: FloatArray) -> FloatArray:
        total = np.zeros_like(x)
        for u, wu in zip(1.5 * nodes, 1.5 * weights, strict=True):
            for v, wv in zip(1.5 * nodes, 1.5 * weights, strict=True):
                d2 = (x - u) ** 2 + (y - v) ** 2 + 2.25
                f = fresnel(1.5 / np.sqrt(d2), 1.5)
                total += wu * wv * (1.0 - f) / (1.0 + f) * 2.25 / d2**2
        return total

    return Expected(seen_from_above(irradiance, 4.0, 16, 3)[..., None] * RHO * LAMP / np.pi, 1e-8)
