"""Polygons: their plane, ties on edges and corners, tilings."""

import itertools
import math

import numpy as np
import pytest
from builders import U, random_turn
from placed_shapes import plane_points, random_map, rays_at
from polygon_checks import count, edges_of, regular, seen_from_above, square, winding

import reference_rt as rt
from reference_rt.core import transform
from reference_rt.shapes.flat import polygon
from reference_rt.shapes.shape import TabulationContext

# ---- against exact arithmetic -------------------------------------------------------------------


def random_rings(rng, flat):
    """A ring that crosses itself and one around the middle, at z = 0 or in any plane."""
    rings = [rng.uniform(-1, 1, (rng.integers(3, 9), 2)), 0.3 * np.array(regular(7))]
    if flat:
        return tuple(tuple(map(tuple, r.tolist())) for r in rings)
    m = random_turn(rng) * 10.0 ** rng.uniform(-2, 2)
    at = m[:, :1].T * rng.uniform(-5, 5)
    return tuple(tuple(map(tuple, (r @ m[:, :2].T + at).tolist())) for r in rings)


@pytest.mark.parametrize("flat", [True, False])
def test_the_plane_is_that_of_the_points(flat):
    """The tabulated vertices are the scene's points under the scene's map."""
    rng = np.random.default_rng(2)
    for _ in range(50):
        rings = random_rings(rng, flat)
        shape = rt.Polygon(rings=rings, transform=(random_map(rng, 1.0, 3.0),))
        table = shape.tabulate(TabulationContext())
        local = np.array([(*p, 0.0)[:3] for r in rings for p in r])
        m = transform.affine(shape.transform)
        expected = local @ m[:, :3].T + m[:, 3]
        a = table.outline[:, :2]
        found = plane_points(table, np.zeros(len(a), int), a[:, 0], a[:, 1])
        size = np.abs(m[:, :3]).max() * np.abs(local).max() + np.abs(m[:, 3]).max()
        assert np.abs(found - expected).max() <= 64 * U * size
        (lower,), (upper,) = polygon.bounds(table)
        assert (lower <= found.min(axis=0)).all()
        assert (upper >= found.max(axis=0)).all()
        assert (upper - lower - np.ptp(found, axis=0)).max() <= 64 * U * size


# ---- ties: points on edges and corners ----------------------------------------------------------


def test_every_lattice_point_as_the_half_open_rule_says():
    """Random lattice polygons; points on corners and edges, all exact."""
    rng = np.random.default_rng(4)
    points = list(itertools.product(np.arange(-0.5, 5, 0.5), repeat=2))
    on_edges = 0
    for k in range(40):
        rings = [tuple(map(tuple, rng.integers(0, 5, (m, 2)).tolist())) for m in (6, 4)]
        edges = edges_of(rings)
        fill = ("even_odd", "nonzero")[k % 2]
        numbers = [winding(x, y, edges) for x, y in points]
        expected = [(n % 2 if fill == "even_odd" else n) != 0 for n in numbers]
        try:
            shape = rt.Polygon(rings=rings, fill=fill)
            found = seen_from_above(shape, points)
        except rt.SceneError:
            assert not any(expected)
            continue
        assert found.tolist() == expected
        on_edges += sum(
            (a - x) * (d - y) == (b - y) * (c - x)
            for x, y in points
            for a, b, c, d in edges
            if min(a, c) <= x <= max(a, c) and min(b, d) <= y <= max(b, d)
        )
    assert on_edges > 1000


def test_the_side_of_an_edge_is_exact():
    """An edge to (p, q), integers of 45 bits: the points on either side of it whose products with
    its ends differ by 1, where float64 rounds both to multiples of 2^37; and points on it."""
    rng = np.random.default_rng(5)
    wrong = 0
    for _ in range(100):
        p, q = (int(x) for x in rng.integers(2**44, 2**45, 2))
        if math.gcd(p, q) > 1:
            continue
        y = pow(p, -1, q)  # p y - q x = 1
        x = (p * y - 1) // q
        points = [(x, y), (p - x, q - y), (0, 0), (p, q)]
        ring = ((0, 0), (p, q), (-q, p))
        if rng.uniform() < 0.5:
            ring = ring[::-1]
        shape = rt.Polygon(rings=(tuple((float(a), float(b)) for a, b in ring),))
        found = seen_from_above(shape, points)
        expected = [winding(*point, edges_of([ring])) != 0 for point in points]
        assert found.tolist() == expected
        assert expected[:2] == [True, False]
        floats = np.array(edges_of([ring]), float)
        alone = [winding(*point, floats) != 0 for point in np.array(points, float)]
        wrong += alone != expected
    assert wrong > 20  # float64 alone


def tiles(rng, n):
    """Corners (n + 1, n + 1, 2) and rings: the unit square as n x n quadrangles with moved corners,
    some cut in two, some joined in pairs, which need not be convex; rings run either way."""
    ticks = np.linspace(0, 1, n + 1)
    v = np.stack(np.meshgrid(ticks, ticks, indexing="ij"), axis=-1)
    v[1:-1, 1:-1] += rng.uniform(-0.3, 0.3, (n - 1, n - 1, 2)) / n
    rings = []
    for i in range(0, n, 2):
        for j in range(n):
            if (i + j) % 3 == 0:  # two cells as one
                rings.append(
                    [
                        v[i, j],
                        v[i + 1, j],
                        v[i + 2, j],
                        v[i + 2, j + 1],
                        v[i + 1, j + 1],
                        v[i, j + 1],
                    ]
                )
                continue
            a, b, c, d = v[i, j], v[i + 1, j], v[i + 1, j + 1], v[i, j + 1]
            rings += [[a, b, c], [a, c, d]]
            rings.append([v[i + 1, j], v[i + 2, j], v[i + 2, j + 1], v[i + 1, j + 1]])
    rings = [r[::-1] if rng.uniform() < 0.5 else r for r in rings]
    return v, [tuple((float(x), float(y)) for x, y in r) for r in rings]


@pytest.mark.parametrize("fill", ["even_odd", "nonzero"])
def test_a_tiling_has_every_point_once(fill):
    """Polygons under one oblique map; rays through corners, along edges and anywhere: where two
    polygons share an edge, exactly one is hit."""
    rng = np.random.default_rng(6)
    for k in range(6):
        v, rings = tiles(rng, 8)
        step = random_map(rng, 0.5, 10.0 ** (k - 2))
        shapes = [rt.Polygon(rings=(r,), fill=fill, transform=(step,)) for r in rings]
        m = transform.affine((step,))
        inner = v[1:-1, 1:-1].reshape(-1, 2)
        starts = np.concatenate([v[1:-2, 1:-1], v[1:-1, 1:-2].transpose(1, 0, 2)]).reshape(-1, 2)
        ends = np.concatenate([v[2:-1, 1:-1], v[1:-1, 2:-1].transpose(1, 0, 2)]).reshape(-1, 2)
        along = rng.uniform(0, 1, (20, len(starts), 1))
        pairs = (starts + (ends - starts) * along).reshape(-1, 2)
        local = np.concatenate([inner, pairs, rng.uniform(0.05, 0.95, (2000, 2))])
        points = local @ m[:, :2].T + m[:, 3]
        o, d = rays_at(rng, points, rng.uniform(0.1, 10, len(points)))
        assert (count(shapes, o, d) == 1).all()


def test_a_tiling_of_the_lattice():
    """The corners themselves, hit exactly: squares own their left and lower edges."""
    shapes = [
        rt.Polygon(rings=(((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)),))
        for i, j in itertools.product(range(4), repeat=2)
    ]
    points = np.array(list(itertools.product(np.arange(-0.5, 5, 0.5), repeat=2)))
    o = np.column_stack([points, np.ones(len(points))])
    inside = ((points >= 0) & (points < 4)).all(axis=1)
    found = count(shapes, o, np.tile([0.0, 0.0, -1.0], (len(o), 1)))
    assert found.tolist() == inside.astype(int).tolist()


# ---- leaving, scales, tables --------------------------------------------------------------------


@pytest.mark.parametrize("scale", [1e-200, 1e200])
def test_extreme_scales(scale):
    """In the points or in the transform."""
    ring = tuple((scale * x, scale * y) for x, y in square(-1, 1))
    step = transform.Scale(scale=(scale,) * 3)
    for shape in (rt.Polygon(rings=(ring,)), rt.Polygon(rings=(square(-1, 1),), transform=(step,))):
        o = [[0.5 * scale, 0.25 * scale, scale], [1.5 * scale, 0, scale]]
        hits = rt.Scene(shapes=(shape,)).intersect(o, [[0, 0, -scale]] * 2)
        assert hits.t.tolist() == [1, math.inf]
        assert hits.uv[0].tolist() == [0.75, 0.625]
