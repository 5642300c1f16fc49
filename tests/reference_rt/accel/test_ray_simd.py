"""SIMD blocks of rays find what each ray finds alone, and so do paths, to the last bit."""

import math

import numpy as np
import pytest
from builders import SCENES

import reference_rt as rt
from reference_rt.accel.block_query import any_hits, closest_hits, hit_of
from reference_rt.accel.geometry import closest_hit, occluded
from reference_rt.core.ray import BLOCK, Ray
from reference_rt.core.ray_block import (
    HIT_FLOATS,
    HIT_INTEGERS,
    RAY_FLOATS,
    HitBlock,
    RayBlock,
    ray_of,
)
from reference_rt.core.vec3 import Vec3
from reference_rt.jit.kernel import entry_kernel
from reference_rt.jit.simd import VECTOR_WIDTH
from reference_rt.rendering.accumulation import jobs_of
from reference_rt.rendering.kernels import Running
from reference_rt.shapes import box
from reference_rt.shapes.curved import sphere
from reference_rt.shapes.flat import rectangle
from reference_rt.shapes.ray_simd import make_plain_nearer


def scene(kinds, rng):
    """Two of each kind somewhere around the origin, the second twice."""
    shapes = []
    for kind in kinds:
        for _ in range(2):
            steps = [
                {"scale": rng.uniform(0.4, 1, 3).tolist() if kind != "sphere" else 0.8},
                {"rotate": {"axis": rng.normal(size=3).tolist(), "degrees": 50.0}},
                {"translate": rng.uniform(-1, 1, 3).tolist()},
            ]
            shapes.append({"type": kind, "transform": steps})
        shapes.append(shapes[-1])
    return rt.Scene.model_validate({"shapes": shapes})


def rays_for(rng, n):
    """Of all directions, along axes and in the plane of faces too; of all lengths."""
    o, d = rng.uniform(-2, 2, (n, 3)), rng.normal(size=(n, 3))
    along = rng.random(n) < 0.2
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    d[along] = axes[rng.integers(0, 6, along.sum())]
    whole = rng.random(n) < 0.2
    o[whole] = np.round(o[whole])
    t_max = rng.choice([math.inf, 1.0, 0.3], n)
    return o, d, t_max


@entry_kernel
def _alone(geometry, o, d, t_max, found, blocked):
    for j in range(len(o)):
        ray = Ray(Vec3(o[j, 0], o[j, 1], o[j, 2]), Vec3(d[j, 0], d[j, 1], d[j, 2]), t_max[j])
        hit = closest_hit(geometry, ray)
        found[j, 0], found[j, 1], found[j, 2] = hit.t, hit.u, hit.v
        found[j, 3], found[j, 4] = hit.kind, hit.row
        blocked[j] = occluded(geometry, ray)


@entry_kernel
def _together(geometry, numbers, hits, n, found, blocked):
    rays = RayBlock(numbers)
    closest_hits(geometry, rays, hits, n)
    for j in range(n):
        hit = hit_of(geometry, ray_of(rays, j), hits, j)
        found[j, 0], found[j, 1], found[j, 2] = hit.t, hit.u, hit.v
        found[j, 3], found[j, 4] = hit.kind, hit.row
    any_hits(geometry, rays, hits, n)
    for j in range(n):
        blocked[j] = hits.codes[j] >= 0


@pytest.mark.parametrize(
    "kinds", [["rectangle", "box"], ["sphere"], ["sphere", "rectangle", "disk"]]
)
def test_rays_side_by_side_find_what_each_finds(kinds):
    rng = np.random.default_rng(71)
    geometry = scene(kinds, rng).tables.geometry
    assert geometry.bvh is None
    hits = HitBlock(np.empty(HIT_FLOATS), np.empty(HIT_INTEGERS, np.int64))
    any_found = 0
    for n in [*range(1, BLOCK + 1)] * 40:
        o, d, t_max = rays_for(rng, n)
        numbers = np.full(RAY_FLOATS, np.nan)
        numbers.reshape(7, BLOCK)[:, :n] = [*o.T, *d.T, t_max]
        one, all_ = np.empty((2, n, 5))
        one_blocked, all_blocked = np.empty((2, n), bool)
        _alone(geometry, o, d, t_max, one, one_blocked)
        _together(geometry, numbers, hits, n, all_, all_blocked)
        assert np.array_equal(one, all_)
        assert np.array_equal(one_blocked, all_blocked)
        assert np.array_equal(one_blocked, one[:, 3] >= 0)
        any_found += one_blocked.sum()
    assert any_found > 300


SHAPES = {
    "rectangle": (rectangle, 4),
    "box": (box, 4),
    "sphere": (sphere, 1),
}


@entry_kernel
def _nearer_rectangle(numbers, at, shape, t, codes):
    rectangle.nearer(numbers, at, shape, 5, t, codes)


@entry_kernel
def _nearer_box(numbers, at, shape, t, codes):
    box.nearer(numbers, at, shape, 5, t, codes)


@entry_kernel
def _nearer_sphere(numbers, at, shape, t, codes):
    sphere.nearer(numbers, at, shape, 5, t, codes)


NEARER = {"rectangle": _nearer_rectangle, "box": _nearer_box, "sphere": _nearer_sphere}


@pytest.mark.parametrize("kind", SHAPES)
def test_vector_code_gives_the_bits_of_the_plain_kernel(kind):
    """Infinities, zeros and NaN included."""
    module, vectors = SHAPES[kind]
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
        if kind == "sphere":
            shape = (*shape, np.float64(rng.uniform(0.5, 3)))
        at = int(rng.choice([0, VECTOR_WIDTH]))
        t, codes = np.full(VECTOR_WIDTH, rng.choice([math.inf, 2.0])), np.full(VECTOR_WIDTH, -1)
        plain_t, plain_codes = t.copy(), codes.copy()
        NEARER[kind](numbers, at, shape, t, codes)
        with np.errstate(all="ignore"):
            make_plain_nearer(module.distance)(numbers, at, shape, 5, plain_t, plain_codes)
        assert t.tobytes() == plain_t.tobytes()
        assert np.array_equal(codes, plain_codes)
        finite += (codes == 5).sum()
    assert finite > 200


@pytest.mark.parametrize("spp", [1, 16, 37])
def test_paths_together_are_paths_one_by_one(spp):
    """Blocks of samples, whole and in part, beyond the dimensions that are drawn in blocks."""
    lit = rt.Scene.load(SCENES / "cornell_box.yaml")
    lit = lit.changed(
        film=lit.film.model_copy(update={"width": 12, "height": 9}),
        sampler=rt.Sobol(spp=spp, seed=3),
        integrator=rt.Path(rr_depth=12),
    )
    jobs, total = jobs_of(lit), np.zeros((12 * 9, 3))
    view, film_filter = lit.camera.setup(12, 9), lit.film.filter.setup()
    with Running(jobs, lit.tables, view, film_filter, 1) as running:
        for pixel in range(12 * 9):
            for sample in range(spp):
                sums = {"colour": total[pixel : pixel + 1]}
                running.run(0)(sums, pixel, pixel + 1, sample, sample + 1)
    assert np.array_equal(rt.render(lit).colour, total.reshape(9, 12, 3) / spp)
