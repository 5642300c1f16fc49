"""Polygons: what fills nothing, orientation, descriptions."""

import numpy as np
import pytest
from builders import U, random_turn
from placed_shapes import random_map
from polygon_checks import EIGHT, regular, seen_from_above, square

import reference_rt as rt
from reference_rt.core import transform
from reference_rt.shapes.shape import TabulationContext

# ---- fill rules ---------------------------------------------------------------------------------


def test_duplicates_and_spikes_change_nothing():
    """Points repeated, a spike out and back, an edge walked back and forth."""
    plain = rt.Polygon(rings=(square(0, 2),))
    odd = rt.Polygon(
        rings=(((0, 0), (0, 0), (2, 0), (5, 0), (2, 0), (2, 2), (1, 2), (1, 1), (1, 2), (0, 2)),)
    )
    points = np.random.default_rng(7).uniform(-1, 6, (2000, 2))
    assert np.array_equal(seen_from_above(plain, points), seen_from_above(odd, points))


# ---- orientation --------------------------------------------------------------------------------


def normal_of(rings, *steps):
    return rt.Polygon(rings=rings, transform=steps).tabulate(TabulationContext()).normal[0].tolist()


def test_the_normal_is_by_the_winding():
    assert normal_of([square(0, 1)]) == [0, 0, 1]
    assert normal_of([square(0, 1, clockwise=True)]) == [0, 0, -1]
    assert normal_of([square(0, 1, clockwise=True), square(2, 5)]) == [0, 0, 1]
    mirror = transform.Scale(scale=(-1, 1, 1))
    assert normal_of([square(0, 1)], mirror) == [0, 0, 1]
    assert normal_of([square(0, 1)], transform.Scale(scale=(1, 1, -1))) == [0, 0, -1]
    # As a triangle of the same points.
    rng = np.random.default_rng(8)
    for _ in range(30):
        v = [tuple(p) for p in rng.uniform(-1, 1, (3, 3)).tolist()]
        step = random_map(rng)
        m = transform.affine((step,))
        a, b, c = np.array(v) @ m[:, :3].T
        n = np.cross(b - a, c - a) * np.sign(np.linalg.det(m[:, :3]))
        assert normal_of([v], step) == pytest.approx(n / np.linalg.norm(n), abs=1e-12)


def test_each_axis_can_be_dropped():
    """A square in each of the planes of two axes, either way round."""
    for axis in range(3):
        x, y = (axis + 1) % 3, (axis + 2) % 3
        for sign in (1, -1):
            ring = np.full((4, 3), 2.5)
            ring[:, [x, y]] = square(0, 1, sign < 0)
            shape = rt.Polygon(rings=[ring.tolist()])
            o, d = np.full((1, 3), 0.25), np.zeros((1, 3))
            o[0, axis], d[0, axis] = 5.0, -2.0
            hits = rt.Scene(shapes=(shape,)).intersect(o, d)
            assert hits.t.tolist() == [1.25]
            assert hits.n[0].tolist() == (sign * np.eye(3)[axis]).tolist()
            assert hits.uv.tolist() == [[0.25, 0.25]]


def test_no_net_area():
    """A figure eight, and a square beside one that runs the other way: by the first turn."""
    assert normal_of([EIGHT]) == [0, 0, -1]
    assert normal_of([EIGHT[::-1]]) == [0, 0, 1]
    assert normal_of([((0, 0), (1, 0), *EIGHT[1:], (1, 0), (0, 0))])[2] in (-1, 1)
    assert normal_of([square(0, 1), square(2, 3, clockwise=True)]) == [0, 0, 1]
    line = ((0, 0), (1, 1), (2, 2))
    assert normal_of([line, square(0, 1, clockwise=True), square(2, 3)]) == [0, 0, -1]


# ---- descriptions -------------------------------------------------------------------------------


def test_points_of_two_and_three_numbers():
    """As read from a file, and written again."""
    text = """\
shapes:
  - {type: polygon, rings: [[[0, 0], [1, 0], [1, 1, 0.0]]], fill: nonzero}
"""
    scene = rt.Scene.parse(text)
    assert scene.shapes[0].rings == (((0, 0, 0), (1, 0, 0), (1, 1, 0)),)
    assert rt.Scene.parse(scene.to_yaml()) == scene
    assert rt.Scene.parse(scene.to_json()) == scene


@pytest.mark.parametrize(
    ("rings", "message"),
    [
        ("[]", "shapes[0].rings: expected a list of rings, one at least"),
        ("[[[0, 0], [1, 0]]]", "shapes[0].rings[0]: expected a ring of at least three points"),
        (
            "[[[0, 0], [1, 0], [1, 1]], [[0, 0], [1], [2, 2]]]",
            "shapes[0].rings[1][1]: expected two or three finite numbers [x, y] or [x, y, z]",
        ),
        (
            "[[[0, 0], [1, a], [2, 2]]]",
            "shapes[0].rings[0][1]: expected two or three finite numbers [x, y] or [x, y, z]",
        ),
        (
            "[[[0, 0], [1, .inf], [2, 2]]]",
            "shapes[0].rings[0][1]: expected two or three finite numbers [x, y] or [x, y, z]",
        ),
        (
            "[[[0, 0], [2, 0], [2, 2], [0, 2]], [[1, 1], [1, 0.5], [0.5, 1, 0.25]]]",
            "shapes[0]: ring 1: point 2 is 0.25 off the plane of the others; expected all in one "
            "plane",
        ),
        (
            "[[[0, 0], [1, 1], [3, 3]]]",
            "shapes[0]: the polygon has no area: all its points are on a line",
        ),
        (
            "[[[0, 0], [1, 1], [3, 3]], [[1, 0], [2, 1], [3, 2]]]",
            "shapes[0]: the polygon has no area: the points of each ring are on a line",
        ),
        (
            "[[[0, 0], [1, 0], [1, 1], [1, 0]]]",
            "shapes[0]: the polygon has no area: its edges take each other back; expected others",
        ),
        (
            "[[[0, 0], [1, 0], [1, 1]], [[1, 1], [1, 0], [0, 0]]]",
            "shapes[0]: the polygon has no area: its edges take each other back; expected others",
        ),
        (
            "[[[0, 0], [1.0e305, 0], [1, 1]]]",
            "shapes[0]: its coordinates overflow; expected finite",
        ),
    ],
)
def test_bad_rings(rings, message):
    with pytest.raises(rt.SceneError) as error:
        rt.build_tables(rt.Scene.parse(f"shapes:\n  - {{type: polygon, rings: {rings}}}\n"))
    assert message in str(error.value)


def test_a_map_that_overflows():
    shape = rt.Polygon(
        rings=(square(0, 1e250),), transform=(transform.Scale(scale=(1e100, 1e100, 1e100)),)
    )
    with pytest.raises(rt.SceneError, match="its coordinates overflow; expected finite numbers"):
        rt.build_tables(rt.Scene(shapes=(shape,)))


def test_points_off_the_plane_by_their_rounding():
    """A polygon turned by a matrix is still flat; one point off by a thousand times that is not."""
    rng = np.random.default_rng(11)
    for _ in range(100):
        rotation = random_turn(rng)
        points = np.array(regular(12)) @ rotation[:, :2].T + rng.uniform(-1, 1, 3) * 100
        table = rt.Polygon(rings=(points.tolist(),)).tabulate(TabulationContext())
        assert abs(abs(table.normal[0] @ rotation[:, 2]) - 1) < 1e-12
        points[7] += 64_000 * U * np.abs(points).max() * rotation[:, 2]
        with pytest.raises(ValueError, match=r"ring 0: point \d+ is .* off the plane"):
            rt.Polygon(rings=(points.tolist(),)).tabulate(TabulationContext())
