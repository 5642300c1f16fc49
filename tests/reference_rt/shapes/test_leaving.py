"""Rays that leave a surface never hit the same flat surface again.

F2 of the stability suites has every kind of shape, at all sizes, distances and angles."""

from functools import partial

import numpy as np
import pytest
from builders import U, random_shape, shapes_in_order, unit_vectors
from drivers import probe
from flat_checks import leave_and_return, plane_points, random_map

import reference_rt as rt
from reference_rt.shapes import BOX, DISK, PLANE, POLYGON, RECTANGLE, SPHERE, TRIANGLE

KINDS = {"sphere": SPHERE, "rectangle": RECTANGLE, "box": BOX, "triangle": TRIANGLE}
N = 100_000


def extent(table, rows):
    """(points inside or on each shape, its size) for aiming."""
    if hasattr(table, "radius"):
        return table.center[rows], table.radius[rows]
    if hasattr(table, "vertices"):
        v = table.vertices[rows].reshape(-1, 3, 3)
        return v.mean(axis=1), np.abs(v - v[:, :1]).max(axis=(1, 2))
    if hasattr(table, "edges"):
        return table.center[rows], np.abs(table.edges[rows]).max(axis=1)
    return table.center[rows], np.maximum(
        np.abs(table.x_edge[rows]).max(axis=1), np.abs(table.y_edge[rows]).max(axis=1)
    )


def leave(kind, shapes, rng):
    """N rays hit the shapes and leave towards any side, half of them grazing."""
    tables, rows = shapes_in_order(shapes)
    rows = np.tile(rows, N // len(rows))
    (table,) = (t for t in tables if t is not None)
    center, size = extent(table, rows)
    n = len(rows)
    o = center + unit_vectors(rng, n) * size[:, None] * rng.uniform(0.01, 8.0, (n, 1))
    w = unit_vectors(rng, n)
    first = probe(tables, KINDS[kind], rows, o, center - o)
    in_plane = w - first.n * np.sum(w * first.n, axis=1, keepdims=True)
    grazing = in_plane + first.n * rng.choice([-1, 1], (n, 1)) * 10.0 ** rng.uniform(
        -16, -1, (n, 1)
    )
    w[::2] = grazing[::2]
    found = probe(tables, KINDS[kind], rows, o, center - o, w)
    hit = np.isfinite(found.t)
    assert hit.mean() > 0.9
    # By where the ray starts: a grazing w·n may round to either sign.
    outside = np.sum((found.start - found.p) * found.n, axis=1) > 0
    return found, hit, outside, center, size, w


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("scale", "offset"), [(1.0, 1.0), (1e-6, 1e3), (1e6, 1e3)])
def test_leaving(kind, scale, offset):
    """`offset` is the distance from the origin in sizes."""
    rng = np.random.default_rng(21)
    shapes = [random_shape(kind, rng, scale, offset * scale) for _ in range(50)]
    found, hit, outside, center, size, w = leave(kind, shapes, rng)
    if kind in ("rectangle", "triangle"):
        assert not np.isfinite(found.again[hit]).any()
    else:
        assert not np.isfinite(found.again[hit & outside]).any()
        # Into a solid: its other side, and nothing nearer than the step that was taken.
        inwards = hit & ~outside
        step = np.linalg.norm(found.start - found.p, axis=1)
        assert np.isfinite(found.again[inwards]).all()
        if kind == "box":
            assert (found.again * np.linalg.norm(w, axis=1) > step)[inwards].all()
    # The policy's 16 sqrt(3) u for anchor, point and size, and the rounding of the sum; for a box
    # as much again as |M| |A| makes of sizes that differ by up to 4.
    thin = {"box": 4.0}.get(kind, 1.0)
    largest = np.abs(center).max(axis=1) + np.abs(found.p).max(axis=1) + 6 * size
    moved = np.linalg.norm(found.start - found.p, axis=1)
    assert (moved <= 30 * U * largest * thin)[hit].all()
    assert (moved > 0)[hit].all()


FLAT = {
    "disk": (rt.Disk, DISK),
    "plane": (rt.Plane, PLANE),
    "polygon": (partial(rt.Polygon, rings=[[(-1, -1), (1, -1), (1, 1), (-0.8, 0.9)]]), POLYGON),
}


@pytest.mark.cases(2)
@pytest.mark.parametrize("name", FLAT)
def test_leaving_the_stretched(name):
    """Sheared, mirrored, up to 1e6 times as long as wide, and 1e12 away; a plane is left as far
    from its middle too."""
    rng = np.random.default_rng(3)
    make, kind = FLAT[name]
    left = 0
    for stretch, offset, reach in ((0, 0, 1), (3, 1, 1), (3, 1e6, 1e3), (1, 1e12, 1e12)):
        shapes = [make(transform=(random_map(rng, stretch, offset),)) for _ in range(50)]
        tables, rows = shapes_in_order(shapes)
        (table,) = (t for t in tables if t is not None)
        rows = np.tile(rows, 400)
        x, y = rng.uniform(-0.7, 0.7, (2, len(rows)))
        if kind == PLANE:
            x, y = reach * x, reach * y
        if kind == POLYGON:  # its table's coordinates have another origin
            low, high = table.lower[rows].T, table.upper[rows].T
            x, y = (low + high + (high - low) * [x, y]) / 2
        size = np.linalg.norm(table.x_edge[rows], axis=1)
        points = plane_points(table, rows, x, y)
        hits, again = leave_and_return(tables, kind, rows, points, size, rng)
        left += hits
        assert np.isinf(again).all()
    assert left > 60_000


def test_leaving_slivers():
    """Triangles whose height is 1e-12 of their longest edge, left by as little as any."""
    rng = np.random.default_rng(22)
    height, offset = 1e-12, 100.0
    shapes = []
    for _ in range(50):
        c = offset * rng.uniform(-1, 1, 3)
        a, b, up = c + rng.uniform(-1, 1, (3, 3))
        tip = a + (b - a) * rng.uniform(0, 1) + (up - c) * height
        shapes.append(rt.Triangle(v0=tuple(a), v1=tuple(b), v2=tuple(tip)))
    found, hit, _, center, size, _ = leave("triangle", shapes, rng)
    assert not np.isfinite(found.again[hit]).any()
    largest = np.abs(center).max(axis=1) + np.abs(found.p).max(axis=1) + 6 * size
    assert (np.linalg.norm(found.start - found.p, axis=1) <= 30 * U * largest)[hit].all()


def test_normals_of_slivers_are_perpendicular_to_their_edges():
    """To a few roundings, however thin; by plain products they are off by 1e-4 at 1e-12."""
    rng = np.random.default_rng(23)
    for height in (1e-2, 1e-6, 1e-12):
        a, b, up = rng.uniform(-1, 1, (3, 3))
        v = np.array([a, b, a + (b - a) * 0.3 + up * height])
        shapes = [rt.Triangle(v0=tuple(v[0]), v1=tuple(v[1]), v2=tuple(v[2]))]
        tables, rows = shapes_in_order(shapes)
        middle = v.mean(axis=0)
        toward = np.cross(b - a, up)
        found = probe(tables, TRIANGLE, rows, [middle + toward], [-toward])
        if np.isfinite(found.t[0]):
            edge = (b - a) / np.linalg.norm(b - a)
            assert abs(found.n[0] @ edge) <= 8 * U


def test_glass_of_any_size_is_left_on_its_far_side():
    """Down the axis of spheres from 1e-6 to 1e6: in at the front, out at the back."""
    for radius in (1e-6, 1.0, 1e6):
        tables, rows = shapes_in_order([rt.Sphere(radius=radius, center=(0, 0, 2 * radius))])
        found = probe(tables, SPHERE, rows, [[0, 0, -radius]], [[0, 0, 1.0]])
        # t is the distance: from -r to r, then across 2 r, each rounded a few times.
        assert found.t[0] == pytest.approx(2 * radius, rel=8 * U)
        assert found.again[0] == pytest.approx(2 * radius, rel=256 * U)
