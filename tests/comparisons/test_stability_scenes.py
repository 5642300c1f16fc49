"""The stiff scenes are right by closed forms, and Mitsuba's limits on them are told."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import comparisons.translate
from comparisons.frame import OURS, RAY_EPSILON, SHARE, Frame, frame_for
from comparisons.limited import limited
from comparisons.results import Tier
from comparisons.sizes import ShapeSizes
from comparisons.tiers import geometry
from comparisons.tiers.camera import camera_rays
from comparisons.tiers.rays import mixed_rays
from comparisons.tiers.resolution import Resolution, resolution
from comparisons.translate import load
from comparisons.translate.moved import frame_of, moved
from reference_rt import query
from reference_rt.integrators import Whitted
from reference_rt.query import Intersections
from reference_rt.scene import Scene
from reference_rt.shapes.shape import FloatArray
from reference_rt.tables import build_tables

FOLDER = Path(__file__).parents[2] / "scenes"
STIFF = (
    *("planet", "needle", "far_origin", "tiny", "slivers", "grazing", "nested_glass"),
    *("csg_coincident", "index_matched", "bright_and_dim", "deep_mirrors", "near_delta"),
    "tiny_light",
)


def scene(name: str) -> Scene:
    return Scene.load(FOLDER / f"{name}.yaml")


def camera_hits(
    of: Scene, x: FloatArray, y: FloatArray
) -> tuple[FloatArray, FloatArray, Intersections]:
    o, d = camera_rays(of, x, y)
    return o, d, of.intersect(o, d)


# ---- the scenes ---------------------------------------------------------------------------------


@pytest.mark.parametrize("name", STIFF)
def test_each_says_what_is_stiff(name: str) -> None:
    text = (FOLDER / f"{name}.yaml").read_text(encoding="utf-8")
    assert text.startswith("# Stiff: ")
    assert "To look for:" in text.split("description:")[0].replace("\n# ", " ")
    assert scene(name).description


def test_the_planets_horizon_is_where_it_must_be() -> None:
    """From h above a sphere of radius R it dips by acos(R / (R + h)) below the horizontal."""
    planet = scene("planet")
    dip = np.arccos(1e6 / (1e6 + 1.0))
    angle = np.linspace(-1.02, -0.98, 41) * dip
    d = np.column_stack([np.full_like(angle, 0.9), np.sin(angle), -np.full_like(angle, 0.3)])
    d[:, [0, 2]] *= (np.cos(angle) / np.hypot(0.9, 0.3))[:, None]
    hits = planet.intersect(np.tile([0.0, 1.0, 0.0], (len(d), 1)), d)
    met = hits.shape == 0
    apart = np.abs(angle + dip) > 1e-12
    assert np.array_equal(met[apart], (angle < -dip)[apart])
    # The nearest ground straight below is 1 away.
    below = planet.intersect([[0.0, 1.0, 0.0]], [[0.0, -1.0, 0.0]])
    assert abs(below.t[0] - 1.0) < 1e-9


@pytest.mark.parametrize("name", ["far_origin", "tiny"])
def test_moved_scenes_show_what_they_show_where_they_are(name: str) -> None:
    there = scene(name)
    here = moved(there, frame_of(there))
    x, y = np.random.default_rng(3).uniform(0.0, [[144.0], [108.0]], (2, 4000))
    _, _, ours = camera_hits(there, x, y)
    _, _, theirs = camera_hits(here, x, y)
    other = (ours.shape != theirs.shape) | (ours.primitive != theirs.primitive)
    # Of rays within 1e-8 of an edge, where float64 has 1e-9 at 1e7: one in thousands.
    assert np.count_nonzero(other) <= 1
    scale = frame_of(there).scale
    assert np.allclose(ours.t[~other] * scale, theirs.t[~other], rtol=1e-7)


def test_the_lamps_light_does_not_leave_the_vase() -> None:
    """Every ray from within meets the vase before anything else, slivers or not."""
    slivers = scene("slivers")
    rng = np.random.default_rng(5)
    aimed = slivers.tables.geometry.shapes.triangles
    assert aimed is not None
    corners = aimed.vertices.reshape(-1, 3)[rng.integers(0, 3 * len(aimed.vertices), 6000)]
    d = np.concatenate([rng.normal(size=(6000, 3)), corners - [0.0, 0.5, 0.0]])
    o = np.tile([0.0, 0.5, 0.0], (len(d), 1)) + 0.06 * d / np.linalg.norm(d, axis=1)[:, None]
    assert (slivers.intersect(o, d).shape == 1).all()


def test_mirrorings_multiply() -> None:
    """Unfolded, the mirrors are planes at odd z: after k of them reflectance^k is left."""
    mirrors = scene("deep_mirrors")
    k = 400
    # So steep that it crosses k planes before it leaves them sideways; then the sky.
    o = np.array([[0.0, 0.9, 0.9]])  # above the frame
    d = np.array([[1.25 / (2.0 * k), 0.0, -1.0]])
    d /= np.linalg.norm(d)
    slope = d[0, 0] / -d[0, 2]
    count = int(np.ceil((1.25 / slope - 1.9) / 2.0))
    tables = build_tables(mirrors)
    deep = Whitted(max_depth=1000, min_contribution=0.0)
    found = query.whitted_radiance(tables, deep.setup(), o, d)[0]
    expected = np.array([0.02, 0.025, 0.04]) * np.array([0.995, 0.98, 0.95]) ** count
    assert np.allclose(found, expected, rtol=1e-11)


def test_cells_look_alike_over_twelve_decades() -> None:
    cells = scene("bright_and_dim")
    o = np.column_stack([np.arange(-6.0, 7.0) + 0.1, np.full(13, -0.3), np.full(13, 5.0)])
    d = np.tile([0.0, 0.0, -1.0], (13, 1))
    found = query.whitted_radiance(build_tables(cells), Whitted().setup(), o, d)
    assert (found > 0.01).all()
    assert np.allclose(found, found[0], rtol=1e-12)


# ---- the frame ----------------------------------------------------------------------------------


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
        query.whitted_radiance(build_tables(s), Whitted().setup(), *rays)
        for s, rays in ((here, (o, d)), (there, (o2, d2)))
    )
    assert ours.max() > 0.2
    # But for a ray or two that pass an edge on different sides.
    assert np.count_nonzero(np.abs(ours - theirs).max(axis=1) > 1e-9) <= 2
    assert np.allclose(d, d2, atol=1e-14)


def test_far_away_agrees_when_moved_and_not_without(monkeypatch: pytest.MonkeyPatch) -> None:
    far = scene("far_origin")
    tables = build_tables(far)
    twin = load(far)
    assert not twin.frame.is_ours
    assert "moved by minus" in twin.notes()[0]
    tier = geometry(far, tables, twin, 300)
    assert tier.status == "agree", tier.reason
    monkeypatch.setattr(comparisons.translate, "frame_of", lambda _: OURS)
    assert geometry(far, tables, load(far), 300).status != "agree"


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


# ---- what Mitsuba resolves ----------------------------------------------------------------------

SLAB = """
integrator: {{type: whitted}}
shapes:
  - {{type: rectangle, transform: [{{scale: 2}}]}}
  - {{type: rectangle, transform: [{{scale: [1, 2, 1]}}, {{translate: [-1, 0, {gap}]}}]}}
"""


def _resolved(text: str) -> Resolution:
    found = Scene.parse(text)
    return resolution(found, build_tables(found), load(found))


def test_narrow_gaps_are_foretold_and_found() -> None:
    """Of a floor half under a slab, the part below is left for what lies above the slab."""
    narrow = _resolved(SLAB.format(gap=1e-5))
    assert narrow.is_limited
    assert narrow.missed <= 0.01 * narrow.found
    assert narrow.found <= 1.05 * narrow.foretold
    wide = _resolved(SLAB.format(gap=0.1))
    assert not wide.is_limited
    assert wide.foretold <= 0.01 * wide.hits


@pytest.mark.parametrize("name", ["grazing", "nested_glass"])
def test_what_is_foretold_is_what_is_found(name: str) -> None:
    of = scene(name)
    found = resolution(of, build_tables(of), load(of))
    assert found.is_limited
    assert found.missed <= 0.02 * found.found
    assert 0.5 * found.foretold <= found.found <= 1.02 * found.foretold


def test_pictures_that_differ_beyond_a_limit_are_limited_by_the_reference() -> None:
    resolved = Resolution(1000, 50, 48, 0, 1e-3, 1e-6)
    below = Tier("geometry", "agree", "", {"resolution": resolved._asdict(), "rays": 1000})
    above = Tier("images", "differ", "other")
    statuses = [tier.status for tier in limited([above, below])]
    assert statuses == ["agree", "reference-limited"]
    assert "50 are foretold" in limited([below, above])[1].reason


@pytest.mark.parametrize(
    "resolved",
    [
        Resolution(1000, 12, 48, 36, 1e-3, 1e-6),  # found, but not foretold: that is a fault
        Resolution(1000, 50, 2, 0, 1e-3, 1e-6),  # foretold, but Mitsuba can
    ],
)
def test_without_a_limit_they_differ(resolved: Resolution) -> None:
    below = Tier("geometry", "agree", "", {"resolution": resolved._asdict(), "rays": 1000})
    above = Tier("images", "differ", "other")
    assert limited([below, above])[1].status == "differ"
    broken = replace(below, status="differ")
    assert limited([broken, above])[1].status == "differ"
    assert limited([above])[0].status == "differ"


def test_what_a_rung_cannot_resolve_limits_the_picture_above() -> None:
    numbers = {"pixels": 400, "explained": 40}
    below = Tier("whitted", "reference-limited", "40 of 400", numbers)
    above = Tier("images", "differ", "other")
    assert limited([below, above])[1].status == "reference-limited"
    few = replace(below, status="agree", numbers=numbers | {"explained": 1})
    assert limited([few, above])[1].status == "differ"
