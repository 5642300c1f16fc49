"""The torus: normals, texture coordinates, what is refused."""

import numpy as np
import pytest

import reference_rt as rt


def test_normals_and_uv():
    scene = rt.Scene(shapes=(rt.Torus(),))
    o = [[5, 0, 0], [0, 0, 0], [0, 1.0, 5], [0, 1.0, 0.0], [0, -5.0, 0]]
    d = [[-1, 0, 0], [1, 0, 0], [0, 0, -1], [0, 0, -1], [0, 2, 0]]
    hits = scene.intersect(o, d)
    np.testing.assert_allclose(hits.t, [3.75, 0.75, 4.75, 0.25, 1.875], rtol=4e-16)
    n = [[1, 0, 0], [-1, 0, 0], [0, 0, 1], [0, 0, -1], [0, -1, 0]]
    np.testing.assert_allclose(hits.n, n, atol=1e-15)
    uv = [[0, 0], [0, 0.5], [0.25, 0.25], [0.25, 0.75], [0.75, 0]]
    np.testing.assert_allclose(hits.uv, uv, atol=1e-15)


def test_refuses_a_tube_that_cuts_itself():
    with pytest.raises(rt.SceneError, match=r"shapes\[0\]: minor_radius is 1; expected less than"):
        rt.build_tables(rt.Scene(shapes=(rt.Torus(minor_radius=1.0),)))
