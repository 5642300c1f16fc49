"""Quadrics in rational arithmetic, where every candidate for a hit is tested."""

import math
from fractions import Fraction
from typing import NamedTuple

import numpy as np

import reference_rt as rt
from reference_rt.core.transform import affine

BITS = 128


class Exact(NamedTuple):
    """form: A to J;  lower, upper, clipped: the box;  capped;  m: the map (3, 4);  rows: of the
    inverse of its linear part."""

    form: tuple
    lower: tuple
    upper: tuple
    clipped: tuple
    capped: bool
    m: np.ndarray
    rows: list


class Meeting(NamedTuple):
    """t (a Fraction to BITS bits, None for a miss), face, world normal, and |cos| to it."""

    t: Fraction | None
    face: int
    n: np.ndarray | None
    cos: float


NOTHING = Meeting(None, -1, None, 0.0)


def exactly(shape):
    """What a description means."""
    m = affine(shape.transform)
    if isinstance(shape, rt.Quadric):
        box = shape.lower, shape.upper, (True,) * 3
        return Exact(tuple(map(Fraction, shape.coefficients)), *box, shape.capped, m, inverse(m))
    if isinstance(shape, rt.Sphere):
        x, y, z = map(Fraction, shape.center)
        r = Fraction(shape.radius)
        form = (1, 1, 1, 0, 0, 0, -2 * x, -2 * y, -2 * z, x * x + y * y + z * z - r * r)
        box = (x - r, y - r, z - r), (x + r, y + r, z + r), (False,) * 3
        return Exact(form, *box, True, m, inverse(m))
    r = Fraction(shape.radius)
    if isinstance(shape, rt.Cylinder):
        form = (1, 1, 0, 0, 0, 0, 0, 0, 0, -r * r)
        low, high = shape.z_min, shape.z_max
    else:
        low, high = 0.0, shape.height
        k = (Fraction(shape.top_radius) - r) / Fraction(shape.height)
        form = (1, 1, -k * k, 0, 0, 0, 0, 0, -2 * r * k, -r * r)
        r = max(r, Fraction(shape.top_radius))
    box = (-r, -r, low), (r, r, high), (False, False, True)
    return Exact(form, *box, shape.capped, m, inverse(m))


def value(form, p):
    a, b, c, d, e, f, g, h, i, j = form
    x, y, z = p
    return x * (a * x + d * y + f * z + g) + y * (b * y + e * z + h) + z * (c * z + i) + j


def gradient(form, p):
    a, b, c, d, e, f, g, h, i, _ = form
    x, y, z = p
    return (
        2 * a * x + d * y + f * z + g,
        d * x + 2 * b * y + e * z + h,
        f * x + e * y + 2 * c * z + i,
    )


def inverse(m):
    """Rows of the exact inverse of the linear part."""
    a = [[Fraction(float(x)) for x in r[:3]] for r in m]
    cofactors = [
        [
            a[(r + 1) % 3][(c + 1) % 3] * a[(r + 2) % 3][(c + 2) % 3]
            - a[(r + 1) % 3][(c + 2) % 3] * a[(r + 2) % 3][(c + 1) % 3]
            for c in range(3)
        ]
        for r in range(3)
    ]
    determinant = sum(a[0][c] * cofactors[0][c] for c in range(3))
    return [[cofactors[r][c] / determinant for r in range(3)] for c in range(3)]


def square_root(x):
    """Of a Fraction >= 0, to BITS bits."""
    if x == 0:
        return Fraction(0)
    n, d = x.numerator, x.denominator
    shift = max(0, 2 * BITS - (n * d).bit_length())
    shift += shift % 2
    return Fraction(math.isqrt((n * d) << shift), d << (shift // 2))


def local(exact, p, is_point):
    v = [Fraction(float(x)) for x in p]
    if is_point:
        v = [x - Fraction(float(c)) for x, c in zip(v, exact.m[:, 3], strict=True)]
    return [sum(r * x for r, x in zip(row, v, strict=True)) for row in exact.rows]


def meetings(exact, o, d):
    """All crossings of the line with the surface, of any sign, in order."""
    o, d = local(exact, o, True), local(exact, d, False)
    c = value(exact.form, o)
    b = sum(g * x for g, x in zip(gradient(exact.form, o), d, strict=True)) / 2
    a = value((*exact.form[:6], 0, 0, 0, 0), d)
    found = []
    if a != 0:
        if b * b - a * c >= 0:
            root = square_root(b * b - a * c)
            # The root that cancels, from the product of the two: exact to BITS bits as well.
            q = -(b + root) if b >= 0 else -(b - root)
            found += [q / a, c / q if q != 0 else q / a]
    elif b != 0:
        found.append(-c / (2 * b))

    def inside(p, but=-1):
        return all(
            k == but or not exact.clipped[k] or exact.lower[k] <= p[k] <= exact.upper[k]
            for k in range(3)
        )

    out = []
    for t in found:
        p = [x + t * y for x, y in zip(o, d, strict=True)]
        if inside(p):
            out.append(_meeting(t, 0, gradient(exact.form, p), d, exact))
    for axis in range(3) if exact.capped else ():
        if not exact.clipped[axis] or d[axis] == 0:
            continue
        for side, plane in ((0, exact.lower[axis]), (1, exact.upper[axis])):
            t = (Fraction(plane) - o[axis]) / d[axis]
            p = [x + t * y for x, y in zip(o, d, strict=True)]
            if value(exact.form, p) <= 0 and inside(p, axis):
                n = [Fraction(0)] * 3
                n[axis] = Fraction(2 * side - 1)
                out.append(_meeting(t, 1 + axis + 3 * side, n, d, exact))
    return sorted(out, key=lambda x: x.t)


def _meeting(t, face, n, d, exact):
    """The local normal n and direction d in the world."""
    world = np.array([float(sum(exact.rows[k][c] * n[k] for k in range(3))) for c in range(3)])
    ray = exact.m[:, :3] @ np.array([float(x) for x in d])
    size = np.linalg.norm(world)
    if size == 0.0:
        return Meeting(t, face, None, 0.0)
    world = world / size
    return Meeting(t, face, world, abs(float(world @ ray)) / np.linalg.norm(ray))


def first(exact, o, d):
    return next((m for m in meetings(exact, o, d) if m.t > 0), NOTHING)


def side(exact, p):
    """f at a point of the world: its sign says on which side it lies."""
    return value(exact.form, local(exact, p, True))


def extent(exact):
    """The world's length of half the box's diagonal, or of what stands for it."""
    half = [(float(b) - float(a)) / 2 for a, b in zip(exact.lower, exact.upper, strict=True)]
    return float(np.linalg.norm(np.abs(exact.m[:, :3]) @ half))


def middle(exact):
    box = [(float(a) + float(b)) / 2 for a, b in zip(exact.lower, exact.upper, strict=True)]
    return exact.m[:, :3] @ box + exact.m[:, 3]
