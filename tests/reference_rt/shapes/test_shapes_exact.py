"""Every shape against rational arithmetic: floats are rationals, so the right answer is exact."""

from fractions import Fraction as Q

import numpy as np
import pytest
from builders import U, random_shape, shapes_in_order, unit_vectors
from drivers import probe
from flat_checks import lattice_rays
from rational import dot, q, solve, sub

import reference_rt as rt
from reference_rt.shapes import BOX, RECTANGLE, SPHERE, TRIANGLE

N = 800


def rays_towards(rng, points):
    """Origins around the points and directions of any length that roughly aim at them."""
    n = len(points)
    size = np.abs(points).max()
    o = points + rng.uniform(-4, 4, (n, 3)) * size
    d = (points + 0.7 * size * unit_vectors(rng, n) * rng.uniform(0, 2, (n, 1)) - o) * 10.0 ** (
        rng.uniform(-3, 3, (n, 1))
    )
    return o, d


# ---- sphere -------------------------------------------------------------------------------------


def test_sphere_hits_and_misses_have_the_discriminants_sign():
    """Rays aimed at the rim, off by 1e-4 to 1e-17 of the radius."""
    rng = np.random.default_rng(1)
    spheres = [random_shape("sphere", rng, 1.0, 3.0) for _ in range(N)]
    tables, rows = shapes_in_order(spheres)
    c, r = np.array([s.center for s in spheres]), np.array([s.radius for s in spheres])
    o = c + rng.uniform(1.5, 6, (N, 1)) * r[:, None] * unit_vectors(rng, N)
    side = np.cross(o - c, unit_vectors(rng, N))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    distance = np.linalg.norm(c - o, axis=1)
    # The tangent from o touches at angle asin(r / distance) from the direction of the centre.
    off = 1.0 + rng.choice([-1, 1], N) * 10.0 ** rng.uniform(-17, -4, N)
    sine = r * off / distance
    d = (c - o) / distance[:, None] * np.sqrt(1 - sine**2)[:, None] + side * sine[:, None]
    t = probe(tables, SPHERE, rows, o, d).t
    decided = 0
    for i in range(N):
        f, direction = sub(q(o[i]), q(c[i])), q(d[i])
        a, b = dot(direction, direction), -dot(f, direction)
        discriminant = Q(r[i]) ** 2 - dot(f, f) + b * b / a
        # f rounds once, b/a and its product with d eight times, each relative to |f|; squaring
        # doubles it against r: 2 * 9 u |f| r, and the squares' own rounding 4 u r².
        margin = 18 * U * distance[i] * r[i] + 4 * U * r[i] ** 2
        if abs(discriminant) > margin:
            decided += 1
            assert np.isfinite(t[i]) == (discriminant > 0)
    assert decided > N // 2


def test_sphere_points_lie_on_it_and_are_the_right_root():
    rng = np.random.default_rng(2)
    spheres = [random_shape("sphere", rng, 1.0, 3.0) for _ in range(N)]
    tables, rows = shapes_in_order(spheres)
    c, r = np.array([s.center for s in spheres]), np.array([s.radius for s in spheres])
    o, d = rays_towards(rng, c)
    found = probe(tables, SPHERE, rows, o, d)
    for i in np.flatnonzero(np.isfinite(found.t)):
        f, direction, t = sub(q(o[i]), q(c[i])), q(d[i]), Q(found.t[i])
        p = [x + t * y for x, y in zip(f, direction, strict=True)]
        reach = float(np.linalg.norm(o[i] - c[i])) + r[i]
        # |p|² - r² = 2 r times the distance from the sphere: some twenty roundings of
        # numbers up to reach², the squares of what the quadratic is made of.
        assert abs(float(dot(p, p) - Q(r[i]) ** 2)) <= 20 * U * reach**2
        inside = dot(f, f) < Q(r[i]) ** 2
        cosine = float(dot(p, direction)) / (r[i] * np.linalg.norm(d[i]))
        if abs(cosine) > 1e-6:  # nearer to the rim both roots are equal to within rounding
            assert (cosine > 0) == inside
        normal = found.n[i]
        assert abs(np.linalg.norm(normal) - 1) < 4 * U
        assert np.allclose(normal, [float(x) / r[i] for x in p], rtol=0, atol=20 * U * reach / r[i])
    assert 0.3 * N < np.isfinite(found.t).sum() < N


# ---- flat shapes --------------------------------------------------------------------------------


@pytest.mark.cases(1)
@pytest.mark.parametrize("kind", ["rectangle", "triangle"])
def test_flat_shapes(kind):
    """Hit or miss by the exact coordinates in the plane, away from the edge by their rounding;
    the distance from the plane of the computed t."""
    rng = np.random.default_rng(3)
    shapes = [random_shape(kind, rng, 1.0, 3.0) for _ in range(N)]
    tables, rows = shapes_in_order(shapes)
    o, d = rays_towards(rng, rng.uniform(-3, 3, (N, 3)))
    if kind == "rectangle":
        table = tables.rectangles
        anchor, e0, e1 = (a[rows] for a in (table.center, table.x_edge, table.y_edge))
    else:
        v = tables.triangles.vertices[rows].reshape(N, 3, 3)
        anchor, e0, e1 = v[:, 0], v[:, 1] - v[:, 0], v[:, 2] - v[:, 0]
    # Half the rays at the shape itself.
    aim = anchor + e0 * rng.uniform(0, 0.6, (N, 1)) + e1 * rng.uniform(0, 0.6, (N, 1))
    d[::2] = (aim - o)[::2]
    found = probe(tables, {"rectangle": RECTANGLE, "triangle": TRIANGLE}[kind], rows, o, d)
    hits = 0
    for i in range(N):
        corners = [q(x) for x in v[i]] if kind == "triangle" else None
        edges = [sub(c, corners[0]) for c in corners[1:]] if corners else [q(e0[i]), q(e1[i])]
        exact = solve([*edges, [-x for x in q(d[i])]], sub(q(o[i]), q(anchor[i])))
        if exact is None:
            assert np.isinf(found.t[i])
            continue
        x, y, t = exact
        n = np.cross(e0[i], e1[i])
        cosine = abs(n @ d[i]) / (np.linalg.norm(n) * np.linalg.norm(d[i]))
        reach = np.linalg.norm(o[i] - anchor[i]) + np.linalg.norm(e0[i]) + np.linalg.norm(e1[i])
        # Some twenty roundings of numbers up to `reach`, stretched by grazing incidence and by
        # thin shapes (their height, area / longest edge, is what x and y are measured in).
        height = np.linalg.norm(n) / max(np.linalg.norm(e0[i]), np.linalg.norm(e1[i]))
        error = 20 * U * reach / cosine
        inside = min(1 - abs(x), 1 - abs(y)) if kind == "rectangle" else min(x, y, 1 - x - y)
        if abs(inside) < 2 * error / height or abs(t) * Q(float(np.linalg.norm(d[i]))) < error:
            continue
        assert np.isfinite(found.t[i]) == (t > 0 and inside > 0)
        if np.isfinite(found.t[i]):
            hits += 1
            assert abs(float(Q(found.t[i]) - t)) * np.linalg.norm(d[i]) <= error
            uv = ((x + 1) / 2, (y + 1) / 2) if kind == "rectangle" else (x, y)
            # uv are lengths over the height.
            assert np.allclose(
                [found.u[i], found.v[i]], [float(s) for s in uv], rtol=0, atol=error / height
            )
            unit = n / np.linalg.norm(n)
            # A cross product of edges up to `reach` long, over its own length.
            limit = 20 * U * reach**2 / np.linalg.norm(n)
            assert np.allclose(found.n[i], unit, rtol=0, atol=limit)
    assert hits > N // 4


# ---- box ----------------------------------------------------------------------------------------


def expected_box(local_o, local_d):
    """The smallest t > 0 on the surface of [-1, 1]³, closed slabs; None for a miss."""
    t_in, t_out = None, None
    for x, dx in zip(local_o, local_d, strict=True):
        if dx == 0:
            if abs(x) > 1:
                return None
            continue
        a, b = sorted(((-1 - x) / dx, (1 - x) / dx))
        t_in = a if t_in is None else max(t_in, a)
        t_out = b if t_out is None else min(t_out, b)
    if t_in > t_out:
        return None
    return t_in if t_in > 0 else t_out if t_out > 0 else None


def test_box_from_outside_and_inside():
    rng = np.random.default_rng(4)
    shapes = [random_shape("box", rng, 1.0, 3.0) for _ in range(N)]
    tables, rows = shapes_in_order(shapes)
    edges = tables.boxes.edges[rows].reshape(N, 3, 3)
    center = tables.boxes.center[rows]
    o, d = rays_towards(rng, center)
    o[::3] = (center + np.einsum("nij,ni->nj", edges, rng.uniform(-0.99, 0.99, (N, 3))))[::3]
    found = probe(tables, BOX, rows, o, d)
    hits, faces = 0, set()
    for i in range(N):
        columns = [q(e) for e in edges[i]]
        local_o, local_d = solve(columns, sub(q(o[i]), q(center[i]))), solve(columns, q(d[i]))
        size, longest = np.linalg.norm(edges[i], axis=1).min(), np.linalg.norm(edges[i])
        reach = np.linalg.norm(o[i] - center[i]) + longest
        error = 20 * U * reach / size  # of a local coordinate; the inverse map's included
        exact = expected_box(local_o, local_d)
        if np.isfinite(found.t[i]) != (exact is not None):
            t = Q(found.t[i]) if exact is None else exact
            p = [abs(x + t * y) for x, y in zip(local_o, local_d, strict=True)]
            slowest = min(abs(float(x)) for x in local_d) / max(abs(float(x)) for x in local_d)
            # Two planes are met at the same time to within rounding: an edge.
            assert sum(abs(float(x) - 1) < error / slowest for x in p) >= 2
            continue
        if exact is None:
            continue
        hits += 1
        axis = int(found.face[i]) % 3
        faces.add(int(found.face[i]))
        side = 1 if found.face[i] >= 3 else -1
        # The plane across the axis is met where the local coordinate is ±1.
        off = local_o[axis] + Q(found.t[i]) * local_d[axis] - side
        assert abs(float(off)) <= error
        n = np.cross(edges[i][(axis + 1) % 3], edges[i][(axis + 2) % 3])
        n *= side / np.linalg.norm(n) * np.sign(np.linalg.det(edges[i]))
        assert np.allclose(found.n[i], n, rtol=0, atol=20 * U * longest / size)
        p = [float(x + exact * y) for x, y in zip(local_o, local_d, strict=True)]
        a, b = (k for k in range(3) if k != axis)
        uv = [(p[a] + 1) / 2, (p[b] + 1) / 2]
        slow = abs(float(local_d[axis])) / max(abs(float(x)) for x in local_d)
        assert np.allclose([found.u[i], found.v[i]], uv, rtol=0, atol=2 * error / slow)
    assert hits > N // 3
    assert faces == set(range(6))


# ---- lattices: small integers, on which float64 is exact ----------------------------------------


def first_hits(shape, kind):
    tables, _ = shapes_in_order([shape])
    o, d = lattice_rays(3)
    return o, d, probe(tables, kind, np.zeros(len(o)), o, d)


def test_box_on_a_lattice():
    """Along faces, in their planes, through edges and corners, either zero: exactly right."""
    o, d, found = first_hits(rt.Box(), BOX)
    for i in range(len(o)):
        exact = expected_box(q(o[i]), q(d[i]))
        assert found.t[i] == (np.inf if exact is None else float(exact)), (o[i], d[i])


def test_rectangle_on_a_lattice():
    o, d, found = first_hits(rt.Rectangle(), RECTANGLE)
    for i in range(len(o)):
        t = np.inf
        if d[i, 2] != 0 and -o[i, 2] / d[i, 2] > 0:
            at = o[i] + d[i] * (-o[i, 2] / d[i, 2])
            t = -o[i, 2] / d[i, 2] if np.abs(at[:2]).max() <= 1 else np.inf
        assert found.t[i] == t, (o[i], d[i])


def test_triangle_on_a_lattice():
    """A ray on an edge or a corner is where it would be moved by (h, h²), across the axes other
    than the largest of d, in cyclic order; swapped where that is negative.  Whatever the winding;
    rays in the triangle's plane miss."""
    for shape in (
        rt.Triangle(v0=(-1, -1, 0), v1=(2, -1, 0), v2=(-1, 2, 0)),
        rt.Triangle(v0=(-1, -1, 0), v1=(-1, 2, 0), v2=(2, -1, 0)),
    ):
        o, d, found = first_hits(shape, TRIANGLE)
        for i in range(len(o)):
            t = np.inf
            if d[i, 2] != 0 and -o[i, 2] / d[i, 2] > 0:
                h = 1e-5
                largest = int(np.flatnonzero(np.abs(d[i]) == 1.0)[0])
                first, second = (largest + 1) % 3, (largest + 2) % 3
                if d[i, largest] < 0:
                    first, second = second, first
                moved = o[i].copy()
                moved[first] += h
                moved[second] += h * h
                x, y, _ = moved - d[i] * (moved[2] / d[i, 2])
                t = -o[i, 2] / d[i, 2] if x > -1 and y > -1 and x + y < 1 else np.inf
            # The area is 9: dividing by it rounds, once for 1/9 and once for its product.
            assert np.isclose(found.t[i], t, rtol=2 * U, atol=0), (o[i], d[i])


def test_sphere_on_a_lattice():
    """Radius 2: tangents along axes and diagonals of faces touch; b / a rounds on others."""
    o, d, found = first_hits(rt.Sphere(radius=2.0), SPHERE)
    for i in range(len(o)):
        a, b, c = d[i] @ d[i], -o[i] @ d[i], o[i] @ o[i] - 4
        discriminant = b * b - a * c
        if discriminant == 0 and a == 3:
            continue
        roots = [(b + s * np.sqrt(discriminant)) / a for s in (-1, 1) if discriminant >= 0]
        t = min([x for x in roots if x > 0], default=np.inf)
        # Above: three roundings, and the sum may lose a bit: b is at most 9, the root at least 1/2.
        assert np.isclose(found.t[i], t, rtol=64 * U, atol=0), (o[i], d[i])
