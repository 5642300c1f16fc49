"""Rays and cameras: silhouettes, positions, depth and normals, the lens's blur."""

import numpy as np

from comparisons.truth.case import Expected, FloatArray, case, derivative
from comparisons.truth.film import (
    View,
    drawn_from_above,
    level,
    mix,
    pixel_means,
    seen_from_above,
    swept,
    swept_from_above,
    turn,
)

FIRST = np.array([[-1.0, -0.6, 0.2], [0.8, -0.9, -0.5], [0.1, 0.7, 0.3]])
SECOND = np.array([[0.9, 0.2, -1.0], [1.6, 0.1, -0.4], [1.3, 1.0, -0.8]])
WARM, COLD = np.array([1.0, 0.5, 0.2]), np.array([0.2, 0.8, 1.5])
RHO = np.array([0.8, 0.5, 0.2])
DUSK = np.array([0.05, 0.1, 0.2])

AREA = r"$L A$, $A$ the area of the projected outline in the pixel"


SEGMENT = r"$L (\frac{1}{2} + \frac{u \sqrt{1 - u^2} + \arcsin u}{\pi})$"


def _triangles(view: View, corners: FloatArray = FIRST) -> Expected:
    """Two triangles that shine, over black."""
    first, second = view.drawn(corners), view.drawn(SECOND)
    return Expected(mix(first, WARM) + mix(second, COLD))


@case(AREA, "the pinhole projection, and its axes")
def perspective(x: float = 0.1) -> Expected:
    """A pinhole camera maps polygons to polygons: their corners are projected, and the area of the
    outline in each pixel is the share that shines."""
    half = np.tan(np.radians(20.0))
    view = View((0.3, 0.4, 4), (0.1, 0, 0), (0, 1, 0), (half, half), (32, 32))
    return _triangles(view, np.array([*FIRST[:2], [x, *FIRST[2, 1:]]]))


SWEPT = r"$L \int (v \cdot n) ds$ over the outline in the pixel, $v$ its velocity on the film"


@derivative("shapes[0].v2[0]", perspective, "x", SWEPT, spp=32768, step=1 / 128)
def perspective_by_corner() -> Expected:
    """The film's outline moves linearly along the two edges of the corner that moves."""
    half = np.tan(np.radians(20.0))
    view = View((0.3, 0.4, 4), (0.1, 0, 0), (0, 1, 0), (half, half), (32, 32))
    return Expected(view.swept(FIRST, [[0, 0, 0], [0, 0, 0], [1, 0, 0]])[..., None] * WARM)


@case(AREA, "the side of the picture that the angle of view spans; pictures that are not square")
def perspective_fov_y(fov: float = 30.0) -> Expected:
    """As `perspective`; 30 degrees span the 24 rows, so that the 48 columns span twice the
    tangent."""
    half = np.tan(np.radians(fov / 2.0))
    return _triangles(View((0, 0, 5), (0.1, 0, 0), (0, 1, 0), (2 * half, half), (48, 24)))


@derivative("camera.fov", perspective_fov_y, "fov", SWEPT, spp=16384, step=0.25)
def perspective_fov_y_by_fov() -> Expected:
    """All images shrink towards the middle, as one over the tangent of half the angle, whose
    derivative is 1 + tan^2 over two."""
    half = np.tan(np.radians(15.0))
    view = View((0, 0, 5), (0.1, 0, 0), (0, 1, 0), (2 * half, half), (48, 24))
    rate = -np.radians(0.5) * (1.0 + half**2) / half
    first, second = (
        swept(film, rate * (film - [24.0, 12.0]), 48, 24)
        for film in (view.project(FIRST), view.project(SECOND))
    )
    return Expected(first[..., None] * WARM + second[..., None] * COLD)


@case(AREA, "the frame of an oblique view with a tilted up")
def perspective_rolled() -> Expected:
    """As `perspective`, from aside: right is forward x up, and the true up right x forward."""
    half = np.tan(np.radians(25.0))
    return _triangles(View((1.5, -1, 3), (0.2, 0.1, -0.2), (1, 2, 0.5), (half, half), (32, 32)))


@case(AREA, "a view rectangle off the axis")
def perspective_sheared() -> Expected:
    """As `perspective`; the view rectangle [-0.3, 0.5] x [-0.45, 0.35] at distance 1."""
    view = View((0, 0, 4), (0, 0, 0), (0, 1, 0), (0.4, 0.4), (32, 32), (0.1, -0.05))
    return _triangles(view)


@case(AREA, "a real pinhole's film: upside down and mirrored")
def pinhole_film() -> Expected:
    """The picture of `perspective` with half a film over its distance as tangent, turned by 180
    degrees."""
    view = View((0, 0, 4), (0.1, 0, 0), (0, 1, 0), (0.36, 0.36), (32, 32))
    return Expected(_triangles(view).pixels[::-1, ::-1])


@case(
    SEGMENT,
    "the blur of a hole without a lens",
)
def pinhole_blur() -> Expected:
    """Through a hole of radius r a film point at distance d behind it sees at depth z a disk of
    radius r (1 + z / d).  Of it an edge leaves the segment beyond, at u radii from its middle.
    Turned by 180 degrees."""
    return Expected(_beyond_an_edge(6.0 * 0.54, 0.04 * (1.0 + 6.0 / 1.0)).pixels[::-1, ::-1], 1e-6)


@case(
    r"$\frac{x \pi L}{2} (1 - \frac{a - r^2}{\sqrt{(a + r^2)^2 - 4 r^2 \rho^2}})$, "
    r"$a = d^2 + \rho^2$",
    "the light that a hole lets onto the film",
    "Howell, Menguc & Siegel 2015, appendix C",
)
def pinhole_exposure() -> Expected:
    """A sky of radiance L lights the film through a disk of radius r at distance d as if the disk
    shone: by its form factor at the distance rho from the axis.  The film shows x times that."""
    r2, place = 0.3**2, level(2.0, 32)

    def exposed(x: FloatArray, y: FloatArray) -> FloatArray:
        across, up = place(x, y)
        rho2 = across * across + up * up
        far = 1.0 + rho2
        return np.asarray(1.0 - (far - r2) / np.sqrt((far + r2) ** 2 - 4.0 * r2 * rho2))

    return Expected(mix(pixel_means(exposed, 32, 32), WARM * 5.0 * np.pi / 2.0))


@case(AREA, "parallel rays, and the scale of their picture")
def orthographic(width: float = 3.4) -> Expected:
    """Corners lose their z."""
    first, second = (drawn_from_above(p[:, :2], width, 32) for p in (FIRST, SECOND))
    return Expected(mix(first, WARM) + mix(second, COLD))


@derivative("camera.width", orthographic, "width", SWEPT, spp=16384, step=1 / 32)
def orthographic_by_width() -> Expected:
    """All images shrink towards the middle, as one over the width."""
    first, second = (swept_from_above(p[:, :2], p[:, :2] / -3.4, 3.4, 32) for p in (FIRST, SECOND))
    return Expected(first[..., None] * WARM + second[..., None] * COLD)


@case(
    r"$L A$, $A$ the area of the outline between the clipping planes",
    "the near and the far clipping plane",
)
def clipped(near: float = 3.4) -> Expected:
    """The plane z = x, seen from z = 4 along -z: depth 4 - x.  Near 3.4 and far 4.75 leave -0.75 <
    x < 0.6, whose images are lines of equal depth."""
    near, far = 4.0 - near, 4.0 - 4.75
    view = View((0, 0, 4), (0, 0, 0), (0, 1, 0), (0.3, 0.3), (32, 32))
    strip = [[far, -5, far], [near, -5, near], [near, 5, near], [far, 5, far]]
    return Expected(mix(view.drawn(strip), WARM))


@derivative("camera.near", clipped, "near", SWEPT, spp=4096)
def clipped_by_near() -> Expected:
    """The edge at the near plane moves by (-1, 0, -1)."""
    near, far = 4.0 - 3.4, 4.0 - 4.75
    view = View((0, 0, 4), (0, 0, 0), (0, 1, 0), (0.3, 0.3), (32, 32))
    strip = [[far, -5, far], [near, -5, near], [near, 5, near], [far, 5, far]]
    velocity = [[0, 0, 0], [-1, 0, -1], [-1, 0, -1], [0, 0, 0]]
    return Expected(view.swept(strip, velocity)[..., None] * WARM)


@case(
    r"$L A$, $A$ the area of the ellipse in which the tangents' cone meets the film",
    "spheres: every pixel",
)
def sphere_outline(radius: float = 0.7) -> Expected:
    """Rays that touch a sphere make a cone with the sine r / d.  Off the axis the film cuts it in
    an ellipse."""
    half = np.tan(np.radians(30.0))
    view = View((0, 0, 3), (0, 0, 0), (0, 1, 0), (half, half), (32, 32))
    return Expected(mix(view.sphere((0.8, 0.5, 0), radius), WARM, DUSK), 1e-9)


@derivative("shapes[0].radius", sphere_outline, "radius", SWEPT, spp=4096, step=1 / 64)
def sphere_outline_by_radius() -> Expected:
    """The touching rays turn away from the axis; no pixel's inside changes."""
    half = np.tan(np.radians(30.0))
    view = View((0, 0, 3), (0, 0, 0), (0, 1, 0), (half, half), (32, 32))
    rate = view.swept(*view.tangents((0.8, 0.5, 0), 0.7))
    return Expected(rate[..., None] * (WARM - DUSK), 1e-9)


@case(r"$L A$, $A$ the area of the convex hull of eight projected corners", "boxes under rotation")
def box_outline(degrees: float = 25.0) -> Expected:
    """The silhouette of a convex solid is the hull of its corners' images."""
    view, corners, _ = _turned_box(degrees)
    return Expected(mix(view.drawn(corners), WARM, DUSK))


@derivative(
    "shapes[0].transform[2].rotate.degrees", box_outline, "degrees", SWEPT, spp=32768, step=0.5
)
def box_outline_by_angle() -> Expected:
    """A corner (x, y, z) that turns about x moves by (0, -z, y) per radian."""
    view, corners, velocity = _turned_box(25.0)
    return Expected(view.swept(corners, velocity)[..., None] * (WARM - DUSK))


def _turned_box(degrees: float) -> tuple[View, FloatArray, FloatArray]:
    """The view, the corners on the box's silhouette, and their velocity per degree."""
    from scipy.spatial import ConvexHull

    a, b = np.radians(35.0), np.radians(degrees)
    about_y = np.array([[np.cos(a), 0, np.sin(a)], [0, 1, 0], [-np.sin(a), 0, np.cos(a)]])
    about_x = np.array([[1, 0, 0], [0, np.cos(b), -np.sin(b)], [0, np.sin(b), np.cos(b)]])
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    corners = corners * [0.7, 0.5, 0.4] @ about_y.T @ about_x.T
    half = np.tan(np.radians(20.0))
    view = View((0, 0, 4), (0, 0, 0), (0, 1, 0), (half, half), (32, 32))
    corners = corners[ConvexHull(view.project(corners)).vertices]
    x, y, z = corners.T
    return view, corners, np.radians(1.0) * np.stack([0.0 * x, -z, y], axis=1)


@case(
    r"$\frac{\rho I \cos^3\theta}{\pi h^2}$",
    "depth: the inverse square of the distance, at every pixel",
)
def depth_of_plane() -> Expected:
    """A point light of intensity I at the eye, a plane across the view at distance h: a ray at the
    angle t meets it at h / cos t, at the angle t."""
    half = np.tan(np.radians(35.0))
    view = View((0, 0, 2), (0, 0, 0), (0, 1, 0), (half, half), (32, 32))

    def radiance(x: FloatArray, y: FloatArray) -> FloatArray:
        return np.asarray((-view.rays(x, y)[..., 2:]) ** 3 / 4.0 * RHO * 5.0 / np.pi)

    return Expected(pixel_means(radiance, 32, 32))


@case(r"$\frac{\rho I \cos\theta}{\pi d^2}$", "depth and normal of a sphere")
def depth_of_sphere() -> Expected:
    """A point light at the eye.  The first hit is the smaller root of the quadratic; the normal is
    radial.  All pixels lie within the outline."""
    half = np.tan(np.radians(8.0))
    view = View((0, 0, 4), (0, 0, 0), (0, 1, 0), (half, half), (32, 32))

    def radiance(x: FloatArray, y: FloatArray) -> FloatArray:
        d = view.rays(x, y)
        b = 4.0 * d[..., 2]  # eye . d
        t = -b - np.sqrt(b * b - 15.0)
        p = view.eye + t[..., None] * d
        cosine = -(p * d).sum(axis=-1)
        return np.asarray((cosine / t**2)[..., None] * RHO * 20.0 / np.pi)

    return Expected(pixel_means(radiance, 32, 32))


def _lit(normal_z: FloatArray) -> FloatArray:
    """Light along the view, of irradiance 4: rho 4 n_z / pi."""
    return np.asarray(normal_z[..., None] * RHO * 4.0 / np.pi)


@case(r"$\frac{\rho E}{\pi} \sqrt{1 - r^2}$", "normals of a sphere")
def sphere_normals() -> Expected:
    """Parallel light along the view: the cosine is that of the sphere's normal.  Pixels within 0.9
    of the radius, where the root is smooth."""

    def radiance(x: FloatArray, y: FloatArray) -> FloatArray:
        r2 = x * x + y * y
        return _lit(np.where(r2 < 0.81, np.sqrt(1.0 - np.minimum(r2, 0.81)), np.nan))

    return Expected(seen_from_above(radiance, 2.0, 32, 10), 1e-9)


@case(r"$\frac{\rho E}{\pi} \sqrt{1 - (r - R)^2 / a^2}$", "roots and normals of a torus")
def torus_normals() -> Expected:
    """A torus seen along its axis: at the distance r from it, the tube's circle has this normal.
    Pixels whose distance from the tube's middle is below 0.8 of its radius."""

    def radiance(x: FloatArray, y: FloatArray) -> FloatArray:
        s = (np.hypot(x, y) - 1.0) / 0.5
        return _lit(np.where(np.abs(s) < 0.8, np.sqrt(1.0 - np.minimum(s * s, 0.64)), np.nan))

    return Expected(seen_from_above(radiance, 3.2, 32, 10), 1e-8)


@case(r"$\frac{\rho E}{\pi \sqrt{1 + R^2 / h^2}}$", "a cone's slope, and its outline")
def cone_normals() -> Expected:
    """A cone seen along its axis has one cosine, R / sqrt(R^2 + h^2), over the disk of its base."""
    c, s = turn()
    share = drawn_from_above(np.stack([c, s], axis=1) * 0.9, 2.2, 32)
    return Expected(mix(share, RHO * 4.0 / np.pi * 0.9 / np.hypot(0.9, 1.2)), 1e-9)


@case(r"$\frac{\rho E}{\pi} \sqrt{1 - y^2 / R^2}$", "a cylinder across the view")
def cylinder_normals() -> Expected:
    """The cosine depends on the distance from the axis alone.  Rows within 0.9 of the radius."""

    def radiance(x: FloatArray, y: FloatArray) -> FloatArray:
        s = y / 0.8
        return _lit(np.where(np.abs(s) < 0.9, np.sqrt(1.0 - np.minimum(s * s, 0.81)), np.nan))

    return Expected(seen_from_above(radiance, 2.0, 32, 10), 1e-9)


@case(r"$\frac{\rho E}{\pi \sqrt{1 + 4 a^2 r^2}}$", "a quadric's gradient")
def paraboloid_normals() -> Expected:
    """z = -a r^2 has the slope 2 a r."""

    def radiance(x: FloatArray, y: FloatArray) -> FloatArray:
        return _lit(1.0 / np.sqrt(1.0 + 4.0 * 0.49 * (x * x + y * y)))

    return Expected(seen_from_above(radiance, 2.0, 32))


@case(
    SEGMENT,
    "the circle of confusion",
    "Potmesil & Chakravarty 1981",
)
def lens_blur(focus: float = 4.0) -> Expected:
    """A lens of radius A in focus at f blurs points at depth z over a disk of radius A |1 - z / f|
    in their plane.  Of it an edge leaves the segment beyond, at u radii from its middle."""
    width = 2 * 6.0 * np.tan(np.radians(15.0))
    return _beyond_an_edge(width, 0.2 * abs(1.0 - 6.0 / focus))


@derivative(
    "camera.focus_distance", lens_blur, "focus",
    r"$-\frac{2 A z L}{3 \pi f^2} (\sqrt{1 - u^2})^3$ at the pixel's right border minus that "
    r"at its left, over its width", spp=131072, step=1 / 8
)  # fmt: skip
def lens_blur_by_focus() -> Expected:
    """The segment's share has the derivative 2 sqrt(1 - u^2) / pi by u, and u that of -u over the
    blur's radius by that radius, A z / f - A: their product is integrated over x exactly."""
    width = 2 * 6.0 * np.tan(np.radians(15.0))
    edges = (np.arange(33) / 32 - 0.5) * width
    u = np.clip((edges - 0.07) / 0.1, -1.0, 1.0)
    rise = np.diff(2.0 / (3.0 * np.pi) * (1.0 - u * u) ** 1.5) / (width / 32)
    return Expected(np.tile(rise * -0.2 * 6.0 / 16.0, (32, 1))[..., None] * WARM)


def _beyond_an_edge(width: float, radius: float) -> Expected:
    """A half plane x > 0.07 that shines, in a picture so wide there, each point seen as a disk."""
    place = level(width, 32)

    def shining(x: FloatArray, y: FloatArray) -> FloatArray:
        u = np.clip((place(x, y)[0] - 0.07) / radius, -1.0, 1.0)
        return 0.5 + (u * np.sqrt(1.0 - u * u) + np.arcsin(u)) / np.pi

    # Order 24: where the disk ends within a pixel, the segment grows as the power 1.5.
    return Expected(mix(pixel_means(shining, 32, 32, 24), WARM), 1e-6)


@case(AREA, "the plane in focus is sharp")
def lens_focus() -> Expected:
    """Whatever the point on the lens, its ray meets the plane in focus where that through the
    middle does: the triangle's outline is the pinhole's."""
    half = np.tan(np.radians(15.0))
    view = View((0, 0, 6), (0, 0, 0), (0, 1, 0), (half, half), (32, 32))
    return Expected(mix(view.drawn(FIRST * [1, 1, 0]), WARM))
