"""The frame of Mitsuba's copy of a scene: moved and scaled where float32 needs it, only there."""

import numpy as np
from stiff_scenes import FOLDER, STIFF, scene

from comparisons.geometry.frame import RAY_EPSILON, SHARE, Frame, frame_for
from comparisons.referee.sizes import ShapeSizes
from comparisons.rungs import geometry
from comparisons.rungs.rays.camera import camera_rays
from comparisons.rungs.rays.rays import mixed_rays
from comparisons.translator import load
from comparisons.translator.moved import frame_of, moved
from reference_rt.integrators import Whitted
from reference_rt.rendering import query
from reference_rt.rendering.scene import Scene
from reference_rt.scene.build import build_tables


def test_only_what_lies_far_away_or_is_small_is_moved() -> None:
    assert {path.stem for path in FOLDER.glob("*.yaml")} >= set(STIFF)
    there = {
        path.stem
        for path in FOLDER.glob("*.yaml")
        if not path.stem.startswith(("many_", "instances"))
        and not frame_of(Scene.load(path)).is_ours
    }
    assert there == {"far_origin", "tiny"}


def test_a_scene_that_is_not_moved_is_the_very_same() -> None:
    box = scene("cornell_box")
    assert moved(box, frame_of(box)) is box


def test_the_bound_is_where_rays_begin_a_hundredth_of_the_size_off() -> None:
    half = 2.0
    reach = SHARE * half / RAY_EPSILON - 1.0
    upper = np.full(3, reach)
    assert frame_for(upper - 2.0 * half, upper).is_ours
    upper *= 1.001
    found = frame_for(upper - 2.0 * half, upper)
    assert found.scale == 1.0 / half
    assert np.abs(np.array(found.center) - (upper - half)).max() <= half


def test_points_go_there_and_back_exactly() -> None:
    frame = Frame((1e7, -9999998.0, 1e7), 0.5)
    p = np.random.default_rng(1).uniform(-4.0, 4.0, (100, 3)) + np.array(frame.center)
    rounded = frame.rounded(p)
    local = frame.into(rounded)
    assert np.array_equal(local, local.astype(np.float32))
    assert np.array_equal(frame.out(local), rounded)
    assert np.abs(rounded - p).max() < 1e-6


def test_light_does_not_depend_on_size() -> None:
    """Point lights, area lights, spots: our own radiance, here and there."""
    text = """
camera: {type: thin_lens, eye: [0, 1, 4], target: [0, 0, 0], aperture_radius: 0.1}
integrator: {type: whitted}
materials: {lamp: {type: emissive, radiance: 5}, mirror: {type: mirror}}
shapes:
  - {type: sphere, radius: 0.7}
  - {type: sphere, radius: 0.4, center: [0.9, 0, 0.6], material: mirror}
  - {type: rectangle, material: lamp, transform: [{scale: 0.5},
     {rotate: {axis: [1, 0, 0], degrees: 90}}, {translate: [0, 3, 0.5]}]}
  - {type: rectangle, transform: [{scale: 3}, {rotate: {axis: [1, 0, 0], degrees: -90}},
     {translate: [0, -0.8, 0]}]}
lights:
  - {type: point, position: [2, 3, 1], intensity: [9, 8, 7]}
  - {type: spot, origin: [-2, 3, 2], target: [0, 0, 0], intensity: [20, 30, 20]}
"""
    here = Scene.parse(text)
    frame = Frame((0.5, -1.0, 2.0), 2.0**-12)
    there = moved(here, frame)
    x, y = np.random.default_rng(7).uniform(0.0, 1.0, (2, 500)) * here.film.width
    o, d = camera_rays(here, x, y, (0.9, 0.6))
    o2, d2 = camera_rays(there, x, y, (0.9, 0.6))
    assert np.allclose(frame.into(o), o2, rtol=0.0, atol=1e-15)
    ours, theirs = (
        query.radiance_without_noise(build_tables(s), Whitted().setup(), *rays)
        for s, rays in ((here, (o, d)), (there, (o2, d2)))
    )
    assert ours.max() > 0.2
    # But for a ray or two that pass an edge on different sides.
    assert np.count_nonzero(np.abs(ours - theirs).max(axis=1) > 1e-9) <= 2
    assert np.allclose(d, d2, atol=1e-14)


def test_a_fault_is_seen_in_a_moved_scene() -> None:
    far = scene("far_origin")
    ball = far.shapes[4]
    other = ball.model_copy(update={"radius": 0.5005})
    faulty = far.changed(shapes=(*far.shapes[:4], other, *far.shapes[5:]))
    assert geometry(far, build_tables(far), load(faulty), 300).status == "differ"


def test_bounds_are_counted_from_the_frames_middle() -> None:
    far = scene("far_origin")
    frame = frame_of(far)
    sizes = ShapeSizes(far, frame)
    assert sizes.reach.max() < 10.0
    rays = mixed_rays(far, build_tables(far), sizes, 50, 0)
    local = frame.into(rays.o)
    assert np.array_equal(local, local.astype(np.float32))
    assert (frame.epsilon(rays.o) < 20.0 * RAY_EPSILON).all()
