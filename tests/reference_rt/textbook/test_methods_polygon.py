"""The methods for polygons against rational arithmetic, and each where it fails as it says."""

import itertools
import math

import numpy as np
import pytest
from builders import U, random_turn
from method_checks import first, mixed_lengths, off
from rational import cross, dot, q, sub

from reference_rt import textbook

# All in coordinates (i, j) of a lattice.
STAR = [(0, 6), (-1, 1), (-6, 2), (-2, -1), (-4, -6), (0, -3), (4, -6), (2, -1), (6, 2), (1, 1)]
PENTAGRAM = [(0, 10), (6, -8), (-9, 3), (9, 3), (-6, -8)]
OUTER, HOLE = [(-8, -8), (8, -8), (8, 8), (-8, 8)], [(-4, -4), (0, -3), (4, 4), (-3, 2)]
CONCAVE = [(-7, -7), (7, -7), (7, 7), (3, 7), (3, -3), (-2, -3), (-2, 7), (-7, 7)]
BOW_TIE = [(-7, -5), (7, 5), (7, -5), (-7, 5)]
FIGURES = {
    "star": [STAR],
    "pentagram": [PENTAGRAM],
    "concave": [CONCAVE],
    "bow tie": [BOW_TIE],
    "hole": [OUTER, HOLE[::-1]],
    "hole wound alike": [OUTER, HOLE],
    "two holes": [OUTER, [(-6, -6), (-6, -2), (-2, -6)], [(1, 1), (2, 5), (6, 6)]],
    "overlapping": [OUTER, [(4, 4), (13, 4), (13, 13), (4, 13)]],
}
FRAMES = {
    "drop z": ((1, 0, 0), (0, 1, 0)),
    "drop x": ((0, 0, -1), (0, 2, 0)),
    "drop y": ((3, 1, 0), (0, 1, 2)),
    "oblique": ((2, 1, -1), (-1, 2, 1)),
}


def in_space(rings, frame="drop z", origin=(0, 0, 0)):
    e1, e2 = np.array(FRAMES[frame], float)
    return textbook.PolygonParameters(
        [np.array(origin) + np.array(r, float) @ np.stack([e1, e2]) for r in rings]
    )


def exact_winding(rings, p):
    """The sum over each ring's fan of the signs of the triangles that contain `p`.

    Not a count of crossings, but known to be of its parity.  None on a line of a fan.
    """

    def side(a, b):
        return (a[0] - p[0]) * (b[1] - p[1]) - (a[1] - p[1]) * (b[0] - p[0])

    total = 0
    for ring in rings:
        for a, b in itertools.pairwise(ring[1:]):
            sides = [side(ring[0], a), side(a, b), side(b, ring[0])]
            if 0 in sides:
                return None
            total += all(s > 0 for s in sides) - all(s < 0 for s in sides)
    return total


INSIDE = {
    "polygon.even_odd": lambda w: w % 2 == 1,
    "polygon.winding": lambda w: w != 0,
    "polygon.angle_sum": lambda w: w != 0,
    "polygon.along_normal": lambda w: w != 0,
}


@pytest.mark.cases(12)
@pytest.mark.parametrize("frame", FRAMES)
@pytest.mark.parametrize("figure", FIGURES)
def test_polygon_is_exact(figure, frame):
    """Vertices are integers, so the plane is exact; t is off by 8 u L² S / |n·d|, as for triangles,
    n of the largest triangle of vertices; points at random are not within rounding of an edge."""
    n = 60
    rng = np.random.default_rng(9)
    origin = np.array([3, -2, 5])
    e1, e2 = np.array(FRAMES[frame], float)
    ij = rng.uniform(-10, 10, (n, 2))
    d = rng.normal(size=(n, 3))
    o = (
        origin
        + ij @ np.stack([e1, e2])
        - d * rng.uniform(1, 30, (n, 1)) * rng.choice([1, -0.1], (n, 1))
    )
    d = mixed_lengths(rng, d)
    shape = in_space(FIGURES[figure], frame, origin)
    found = {name: textbook.intersect(name, shape, o, d) for name in INSIDE}
    vertices = np.concatenate(shape.rings)
    size2 = np.max(np.sum((vertices[:, None] - vertices) ** 2, axis=2))
    legs = vertices - vertices[0]
    largest = np.max(np.linalg.norm(np.cross(legs[:, None], legs), axis=2))
    normal = largest * np.cross(e1, e2) / np.linalg.norm(np.cross(e1, e2))
    for k in range(n):
        a, b, back = q(e1), q(e2), [-x for x in q(d[k])]
        s = sub(q(o[k]), q(origin))
        whole = dot(a, cross(b, back))
        i, j, t = (
            dot(x, cross(y, z)) / whole for x, y, z in ((s, b, back), (a, s, back), (a, b, s))
        )
        number = exact_winding(FIGURES[figure], (i, j))
        far = np.max(np.linalg.norm(vertices - o[k], axis=1))
        bound = 8 * U * size2 * far / abs(normal @ d[k])
        for name, inside in INSIDE.items():
            assert off(found[name][k], first(t) if inside(number) else math.inf) <= bound


def test_turned_and_distant_polygons_count_as_planar():
    """Coordinates that an affine map has rounded: its own few roundings of the largest."""
    rng = np.random.default_rng(13)
    flat = np.array([(*p, 0) for p in STAR], float)
    thin = flat * (1, 1e-6, 1)
    for figure, offset in itertools.product((flat, thin), (0, 10, 1e4)):
        for _ in range(50):
            turn = random_turn(rng)
            move = offset * rng.uniform(-1, 1, 3)
            shape = textbook.PolygonParameters([figure @ turn.T + move])
            o, d = [(turn[:, 2] + move).tolist()], [(-turn[:, 2]).tolist()]
            for name in textbook.names("polygon"):
                assert np.isfinite(textbook.intersect(name, shape, o, d)[0])


def test_rules_differ_where_they_must():
    """(even-odd, winding) inside: the pentagram's centre is wound twice; a hole must be wound the
    other way for the winding number alone."""
    down = [[0, 0, -1]]
    for rings, p, expected in (
        ([PENTAGRAM], (0, 0), (False, True)),
        ([PENTAGRAM], (0, 6), (True, True)),
        ([OUTER, HOLE], (0, 0), (False, True)),
        ([OUTER, HOLE[::-1]], (0, 0), (False, False)),
        ([OUTER, HOLE[::-1]], (6, 6), (True, True)),
        ([[(0, 0), (3, 0), (3, 3), (0, 3)] * 2], (1, 1), (False, True)),
    ):
        shape = in_space(rings)
        even_odd, winding, angle_sum, along_normal = (
            bool(np.isfinite(textbook.intersect(n, shape, [[*p, 5]], down)[0]))
            for n in textbook.names("polygon")
        )
        assert (even_odd, winding) == expected
        assert angle_sum == along_normal == winding


TILES = [
    [(0, 0), (4, 0), (2, 2)],
    [(4, 0), (4, 4), (3, 2), (2, 2)],
    [(4, 4), (0, 4), (1, 3), (2, 3), (2, 2), (3, 2)],
    [(0, 4), (0, 0), (2, 2), (2, 3), (1, 3)],
]
"""Of the square [0, 4]², with concave corners and edges along the axes."""


@pytest.mark.parametrize("name", ["polygon.even_odd", "polygon.winding"])
@pytest.mark.parametrize("turn", range(4))
def test_vertex_rule(name, turn):
    """Every point of a grid, on edges and vertices too, belongs to one tile of the square, and to
    none beyond; the half-open rule gives the square the sides that it starts with."""
    rotation = np.linalg.matrix_power(np.array([[0, 1], [-1, 0]]), turn)
    grid = np.array(list(itertools.product(np.arange(-0.5, 5, 0.5), repeat=2)))
    o = np.hstack([grid @ rotation, np.ones((len(grid), 1))])
    d = np.tile((0.0, 0.0, -1.0), (len(grid), 1))
    owners = sum(
        np.isfinite(textbook.intersect(name, in_space([np.array(tile) @ rotation]), o, d)).astype(
            int
        )
        for tile in TILES
    )
    square = in_space([np.array([(0, 0), (4, 0), (4, 4), (0, 4)]) @ rotation])
    assert np.array_equal(owners, np.isfinite(textbook.intersect(name, square, o, d)))
    assert np.all(owners[np.all((grid > 0) & (grid < 4), axis=1)] == 1)
    assert np.sum(owners) == 64


def test_points_on_a_common_edge():
    """Rounded points of the edge of two triangles: winding gives each to one of them."""
    n = 10_000
    rng = np.random.default_rng(10)
    a, b, c, d = np.array([(-1, -0.1), (0.7, 0.3), (0.2, -1), (-0.1, 1)])
    along = rng.uniform(0, 1, (n, 1))
    o = np.hstack([a * along + b * (1 - along), np.ones((n, 1))])
    down = np.tile((0.0, 0.0, -1.0), (n, 1))
    owners = {
        name: sum(
            np.isfinite(textbook.intersect(name, in_space([ring]), o, down)).astype(int)
            for ring in ([a, b, d], [b, a, c])
        )
        for name in textbook.names("polygon")
    }
    assert np.all(owners["polygon.winding"] == 1)
    assert np.mean(owners["polygon.even_odd"] == 0) > 0.1
    assert np.mean(owners["polygon.even_odd"] == 2) > 0.05
    assert np.all(owners["polygon.angle_sum"] >= 1)
    assert np.mean(owners["polygon.angle_sum"] == 2) > 0.1
    # Its frames are those of each triangle: neighbours do not share their rounded vertices.
    assert np.mean(owners["polygon.along_normal"] == 0) > 0.02
    assert np.mean(owners["polygon.along_normal"] == 2) > 0.02
