"""Bases around any normal; lengths of tiny vectors."""

import math

import numpy as np
from builders import U, unit_vectors

from reference_rt.core.vec3 import Vec3, frame_from_normal, length, normalize, row
from reference_rt.jit.kernel import entry_kernel


@entry_kernel
def _frames(n, out):
    for i in range(len(n)):
        frame = frame_from_normal(row(n, i))
        out[i, 0, 0], out[i, 0, 1], out[i, 0, 2] = frame.s
        out[i, 1, 0], out[i, 1, 1], out[i, 1, 2] = frame.t
        out[i, 2, 0], out[i, 2, 1], out[i, 2, 2] = frame.n


def test_frames_are_orthonormal_and_right_handed():
    """Everywhere, at both poles, and as near to them as floats go, with either zero."""
    rng = np.random.default_rng(91)
    normals = unit_vectors(rng, 100_000)
    tiny = 10.0 ** rng.uniform(-320, -1, (20_000, 1)) * normals[:20_000]
    near_poles = tiny + np.sign(normals[:20_000, 2:]) * [0, 0, 1.0]
    near_poles /= np.linalg.norm(near_poles, axis=1, keepdims=True)
    exact = [[x, y, z] for z in (1.0, -1.0) for x in (0.0, -0.0) for y in (0.0, -0.0)]
    exact += [[1.0, 0, z] for z in (0.0, -0.0)] + [[0, -1.0, z] for z in (0.0, -0.0)]
    n = np.concatenate([normals, near_poles, exact])
    frames = np.empty((len(n), 3, 3))
    _frames(n, frames)
    products = frames @ frames.transpose(0, 2, 1)
    # About ten operations on numbers up to 2; the normals themselves are unit to 2 u.
    assert np.abs(products - np.eye(3)).max() < 16 * U
    assert np.abs(np.linalg.det(frames) - 1).max() < 32 * U
    assert np.array_equal(frames[:, 2], n)


def test_normalize():
    assert normalize(Vec3(0.0, -2.0, 0.0)) == (0.0, -1.0, 0.0)
    assert math.isclose(length(normalize(Vec3(1e-150, 1e-150, 0.0))), 1.0)
