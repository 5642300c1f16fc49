"""Queries with arrays: their shapes, their errors, and that each is what rendering uses."""

import math

import numpy as np
import pytest
from builders import U, unit_vectors

import reference_rt as rt
from reference_rt.rendering import query
from reference_rt.rendering.query import tracing

TEXT = """
camera: {type: thin_lens, eye: [0.3, 0.5, 4], target: [0, 0, -1], fov: 40, aperture_radius: 0.1}
film: {width: 12, height: 8}
integrator: {type: whitted}
textures:
  checks: {type: checker, first: [0.8, 0.7, 0.2], second: [0.1, 0.2, 0.3], uv: {scale: [6, 4]}}
materials:
  grey: {type: diffuse, reflectance: checks}
  silver: {type: mirror, reflectance: 0.9}
  lamp: {type: emissive, radiance: [5, 4, 3], base: grey}
shapes:
  - {type: rectangle, material: grey, transform: [{scale: 3}, {translate: [0, 0, -2]}]}
  - {type: sphere, radius: 0.7, material: silver}
  - {type: rectangle, material: lamp,
     transform: [{rotate: {axis: [0, 1, 0], degrees: 70}}, {translate: [-2.5, 0, 1]}]}
lights:
  - {type: ambient, radiance: 0.1}
  - {type: constant, radiance: [0.1, 0.2, 0.3]}
  - {type: directional, direction: [0, -1, -1], irradiance: [1, 2, 3]}
  - {type: point, position: [2, 3, 3], intensity: [9, 8, 7]}
"""


@pytest.fixture(scope="module")
def scene():
    return rt.Scene.parse(TEXT)


# ---- rays -------------------------------------------------------------------------------------

O, D = (0.1, 0.2, 5.0), (0.02, -0.01, -0.9)
NAMES = ("t", "shape", "primitive", "part", "instance", "p", "n", "ns", "uv")


def test_a_single_ray_gives_numbers(scene):
    hit, many = scene.intersect(O, D), scene.intersect([O], [D])
    assert np.ndim(hit.t) == np.ndim(hit.shape) == np.ndim(hit.hit) == 0
    assert hit.p.shape == hit.n.shape == hit.ns.shape == (3,)
    assert hit.uv.shape == (2,)
    for name in NAMES:
        assert np.array_equal(getattr(hit, name), getattr(many, name)[0])
    assert bool(hit.hit)
    assert np.ndim(scene.occluded(O, D)) == 0
    assert scene.crossings(O, D).count.tolist() == [3]


@pytest.mark.parametrize("shape", [(), (5,), (4, 3), (2, 1, 3)])
def test_rays_keep_the_shape_of_their_arrays(scene, shape):
    rng = np.random.default_rng(1)
    d = np.array(D) + 0.1 * rng.normal(size=(*shape, 3))
    flat = d.reshape(-1, 3)
    hits, each = scene.intersect(O, d), scene.intersect(np.tile(O, (len(flat), 1)), flat)
    for name in NAMES:
        got, expected = getattr(hits, name), getattr(each, name)
        assert np.shape(got) == shape + expected.shape[1:]
        assert np.array_equal(np.reshape(got, expected.shape), expected)
    assert np.shape(scene.occluded(O, d)) == shape
    assert np.shape(scene.first_hits(O, d).t) == shape


def test_origins_directions_and_limits_broadcast(scene):
    o, d = np.array(O) + np.zeros((4, 1, 3)), np.array(D) + np.zeros((3, 3))
    t_max = np.array([[1.0], [5.0], [20.0], [np.inf]])
    hits = scene.intersect(o, d, t_max=t_max)
    assert hits.t.shape == (4, 3)
    assert np.array_equal(hits.hit[:, 0], hits.t[3, 0] < t_max[:, 0])
    assert scene.intersect(O, D, t_min=[0.0, 5.5]).t.shape == (2,)


@pytest.mark.parametrize(
    "make",
    [
        lambda a: a.tolist(),
        lambda a: a.astype(np.float32),
        lambda a: a[::-1][::-1],
        lambda a: np.asfortranarray(a),
        lambda a: np.repeat(a, 2, axis=0)[::2],
        lambda a: _read_only(a),
    ],
    ids=["lists", "float32", "reversed", "fortran", "strided", "read-only"],
)
def test_any_array_of_numbers_will_do(scene, make):
    o, d = np.array([O, O]), np.array([D, [0.0, 0.0, -1.0]])
    o, d = (np.round(a * 64) / 64 for a in (o, d))  # float32 has these
    assert np.array_equal(scene.intersect(make(o), make(d)).t, scene.intersect(o, d).t)


def _read_only(a):
    a = a.copy()
    a.flags.writeable = False
    return a


def test_integers_are_numbers(scene):
    assert scene.intersect([0, 0, 5], [0, 0, -1]).t == pytest.approx(4.3)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
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
    ],
)
def test_what_is_wrong_with_arrays_of_rays_is_told(scene, arguments, message):
    asked = [scene.intersect, scene.first_hits, scene.crossings]
    for ask in asked:
        with pytest.raises(ValueError, match=message):
            ask(*arguments)
    names = ("origins", "directions", "t_min", "t_max", "threads")
    with pytest.raises(ValueError, match=message):
        scene.occluded(**dict(zip(names, arguments, strict=False)))


@pytest.mark.parametrize(
    ("ask", "message"),
    [
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
    ],
)
def test_what_is_wrong_with_other_arrays_is_told(scene, ask, message):
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
    rng = np.random.default_rng(2)
    o, d = np.array(O) + rng.normal(size=(30_000, 3)), unit_vectors(rng, 30_000)
    one, two = (scene.intersect(o, d, threads=n) for n in (1, 2))
    for name in NAMES:
        assert getattr(one, name).tobytes() == getattr(two, name).tobytes(), name
    few = scene.first_hits(o, d)
    for name in NAMES[:5]:
        assert getattr(few, name).tobytes() == getattr(one, name).tobytes(), name
    assert np.array_equal(scene.occluded(o, d), one.hit)


def test_few_rays_find_what_many_find(scene):
    """They are traced by other kernels."""
    rng = np.random.default_rng(7)
    o, d = np.array(O) + rng.normal(size=(tracing.FEW + 1, 3)), D + 0.1 * rng.normal(size=(1, 3))
    many, few = scene.intersect(o, d), scene.intersect(o[:-1], d)
    assert 0.1 < many.hit.mean() < 0.99
    for name in NAMES:
        assert getattr(many, name)[:-1].tobytes() == getattr(few, name).tobytes(), name


def test_old_names_still_answer(scene):
    with pytest.warns(DeprecationWarning, match="first_hits"):
        found = query.closest(scene.tables, [O], [D])
    assert found.t[0] == scene.intersect(O, D).t
    with pytest.warns(DeprecationWarning, match="radiance_without_noise"):
        old = query.whitted_radiance(scene.tables, rt.Whitted().setup(), [O], [D])
    assert np.array_equal(old, scene.radiance([O], [D]).mean)


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


def test_rays_through_a_lens_meet_in_the_plane_in_focus(scene):
    """At the distance of the target; their origins fill the lens."""
    u = np.random.default_rng(3).uniform(size=(200, 2))
    camera = scene.camera
    eye, w = np.array(camera.eye), camera.basis[2]
    focus = np.linalg.norm(eye - camera.target)
    rays = scene.camera_rays([3, 1], lens=u)
    t = (focus + (rays.origins - eye) @ w) / -(rays.directions @ w)
    points = rays.origins + t[:, None] * rays.directions
    assert np.abs(points - points[0]).max() < 64 * U * focus
    radius = np.linalg.norm(rays.origins - eye, axis=1)
    assert 0.09 < radius.max() <= 0.1 * (1 + 4 * U)
    assert np.abs((rays.origins - eye) @ w).max() < 8 * U * focus


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


def test_what_shapes_without_material_scatter(scene):
    value = scene.bsdf(None).evaluate((0, 0, 1), (0, 0, 1))
    np.testing.assert_allclose(value, 0.5 / math.pi, rtol=4 * U)


# ---- lights -----------------------------------------------------------------------------------


def test_light_numbers_say_what_they_are_of(scene):
    found = scene.light_sources()
    assert found.shape.tolist() == [2, -1, -1, -1]
    assert found.light.tolist() == [-1, 3, 2, 1]  # areas, points, directions, the environment
    assert found.probability.sum() == pytest.approx(1.0)


def test_samples_of_lights_are_where_they_say(scene):
    rng = np.random.default_rng(5)
    p, u = np.array([0.5, 1.0, 2.0]), rng.uniform(size=(4000, 3))
    found, sources = scene.sample_lights(p, u), scene.light_sources()
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
    free = soft & ~scene.occluded(p, found.target - p, t_max=1.0) | (found.light == 3)
    hits = scene.intersect(p, found.wi)
    free &= np.where(found.light == 0, hits.shape == 2, ~hits.hit)
    assert free.sum() > 1000
    pdf = scene.light_pdf(p, found.wi[free])
    np.testing.assert_allclose(pdf, found.pdf[free], rtol=1e-12)


def test_light_densities_integrate_to_their_chance(scene):
    """Over all directions from a point in the open, where the lamp and the sky are all there is."""
    lit = scene.changed(shapes=scene.shapes[2:])
    rng = np.random.default_rng(6)
    n = 400_000
    pdf = lit.light_pdf((-1.0, 0.3, 1.5), unit_vectors(rng, n))
    sources = lit.light_sources()
    soft = sources.probability[[0, 3]].sum()
    # The lamp covers some of the sky, whose density is missing there.
    sky = sources.probability[3] / (4 * math.pi)
    covered = np.mean(lit.first_hits((-1.0, 0.3, 1.5), unit_vectors(rng, n)).hit) * 4 * math.pi
    mean, error = 4 * math.pi * pdf.mean(), 4 * math.pi * pdf.std() / math.sqrt(n)
    assert mean == pytest.approx(soft - sky * covered, abs=5 * error)
