"""Equations, patches and exact crossings of shapes, which are written apart, against each other.

Mitsuba and Cycles get meshes of the patches, the rung `files` judges by the equation, and the
referee by the crossings: a wrong number in one of them is seen here.
"""

from typing import Any, get_args

import numpy as np
import pytest
from placed_shapes import Placed, anywhere

from comparisons.geometry import affine
from comparisons.geometry.exact.dyadic import NEVER, nearest
from comparisons.referee import all_hits
from comparisons.shapes import SHAPES, type_of
from reference_rt.scene.examples import examples
from reference_rt.shapes.tables import Primitive

WITH_EQUATION = [shape for shape in examples(Primitive) if type_of(shape).surface is not None]
WITH_PATCHES = [shape for shape in WITH_EQUATION if type_of(shape).surface(shape).patches()]


def name(shape: Any) -> str:
    return f"{shape.type} {' '.join(map(str, shape.model_dump(exclude_defaults=True)))}"


def test_every_shape_has_its_type() -> None:
    assert {one.of for one in SHAPES} == set(get_args(Primitive))
    assert len(SHAPES) == len(get_args(Primitive))


def crossings(placed: Placed, o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, ...]:
    """t (n, k), inf where there is none, and whether rays enter there."""
    found = all_hits(placed.field, placed.row, o, d)
    t = np.where(found.t == NEVER, np.inf, nearest(np.where(found.t == NEVER, 0, found.t)))
    return t.astype(float), found.enters


@pytest.mark.parametrize("shape", WITH_EQUATION, ids=name)
def test_exact_crossings_are_where_the_equation_holds(shape: Any) -> None:
    """And lines enter there against its normals."""
    rng = np.random.default_rng(7)
    shape = anywhere(rng, shape)
    placed, surface = Placed(shape), type_of(shape).surface(shape)
    o, d = placed.rays(rng, 400, (0.0, 0.5))
    t, enters = crossings(placed, o, d)
    ray, k = np.nonzero(np.isfinite(t))
    assert len(ray) > 60
    inverse = affine.invert(affine.of_steps(shape.transform))
    q = affine.apply_points(inverse, o[ray] + d[ray] * t[ray, k][:, None])
    assert surface.distance(q).max() < 1e-12 * placed.reach * np.linalg.norm(inverse[:, :3], 2)
    along = np.sum(surface.normals(q) * (d[ray] @ inverse[:, :3].T), axis=1)
    assert ((along < 0.0) == enters[ray, k]).all()


@pytest.mark.parametrize("shape", WITH_EQUATION, ids=name)
def test_gradients_are_derivatives(shape: Any) -> None:
    rng = np.random.default_rng(8)
    surface = type_of(shape).surface(shape)
    q = np.array(surface.middle) + rng.uniform(-1.2, 1.2, (200, 3)) * np.max(surface.half)
    h = 1e-6
    slopes = [(surface.value(q + h * e) - surface.value(q - h * e)) / (2.0 * h) for e in np.eye(3)]
    np.testing.assert_allclose(np.transpose(slopes), surface.gradient(q), rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("shape", WITH_PATCHES, ids=name)
def test_lines_cross_shapes_at_points_of_their_patches(shape: Any) -> None:
    rng = np.random.default_rng(9)
    placed, surface = Placed(shape), type_of(shape).surface(shape)
    at = rng.uniform(0.01, 0.99, (2, 200))
    q = np.concatenate([patch.point(*at) for patch in surface.patches()])
    if surface.ends is not None:
        low, high = surface.ends
        q = q[((q > low) & (q < high)).all(axis=1)]
    assert len(q) > 40
    n = surface.gradient(q)
    d = n / np.linalg.norm(n, axis=1, keepdims=True) + 0.3 * rng.normal(size=n.shape)
    t, _ = crossings(placed, q - d, d)
    assert np.abs(t - 1.0).min(axis=1).max() < 1e-10
