"""Photometry: point lights, lamps and skies over a matte floor.

The floor is z = 0; it sends back rho E / pi.  The usual view looks down the z axis."""

from collections.abc import Callable

import numpy as np

from comparisons.truth.case import Expected, FloatArray, case, derivative
from comparisons.truth.film import drawn_from_above, mix, seen_from_above
from comparisons.truth.optics import UP, floor_irradiance, on_floor, polygon_irradiance_rate

RHO = np.array([0.8, 0.5, 0.2])
INTENSITY = np.array([10.0, 6.0, 2.0])
RADIANCE = np.array([3.0, 2.0, 1.0])


def _floor(
    irradiance: Callable[[FloatArray, FloatArray], FloatArray],
    colour: FloatArray = RADIANCE,
    width: float = 4.0,
    pixels: int = 32,
    order: int = 6,
    bound: float = 1e-10,
) -> Expected:
    """The floor's picture; irradiance: of a lamp whose radiance or intensity is 1."""
    share = seen_from_above(irradiance, width, pixels, order)
    return Expected(share[..., None] * colour * RHO / np.pi, bound)


def _point(
    x: FloatArray, y: FloatArray, at: tuple[float, float, float], normal: tuple[float, ...]
) -> FloatArray:
    """cos / d² of a point light at points (x, y, z) of a plane through the origin."""
    n = np.array(normal)
    z = -(n[0] * x + n[1] * y) / n[2]
    to = np.stack([at[0] - x, at[1] - y, at[2] - z], axis=-1)
    return np.asarray(to @ n / (to**2).sum(axis=-1) ** 1.5)


@case(r"$\frac{\rho I h}{\pi d^3}$", "the inverse square, and the cosine")
def point_over_floor(height: float = 1.0) -> Expected:
    """Irradiance is I cos / d^2, and the cosine h / d."""
    return _floor(lambda x, y: _point(x, y, (0.5, 0.3, height), (0, 0, 1)), INTENSITY)


@derivative(
    "lights[0].position[2]", point_over_floor, "height",
    r"$\frac{\rho I (d^2 - 3 h^2)}{\pi d^5}$",
)  # fmt: skip
def point_over_floor_by_height() -> Expected:
    """h / d^3 by h, with d' = h / d: far from the light a larger height helps, below it it does
    not."""

    def rate(x: FloatArray, y: FloatArray) -> FloatArray:
        d2 = (x - 0.5) ** 2 + (y - 0.3) ** 2 + 1.0
        return np.asarray((d2 - 3.0) / d2**2.5)

    return _floor(rate, INTENSITY)


@case(r"$\frac{\rho I (n \cdot l)}{\pi d^3}$", "the cosine at a tilted surface")
def point_over_slope() -> Expected:
    """As `point_over_floor`, on a plane that is tilted by 40 degrees about the x axis."""
    a = np.radians(40.0)
    normal = (0.0, -np.sin(a), np.cos(a))
    return _floor(lambda x, y: _point(x, y, (0.5, -1.0, 1.5), normal), INTENSITY)


@case(
    r"$\sum_k \frac{\rho I_k h_k}{\pi d_k^3}$", "lights add up, whatever the odds of their choice"
)
def three_points() -> Expected:
    """Light is linear: three lights of different colour, one 50 times as bright as the others."""
    parts = [
        _floor(lambda x, y, at=at: _point(x, y, at, (0, 0, 1)), np.array(colour)).pixels  # type: ignore[misc]
        for at, colour in (
            ((-1.0, 1.0, 1.0), (0.2, 0.2, 0.0)),
            ((1.0, 1.0, 1.5), (0.0, 0.2, 0.2)),
            ((0.0, -1.0, 3.0), (10.0, 0.0, 10.0)),
        )
    ]
    return Expected(np.sum(parts, axis=0))


@case(r"$\frac{\rho I s(\alpha) \cos\theta}{\pi d^2}$", "a spot's beam, fall-off and cut-off")
def spot_falloff(cutoff: float = 25.0) -> Expected:
    """s is 1 within the beam (10 degrees), 0 beyond the cut-off (25), and linear in the angle
    between.  Pixels that the two circles may cross are not stated: s has kinks there."""

    def irradiance(x: FloatArray, y: FloatArray) -> FloatArray:
        angle, d = _from_spot(x, y)
        return np.asarray(np.clip((cutoff - angle) / (cutoff - 10.0), 0.0, 1.0) * 2.0 / d**3)

    return _floor(irradiance, INTENSITY)


def _from_spot(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The angle from the spot's axis in degrees, NaN near its circles, and the distance."""
    axis = np.array([0.3, 0.2, -2.0]) / np.linalg.norm([0.3, 0.2, -2.0])
    half_pixel = 4.0 / 32 / 2
    to = np.stack([x, y, np.full_like(x, -2.0)], axis=-1)
    d = np.linalg.norm(to, axis=-1)
    angle = np.degrees(np.arccos(to @ axis / d))
    close = np.minimum(abs(angle - 10.0), abs(angle - 25.0)) < np.degrees(half_pixel / 2.0)
    return np.where(close, np.nan, angle), d


@derivative(
    "lights[0].cutoff_angle", spot_falloff, "cutoff",
    r"$\frac{\rho I \cos\theta}{\pi d^2} \frac{\alpha - b}{(c - b)^2}$ between beam and cut-off",
)  # fmt: skip
def spot_falloff_by_cutoff() -> Expected:
    """(c - alpha) / (c - b) by c, with the beam's angle b; elsewhere nothing changes."""

    def rate(x: FloatArray, y: FloatArray) -> FloatArray:
        angle, d = _from_spot(x, y)
        between = (angle > 10.0) & (angle < 25.0)
        return np.where(between, (angle - 10.0) / 225.0, 0.0 * angle) * 2.0 / d**3

    return _floor(rate, INTENSITY)


@case(
    r"$\frac{\rho I(\gamma, C) h}{\pi d^3}$, $I$ bilinear in $\gamma$ and $C$",
    "a lamp with a measured table",
)
def measured_lamp() -> Expected:
    """gamma is the angle from the axis, straight down, and C that around it, from the x axis
    counterclockwise seen from above.  Between the table's angles I is linear in each.  Its kinks in
    C lie on the pixels' edges; those in gamma are not stated, nor what is below the lamp."""
    vertical, table = (0.0, 30.0, 90.0), ((1, 0.7, 0.1), (1, 0.3, 0.5), (1, 0.9, 0), (1, 0.2, 0.4))
    half_pixel = 4.0 / 32 / 2

    def irradiance(x: FloatArray, y: FloatArray) -> FloatArray:
        x, y = x - 0.25, y + 0.125
        out, d = np.hypot(x, y), np.sqrt(x**2 + y**2 + 4.0)
        gamma, c = np.degrees(np.arctan2(out, 2.0)), np.degrees(np.arctan2(y, x)) % 360.0
        rows = np.stack([np.interp(gamma, vertical, row) for row in (*table, table[0])])
        share = np.stack([np.maximum(0.0, 1.0 - abs(c / 90.0 - k)) for k in range(5)])
        close = (abs(gamma - 30.0) < np.degrees(half_pixel / 2.0)) | (out < 6.0 * half_pixel)
        return np.where(close, np.nan, (rows * share).sum(axis=0) * 2.0 / d**3)

    return _floor(irradiance, INTENSITY)


@case(
    r"$\frac{\rho E}{\pi d^2} A$, $A$ the area of the image in the pixel",
    "a projector's even image",
)
def projector() -> Expected:
    """A white image lights a plane across the axis evenly, with E / d^2 at the distance d.  45
    degrees span its width, which is 1.5 times its height."""
    a = 2.0 * np.tan(np.radians(22.5))
    b = a / 1.5
    corners = np.array([[-a, -b], [a, -b], [a, b], [-a, b]]) + np.array([0.2, 0.1])
    return Expected(mix(drawn_from_above(corners, 4.0, 32), RHO * INTENSITY / 4.0 / np.pi))


@case(r"$\frac{\rho E \cos\theta}{\pi}$", "a directional light on two slopes")
def directional_on_roof() -> Expected:
    """The slopes of a roof, tilted by 30 degrees about y, have normals (-1/2, 0, sqrt 3 / 2) and
    (1/2, 0, sqrt 3 / 2).  The light comes from (0.5, 0.2, 1)."""
    to = np.array([0.5, 0.2, 1.0]) / np.linalg.norm([0.5, 0.2, 1.0])
    left, right = (np.array([s * 0.5, 0.0, np.sqrt(0.75)]) @ to for s in (-1.0, 1.0))
    share = np.zeros((32, 32))
    share[:, :16], share[:, 16:] = left, right
    return Expected(share[..., None] * RHO * INTENSITY / np.pi)


def disk(r2: FloatArray, height: float, radius: float) -> FloatArray:
    """The irradiance of a level disk of radiance 1 at the distance sqrt(r2) from its axis."""
    z = r2 + height**2 + radius**2
    return np.asarray(
        np.pi / 2.0 * (1.0 - (z - 2.0 * radius**2) / np.sqrt(z * z - 4.0 * r2 * radius**2))
    )


@case(
    r"$\frac{\rho L}{2} (1 - \frac{h^2 + r^2 - a^2}{\sqrt{(h^2 + r^2 + a^2)^2 - 4 a^2 r^2}})$",
    "a disk lamp",
    "Howell & Mengüç, A Catalog of Radiation Transfer Configuration Factors, B-13",
)
def disk_lamp(radius: float = 0.9) -> Expected:
    """The factor from a level element to a level disk, whose axis is at the distance r."""
    return _floor(lambda x, y: disk((x - 0.7) ** 2 + y**2, 1.5, radius))


def disk_rate(r2: FloatArray, height: float, radius: float) -> FloatArray:
    """The derivative of `disk` by its radius."""
    z = r2 + height**2 + radius**2
    root = np.sqrt(z * z - 4.0 * r2 * radius**2)
    turn = (z - 2.0 * radius**2) * (z - 2.0 * r2) / root**3
    return np.asarray(np.pi * radius * (1.0 / root + turn))


@derivative(
    "shapes[1].transform[0].scale", disk_lamp, "radius",
    r"$\rho L a (\frac{1}{S} + \frac{(z - 2 a^2) (z - 2 r^2)}{S^3})$, $z = h^2 + r^2 + a^2$, "
    r"$S^2 = z^2 - 4 a^2 r^2$", spp=1024
)  # fmt: skip
def disk_lamp_by_radius() -> Expected:
    """The quotient rule, with z' = 2 a.  The lamp's edge moves; the light of its inside stays."""
    return _floor(lambda x, y: disk_rate((x - 0.7) ** 2 + y**2, 1.5, 0.9))


LAMBERT = r"$\frac{\rho L}{2 \pi} \sum_k \beta_k \cos\gamma_k$, over edges, $\beta$ their angles"


@case(LAMBERT, "a rectangle lamp, tilted", "Lambert 1760")
def rectangle_lamp(degrees: float = 210.0) -> Expected:
    """Stokes' theorem turns the solid angle's cosine integral into one along the outline."""
    corners = _tilted(degrees)
    return _floor(lambda x, y: floor_irradiance(corners + np.array([0.4, 0.3, 1.5]), x, y))


def _tilted(degrees: float) -> FloatArray:
    a = np.radians(degrees)
    return np.array([[x, y * np.cos(a), y * np.sin(a)] for x, y in _SQUARE]) * 0.8


LAMBERT_RATE = r"$\frac{\rho L}{2 \pi} \sum_k (\beta_k \cos\gamma_k)'$, over edges as they move"


def _moved(corners: FloatArray, velocity: object, **picture: float) -> Expected:
    """The derivative of the floor's picture as a lamp's corners move."""
    v = np.array(velocity)

    def rate(x: FloatArray, y: FloatArray) -> FloatArray:
        return polygon_irradiance_rate(corners, v, on_floor(x, y), UP)

    return _floor(rate, **picture)  # type: ignore[arg-type]


@derivative(
    "shapes[1].transform[1].rotate.degrees",
    rectangle_lamp,
    "degrees",
    LAMBERT_RATE,
    spp=1024,
    step=0.5,
)
def rectangle_lamp_by_angle() -> Expected:
    """A plate turns: a corner (x, y, z) from the axis moves by (0, -z, y) per radian."""
    corners = _tilted(210.0)
    x, y, z = corners.T
    velocity = np.radians(1.0) * np.stack([0.0 * x, -z, y], axis=1)
    return _moved(corners + np.array([0.4, 0.3, 1.5]), velocity)


_SQUARE = ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0))
TRIANGLE = np.array([[1.0, 2.0, 0.5], [1.5, 1.0, 1.5], [-1.0, 1.5, 1.0]])


@case(LAMBERT, "a triangle lamp", "Lambert 1760")
def triangle_lamp(x: float = -1.0) -> Expected:
    """As `rectangle_lamp`."""
    corners = np.array([*TRIANGLE[:2], [x, *TRIANGLE[2, 1:]]])
    return _floor(lambda x, y: floor_irradiance(corners, x, y), width=3.0)


@derivative("shapes[1].v2[0]", triangle_lamp, "x", LAMBERT_RATE, spp=4096)
def triangle_lamp_by_corner() -> Expected:
    """Two of the three edges move with their corner."""
    return _moved(TRIANGLE, [[0, 0, 0], [0, 0, 0], [1, 0, 0]], width=3.0)


@case(LAMBERT, "a box lamp: only the faces that a point sees", "Lambert 1760")
def box_lamp() -> Expected:
    """From below the middle of a level box only its lower face is seen; beside it, one or two of
    its sides as well: each by Lambert's formula.  Edges of the box lie over borders of pixels."""

    def irradiance(x: FloatArray, y: FloatArray) -> FloatArray:
        low = [[a / 2, b / 2, 1.0] for a, b in _SQUARE]
        total = floor_irradiance(low, x, y)
        for axis in (0, 1):
            for side in (-0.5, 0.5):
                face = np.array([[side, a / 2, 1.5 + b / 2] for a, b in _SQUARE])
                face = face if axis == 0 else face[:, [1, 0, 2]]
                seen = (x, y)[axis] * np.sign(side) > 0.5
                total = total + np.where(seen, floor_irradiance(face, x, y), 0.0)
        return total

    return _floor(irradiance)


@case(r"$\rho L \frac{r^2}{d^2} \cos\theta$", "a sphere lamp", "Howell & Mengüç, B-42")
def sphere_lamp(radius: float = 0.8) -> Expected:
    """A sphere wholly above the horizon: its projected solid angle is pi (r / d)^2 cos."""

    def irradiance(x: FloatArray, y: FloatArray) -> FloatArray:
        d2 = (x - 0.5) ** 2 + (y + 0.4) ** 2 + 2.25
        return np.asarray(np.pi * radius**2 * 1.5 / d2**1.5)

    return _floor(irradiance)


@derivative(
    "shapes[1].radius", sphere_lamp, "radius", r"$2 \rho L \frac{r}{d^2} \cos\theta$", spp=1024
)
def sphere_lamp_by_radius() -> Expected:
    """r^2 by r."""
    return Expected(sphere_lamp().pixels * 2.0 / 0.8)


@case(
    r"$\frac{\rho L}{\pi} (\frac{\pi}{2} - \arcsin(\frac{q}{h \sin\theta}) + "
    r"\frac{\cos\theta \arccos(-q \cot\theta) - q \sqrt{1 - h^2 \cos^2\theta}}{h^2})$",
    "a sphere lamp that the floor cuts",
    "Howell & Mengüç, B-43",
)
def setting_sphere() -> Expected:
    """The horizon leaves a part of the sphere; h is the distance of its centre in radii, q the root
    of h^2 - 1."""

    def irradiance(x: FloatArray, y: FloatArray) -> FloatArray:
        d = np.sqrt((x + 2.6) ** 2 + y**2 + 0.09)
        h, cosine = d / 1.0, 0.3 / d
        sine, q = np.sqrt(1.0 - cosine**2), np.sqrt(h * h - 1.0)
        lune = cosine * np.arccos(-q * cosine / sine) - q * np.sqrt(1.0 - (h * cosine) ** 2)
        return np.asarray(np.pi / 2.0 - np.arcsin(q / (h * sine)) + lune / h**2)

    return _floor(irradiance, width=3.0)


@case(
    r"$\frac{\rho L}{\pi} \int \frac{\cos\theta \cos\theta'}{d^2} dA$ over the side that is seen",
    "a tube lamp",
)
def tube_lamp() -> Expected:
    """A level tube, seen from points below it and between its ends, shows the part of its side
    whose normals point at them, and no cap.  Gauss's rule in angle and length, 32 x 32."""
    nodes, weights = np.polynomial.legendre.leggauss(32)
    radius, height, half = 0.2, 1.0, 2.5

    def irradiance(x: FloatArray, y: FloatArray) -> FloatArray:
        d = np.hypot(y, height)
        middle, reach = np.arctan2(y, -height), np.arccos(radius / d)
        angle = middle[..., None] + reach[..., None] * nodes
        dy = radius * np.sin(angle) - y[..., None]
        dz = height + radius * np.cos(angle)
        # n . (p - q), the same all along the tube
        facing = radius + (height * np.cos(angle) - y[..., None] * np.sin(angle))
        dx = half * nodes - x[..., None]
        d2 = (dy**2 + dz**2)[..., None] + dx[..., None, :] ** 2
        inner = (1.0 / d2**2) @ (weights * half)
        return np.asarray((dz * -facing * inner) @ (weights) * radius * reach)

    return _floor(irradiance, pixels=16, order=5, width=3.0, bound=1e-9)


@case(LAMBERT, "a lamp with a texture", "Lambert 1760")
def checkered_lamp() -> Expected:
    """Each quarter of a level square lamp by itself: first and third of one colour."""
    total = np.zeros((32, 32, 3))
    for x0 in (-0.5, 0.5):
        for y0 in (-0.5, 0.5):
            part = np.array([[x0 + a / 2, y0 + b / 2, 1.0] for a, b in _SQUARE])
            # The lamp faces down: turned about x, its v axis runs along -y.
            colour = np.array((0.5, 1.0, 2.0) if x0 * y0 > 0 else (3.0, 2.0, 1.0))
            total += _floor(lambda x, y, p=part: floor_irradiance(p, x, y), colour).pixels  # type: ignore[misc]
    return Expected(total)


@case(
    r"$\sum_k \rho L_k F_k$ of a sphere, a disk and a triangle", "lamps of different kinds add up"
)
def three_lamps() -> Expected:
    """As `sphere_lamp`, `disk_lamp` and `triangle_lamp`, none of which hides another."""

    def sphere(x: FloatArray, y: FloatArray) -> FloatArray:
        d2 = (x + 2.0) ** 2 + (y + 2.0) ** 2 + 4.0
        return np.asarray(np.pi * 0.64 * 2.0 / d2**1.5)

    parts = (
        (sphere, (2.0, 0.1, 0.1)),
        (lambda x, y: disk((x - 1.5) ** 2 + (y + 1.5) ** 2, 1.0, 0.4), (0.1, 2.0, 0.1)),
        (lambda x, y: floor_irradiance(TRIANGLE, x, y), (0.1, 0.1, 2.0)),
    )
    total = [_floor(f, np.array(colour), width=2.0).pixels for f, colour in parts]
    return Expected(np.sum(total, axis=0))


@case(LAMBERT, "a lamp shines from its front alone", "Lambert 1760")
def lamp_back() -> Expected:
    """Two level lamps side by side; the front of the second one points up."""
    corners = np.array([[-0.75 + a / 2, b / 2, 1.0] for a, b in _SQUARE])
    return _floor(lambda x, y: floor_irradiance(corners, x, y))


@case(
    r"$\rho (a + \frac{2}{3} b n_y)$",
    "an environment map over slopes",
    "Ramamoorthi & Hanrahan 2001",
)
def harmonic_sky(degrees: float = 0.0) -> Expected:
    """A sky of radiance a + b y sends pi a + b n_y 2 pi / 3 to the normal n: the clamped cosine
    scales harmonics of order 1 by 2/3.  Seen on a sphere: n_y = y.  The map's 64 rows are linear
    between their middles, which moves no mean of it by more than 3e-4."""

    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))

    def irradiance(x: FloatArray, y: FloatArray) -> FloatArray:
        return np.where(x * x + y * y < 0.9, 1.0 + 0.8 * (c * y - s * x) * 2.0 / 3.0, np.nan)

    share = seen_from_above(irradiance, 2.0, 32)
    return Expected(share[..., None] * RHO * np.array([1.0, 0.7, 0.4]), 3e-4)


@derivative(
    "lights[0].transform[0].rotate.degrees", harmonic_sky, "degrees",
    r"$-\frac{2}{3} \rho b n_x \frac{\pi}{180}$", spp=4096, step=2.0,
)  # fmt: skip
def harmonic_sky_by_angle() -> Expected:
    """A sky that turns about z by an angle brightens along (-sin, cos)."""

    def rate(x: FloatArray, y: FloatArray) -> FloatArray:
        return np.where(x * x + y * y < 0.9, -0.8 * x * 2.0 / 3.0 * np.radians(1.0), np.nan)

    share = seen_from_above(rate, 2.0, 32)
    return Expected(share[..., None] * RHO * np.array([1.0, 0.7, 0.4]), 1e-3)
