"""Queries with arrays: their shapes, their errors, and that rendering uses the same code."""

import math
import threading
import time

import numpy as np
import pytest
from builders import U, unit_vectors
from camera_checks import rays
from query_scene import LIT

import reference_rt as rt
from reference_rt.rendering.query.rays import in_blocks

VIEW = """
camera: {type: thin_lens, eye: [0.3, 0.5, 4], target: [0, 0, -1], fov: 40, aperture_radius: 0.1}
film: {width: 12, height: 8}
"""


@pytest.fixture(scope="module")
def scene():
    return rt.Scene.parse(VIEW + LIT)


# ---- rays -------------------------------------------------------------------------------------

O, D = (0.1, 0.2, 5.0), (0.02, -0.01, -0.9)
NAMES = ("t", "shape", "primitive", "part", "instance", "p", "n", "ns", "uv")


def assert_same(one, other, names=NAMES):
    """The same bits, whatever the shapes of the arrays."""
    for name in names:
        assert getattr(one, name).tobytes() == getattr(other, name).tobytes(), name


def test_a_single_ray_gives_numbers(scene):
    hit, many = scene.intersect(O, D), scene.intersect([O], [D])
    assert np.ndim(hit.t) == np.ndim(hit.shape) == np.ndim(hit.hit) == 0
    assert hit.p.shape == hit.n.shape == hit.ns.shape == (3,)
    assert hit.uv.shape == (2,)
    assert_same(hit, many)
    assert bool(hit.hit)
    assert np.ndim(scene.occluded(O, D)) == 0
    assert scene.crossings(O, D).count.tolist() == [3]


def test_rays_keep_the_shape_of_their_arrays(scene):
    rng = np.random.default_rng(1)
    for shape in ((), (5,), (4, 3), (2, 1, 3)):
        d = np.array(D) + 0.1 * rng.normal(size=(*shape, 3))
        flat = d.reshape(-1, 3)
        hits, each = scene.intersect(O, d), scene.intersect(np.tile(O, (len(flat), 1)), flat)
        for name in NAMES:
            assert np.shape(getattr(hits, name)) == shape + getattr(each, name).shape[1:]
        assert_same(hits, each)
        assert np.shape(scene.occluded(O, d)) == shape
        assert np.shape(scene.first_hits(O, d).t) == shape


def test_origins_directions_and_limits_broadcast(scene):
    o, d = np.array(O) + np.zeros((4, 1, 3)), np.array(D) + np.zeros((3, 3))
    t_max = np.array([[1.0], [5.0], [20.0], [np.inf]])
    hits = scene.intersect(o, d, t_max=t_max)
    assert hits.t.shape == (4, 3)
    assert np.array_equal(hits.hit[:, 0], hits.t[3, 0] < t_max[:, 0])
    assert scene.intersect(O, D, t_min=[0.0, 5.5]).t.shape == (2,)


ARRAYS = {
    "lists": lambda a: a.tolist(),
    "float32": lambda a: a.astype(np.float32),
    "integers": lambda a: a.astype(int),
    "reversed": lambda a: a[::-1][::-1],
    "fortran": np.asfortranarray,
    "strided": lambda a: np.repeat(a, 2, axis=0)[::2],
    "read-only": lambda a: np.broadcast_to(a, a.shape),
}


def test_any_array_of_numbers_will_do(scene):
    for name, make in ARRAYS.items():
        digits = 1 if name == "integers" else 64  # integers, or numbers that float32 has
        o, d = np.array([O, O]), np.array([D, [0.0, 0.0, -1.0]])
        o, d = (np.round(a * digits) / digits for a in (o, d))
        hits = scene.intersect(o, d)
        assert hits.hit.all()
        assert_same(scene.intersect(make(o), make(d)), hits)


def test_what_is_wrong_with_arrays_of_rays_is_reported(scene):
    names = ("origins", "directions", "t_min", "t_max", "threads")
    for arguments, message in (
        (([0, 0], [0, 0, 1]), r"origins: expected shape \(..., 3\), got \(2,\)"),
        ((0.0, [0, 0, 1]), "origins: expected shape"),
        (([0, 0, 1], [[0, 0, 1, 2]]), "directions: expected shape"),
        (([[0, 0, 1]] * 2, [[0, 0, 1]] * 3), r"broadcast to one, got origins \(2, 3\)"),
        ((["a", "b", "c"], [0, 0, 1]), "origins: expected an array of real numbers"),
        (([0, 0, 1j], [0, 0, 1]), "origins: expected an array of real numbers"),
        (([0, 0, None], [0, 0, 1]), "origins: expected an array of real numbers"),
        (([[0, 0, 1], [0, 1]], [0, 0, 1]), "origins: expected an array of real numbers"),
        (([0, 0, 1], [0, 0, 1], -1.0), "t_min: expected 0 or above"),
        (([0, 0, 1], [0, 0, 1], np.nan), "t_min: expected numbers, got NaN"),
        (([0, 0, 1], [0, 0, 1], 0.0, np.nan), "t_max: expected numbers, got NaN"),
        (([[0, 0, 1]] * 2, [0, 0, 1], [1, 2, 3]), "broadcast to one"),
        (([0, 0, 1], [0, 0, 1], 0.0, 1.0, 0), "threads: expected 1 or more, got 0"),
    ):
        for ask in (scene.intersect, scene.first_hits, scene.crossings):
            with pytest.raises(ValueError, match=message):
                ask(*arguments)
        with pytest.raises(ValueError, match=message):
            scene.occluded(**dict(zip(names, arguments, strict=False)))


def test_what_is_wrong_with_other_arrays_is_reported(scene):
    for ask, message in (
        (lambda s: s.radiance([0, 0], [0, 0, 1]), "origins: expected shape"),
        (lambda s: s.radiance(O, D, integrator=rt.RayCast(show="id")), "shows 'id'"),
        (lambda s: s.sample_lights([0, 0], [0.5] * 3), "points: expected shape"),
        (lambda s: s.sample_lights(O, [0.5] * 2), "u: expected shape"),
        (lambda s: s.sample_lights(O, [0.5, 0.5, 1.0]), "u: expected numbers from 0"),
        (lambda s: s.sample_lights(O, [0.5, 0.5, np.nan]), "u: expected numbers from 0"),
        (lambda s: s.light_pdf(O, [0, 1]), "directions: expected shape"),
        (lambda s: s.light_pdf(O, D, t_min=-1.0), "t_min: expected 0"),
        (lambda s: s.bsdf("gray"), "no material 'gray'; expected one of: 'grey', 'silver'"),
        (lambda s: s.bsdf("grey").evaluate([0, 1], D), "wo: expected shape"),
        (lambda s: s.bsdf("grey").pdf(D, "up"), "wi: expected an array of real numbers"),
        (lambda s: s.bsdf("grey").sample(D, [0.5, 0.5, -0.1]), "u: expected numbers from 0"),
        (lambda s: s.camera_rays([1, 2, 3]), "pixels: expected shape"),
        (lambda s: s.camera_rays([1, 2], lens=[2.0, 0.0]), "lens: expected numbers from 0 to 1"),
    ):
        with pytest.raises((ValueError, rt.SceneError), match=message):
            ask(scene)


def test_rays_that_are_none_miss(scene):
    bad = np.array([[np.nan, 0, 1], [0, 0, 0], [np.inf, 0, 1], [0, -np.inf, 0]])
    hits = scene.intersect(O, bad)
    assert not hits.hit.any()
    assert np.isinf(hits.t).all()
    assert not scene.occluded(O, bad).any()
    assert not scene.intersect(bad[[0, 2, 3]], D).hit.any()
    assert not scene.radiance(O, bad).mean.any()
    assert not scene.light_pdf(O, bad).any()
    assert not scene.bsdf("grey").evaluate(bad, (0, 0, 1)).any()
    assert not scene.bsdf("grey").sample(bad, (0.5, 0.5, 0.5)).pdf.any()


def test_threads_change_nothing(scene):
    """And first hits, by other kernels, are the same (see also `test_ways`)."""
    rng = np.random.default_rng(2)
    o, d = np.array(O) + rng.normal(size=(30_000, 3)), unit_vectors(rng, 30_000)
    one, two = (scene.intersect(o, d, threads=n) for n in (1, 2))
    assert_same(one, two)
    assert_same(scene.first_hits(o, d), one, NAMES[:5])
    assert np.array_equal(scene.occluded(o, d), one.hit)


def test_after_ctrl_c_no_thread_begins_another_block():
    """The block that a helper of the interrupted thread is at ends, the other seven stay."""
    helping, helped = threading.Event(), []

    def trace(block):
        if threading.current_thread() is threading.main_thread():
            helping.wait()
            raise KeyboardInterrupt
        helping.set()
        helped.append(block)
        time.sleep(0.1)

    with pytest.raises(KeyboardInterrupt):
        in_blocks(trace, 10, threads=2, least=1)
    assert len(helped) < 4


# ---- the camera and radiance ------------------------------------------------------------------


def test_camera_rays_and_radiance_are_what_is_rendered(scene):
    """Of Whitted at the pixels' centres, through the lens's middle: to the last bit."""
    rays = scene.camera_rays()
    assert rays.origins.shape == rays.directions.shape == (8, 12, 3)
    found = scene.radiance(*rays)
    assert np.array_equal(found.mean, rt.render(scene).colour)
    assert not found.standard_error.any()
    cast = scene.radiance(*rays, integrator=rt.RayCast())
    mirrored = scene.intersect(*rays).shape == 1
    assert mirrored.any()
    assert (cast.mean[mirrored] == 0.9).all()
    one = scene.camera_rays([5, 2])
    assert np.array_equal(one.directions, rays.directions[2, 5])
    assert np.array_equal(
        scene.camera_rays([5.0, 2.0], offsets=[0.25, -0.5]).directions,
        scene.camera_rays([5.25, 1.5]).directions,
    )


def test_rays_through_a_lens_are_those_of_the_camera(scene):
    for lens in np.random.default_rng(3).uniform(size=(200, 2)):
        found = scene.camera_rays([3, 1], lens=lens)
        o, d = rays(scene.camera, [[3.5 / 12, 1.5 / 8]], (12, 8), lens)
        assert np.array_equal((found.origins, found.directions), (o[0], d[0]))


def test_radiance_is_a_pure_function_of_seed_ray_and_sample(scene):
    o, d = (a.reshape(-1, 3) for a in scene.camera_rays())
    path = rt.Path(max_depth=4)
    once = scene.radiance(o, d, spp=5, seed=3, integrator=path)
    for other in (
        scene.radiance(o, d, spp=5, seed=3, integrator=path, threads=1),
        scene.radiance(o, d * 3.7, spp=5, seed=3, integrator=path),
    ):
        np.testing.assert_allclose(other.mean, once.mean, rtol=1e-9)
    first = scene.radiance(o[:7], d[:7], spp=5, seed=3, integrator=path)
    assert np.array_equal(first.mean, once.mean[:7])
    assert np.array_equal(first.standard_error, once.standard_error[:7])
    assert (scene.radiance(o, d, spp=5, seed=4, integrator=path).mean != once.mean).any()
    single = scene.radiance(o, d, spp=1, seed=3, integrator=path)
    assert np.isinf(single.standard_error).all()


def test_standard_errors_say_how_far_means_are_apart(scene):
    """Of 64 estimates of each ray, by other seeds: their own spread is what they state."""
    o, d = (a[2:6, 3:9].reshape(-1, 3) for a in scene.camera_rays())
    path, n = rt.Path(max_depth=3), 64
    found = [scene.radiance(o, d, spp=32, seed=k, integrator=path) for k in range(n)]
    means = np.array([f.mean for f in found])
    stated = np.sqrt(np.mean([np.square(f.standard_error) for f in found], axis=0))
    noisy = stated > 1e-9 * means.mean(axis=0)  # others see what is not random, but for roundings
    ratio = means.std(axis=0, ddof=1)[noisy] / stated[noisy]
    # A standard deviation of 64 numbers is known to 1 / sqrt(126), 9 %; that of many, to far less.
    assert noisy.mean() > 0.2
    assert np.median(ratio) == pytest.approx(1.0, abs=0.1)


def test_one_edge_shows_what_shines(scene):
    lamp = (-1.0, 0.0, 1.2), (-1.0, 0.0, 0.0)
    seen = scene.radiance(*lamp, spp=2, integrator=rt.Path(max_depth=1))
    assert np.array_equal(seen.mean, (5.0, 4.0, 3.0))
    assert not seen.standard_error.any()


# ---- materials --------------------------------------------------------------------------------


def test_a_diffuse_bsdf_is_its_closed_form(scene):
    bsdf = scene.bsdf("grey")
    rng = np.random.default_rng(4)
    wi, uv = unit_vectors(rng, 500), rng.uniform(size=(500, 2))
    value = bsdf.evaluate((0.3, 0.0, 0.5), 7.0 * wi, uv=uv)
    first = (np.floor(uv[:, 0] * 12) + np.floor(uv[:, 1] * 8)) % 2 == 0
    colour = np.where(first[:, None], (0.8, 0.7, 0.2), (0.1, 0.2, 0.3))
    expected = colour * np.maximum(wi[:, 2:], 0.0) / math.pi
    np.testing.assert_allclose(value, expected, rtol=8 * U)
    np.testing.assert_allclose(
        bsdf.pdf((0.3, 0.0, 0.5), wi), np.maximum(wi[:, 2], 0.0) / math.pi, rtol=8 * U
    )
    drawn = bsdf.sample((0.0, 0.0, 1.0), rng.uniform(size=(500, 3)), uv=uv)
    np.testing.assert_allclose(drawn.weight, colour, rtol=8 * U)
    np.testing.assert_allclose(drawn.pdf, drawn.wi[:, 2] / math.pi, rtol=8 * U)
    assert not drawn.is_delta.any()
    # Shapes without a material.
    value = scene.bsdf(None).evaluate((0, 0, 1), (0, 0, 1))
    np.testing.assert_allclose(value, 0.5 / math.pi, rtol=4 * U)


def test_a_mirror_is_sampled_and_not_evaluated(scene):
    bsdf = scene.bsdf("silver")
    wo = np.array([0.6, 0.0, 0.8])
    drawn = bsdf.sample(wo, (0.5, 0.5, 0.5))
    np.testing.assert_allclose(drawn.wi, wo * (-1, -1, 1), atol=4 * U)
    assert np.array_equal(drawn.weight, (0.9, 0.9, 0.9))
    assert bool(drawn.is_delta)
    assert drawn.pdf == 1.0
    assert not bsdf.evaluate(wo, drawn.wi).any()
    assert bsdf.pdf(wo, drawn.wi) == 0.0


# ---- lights -----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def lit():
    return rt.Scene.parse(LIT)


def test_light_numbers_say_what_they_are_of(lit):
    found = lit.light_sources()
    assert found.shape.tolist() == [2, -1, -1, -1]
    assert found.light.tolist() == [-1, 3, 2, 1]  # areas, points, directions, the environment
    assert found.probability.sum() == pytest.approx(1.0)


def test_samples_of_lights_are_where_they_say(lit):
    rng = np.random.default_rng(5)
    p, u = np.array([0.5, 1.0, 2.0]), rng.uniform(size=(4000, 3))
    found, sources = lit.sample_lights(p, u), lit.light_sources()
    there = found.pdf > 0.0
    for k in range(4):
        mine = found.light == k
        share = (mine | ~there).mean() if k == 0 else mine.mean()
        assert share == pytest.approx(sources.probability[k], abs=5 * 0.5 / math.sqrt(4000))
        one = np.flatnonzero(mine)[0]
        assert bool(found.is_delta[one]) == (k in (1, 2))
    chance = sources.probability[np.maximum(found.light, 0)]
    points = found.light == 1
    r = np.array([2.0, 3.0, 3.0]) - p
    np.testing.assert_allclose(
        found.radiance[points], np.tile([9.0, 8.0, 7.0] / (r @ r), (points.sum(), 1)), rtol=8 * U
    )
    np.testing.assert_allclose(found.pdf[points], chance[points], rtol=4 * U)
    sun = found.light == 2
    np.testing.assert_allclose(found.wi[sun], np.tile([0, 0.5**0.5, 0.5**0.5], (sun.sum(), 1)))
    assert np.isinf(found.distance[sun]).all()
    # What `light_pdf` says of directions that nothing stands in the way of.
    soft = there & ~found.is_delta
    free = soft & ~lit.occluded(p, found.target - p, t_max=1.0) | (found.light == 3)
    hits = lit.intersect(p, found.wi)
    free &= np.where(found.light == 0, hits.shape == 2, ~hits.hit)
    assert free.sum() > 1000
    pdf = lit.light_pdf(p, found.wi[free])
    np.testing.assert_allclose(pdf, found.pdf[free], rtol=1e-12)
