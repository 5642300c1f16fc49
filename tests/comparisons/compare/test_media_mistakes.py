"""Mistakes with media are named, and a right picture has none."""

from functools import cache

import numpy as np
import pytest

from comparisons.compare import diagnosis
from comparisons.compare.judge import of_replicates
from comparisons.compare.media_mistakes import CHANGES, mistaken
from comparisons.compare.path_length import path_lengths
from comparisons.results.case import Images
from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene

SCENE = Scene.parse("""
camera: {type: perspective, eye: [0, 0, 4], target: [0, 0, 0], fov: 36, medium: haze}
film: {width: 24, height: 18}
sampler: {type: sobol, spp: 64}
integrator: {type: path, max_depth: 12}
materials:
  none: {type: none}
  floor: {type: diffuse, reflectance: [0.5, 0.4, 0.3]}
media:
  haze: {type: homogeneous, sigma_t: [0.02, 0.03, 0.06], albedo: 0.8}
  smoke: {type: homogeneous, sigma_t: [0.4, 0.8, 1.6], albedo: [0.9, 0.7, 0.3], scale: 1.6,
    phase: {type: hg, g: 0.7}}
shapes:
  - {type: sphere, material: none, interior: smoke, exterior: haze}
  - {type: sphere, material: none, interior: haze, radius: 6}
  - {type: rectangle, material: floor, transform: [{scale: 4}, {translate: [0, 0, -1.5]}]}
lights:
  - {type: directional, direction: [0.2, -0.3, 1], irradiance: [2, 2, 2]}
  - {type: directional, direction: [1, -1, -1], irradiance: [1.5, 1.5, 1.5]}
""")

MISTAKES = {name: scene for name, _, scene in mistaken(SCENE)}


DARK = (
    "light does not leave the media that it has entered",
    "the media inside and outside of surfaces change places",
)
"""Here haze without end takes all light of the suns: of a black picture the rung `input` speaks."""


def pictures(scene: Scene, first: int) -> FloatArray:
    return np.stack([render(scene, spp=128, seed=first + k).colour for k in range(8)])


@cache
def right() -> FloatArray:
    return pictures(SCENE, 100)


def images(scene: Scene) -> Images:
    return of_replicates(pictures(scene, 500), right(), {}).images


def test_each_mistake_is_tried():
    others = {*MISTAKES} - {*CHANGES}
    assert {*CHANGES} <= {*MISTAKES}
    assert others == {
        "light does not leave the media that it has entered",
        "the media inside and outside of surfaces change places",
        "the camera is not in its medium",
    }


@pytest.mark.cases(2)
@pytest.mark.parametrize("mistake", [name for name in MISTAKES if name not in DARK])
def test_a_mistake_is_named(mistake: str):
    found = diagnosis.likeliest(images(MISTAKES[mistake]), {}, path_lengths(SCENE))
    assert found is not None
    assert found.name == mistake


@pytest.mark.parametrize("mistake", DARK)
def test_without_an_end_haze_takes_all(mistake: str):
    seen = render(MISTAKES[mistake], spp=16).colour
    assert seen.mean() < 0.05 * right().mean()


def test_a_right_picture_has_none():
    assert diagnosis.likeliest(images(SCENE), {}, path_lengths(SCENE)) is None
