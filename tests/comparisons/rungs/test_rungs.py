"""The deterministic rungs: they agree where the scenes are the same, and see each planted fault."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from counterparts import faulty_counterpart

from comparisons.referee.sizes import ShapeSizes
from comparisons.results.case import RungResult
from comparisons.rungs import direct, whitted
from comparisons.rungs import geometry as geometry_of_many
from comparisons.rungs.rays import arbiter
from comparisons.rungs.rays.camera import pixel_centres
from comparisons.translator import load
from reference_rt.cameras.film import Film
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.rendering import query
from reference_rt.rendering.scene import Scene
from reference_rt.scene.build import build_tables

SCENE = """
camera: {type: perspective, eye: [0.3, 1.2, 5], target: [0, 0.5, 0], fov: 40}
film: {width: 64, height: 48}
integrator: {type: whitted, max_depth: 6}
materials:
  floor: {type: diffuse, reflectance: [0.8, 0.7, 0.6]}
  red: {type: diffuse, reflectance: [0.7, 0.2, 0.1]}
  mirror: {type: mirror, reflectance: [0.9, 0.8, 0.7]}
  glass: {type: dielectric, interior_ior: 1.5, exterior_ior: 1.1}
  lamp: {type: emissive, radiance: [9, 8, 7], base: floor}
  glow: {type: emissive, radiance: [2, 3, 4]}
shapes:
  - {type: rectangle, material: floor,
     transform: [{scale: 6}, {rotate: {axis: [1, 0, 0], degrees: -90}}]}
  - {type: sphere, material: glass, center: [0.9, 0.7, 1.2], radius: 0.6}
  - {type: sphere, material: mirror, center: [-1.1, 0.8, 0], radius: 0.8}
  - {type: sphere, material: glow, center: [0.2, 0.4, -1.5], radius: 0.35}
  - {type: rectangle, material: lamp,
     transform: [{scale: [0.4, 0.3, 1]}, {rotate: {axis: [1, 0, 0], degrees: 80}},
       {translate: [0.1, 3, 0]}]}
  - {type: triangle, material: glow, v0: [-2, 2, -1], v1: [-2, 2.5, 0], v2: [-1.5, 2.5, -1]}
  - {type: box, material: red,
     transform: [{scale: 0.3}, {rotate: {axis: [0.3, 1, 0.2], degrees: 30}},
       {translate: [-0.2, 0.5, 1.5]}]}
lights:
  - {type: point, position: [2, 3, 3], intensity: [10, 11, 12]}
  - {type: point, position: [-3, 2, 2], intensity: 4}
  - {type: constant, radiance: [0.1, 0.2, 0.3]}
"""

Rung = Callable[[Scene, SceneTables, Any], RungResult]


def geometry(scene: Scene, tables: SceneTables, counterpart: Any) -> RungResult:
    """The rung with a tenth of its rays."""
    return geometry_of_many(scene, tables, counterpart, pixels=1_700)


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene.parse(SCENE)


@pytest.mark.cases(1)
@pytest.mark.parametrize("rung", [geometry, direct, whitted])
def test_the_same_scene_agrees(
    rung: Rung, scene: Scene, tables: SceneTables, counterpart: Any
) -> None:
    result = rung(scene, tables, counterpart)
    assert result.status == "agree", result.reason
    assert result.name == rung.__name__
    # Far from the bound: it is not there to hide anything.
    bounds = {k: v for k, v in result.numbers.items() if k.endswith("over_bound")}
    assert bounds
    assert all(0.0 <= ratio < 1.0 for ratio in bounds.values()), bounds


FAULTS: tuple[tuple[Rung, str, str], ...] = (
    # a shape moved by a thousandth
    (geometry, "center: [0.9, 0.7, 1.2]", "center: [0.901, 0.7, 1.2]"),
    (geometry, "translate: [-0.2, 0.5, 1.5]", "translate: [-0.2, 0.501, 1.5]"),
    (geometry, "radius: 0.6}", "radius: 0.60005}"),
    # a normal turned over
    (geometry, "[{scale: 6}, ", "[{scale: [6, 6, -6]}, "),
    (geometry, "fov: 40", "fov: 40.01"),
    # lights and colours wrong by one per cent
    (direct, "intensity: [10, 11, 12]", "intensity: [10, 11.11, 12]"),
    (direct, "radiance: [9, 8, 7]", "radiance: [9.09, 8, 7]"),
    (direct, "radiance: [0.1, 0.2, 0.3]", "radiance: [0.1, 0.202, 0.3]"),
    (direct, "reflectance: [0.7, 0.2, 0.1]", "reflectance: [0.7, 0.2, 0.101]"),
    (direct, "{scale: [0.4, 0.3, 1]}", "{scale: [0.4, 0.3, -1]}"),
    # something stands in the light
    (direct, "shapes:\n", "shapes:\n  - {type: sphere, center: [1.4, 2.2, 2.5], radius: 0.1}\n"),
    # mirrors and glass
    (whitted, "interior_ior: 1.5,", "interior_ior: 1.505,"),
    (whitted, "interior_ior: 1.5, exterior_ior: 1.1", "interior_ior: 1.1, exterior_ior: 1.5"),
    (whitted, "reflectance: [0.9, 0.8, 0.7]", "reflectance: [0.909, 0.8, 0.7]"),
    (whitted, "material: mirror, center", "material: glass, center"),
)  # fmt: skip
MORE_FAULTS: tuple[tuple[Rung, str, str], ...] = (
    (geometry, "v1: [-2, 2.5, 0]", "v1: [-2, 2.501, 0]"),
    (geometry, "v1: [-2, 2.5, 0], v2: [-1.5, 2.5, -1]", "v2: [-2, 2.5, 0], v1: [-1.5, 2.5, -1]"),
    (direct, "intensity: 4", "intensity: 4.04"),
    (direct, "radiance: [2, 3, 4]", "radiance: [2, 3, 4.04]"),
    (direct, "position: [2, 3, 3]", "position: [2.001, 3, 3]"),
    (whitted, "radiance: [0.1, 0.2, 0.3]", "radiance: [0.1, 0.202, 0.3]"),
    (whitted, "radiance: [9, 8, 7]", "radiance: [9.09, 8, 7]"),
)  # fmt: skip


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("rung", "right", "wrong"),
    [*FAULTS, *(pytest.param(*fault, marks=pytest.mark.slow) for fault in MORE_FAULTS)],
)
def test_a_planted_fault_is_seen(
    rung: Rung, right: str, wrong: str, scene: Scene, tables: SceneTables
) -> None:
    result = rung(scene, tables, faulty_counterpart(SCENE, right, wrong))
    assert result.status == "differ"
    assert result.reason


@pytest.mark.slow
def test_a_faint_scene_is_held_to_the_same_relative_bound(scene: Scene) -> None:
    text = SCENE
    for bright, faint in (
        ("intensity: [10, 11, 12]", "intensity: [1.0e-9, 1.1e-9, 1.2e-9]"),
        ("intensity: 4", "intensity: 4.0e-10"),
        ("radiance: [9, 8, 7]", "radiance: [9.0e-10, 8.0e-10, 7.0e-10]"),
        ("radiance: [2, 3, 4]", "radiance: [2.0e-10, 3.0e-10, 4.0e-10]"),
        ("radiance: [0.1, 0.2, 0.3]", "radiance: [1.0e-11, 2.0e-11, 3.0e-11]"),
    ):
        text = text.replace(bright, faint)
    dim = Scene.parse(text)
    wrong = load(Scene.parse(text.replace("interior_ior: 1.5,", "interior_ior: 1.505,")))
    assert whitted(dim, build_tables(dim), load(dim)).status == "agree"
    assert whitted(dim, build_tables(dim), wrong).status == "differ"


def test_rungs_that_a_scene_does_not_have(scene: Scene) -> None:
    dark = scene.changed(
        lights=(), shapes=tuple(s for s in scene.shapes if s.material not in ("lamp", "glow"))
    )
    mi_dark = load(dark)
    for rung in (direct, whitted):
        result = rung(dark, build_tables(dark), mi_dark)
        assert (result.status, result.reason) == ("not-applicable", "the scene has no light")


@pytest.mark.slow
def test_coincident_surfaces_are_explained() -> None:
    text = """
camera: {type: perspective, eye: [1, 2, -6]}
film: {width: 24, height: 24}
shapes:
  - {type: rectangle, transform: [{scale: 2}]}
  - type: box
    transform: [{rotate: {axis: [0, 0, 1], degrees: 17}}, {translate: [0.1, 0.2, 1]}]
  # Aside: with them there are the same kinds of shapes as above, which share kernels.
  - {type: sphere, center: [9, 9, 9], radius: 0.5}
  - {type: triangle, v0: [9, -9, 9], v1: [8, -9, 9], v2: [9, -8, 9]}
"""
    scene = Scene.parse(text)
    result = geometry(scene, build_tables(scene), load(scene))
    assert (result.numbers["decided_ours"], result.numbers["undecided"]) == (0, 0), result.reason
    assert result.status in ("agree", "reference-limited")
    gap = load(Scene.parse(text.replace("0.2, 1]", "0.2, 0.999]")))
    assert geometry(scene, build_tables(scene), gap).status == "differ"


def test_the_arbiter_explains_an_edge_and_nothing_else() -> None:
    """Ours says "in" below x = 0; Mitsuba said so for rays at x, and may err by 1."""
    x = np.array([0.5, -3.0, 1.5, 0.93])

    def like_theirs(rays: np.ndarray[Any, Any], offsets: np.ndarray[Any, Any]) -> Any:
        return x[rays] + offsets[:, 0] < 0.0

    settled = arbiter.explained(np.arange(4), np.ones(4), like_theirs)
    assert settled.tolist() == [True, True, False, True]


def test_moved_rays_leave_no_side_out() -> None:
    """The highest empty cap, found by trying: what NEIGHBOURS promises."""
    moves = arbiter.directions(arbiter.NEIGHBOURS)
    sides = arbiter.directions(20_000)
    np.testing.assert_allclose(np.linalg.norm(moves, axis=1), 1.0, rtol=1e-14)
    assert (sides @ moves.T).max(axis=1).min() > 11 / 12


@pytest.mark.parametrize("size", [(1, 1), (640, 480), (3, 5000), (129, 128)])
def test_pixel_centres_are_centres_and_not_too_many(size: tuple[int, int]) -> None:
    x, y = pixel_centres(Film(width=size[0], height=size[1]), 16_384)
    assert 0 < len(x) <= 16_384
    assert np.all(x % 1.0 == 0.5)
    assert np.all(y % 1.0 == 0.5)
    assert x.max() < size[0]
    assert y.max() < size[1]


def test_sizes_of_shapes(scene: Scene, tables: SceneTables) -> None:
    sizes = ShapeSizes(scene)
    assert sizes.reach[0] == pytest.approx(6.0)
    rng = np.random.default_rng(1)
    o = rng.uniform(-4.0, 4.0, (4000, 3))
    hits = query.intersect(tables, o, rng.uniform(-2.0, 2.0, (4000, 3)) - o)
    feature = sizes.feature_of(hits)
    for shape, expected in ((0, 12.0), (1, 0.6), (6, 0.6), (-1, np.inf)):
        assert (hits.shape == shape).any()
        np.testing.assert_allclose(feature[hits.shape == shape], expected, rtol=1e-12)
