"""Every kind of shape, turned, sheared and mirrored, and where rays cross it by closed forms."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from builders import icosphere, write_obj

import reference_rt as rt
from reference_rt.core import transform
from reference_rt.core.arrays import FloatArray

Polynomial = Callable[[FloatArray, FloatArray], list[FloatArray]]


class Form(NamedTuple):
    """A surface in its own coordinates: `zeros`, from an origin and a direction all t at which
    something of it may lie;  holds: whether points (n, 3) there do.  A solid is told by `inside`
    alone, of points (n, 3): its surface is where that changes."""

    zeros: Callable[[FloatArray, FloatArray], FloatArray]
    holds: Callable[[FloatArray], FloatArray] | None = None
    inside: Callable[[FloatArray], FloatArray] | None = None


def real_roots(values: Callable[[FloatArray], FloatArray], degree: int) -> FloatArray:
    """The real zeros of a polynomial in t, told by its values."""
    t = np.cos(np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1)) * 4.0
    roots = np.polynomial.Polynomial.fit(t, values(t), degree).convert().roots()
    return roots[np.abs(roots.imag) < 1e-7].real


def implicit(f: Callable[[FloatArray], FloatArray], degree: int) -> Callable[..., FloatArray]:
    """The zeros of f along a line, seen from the line's point that is nearest to the origin."""

    def zeros(o: FloatArray, d: FloatArray) -> FloatArray:
        speed = np.linalg.norm(d)
        middle = -(o @ d) / speed**2
        nearest = o + middle * d
        return middle + real_roots(lambda s: f(nearest + s[:, None] * d / speed), degree) / speed

    return zeros


def plane(axis: int, at: float) -> Callable[..., FloatArray]:
    return lambda o, d: np.array([(at - o[axis]) / d[axis]])


def several(*parts: Callable[..., FloatArray]) -> Callable[..., FloatArray]:
    return lambda o, d: np.concatenate([part(o, d) for part in parts])


def in_polygon(p: FloatArray) -> FloatArray:
    """Even-odd, of STAR."""
    found = np.zeros(len(p), bool)
    for a, b in zip(STAR, np.roll(STAR, -1, axis=0), strict=True):
        if a[1] != b[1]:
            spans = (a[1] > p[:, 1]) != (b[1] > p[:, 1])
            found ^= spans & (p[:, 0] < a[0] + (p[:, 1] - a[1]) * (b[0] - a[0]) / (b[1] - a[1]))
    return found


def in_triangle(p: FloatArray) -> FloatArray:
    return (p[:, 0] >= 0) & (p[:, 1] >= 0) & (p[:, 0] + p[:, 1] <= 1)


STAR = np.array([[0.0, 1.0], [0.6, -0.8], [-1.0, 0.3], [1.0, 0.3], [-0.6, -0.8]])
CONE = (1.0, 1.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.1)
WIDE = ((-0.9, -0.8, -0.7), (0.8, 0.9, 1.0))


def hyperboloid(p: FloatArray) -> FloatArray:
    """x² + y² - z² + 0.1: two sheets."""
    return p[..., 0] ** 2 + p[..., 1] ** 2 - p[..., 2] ** 2 + 0.1


def in_wide(p: FloatArray) -> FloatArray:
    return np.all((p >= WIDE[0]) & (p <= WIDE[1]), axis=-1)


def tube(p: FloatArray) -> FloatArray:
    x, y, z = p[..., 0], p[..., 1], p[..., 2]
    return (x * x + y * y + z * z + 0.7**2 - 0.3**2) ** 2 - 4 * 0.7**2 * (x * x + y * y)


def ball(p: FloatArray, radius: float) -> FloatArray:
    return np.sum(p * p, axis=-1) - radius**2


box_planes = several(*(plane(axis, at) for axis in range(3) for at in (-1.0, 1.0)))
wide_planes = several(*(plane(axis, corner[axis]) for axis in range(3) for corner in WIDE))
bite_zeros = several(box_planes, implicit(lambda p: ball(p, 1.2), 2))


def in_cube(p: FloatArray) -> FloatArray:
    return np.all(np.abs(p) <= 1.0, axis=-1)


def in_bite(p: FloatArray) -> FloatArray:
    return in_cube(p) & (ball(p, 1.2) > 0)


def kinds(folder: Path) -> dict[str, tuple[Callable[..., object], Form]]:
    """By name: the shape, for a transform, and its form."""
    vertices, faces = icosphere(1)
    file = write_obj(folder / "ball.obj", vertices, faces)
    corners = vertices[faces]

    def of_mesh(o: FloatArray, d: FloatArray) -> FloatArray:
        a, e, f = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        h = np.cross(d, f)
        scale = 1.0 / np.sum(e * h, axis=1)
        u = np.sum((o - a) * h, axis=1) * scale
        q = np.cross(o - a, e)
        v = q @ d * scale
        return (np.sum(f * q, axis=1) * scale)[(u >= 0) & (v >= 0) & (u + v <= 1)]

    def round_tube(p: FloatArray) -> FloatArray:
        return p[..., 0] ** 2 + p[..., 1] ** 2 - 0.25

    def pointed(p: FloatArray) -> FloatArray:
        return p[..., 0] ** 2 + p[..., 1] ** 2 - (0.6 * (1.0 - p[..., 2])) ** 2

    def between(p: FloatArray) -> FloatArray:
        return (p[:, 2] >= 0.0) & (p[:, 2] <= 1.0)

    flat, top = plane(2, 0.0), plane(2, 1.0)
    quadric = {"coefficients": CONE, "lower": WIDE[0], "upper": WIDE[1]}
    return {
        "ellipsoid": (
            lambda **at: rt.Sphere(radius=0.8, **at),
            Form(implicit(lambda p: ball(p, 0.8), 2)),
        ),
        "box": (rt.Box, Form(box_planes, inside=in_cube)),
        "rectangle": (rt.Rectangle, Form(flat, lambda p: np.all(np.abs(p[:, :2]) <= 1, axis=1))),
        "disk": (rt.Disk, Form(flat, lambda p: np.sum(p[:, :2] ** 2, axis=1) <= 1)),
        "plane": (rt.Plane, Form(flat)),
        "triangle": (
            lambda **at: rt.Triangle(v0=(0, 0, 0), v1=(1, 0, 0), v2=(0, 1, 0), **at),
            Form(flat, in_triangle),
        ),
        "polygon": (lambda **at: rt.Polygon(rings=(STAR.tolist(),), **at), Form(flat, in_polygon)),
        "mesh": (lambda **at: rt.Mesh(file=str(file), **at), Form(of_mesh)),
        "cylinder": (
            lambda **at: rt.Cylinder(radius=0.5, capped=False, **at),
            Form(implicit(round_tube, 2), between),
        ),
        "cone": (
            lambda **at: rt.Cone(radius=0.6, **at),
            Form(
                several(implicit(pointed, 2), flat, top),
                inside=lambda p: (pointed(p) <= 0.0) & between(p),
            ),
        ),
        "torus": (
            lambda **at: rt.Torus(major_radius=0.7, minor_radius=0.3, **at),
            Form(implicit(tube, 4)),
        ),
        "quadric": (
            lambda **at: rt.Quadric(**quadric, **at),
            Form(implicit(hyperboloid, 2), in_wide),
        ),
        "capped": (
            lambda **at: rt.Quadric(**quadric, capped=True, **at),
            Form(
                several(implicit(hyperboloid, 2), wide_planes),
                inside=lambda p: (hyperboloid(p) <= 0) & in_wide(p),
            ),
        ),
        "solid": (
            lambda **at: rt.Difference(of=(rt.Box(), rt.Sphere(radius=1.2)), **at),
            Form(bite_zeros, inside=in_bite),
        ),
        "group": (
            lambda **at: rt.Instance(group="pair", **at),
            Form(several(implicit(lambda p: ball(p, 0.8), 2), implicit(apart, 2))),
        ),
    }


GROUPS = {"pair": (rt.Sphere(radius=0.8), rt.Sphere(radius=0.3, center=(0.2, 0.9, 0.1)))}


def apart(p: FloatArray) -> FloatArray:
    """The second of GROUPS' pair."""
    return ball(p - (0.2, 0.9, 0.1), 0.3)


def tilted(rng: np.random.Generator, k: int, mirrored: bool) -> tuple:
    """A map that turns, shears, stretches and, or not, mirrors; each somewhere else."""
    axis = rng.normal(size=3)
    turn = transform.Rotate(
        rotate=transform.Turn(axis=tuple(axis), degrees=float(rng.uniform(0, 360)))
    )
    linear = np.eye(3) + 0.3 * rng.uniform(-1, 1, (3, 3))
    if mirrored:
        linear[:, 0] *= -1.0
    matrix = np.column_stack([linear, 2.5 * np.array([k % 4, k // 4 % 4, 0.3 * k])])
    rows = tuple(tuple(map(float, row)) for row in matrix)
    return turn, transform.Matrix(matrix=rows)


def crossings_of(form: Form, m: FloatArray, o: FloatArray, d: FloatArray) -> FloatArray:
    """All t > 0 at which a ray crosses a shape under the map m (3, 4), in order."""
    inverse = np.linalg.inv(m[:, :3])
    local_o, local_d = inverse @ (o - m[:, 3]), inverse @ d
    t = np.sort(form.zeros(local_o, local_d))
    at = local_o + t[:, None] * local_d
    if form.holds is not None:
        t = t[form.holds(at)]
    if form.inside is not None and len(t) > 0:
        middles = np.concatenate([[t[0] - 1.0], 0.5 * (t[1:] + t[:-1]), [t[-1] + 1.0]])
        inside = form.inside(local_o + middles[:, None] * local_d)
        t = t[inside[1:] != inside[:-1]]
    return t[t > 0.0]
