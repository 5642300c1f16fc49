"""Whitted's recursive ray tracing: what each bounce adds, glass from within, lit quadrics, unions.

Nothing here has noise but for the places of samples in a pixel."""

import numpy as np

from comparisons.truth.areas.materials import FRESNEL, HALF, LAMP, SKY
from comparisons.truth.case import Expected, FloatArray, case
from comparisons.truth.film import View, drawn_from_above, mix, pixel_means, seen_from_above
from comparisons.truth.optics import fresnel


def _in_turn(
    first: FloatArray, second: FloatArray, rho: FloatArray, count: int, reach: float
) -> Expected:
    """Two mirrors that face each other, left and right: what each adds at every hit, `count` hits
    in all.  They are 2 apart and end at `reach`: columns of rays that get there are not stated."""
    pixels = np.empty((32, 32, 3))
    for half, pair in ((slice(None, 16), (first, second)), (slice(16, None), (second, first))):
        pixels[:, half] = np.sum([rho**k * pair[k % 2] for k in range(count)], axis=0)
    slope = np.tan(np.radians(30.0)) * np.abs(np.arange(33) / 16.0 - 1.0)
    ends = 2.0 * count > reach * np.minimum(slope[:-1], slope[1:])
    pixels[:, ends] = np.nan
    return Expected(pixels)


@case(
    r"$L_0 + \rho L_1 + \rho^2 L_2 + ...$, of both sides in turn", "the depth of the tree of rays"
)
def whitted_depth() -> Expected:
    """Two mirrors that shine by themselves, with a and b: a + rho b + rho^2 a + ..., up to the
    mirrored ray number n = 12, the last one that may be traced."""
    a, b = np.array([1.0, 0.5, 0.2]), np.array([0.1, 0.4, 1.0])
    return _in_turn(a, b, np.array([0.9, 0.8, 0.7]), 13, 1e6)


@case(
    r"$I_a (k_0 + k_r k_1 + k_r^2 k_2 + ...)$, of both sides in turn",
    "ambient light after mirrorings",
    "Whitted 1980",
)
def whitted_ambient() -> Expected:
    """As `whitted_depth`: at every hit the ambient term k_a I_a, times the colour of all mirrors on
    the way there; n = 6."""
    a, b, light = np.array([0.3, 0.2, 0.1]), np.array([0.05, 0.2, 0.4]), 1.5
    return _in_turn(light * a, light * b, np.array([0.8, 0.6, 0.4]), 7, 100.0)


@case(
    r"$k_r (k_a I_a + k_d E (n \cdot l) + k_s E (r \cdot v)^p)$",
    "the light of a surface that a mirror shows",
    "Phong 1975; Whitted 1980",
)
def whitted_lit_mirror() -> Expected:
    """A mirror at 45 degrees turns the view, which is against z, towards -x, where a wall stands in
    parallel light along (-2, -1, 0): of one radiance.  The mirror is 1.2 wide, before a sky."""
    light = np.array([2.0, 1.0, 0.0]) / np.sqrt(5.0)
    n = np.array([1.0, 0.0, 0.0])
    highlight = (2.0 * (n @ light) * n - light)[0] ** 5
    wall = np.array([0.1, 0.05, 0.02]) * 0.5
    wall = wall + 2.0 * (np.array([0.1, 0.3, 0.2]) * light[0] + 0.2 * highlight)
    mirror = [[-0.6, -1.2], [0.6, -1.2], [0.6, 1.2], [-0.6, 1.2]]
    return Expected(mix(drawn_from_above(mirror, 2.0, 32), [0.9, 0.7, 0.5] * wall, SKY / 10.0))


@case(
    r"$(F + (1 - F) \tau \eta^2) L$, $F = 1$ beyond the critical angle",
    "radiance inside glass, by recursive ray tracing",
    FRESNEL,
)
def whitted_in_glass() -> Expected:
    """Seen from glass, the sky above it is within the critical angle, and eta^2 = 2.56 as bright
    (times tau, the glass's colour); outside of it the boundary mirrors the sky below, all of it."""
    eta = 1.6
    critical = np.sqrt(1.0 - 1.0 / eta**2)

    def radiance(c: FloatArray) -> FloatArray:
        f = fresnel(c, 1.0 / eta)
        close = (c > critical - 0.03) & (c < critical + 0.06)
        colour = f[..., None] + ((1.0 - f) * eta**2)[..., None] * [0.9, 0.8, 0.7]
        return np.asarray(np.where(close[..., None], np.nan, colour))

    view = View((0, 0, -1), (0, 1.0, 0), (0, 0, 1), (HALF, HALF), (32, 32))
    seen = pixel_means(lambda x, y: radiance(np.abs(view.rays(x, y)[..., 2])), 32, 32, 8)
    return Expected(seen * SKY, 1e-8)


@case(
    r"$(1 - R) L_{lamp} + R L$, $R = \frac{2 F}{1 + F}$",
    "a union has no surfaces within",
)
def whitted_union() -> Expected:
    """Two boxes of glass that overlap are one thick slab, with two boundaries: as `slab`.  With the
    faces inside of it there would be four."""
    view = View((0, 0, 1), (0, 1.2, 0), (0, 0, 1), (HALF, HALF), (32, 32))

    def radiance(x: FloatArray, y: FloatArray) -> FloatArray:
        f = fresnel(np.abs(view.rays(x, y)[..., 2]), 1.5)
        r = (2.0 * f / (1.0 + f))[..., None]
        return np.asarray(r * SKY + (1.0 - r) * LAMP)

    # Rays are cut after 8 bounces, seven of which are within the slab, with F below 0.13.
    return Expected(pixel_means(radiance, 32, 32, 8), 1e-5)


@case(
    r"$k_r L + k_d E (n \cdot l) + k_s E (r \cdot v)^p$, $n$ along the gradient",
    "a quadric of ten coefficients in light, and as a mirror",
    "Phong 1975",
)
def whitted_quadric() -> Expected:
    """A ray along z meets an ellipsoid where its equation, quadratic in z, has its larger root.  It
    is convex: what it mirrors is the sky.  Pixels near the outline and in the shade are not
    stated."""
    a, b, c, d, e, f, g, h, i, j = 1.0, 1.6, 2.0, 0.5, -0.4, 0.3, 0.2, -0.3, 0.25, -1.2
    light = np.array([0.3, 0.5, 1.0]) / np.linalg.norm([0.3, 0.5, 1.0])

    def radiance(x: FloatArray, y: FloatArray) -> FloatArray:
        half = (e * y + f * x + i) / 2.0
        rest = a * x * x + b * y * y + d * x * y + g * x + h * y + j
        root2 = half * half - c * rest
        z = (np.sqrt(np.maximum(root2, 0.0)) - half) / c
        n = np.stack(
            [
                2.0 * a * x + d * y + f * z + g,
                d * x + 2.0 * b * y + e * z + h,
                f * x + e * y + 2.0 * c * z + i,
            ],
            axis=-1,
        )
        n /= np.linalg.norm(n, axis=-1, keepdims=True)
        cosine = n @ light
        seen = 2.0 * cosine * n[..., 2] - light[2]
        highlight = 0.3 * np.maximum(seen, 0.0) ** 12
        value = cosine[..., None] * [0.2, 0.3, 0.1] + highlight[..., None]
        stated = (root2 > 0.5) & (cosine > 0.1)
        return np.asarray(np.where(stated[..., None], 2.0 * value + 0.4 * SKY, np.nan))

    return Expected(seen_from_above(radiance, 2.4, 32, 12), 1e-8)
