"""Mitsuba against itself, pictures of single lights, and what a case tells of a difference."""

import numpy as np
import pytest

from comparisons.compare.budget import Budget
from comparisons.compare.compare import Subject, budgeted, compare_scene
from comparisons.compare.single_lights import single_lights
from reference_rt.integrators import Direct, RayCast
from reference_rt.integrators import Path as PathTracing
from reference_rt.lights import Point
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import Grid, Sobol

TWO_LIGHTS = """
camera: {type: perspective, eye: [0, 2, 5], target: [0, 0.4, 0], fov: 40}
film: {width: 32, height: 24, filter: {type: tent}}
sampler: {type: sobol, spp: 256}
integrator: {type: path, max_depth: 3}
materials:
  floor: {type: diffuse, reflectance: 0.5}
  lamp: {type: emissive, radiance: [9, 6, 3]}
shapes:
  - {type: sphere, center: [0, 0.5, 0], radius: 0.5, material: floor}
  - type: rectangle
    material: floor
    transform: [{scale: 3}, {rotate: {axis: [1, 0, 0], degrees: -90}}]
  - {type: sphere, center: [-1.5, 2, 1], radius: 0.3, material: lamp}
lights:
  - {type: point, position: [2, 3, 2], intensity: [4, 5, 6]}
"""


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene.parse(TWO_LIGHTS)


def silent(step: str) -> None:
    pass


@pytest.mark.slow
def test_mitsuba_agrees_with_itself(scene: Scene) -> None:
    budget = Budget(control=True, spp=512, replicates=8, limit=0.05)
    case = compare_scene(Subject(scene), budget, silent)
    assert case.verdict == "agree", case.reason
    assert case.scene.endswith("(control)")
    assert case.sides[0] != case.sides[1]
    assert [rung.name for rung in case.rungs] == ["input", "statistics", "images"]


@pytest.mark.parametrize("show", ["normal", "id"])
def test_mitsuba_agrees_with_itself_without_noise(scene: Scene, show: str) -> None:
    cast = scene.changed(integrator=RayCast(show=show), sampler=None)
    case = compare_scene(Subject(cast), Budget(control=True), silent)
    assert case.verdict == "agree", case.reason


def test_pictures_of_single_lights_sum_to_the_scene(scene: Scene) -> None:
    alone = single_lights(scene, 256)
    assert sorted(alone) == ["lights[0] (point)", "the material 'lamp'"]
    whole = render(scene).colour
    total = np.sum(list(alone.values()), axis=0)
    # Light is additive. 768 pixels of 256 stratified samples: their mean is known to 0.2 %.
    assert total.mean() == pytest.approx(whole.mean(), rel=0.01)


def test_one_light_alone_needs_no_pictures(scene: Scene) -> None:
    assert single_lights(scene.changed(lights=()), 4) == {}


def test_a_lost_light_is_reported_with_its_place(scene: Scene) -> None:
    budget = Budget(spp=64, replicates=8, pixels=100, light_pixels=64)
    lost = Subject(scene.changed(lights=()), scene)
    case = compare_scene(lost, budget, silent, rungs=("statistics", "images"))
    assert case.verdict == "differ"
    assert case.cause is not None
    assert "lights[0]" in case.cause.name + case.cause.evidence
    assert case.worst
    assert case.left_out


def test_only_the_rungs_asked_for(scene: Scene) -> None:
    case = compare_scene(Subject(scene), Budget(pixels=100), silent, rungs=("geometry",))
    assert [rung.name for rung in case.rungs] == ["geometry"]
    assert case.images is None


def test_a_budget_changes_size_samples_and_filter(scene: Scene) -> None:
    other = budgeted(scene, Budget(size=(16, 12), spp=4))
    assert (other.film.width, other.film.height, other.resolved_sampler.spp) == (16, 12, 4)
    assert other.film.filter.type == "box"
    samples = [budgeted(other, Budget(parts=n)).resolved_sampler.spp for n in (1, 2)]
    assert samples == [4, 4]  # not fewer than LEAST
    many = scene.changed(sampler=Sobol(spp=64))
    assert budgeted(many, Budget(parts=4, size=(512, 512))).sampler == Sobol(spp=16)
    assert budgeted(many, Budget(parts=4, size=(128, 128))).sampler == Sobol(spp=16)
    assert budgeted(many, Budget(parts=4, size=(128, 80))).sampler == Sobol(spp=25)
    assert budgeted(many, Budget(parts=4, size=(16, 16))).sampler == Sobol(spp=32)  # a small one
    assert budgeted(many, Budget(size=(16, 16))).sampler == Sobol(spp=64)
    assert budgeted(many, Budget(parts=4, spp=8)).sampler == Sobol(spp=8)
    lamp = Point(position=(0.0, 3.0, 0.0), intensity=(1.0, 1.0, 1.0))
    dark = {"materials": {}, "shapes": (), "lights": (lamp,)}
    fixed = scene.changed(integrator=Direct(), sampler=Grid(), **dark)
    assert budgeted(fixed, Budget(spp=4)).sampler == Sobol(spp=4)
    cast = scene.changed(integrator=RayCast(), sampler=None)
    assert budgeted(cast, Budget(spp=4)).resolved_sampler.spp == cast.resolved_sampler.spp
    assert isinstance(other.integrator, PathTracing)
