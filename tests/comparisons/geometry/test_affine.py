"""Affine maps of descriptions against Mitsuba's own functions, and against ours."""

import numpy as np
import pytest

from comparisons.geometry import affine
from comparisons.mitsuba.backend import mitsuba
from reference_rt.core import transform
from reference_rt.core.transform import Matrix, Rotate, Scale, Translate, Turn

STEPS = (
    Scale(scale=(-2.0, 0.5, 3e4)),
    Rotate(rotate=Turn(axis=(1.0, -2.0, 0.25), degrees=37.0)),
    Translate(translate=(1e3, -2.0, 0.5)),
    Matrix(matrix=((1.0, 2.0, 0.0, 1.0), (0.0, 1.0, 3.0, -4.0), (0.5, 0.0, 1.0, 2.0))),
    Rotate(rotate=Turn(axis=(0.0, 1e200, 0.0), degrees=-90.0)),
)


def of_mitsuba(steps):
    known = mitsuba().ScalarTransform4d
    total = known()
    for step in steps:
        match step:
            case Translate(translate=v):
                one = known().translate(list(v))
            case Scale(scale=v):
                one = known().scale(list(v))
            case Rotate(rotate=turn):
                axis = np.array(turn.axis) / np.abs(turn.axis).max()
                one = known().rotate((axis / np.linalg.norm(axis)).tolist(), turn.degrees)
            case Matrix(matrix=rows):
                one = known(np.vstack([rows, [[0.0, 0.0, 0.0, 1.0]]]))
        total = one @ total
    return np.array(total.matrix, np.float64)[:3]


@pytest.mark.parametrize("count", range(len(STEPS) + 1))
def test_steps_are_those_of_mitsuba_and_ours(count):
    m = affine.of_steps(STEPS[:count])
    size = np.abs(m).max()
    np.testing.assert_allclose(m, of_mitsuba(STEPS[:count]), rtol=0.0, atol=64 * 2**-52 * size)
    ours = transform.affine(STEPS[:count])
    np.testing.assert_allclose(m, ours, rtol=0.0, atol=64 * 2**-52 * size)
    assert affine.mirrors(m) == transform.flips_orientation(ours) == (count > 0)
    points = np.random.default_rng(1).normal(size=(50, 3))
    np.testing.assert_allclose(
        affine.apply_points(affine.invert(m), affine.apply_points(m, points)), points, atol=1e-9
    )
    normals = points / np.linalg.norm(points, axis=1, keepdims=True)
    np.testing.assert_allclose(
        affine.apply_normals(m, normals), transform.apply_normals(ours, normals), atol=1e-9
    )


@pytest.mark.parametrize("degrees", [-270.0, -90.0, 90.0, 180.0, 450.0])
@pytest.mark.parametrize("axis", np.eye(3).tolist())
def test_quarter_turns_are_exact(axis, degrees):
    steps = (Rotate(rotate=Turn(axis=tuple(axis), degrees=degrees)),)
    np.testing.assert_array_equal(affine.of_steps(steps), transform.affine(steps))


def test_similarities():
    turned = affine.of_steps((STEPS[1], STEPS[1], Scale(scale=(-1e150,) * 3), STEPS[1]))
    assert affine.is_similarity(turned[:, :3])
    assert not affine.is_similarity(affine.of_steps((STEPS[0], STEPS[1]))[:, :3])
