"""Helpers for tests of flat shapes: maps, rays, and the plane in rational arithmetic."""

import itertools
from fractions import Fraction as Q

import numpy as np
from builders import U, shapes_in_order, unit_vectors
from drivers import probe
from rational import cross, dot, q

from reference_rt.core import transform


def random_map(rng, stretch=1.0, offset=3.0):
    """A step of a transform: rotation, scales from 10^-stretch to 10^stretch, shear, rotation,
    mirrored every other time, moved."""
    rotations = [np.linalg.qr(rng.normal(size=(3, 3)))[0] for _ in range(2)]
    sheared = np.eye(3) + np.triu(rng.uniform(-1, 1, (3, 3)), 1)
    factors = 10.0 ** rng.uniform(-stretch, stretch, 3) * [1, 1, rng.choice([-1, 1])]
    linear = rotations[0] @ sheared @ np.diag(factors)
    if rng.uniform() < 0.5:
        linear = linear @ rotations[1]
    m = np.column_stack([linear, offset * rng.uniform(-1, 1, 3)])
    return transform.Matrix(matrix=tuple(tuple(r) for r in m.tolist()))


def mirrors(shape):
    """Whether the map of a shape mirrors space."""
    return np.linalg.det(transform.affine(shape.transform)[:, :3]) < 0


def plane_points(table, rows, x, y):
    """Points of each row's plane."""
    return (
        table.center[rows]
        + table.x_edge[rows] * np.asarray(x)[:, None]
        + table.y_edge[rows] * np.asarray(y)[:, None]
    )


def rays_at_plane(rng, table, rows, x, y, distance):
    """Rays towards points of each row's plane."""
    return rays_at(rng, plane_points(table, rows, x, y), distance)


def rays_at(rng, points, distance):
    """Rays of any length towards the points, from about this far (n,)."""
    w = unit_vectors(rng, len(points))
    o = points + w * distance[:, None]
    return o, (points - o) * 10.0 ** rng.uniform(-3, 3, (len(points), 1))


class ExactHits:
    """Where rays meet planes, in rational arithmetic: t, x, y (n,), None for parallel ones, and the
    bounds (n,) that `flat.meet` promises for the computed t, x and y."""

    def __init__(self, table, rows, o, d):
        c, a, b = (k[rows] for k in (table.center, table.x_edge, table.y_edge))
        self.t, self.x, self.y = [], [], []
        self.t_error, self.x_error, self.y_error = np.zeros((3, len(rows)))
        for i in range(len(rows)):
            f = [p - q for p, q in zip(q(o[i]), q(c[i]), strict=True)]
            direction, u, v = q(d[i]), q(a[i]), q(b[i])
            n = cross(u, v)
            n2, slope = dot(n, n), dot(direction, n)
            if slope == 0:
                self.t.append(None), self.x.append(None), self.y.append(None)
                continue
            t = -dot(f, n) / slope
            at = [p + t * q for p, q in zip(f, direction, strict=True)]
            x_of, y_of = [s / n2 for s in cross(v, n)], [s / n2 for s in cross(n, u)]
            self.t.append(t), self.x.append(dot(at, x_of)), self.y.append(dot(at, y_of))
            speed = float(dot(direction, direction)) ** 0.5
            cosine = abs(float(slope)) / (speed * float(n2) ** 0.5)
            r = float(dot(f, f)) ** 0.5 + abs(float(t)) * speed
            self.t_error[i] = 7 * U * r / cosine / speed
            self.x_error[i] = 13 * U * r / cosine * float(dot(x_of, x_of)) ** 0.5
            self.y_error[i] = 13 * U * r / cosine * float(dot(y_of, y_of)) ** 0.5


def check_distances(tables, kind, rows, o, d):
    """t to 16 ulp of itself and the size, in lengths, where the cosine is 0.1 and more."""
    table = next(t for t in tables if t is not None)
    found, right = probe(tables, kind, rows, o, d), ExactHits(table, rows, o, d)
    speed = np.linalg.norm(d, axis=1)
    cosine = np.abs(np.sum(d * table.normal[rows], axis=1)) / speed
    size = np.linalg.norm(np.hstack([table.x_edge, table.y_edge])[rows], axis=1)
    worst = max(
        abs(float(Q(found.t[i]) - right.t[i])) * speed[i] / (found.t[i] * speed[i] + size[i])
        for i in np.flatnonzero(np.isfinite(found.t) & (cosine > 0.1))
    )
    assert worst <= 16 * 2 * U


def lattice_rays(reach=2):
    """From integers up to `reach`, along axes and diagonals, with either zero."""
    origins = np.array(list(itertools.product(range(-reach, reach + 1), repeat=3)), float)
    directions = [w for w in itertools.product((-1.0, 0.0, -0.0, 1.0), repeat=3) if any(w)]
    return np.repeat(origins, len(directions), axis=0), np.tile(directions, (len(origins), 1))


def lattice_hits(shape, kind):
    """Of one shape: the origins and directions of `lattice_rays`, and their hits."""
    o, d = lattice_rays()
    tables, _ = shapes_in_order([shape])
    return o, d, probe(tables, kind, np.zeros(len(o)), o, d)


def check_normal(n, shape, table, i):
    """The hit's normal n against the exact one (3,), which is returned, and its side."""
    normal, side = exact_normal(table, i)
    assert side == (-1 if mirrors(shape) else 1)
    assert np.abs(n - side * normal).max() <= 4 * U
    return normal


def exact_normal(table, i):
    """That of x_edge x y_edge (3,), and its sign against the table's."""
    n = [float(x) for x in cross(q(table.x_edge[i]), q(table.y_edge[i]))]
    n = np.array(n) / np.abs(n).max()
    n /= np.linalg.norm(n)
    return n, np.sign(n @ table.normal[i])


def leave_and_return(tables, kind, rows, points, size, rng):
    """How many of the rays hit, and the t at which those meet the shape again that leave it towards
    anywhere, half of them grazing by 1e-1 to 1e-16."""
    n = len(rows)
    o = points + unit_vectors(rng, n) * size[:, None] * 10.0 ** rng.uniform(-2, 2, (n, 1))
    w = unit_vectors(rng, n)
    table = next(t for t in tables if t is not None)
    normal = table.normal[rows]
    in_plane = w - normal * np.sum(w * normal, axis=1, keepdims=True)
    grazing = in_plane + normal * rng.choice([-1, 1], (n, 1)) * 10.0 ** rng.uniform(-16, -1, (n, 1))
    w[::2] = grazing[::2]
    found = probe(tables, kind, rows, o, points - o, w * 10.0 ** rng.uniform(-3, 3, (n, 1)))
    hit = np.isfinite(found.t)
    return hit.sum(), found.again[hit]
