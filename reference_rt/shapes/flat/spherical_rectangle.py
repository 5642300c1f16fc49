"""Spherical rectangles: the solid angle of a rectangle at a point, and sampling it uniformly.

Urena, Fajardo & King 2013, "An Area-Preserving Parametrization for Spherical Rectangles" (Computer
Graphics Forum 32(4)), in a form that loses no digits where the rectangle is seen edge-on.

The point is the origin, the rectangle lies at distance h along -z of axes along its edges, from x0
to x1 and from y0 to y1.  The rectangle from the middle (0, 0) to (x, y) has the solid angle
G(x, y) = atan(x y / (h sqrt(x² + y² + h²))) = asin(s b), with the sines s = x / sqrt(x² + h²) and
b = y / sqrt(y² + h²).
"""

import math
from typing import NamedTuple

from reference_rt.jit.kernel import kernel, reciprocal


class SphericalRectangle(NamedTuple):
    """h > 0; the sides; phi, the signed solid angle between y0 and y1 from x = 0 to x0;
    solid_angle, that of the rectangle."""

    h: float
    x0: float
    x1: float
    y0: float
    y1: float
    phi: float
    solid_angle: float


@kernel
def _corner(x: float, y: float, h: float) -> float:
    """G(x, y)."""
    return math.atan2(x * y, h * math.sqrt(x * x + y * y + h * h))


@kernel
def solid_angle_of(h: float, x0: float, x1: float, y0: float, y1: float) -> float:
    """The sum of two triangles, each by tan(omega / 2) = |a b c| / (abc + (a·b) c + (b·c) a +
    (c·a) b) (van Oosterom & Strackee 1983, "The Solid Angle of a Plane Triangle"): the triple
    product is h times twice the area, so that small ones keep their digits, which differences of
    angles at corners lose."""
    volume, h2 = h * (x1 - x0) * (y1 - y0), h * h
    a, b = math.sqrt(x0 * x0 + y0 * y0 + h2), math.sqrt(x1 * x1 + y0 * y0 + h2)
    c, d = math.sqrt(x1 * x1 + y1 * y1 + h2), math.sqrt(x0 * x0 + y1 * y1 + h2)
    ac = x0 * x1 + y0 * y1 + h2
    ab, bc = x0 * x1 + y0 * y0 + h2, x1 * x1 + y0 * y1 + h2
    ad, dc = x0 * x0 + y0 * y1 + h2, x0 * x1 + y1 * y1 + h2
    lower = math.atan2(volume, a * b * c + ab * c + bc * a + ac * b)
    upper = math.atan2(volume, a * d * c + ad * c + dc * a + ac * d)
    return 2.0 * (lower + upper)


@kernel
def project(h: float, x0: float, x1: float, y0: float, y1: float) -> SphericalRectangle:
    phi = _corner(x0, y1, h) - _corner(x0, y0, h)
    return SphericalRectangle(h, x0, x1, y0, y1, phi, solid_angle_of(h, x0, x1, y0, y1))


@kernel
def empty() -> SphericalRectangle:
    """A rectangle of solid angle 0."""
    return SphericalRectangle(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@kernel
def sample(seen: SphericalRectangle, u0: float, u1: float) -> tuple[float, float]:
    """(x, y), uniform in solid angle.

    x: where the solid angle from x0 is u0 of the whole, G(x, y1) - G(x, y0) = phi + u0 solid_angle.
    Of asin(s b1) - asin(s b0) = phi the root is s = sin(phi) / sqrt(b0² + b1² - 2 b0 b1 cos(phi)),
    and x = h s / sqrt(1 - s²).  With sin(beta) = b that is

        x = h sin(phi) / sqrt((cos(phi) - cos(beta1 - beta0)) (cos(phi) + cos(beta0 + beta1))),

    where both factors are differences of squared sines and cosines of half angles, which are exact
    to a few roundings however thin the strip or grazing the view.

    y: at x the solid angle is uniform in the sine y / sqrt(x² + h² + y²) (Archimedes).
    """
    h, y0, y1 = seen.h, seen.y0, seen.y1
    half_sine = math.sin(0.5 * (seen.phi + u0 * seen.solid_angle))
    half_sine2 = half_sine * half_sine
    lengths = math.sqrt((y0 * y0 + h * h) * (y1 * y1 + h * h))
    inner, outer = y0 * y1 + h * h, h * h - y0 * y1
    # sin²((beta1 - beta0) / 2) = (1 - inner / lengths) / 2 and cos²((beta0 + beta1) / 2) =
    # (1 + outer / lengths) / 2, each by the form that does not cancel.
    if inner > 0.0:
        most = h * h * (y1 - y0) * (y1 - y0) / (2.0 * lengths * (lengths + inner))
    else:
        most = 0.5 * (lengths - inner) / lengths
    if outer < 0.0:
        rest = h * h * (y0 + y1) * (y0 + y1) / (2.0 * lengths * (lengths - outer))
    else:
        rest = 0.5 * (lengths + outer) / lengths
    product = (most - half_sine2) * (rest - half_sine2)
    x = math.copysign(math.inf, half_sine)
    if product > 0.0:
        x = h * half_sine * math.sqrt(1.0 - half_sine2) / math.sqrt(product)
    x = min(max(x, seen.x0), seen.x1)
    distance2 = x * x + h * h
    s0, s1 = y0 / math.sqrt(distance2 + y0 * y0), y1 / math.sqrt(distance2 + y1 * y1)
    s = s0 + u1 * (s1 - s0)
    y = s * math.sqrt(distance2 * reciprocal((1.0 - s) * (1.0 + s)))
    return x, min(max(y, y0), y1)
