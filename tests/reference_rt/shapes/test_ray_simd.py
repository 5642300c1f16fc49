"""One shape against several rays at once gives the bits of plain Python."""

import math

import numpy as np
import pytest

from reference_rt.core.ray import RAY_FLOATS
from reference_rt.core.vec3 import Vec3
from reference_rt.jit.kernel import entry_kernel
from reference_rt.jit.simd import VECTOR_WIDTH
from reference_rt.shapes import box
from reference_rt.shapes.curved import quadrics, sphere
from reference_rt.shapes.flat import disk, rectangle
from reference_rt.shapes.ray_simd import make_plain_nearer


@entry_kernel
def _nearer_rectangle(numbers, at, shape, t, codes):
    rectangle.nearer(numbers, at, shape, 5, t, codes)


@entry_kernel
def _nearer_box(numbers, at, shape, t, codes):
    box.nearer(numbers, at, shape, 5, t, codes)


@entry_kernel
def _nearer_sphere(numbers, at, shape, t, codes):
    sphere.nearer(numbers, at, shape, 5, t, codes)


@entry_kernel
def _nearer_disk(numbers, at, shape, t, codes):
    disk.nearer(numbers, at, shape, 5, t, codes)


@entry_kernel
def _nearer_quadric(numbers, at, shape, t, codes):
    quadrics.nearer(numbers, at, shape, 5, t, codes)


NEARER = (
    (rectangle, 4, _nearer_rectangle),
    (box, 4, _nearer_box),
    (sphere, 1, _nearer_sphere),
    (disk, 4, _nearer_disk),
    (quadrics, 4, _nearer_quadric),
)
NAMES = ["flat", "box", "sphere", "disk", "quadric"]


def _rest_of_quadric(rng):
    """Coefficients, of which many are 0, a box that clips some axes, and whether it is a solid."""
    k = tuple(np.where(rng.random(10) < 0.5, 0.0, rng.normal(size=10)))
    lower, upper = Vec3(*-rng.uniform(0.1, 1, 3)), Vec3(*rng.uniform(0.1, 1, 3))
    clipped = Vec3(*rng.integers(0, 2, 3).astype(float))
    return k, lower, upper, clipped, np.float64(rng.integers(0, 2))


@pytest.mark.parametrize(("module", "vectors", "nearer"), NEARER, ids=NAMES)
def test_vector_code_gives_the_bits_of_the_plain_kernel(module, vectors, nearer):
    """Infinities, zeros and NaN included."""
    rng = np.random.default_rng(72)
    odd = np.array([0.0, -0.0, 1.0, -1.0, math.inf, -math.inf, math.nan, 1e300, 1e-310])
    finite = 0
    for _ in range(400):
        numbers = rng.normal(size=RAY_FLOATS)
        which = rng.random(RAY_FLOATS) < 0.1
        numbers[which] = rng.choice(odd, which.sum())
        values = rng.normal(size=(vectors, 3)) * 0.5
        values[rng.random(values.shape) < 0.1] = 0.0
        shape = tuple(Vec3(*map(np.float64, v)) for v in values)
        if module is sphere:
            shape = (*shape, np.float64(rng.uniform(0.5, 3)))
        if module is quadrics:
            shape = (*shape, *_rest_of_quadric(rng))
        at = int(rng.choice([0, VECTOR_WIDTH]))
        t, codes = np.full(VECTOR_WIDTH, rng.choice([math.inf, 2.0])), np.full(VECTOR_WIDTH, -1)
        plain_t, plain_codes = t.copy(), codes.copy()
        nearer(numbers, at, shape, t, codes)
        with np.errstate(all="ignore"):
            make_plain_nearer(module.distance)(numbers, at, shape, 5, plain_t, plain_codes)
        assert t.tobytes() == plain_t.tobytes()
        assert np.array_equal(codes, plain_codes)
        finite += (codes == 5).sum()
    assert finite > 200
