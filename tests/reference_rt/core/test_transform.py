"""Affine maps: their order, exact quarter turns, inverses, and what is refused."""

import itertools
import math

import numpy as np
import pytest
from builders import U, placed, unit_vectors

import reference_rt as rt
from reference_rt.core.transform import (
    Matrix,
    Rotate,
    Scale,
    Translate,
    Turn,
    affine,
    apply_normals,
    apply_points,
    compose,
    flattens,
    identity,
    invert,
    is_similarity,
    look_at,
    rotate,
    scale,
    singular,
    translate,
)


def test_steps_apply_in_the_order_written():
    steps = (
        Scale(scale=(2, 2, 2)),
        Rotate(rotate=Turn(axis=(0, 0, 1), degrees=90)),
        Translate(translate=(1, 0, 0)),
    )
    # (1, 0, 0) -> (2, 0, 0) -> (0, 2, 0) -> (1, 2, 0)
    assert apply_points(affine(steps), np.array([[1.0, 0, 0]])).tolist() == [[1, 2, 0]]
    assert np.array_equal(affine(()), identity())
    assert affine((Matrix(matrix=((1, 2, 3, 4), (5, 6, 7, 8), (9, 10, 11, 12))),))[1, 3] == 8


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, -5)])
@pytest.mark.parametrize("degrees", [-720, -270, -180, -90, 0, 90, 180, 270, 360, 450])
def test_quarter_turns_are_exact(axis, degrees):
    """Whole numbers, a determinant of one, and as many of them as make a full turn."""
    m = rotate(axis, degrees)[:, :3]
    assert np.array_equal(m, np.round(m))
    assert np.linalg.det(m) == 1.0
    quarter = rotate(axis, 90)[:, :3]
    assert np.array_equal(m, np.linalg.matrix_power(quarter, int(degrees // 90) % 4))


def test_a_turn_is_counter_clockwise_seen_against_its_axis():
    assert apply_points(rotate((0, 0, 1), 90), np.array([[1.0, 0, 0]])).tolist() == [[0, 1, 0]]
    assert apply_points(rotate((1, 0, 0), 90), np.array([[0, 1.0, 0]])).tolist() == [[0, 0, 1]]


def test_rotations_keep_lengths_angles_and_their_axis():
    rng = np.random.default_rng(101)
    for axis, degrees in zip(unit_vectors(rng, 50), rng.uniform(-500, 500, 50), strict=True):
        m = rotate(tuple(3 * axis), degrees)[:, :3]
        # Some ten operations on numbers up to 1 in each entry.
        assert np.allclose(m.T @ m, np.eye(3), rtol=0, atol=16 * U)
        assert np.allclose(m @ axis, axis, rtol=0, atol=16 * U)
        assert np.trace(m) == pytest.approx(1 + 2 * math.cos(math.radians(degrees)), abs=16 * U)


def test_compose_and_invert():
    rng = np.random.default_rng(102)
    for _ in range(50):
        a, b = affine(placed(rng, 1.0, 3.0)), affine(placed(rng, 1.0, 3.0))
        points = rng.uniform(-1, 1, (5, 3))
        both = apply_points(b, apply_points(a, points))
        # Numbers up to about 20, a dozen operations.
        assert np.allclose(apply_points(compose(a, b), points), both, rtol=0, atol=20 * 16 * U)
        back = compose(a, invert(a))
        # Scales between 1/2 and 2: a condition of at most four.
        assert np.allclose(back, identity(), rtol=0, atol=4 * 64 * U)


def test_normals_go_by_the_inverse_transpose():
    """They stay at right angles to what they were at right angles to."""
    rng = np.random.default_rng(103)
    for _ in range(50):
        m = compose(np.column_stack([rng.normal(size=(3, 3)) + 2 * np.eye(3), np.zeros(3)]))
        n = unit_vectors(rng, 1)
        tangents = np.cross(n, unit_vectors(rng, 4))
        mapped = apply_normals(m, n)
        assert np.linalg.norm(mapped) == pytest.approx(1.0, abs=4 * U)
        flat = tangents @ m[:, :3].T
        cond = np.linalg.cond(m[:, :3])
        assert np.abs(flat @ mapped[0]).max() <= 32 * U * cond * np.abs(flat).max()
    assert apply_normals(scale((1, 2, 1)), np.array([[0.6, 0.8, 0]]))[0] == pytest.approx(
        np.array([0.6, 0.4, 0]) / math.hypot(0.6, 0.4)
    )


@pytest.mark.parametrize(
    "factors",
    [(1e-100, 1e-100, 1e-100), (1e100,) * 3, (1e-30, 1.0, 1e30), (-1, 1, 1), (1, 1e-15, 1)],
)
def test_extreme_but_regular_maps_are_inverted(factors):
    m = compose(rotate((1, 2, 3), 30), scale(factors), translate((1, 2, 3)))
    found = invert(m)
    expected = compose(
        translate((-1, -2, -3)), scale(1 / np.array(factors)), rotate((1, 2, 3), -30)
    )
    # Each row on its own scale; translations are as large as the factors make them.
    for k in range(3):
        assert np.allclose(found[k], expected[k], rtol=0, atol=64 * U * np.abs(expected).max())


SINGULAR = {
    "one factor zero": scale((1, 0, 1)),
    "all zero": scale((0, 0, 0)),
    "two equal rows": np.array([[1, 2, 3, 0], [1, 2, 3, 0], [0, 0, 1, 0.0]]),
    "two equal columns": np.array([[1, 1, 0, 0], [2, 2, 0, 0], [0, 0, 1, 0.0]]),
    "rows dependent up to rounding": np.array(
        [[0.1, 0.2, 0.3, 0], [0.3, 0.6, 0.9, 0], [0, 0, 1, 0.0]]
    ),
    "not a number": np.array([[np.nan, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]),
    "infinite": translate((np.inf, 0, 0)),
}


@pytest.mark.parametrize("name", SINGULAR)
def test_singular_maps_are_refused(name):
    with pytest.raises(ValueError, match="singular"):
        invert(SINGULAR[name])


@pytest.mark.parametrize("factor", [1e-300, 1e-200, 1e-60, 1e60, 1e200])
@pytest.mark.parametrize("shape", [rt.Sphere, rt.Rectangle, rt.Box])
def test_a_shape_of_extreme_size_is_finite_or_refused(shape, factor):
    """Never NaN in the tables."""
    scene = rt.Scene(shapes=(shape(transform=(Scale(scale=(factor,) * 3),)),))
    try:
        tables = rt.build_tables(scene).geometry.shapes
    except rt.SceneError:
        assert not 1e-70 < factor < 1e70  # the squares of areas stay within float64
        return
    (table,) = (t for t in tables if t is not None)
    assert all(np.isfinite(column).all() for column in table)


def test_look_at():
    """Right-handed, unit, w away from the target, v as near to up as it can be."""
    rng = np.random.default_rng(104)
    for _ in range(50):
        eye, target, up = rng.normal(size=(3, 3))
        m = look_at(tuple(eye), tuple(target), tuple(up))
        u, v, w = m[:, :3].T
        assert np.allclose(m[:, :3].T @ m[:, :3], np.eye(3), rtol=0, atol=64 * U)
        assert np.allclose(np.cross(u, v), w, rtol=0, atol=64 * U)
        assert np.allclose(w * np.linalg.norm(eye - target), eye - target, rtol=0, atol=64 * U)
        assert v @ up > 0
        assert abs(u @ up) < 64 * U * np.linalg.norm(up)
        assert np.array_equal(m[:, 3], eye)


def test_look_at_of_the_defaults_is_the_identity():
    m = look_at((0, 0, 1), (0, 0, 0), (0, 1, 0))
    assert np.array_equal(m, np.column_stack([np.eye(3), [0, 0, 1]]))


def test_look_at_refuses_what_it_cannot_do():
    for up, direction in itertools.product(((0, 1, 0), (0, -3, 0)), (1.0, -1.0)):
        with pytest.raises(ValueError, match="parallel"):
            look_at((0, 0, 0), (0, direction, 0), up)
    with pytest.raises(ValueError, match="same point"):
        look_at((1, 2, 3), (1, 2, 3), (0, 1, 0))
    with pytest.raises(ValueError, match="too far apart"):
        look_at((1e308, 0, 0), (-1e308, 0, 0), (0, 1, 0))
    look_at((0, 0, 0), (0, 1, 0), (1e-10, 1, 0))  # nearly parallel is a direction


def test_one_map_and_many_are_singular_alike():
    """And as the condition number says, near its limit too."""
    rng = np.random.default_rng(11)
    maps = rng.normal(size=(600, 3, 4)) * 10.0 ** rng.uniform(-150, 150, (600, 3, 1))
    # From dependent rows to nearly dependent ones, about the limit.
    maps[::3, 2, :3] = maps[::3, 0, :3] + maps[::3, 1, :3]
    maps[::3, 2, 0] *= 1.0 + 2.0 ** -rng.uniform(30, 60, 200)
    maps[1, 1, 1], maps[2, 0, 3], maps[4, 2] = np.nan, np.inf, 0.0
    maps[5, 0, :3] = 1.7e308
    found = singular(maps)
    assert [flattens(m) for m in maps] == found.tolist()
    for m, flat in zip(maps, found.tolist(), strict=True):
        linear = m[:, :3]
        norms = np.abs(linear).max(axis=1)
        regular = np.isfinite(m).all() and (norms > 0.0).all()
        assert flat == (not regular or np.linalg.cond(linear / norms[:, None]) > 2.0**52)
    assert 30 < found.sum() < 570


@pytest.mark.parametrize("size", [1e-200, 1.0, 3e150])
@pytest.mark.parametrize("mirrored", [1.0, -1.0])
def test_similarities(size, mirrored):
    turn = compose(rotate((1, 2, 3), 40.0), rotate((0, 1, -1), 77.0))[:, :3]
    turn = size * turn @ np.diag([1.0, 1.0, mirrored])
    assert is_similarity(turn)
    for wrong in np.eye(9).reshape(9, 3, 3):
        assert not is_similarity(turn + 1e-14 * size * wrong)
