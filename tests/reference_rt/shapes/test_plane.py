"""Planes: signed distances, far away, among instances, and the half space below as a solid."""

import math

import numpy as np
import pytest
from builders import U, shapes_in_order
from drivers import probe
from placed_shapes import random_map

import reference_rt as rt
from reference_rt.core import transform
from reference_rt.core.ray import Ray
from reference_rt.core.vec3 import Vec3
from reference_rt.shapes.flat import base, plane
from reference_rt.shapes.tables import CODES


def test_signed_distance():
    """Above is positive, in scene units whatever the scale of the map."""
    step = transform.Scale(scale=(2, 3, 50))
    lift = transform.Translate(translate=(7, 7, 4))
    planes = rt.build_tables(rt.Scene(shapes=(rt.Plane(transform=(step, lift)),)))
    table = planes.geometry.shapes.planes
    assert base.signed_distance(table, 0, Vec3(100.0, 9.0, 6.5)) == 2.5
    assert base.signed_distance(table, 0, Vec3(100.0, 9.0, 3.0)) == -1.0


def test_the_point_is_off_by_no_more_than_its_error_at_the_horizon():
    """A plane met 1e15 away at 1e-15 radians."""
    tables, _ = shapes_in_order([rt.Plane(transform=(random_map(np.random.default_rng(4)),))])
    n = tables.planes.normal[0]
    along = np.cross(n, [0.3, 0.5, -0.8])
    found = probe(tables, CODES[plane], [0], [tables.planes.center[0] + n], [along - 1e-15 * n])
    assert found.t[0] > 1e14
    assert abs(n @ (found.p[0] - tables.planes.center[0])) <= found.error[0]
    assert found.error[0] <= 1e-14 * np.abs(found.p[0]).max()


# ---- among other shapes -------------------------------------------------------------------------


def test_not_in_a_group():
    scene = rt.Scene(groups={"ground": (rt.Plane(),)}, shapes=(rt.Instance(group="ground"),))
    with pytest.raises(rt.SceneError, match=r"groups\.ground\[0\]: it is infinite; expected"):
        rt.build_tables(scene)


# ---- as a solid ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("o", "d", "expected"),
    [
        ((0, 0, 2), (0, 0, -2), (1, math.inf)),
        ((0, 0, 2), (0, 0, 1), (-math.inf, -2)),
        ((0, 0, -3), (1, 0, 1), (-math.inf, 3)),
        ((0, 0, -3), (1, 1, 0), (-math.inf, math.inf)),
        ((0, 0, 3), (1, 1, 0), (math.inf, math.inf)),
        ((0, 0, 0), (1, 1, -0.0), (math.inf, math.inf)),
    ],
)
def test_spans(o, d, expected):
    """The line's part below, over all t; none in the plane."""
    tables, _ = shapes_in_order([rt.Plane()])
    ray = Ray(Vec3(*map(float, o)), Vec3(*map(float, d)), math.inf)
    spans = plane.spans(tables.planes, 0, ray)
    assert (spans.t0, spans.t1) == expected
    assert spans.t2 == math.inf


def test_a_solid_without_end():
    """What is below, less a ball: seen from above, from within and from the ball's hollow."""
    scene = rt.Scene(shapes=(rt.Plane() - rt.Sphere(),))
    o = [[3, 0, 2], [0, 0, 2], [3, 0, -2], [0, 0, -0.5], [3, 0, -5]]
    d = [[0, 0, -1], [0, 0, -1], [0, 0, 1], [1, 0, 0], [0, 0, -1]]
    hits = scene.intersect(o, d)
    assert hits.t.tolist() == pytest.approx([2, 3, 2, math.sqrt(0.75), math.inf], rel=4 * U)
    assert hits.part.tolist() == [0, 1, 0, 1, -1]
    assert hits.n[1].tolist() == [0, 0, 1]
