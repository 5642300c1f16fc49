"""One shape of any kind: maps, rays at it, what kernels find, and what the exact referee does."""

import itertools

import numpy as np
from builders import random_turn, shapes_in_order, unit_vectors
from drivers import probe

import reference_rt as rt
from comparisons.geometry.exact.dyadic import NEVER, Dyadic, nearest
from comparisons.referee import KINDS, columns_of, first_hit
from reference_rt.core.transform import Matrix
from reference_rt.shapes import TABLES

# ---- maps and rays ------------------------------------------------------------------------------


def random_map(rng, stretch=1.0, offset=3.0):
    """A step of a transform: rotation, scales from 10^-stretch to 10^stretch, shear, rotation,
    mirrored every other time, moved."""
    rotations = [random_turn(rng) for _ in range(2)]
    sheared = np.eye(3) + np.triu(rng.uniform(-1, 1, (3, 3)), 1)
    factors = 10.0 ** rng.uniform(-stretch, stretch, 3) * [1, 1, rng.choice([-1, 1])]
    linear = rotations[0] @ sheared @ np.diag(factors)
    if rng.uniform() < 0.5:
        linear = linear @ rotations[1]
    m = np.column_stack([linear, offset * rng.uniform(-1, 1, 3)])
    return Matrix(matrix=tuple(tuple(r) for r in m.tolist()))


def plane_points(table, rows, x, y):
    """Points of each row's plane."""
    return (
        table.center[rows]
        + table.x_edge[rows] * np.asarray(x)[:, None]
        + table.y_edge[rows] * np.asarray(y)[:, None]
    )


def rays_at(rng, points, distance):
    """Rays of any length towards the points, from about this far (n,)."""
    w = unit_vectors(rng, len(points))
    o = points + w * distance[:, None]
    return o, (points - o) * 10.0 ** rng.uniform(-3, 3, (len(points), 1))


def lattice_rays(reach=2):
    """From integers up to `reach`, along axes and diagonals, with either zero."""
    origins = np.array(list(itertools.product(range(-reach, reach + 1), repeat=3)), float)
    directions = [w for w in itertools.product((-1.0, 0.0, -0.0, 1.0), repeat=3) if any(w)]
    return np.repeat(origins, len(directions), axis=0), np.tile(directions, (len(origins), 1))


# ---- one shape ----------------------------------------------------------------------------------


class Placed:
    """One shape: its tables, the code of its kind, its row, and the middle and size of its bounds.
    Of a plane, 3 around its middle."""

    def __init__(self, shape):
        self.shape = shape
        self.tables, _ = shapes_in_order([shape])
        self.kind, self.field, table, module = next(
            (code, field, getattr(self.tables, field), module)
            for code, field, _, module in TABLES
            if getattr(self.tables, field) is not None
        )
        self.row = columns_of(table)
        self.table = table
        self.lower, self.upper = (side[0] for side in module.bounds(table))
        lower, upper = self.lower, self.upper
        if self.field == "planes":
            lower, upper = table.center[0] - 3.0, table.center[0] + 3.0
        self.middle, self.half = (lower + upper) / 2, (upper - lower) / 2
        self.size = np.linalg.norm(self.half)
        self.reach = self.size + np.abs(self.middle).max()

    @property
    def is_solid(self):
        return self.field not in ("rectangles", "disks", "triangles", "polygons") and (
            self.field != "quadrics" or bool(self.row["capped"][0])
        )

    def probe(self, o, d, w=None):
        """Of rays that leave what they hit towards w."""
        return probe(self.tables, self.kind, np.zeros(len(o)), o, d, w)

    def first(self, o, d):
        return first_hit(self.field, self.row, o, d)

    def rays(self, rng, n, distance):
        """At its bounds from 10^distance sizes, with |d| from 1e-3 to 1e3 of that."""
        target = self.middle + rng.uniform(-1.05, 1.05, (n, 3)) * self.half
        o = target + unit_vectors(rng, n) * self.size * 10.0 ** rng.uniform(*distance, (n, 1))
        return o, (target - o) * 10.0 ** rng.uniform(-3.0, 3.0, (n, 1))

    def normals(self, o, d, code):
        """Exact unit normals (n, 3) of first hits, up to their signs: of the points where rays hit
        that begin 2^-60 sizes beside.  Differences of exact t lose no digits."""
        h = 2.0**-60 * self.size
        across = np.cross(d, np.eye(3)[np.abs(d).argmin(axis=1)])
        sides = [
            v / np.linalg.norm(v, axis=1, keepdims=True) for v in (across, np.cross(d, across))
        ]
        origin, direction = Dyadic.of(o), Dyadic.of(d)
        t = []
        for side in (0.0 * d, *sides):
            found = KINDS[self.field](self.row, origin + Dyadic.of(h * side), direction)
            ahead = (found.t > 0) & (found.t != NEVER) & (found.code == code[:, None])
            t.append(np.where(ahead, found.t, NEVER).min(axis=1))
        slopes = [nearest(np.asarray(x - t[0], object))[:, None] / h for x in t[1:]]
        n = np.cross(*(side + slope * d for side, slope in zip(sides, slopes, strict=True)))
        return n / np.linalg.norm(n, axis=1, keepdims=True)


def anywhere(rng, shape, stretch=0.3):
    """Under a random map; a sphere stays one."""
    if isinstance(shape, rt.Sphere):
        return shape
    return shape.model_copy(update={"transform": (random_map(rng, stretch),)})


def put(shape, linear, offset=(0.0, 0.0, 0.0)):
    """The shape under an affine map."""
    m = np.column_stack([linear, offset])
    return shape.model_copy(update={"transform": (Matrix(matrix=tuple(map(tuple, m.tolist()))),)})
