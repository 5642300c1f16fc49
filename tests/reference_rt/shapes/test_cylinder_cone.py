"""What is special about cylinders, cones and frustums; the rest is in `test_shapes_exact`."""

import math
import re

import numpy as np
import pytest
from builders import U, random_turn, unit_vectors
from placed_shapes import Placed, put
from quadric_kinds import KINDS, TURNED

import reference_rt as rt
from reference_rt.core import transform


@pytest.mark.parametrize("name", TURNED)
def test_bounds_are_tight(name):
    for shape in KINDS[name]:
        placed = Placed(shape)
        low, high = (0.0, shape.height) if shape.type == "cone" else (shape.z_min, shape.z_max)
        r = max(shape.radius, getattr(shape, "top_radius", 0.0))
        assert np.allclose(placed.lower, [-r, -r, low], rtol=1e-14, atol=1e-14)
        assert np.allclose(placed.upper, [r, r, high], rtol=1e-14, atol=1e-14)


def test_coordinates_and_faces():
    cylinder = rt.Cylinder(radius=2, z_min=-1, z_max=3)
    phi = np.linspace(0.01, 0.99, 50) * 2.0 * math.pi
    z = np.linspace(-0.9, 2.9, 50)
    away = np.column_stack([np.cos(phi), np.sin(phi), np.zeros(50)])
    side = Placed(cylinder).probe(5.0 * away + [[0, 0, 1]] * z[:, None], -away)
    assert np.allclose(side.t, 3.0)
    assert np.allclose(side.u, phi / (2.0 * math.pi))
    assert np.allclose(side.v, (z + 1.0) / 4.0)
    assert np.allclose(side.n, away)
    assert set(side.face) == {0}
    ends = Placed(cylinder).probe([[1, -0.5, 9], [1, -0.5, -9]], [[0, 0, -1], [0, 0, 1]])
    assert ends.face.tolist() == [6, 3]
    assert np.array_equal(ends.n, [[0, 0, 1], [0, 0, -1]])
    assert np.allclose([ends.u, ends.v], [[0.75, 0.75], [0.375, 0.375]])
    cone = Placed(rt.Cone(radius=2, height=4)).probe(5.0 * away + [[0, 0, 3]], -away)
    assert np.allclose(cone.t, 4.5)
    assert np.allclose(cone.u, phi / (2.0 * math.pi))
    assert np.allclose(cone.v, 0.75)
    assert np.allclose(cone.n, (2.0 * away + [0, 0, 1]) / math.sqrt(5.0))


def test_an_open_one_is_seen_from_both_sides():
    inside = [[0.1, 0.2, 0.5]]
    for shape in (rt.Cylinder(capped=False), rt.Cone(capped=False), rt.Cone(top_radius=2)):
        shape = shape.model_copy(update={"capped": False})
        found = Placed(shape).probe(inside * 2, [[1, 0, 0], [-1, 0, 0]])
        assert (found.t > 0).all()
        assert np.isfinite(found.t).all()
        assert (found.n[0] @ [1, 0, 0] > 0, found.n[1] @ [-1, 0, 0] > 0) == (True, True)
        # Straight through the ends.
        assert np.isinf(Placed(shape).probe([[0.1, 0.2, 9]], [[0, 0, 1]]).t).all()
    through = Placed(rt.Cylinder(capped=False)).probe([[0.1, 0.2, 9]], [[0, 0, -1]])
    assert np.isinf(through.t).all()


def test_a_frustum_of_equal_radii_is_a_cylinder():
    rng = np.random.default_rng(6)
    one, two = rt.Cone(radius=0.7, top_radius=0.7, height=2), rt.Cylinder(radius=0.7, z_max=2)
    o, d = Placed(two).rays(rng, 2000, (0.0, 1.0))
    a, b = Placed(one).probe(o, d), Placed(two).probe(o, d)
    assert np.array_equal(a.t, b.t)
    assert np.array_equal(a.face, b.face)


# ---- the apex -----------------------------------------------------------------------------------


def apex_of(shape):
    m = transform.affine(shape.transform)
    return m[:, :3] @ [0.0, 0.0, shape.height] + m[:, 3]


@pytest.mark.parametrize("capped", [False, True])
def test_the_apex(capped):
    """Met from all around, within rounding and exactly: a point, a unit normal, no other nappe."""
    rng = np.random.default_rng(7)
    upright = rt.Cone(capped=capped)
    turn = random_turn(rng)
    for shape in (upright, put(upright, turn @ np.diag([1, 2, 0.5]), (1.0, -2.0, 3.0))):
        apex, linear = apex_of(shape), transform.affine(shape.transform)[:, :3]
        v = rng.normal(size=(3000, 3))
        near = apex + v * 10.0 ** -rng.uniform(1, 17, (3000, 1))
        near[:500] = apex
        o = near + rng.normal(size=(3000, 3)) * 3.0
        found = Placed(shape).probe(o, near - o)
        i = np.isfinite(found.t)
        assert i.sum() > 300
        assert np.allclose(np.linalg.norm(found.n[i], axis=1), 1.0, rtol=1e-14)
        assert np.isfinite(found.error[i]).all()
        assert (found.error[i] < 1e-12).all()
        up = np.linalg.solve(linear, (found.p[i] - apex).T).T[:, 2]
        assert (up <= 128 * U).all()


def test_the_apex_exactly():
    apex = [0.0, 0.0, 1.0]
    for shape in (rt.Cone(), rt.Cone(capped=False)):
        for d in ([1, 0, 0], [0, -1, 0], [0.25, 0.5, 0], [0, 0, -1], [0.125, 0, -1]):
            d = np.array(d, float)
            found = Placed(shape).probe([apex - 2.0 * d], [d])
            assert found.t[0] == 2.0
            assert np.array_equal(found.p[0], apex)
            assert np.array_equal(found.n[0], [0.0, 0.0, 1.0])
            assert found.face[0] in (0, 6)
        # Above it there is the nappe that is cut off.
        for height in (2.0**-52, 2.0**-30, 0.5):
            o = np.array([[-2.0, 0.0, 1.0 + height]])
            assert np.isinf(Placed(shape).probe(o, [[1.0, 0.0, 0.0]]).t[0])
            below = Placed(shape).probe([[-2.0, 0.0, 1.0 - height / 2]], [[1.0, 0.0, 0.0]])
            assert below.t[0] == 2.0 - height / 2
            assert below.face[0] == 0


def test_leaving_the_apex():
    """Upwards nothing is met again, however flat."""
    rng = np.random.default_rng(8)
    w = unit_vectors(rng, 1000)
    w[:, 2] = np.abs(w[:, 2]) * 10.0 ** -rng.uniform(0.0, 18.0, 1000)
    for shape in (rt.Cone(), rt.Cone(radius=0.3), rt.Cone(radius=5.0)):
        for offset in ((0.0, 0.0, 0.0), (1.0, 2.0, 3.0)):
            placed = put(shape, np.eye(3), offset)
            o = np.tile(np.add(apex_of(placed), [0.0, 0.0, 4.0]), (1000, 1))
            found = Placed(placed).probe(o, np.tile([0.0, 0.0, -1.0], (1000, 1)), w)
            assert (found.t == 4.0).all()
            assert np.isinf(found.again).all()


# ---- what there is to describe ------------------------------------------------------------------


@pytest.mark.parametrize(
    ("shape", "fields", "message"),
    [
        (rt.Cylinder, {"radius": 0}, "greater than 0"),
        (rt.Cylinder, {"z_min": 1.0}, "expected 'z_min' below 'z_max'"),
        (rt.Cylinder, {"z_max": math.inf}, "finite"),
        (rt.Cone, {"radius": 0}, "greater than 0"),
        (rt.Cone, {"height": -1}, "greater than 0"),
        (rt.Cone, {"top_radius": -1}, "greater than or equal to 0"),
    ],
)
def test_refused(shape, fields, message):
    with pytest.raises(rt.SceneError, match=re.escape(message)):
        shape(**fields)
