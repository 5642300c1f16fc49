"""Mistakes of a stranger's path tracer are named, and a right one has none."""

from functools import cache

import numpy as np
import pytest
from small_path_tracer import DIRECT, GLASS, SCENE, WHITTED, picture

from comparisons.compare import diagnosis, mistaken_paths
from comparisons.compare.judge import of_replicates
from comparisons.compare.path_length import path_lengths
from comparisons.results.case import Images
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene

NAMES = {
    "no shadows": "without shadows of lights without extent",
    "uniform": mistaken_paths.UNIFORM,
    "no pi": "direct light of lights without extent is not divided by pi",
    "no cosine": "direct light of lights without extent lacks the cosine",
    "1 / d": "light of points falls with the distance, not with its square",
    "twice": "light is counted twice: by samples of lights, and where paths meet them",
    "one bounce less": "paths are one edge too short",
    "no shadows of any light": "without shadows",
    "no shadows at the first surface": "without shadows at the first surface",
    "no shadows at later surfaces": "without shadows at later surfaces",
    "no pi for any light": "direct light is not divided by pi",
    "cosine twice": mistaken_paths.TWICE,
    "0.8 a bounce": "each bounce is multiplied by 0.8",
    "roulette": "Russian roulette from bounce 2 on does not compensate for the paths that it ends",
    "glass mirrors nothing": "dielectrics mirror nothing, without Fresnel's formulas",
    "glass mirrors half": "dielectrics mirror half of the light, without Fresnel's formulas",
}


def test_each_mistake_is_tried() -> None:
    assert {*mistaken_paths.CHANGES, mistaken_paths.UNIFORM} <= {*NAMES.values()}
    kinds = {name.split(" by ")[0].split(" from ")[0] for name in mistaken_paths.BOUNCES}
    assert kinds <= {name.split(" by ")[0].split(" from ")[0] for name in NAMES.values()}


@cache
def right(text: str) -> np.ndarray:
    scene = Scene.parse(text)
    return np.stack([render(scene, spp=128, seed=100 + seed).colour for seed in range(8)])


def images(mistake: str, text: str = SCENE) -> Images:
    wrong = np.stack([picture(32, seed, mistake, text) for seed in range(8)])
    return of_replicates(wrong, right(text), {}).images


@pytest.mark.cases(1)
@pytest.mark.parametrize("mistake", NAMES)
def test_a_mistake_is_named(mistake: str) -> None:
    text = GLASS if mistake.startswith("glass") else SCENE
    found = diagnosis.likeliest(images(mistake, text), {}, path_lengths(Scene.parse(text)))
    assert found is not None
    assert found.name == NAMES[mistake]


SIMPLER = [
    (text, mistake)
    for text, of_glass in ((WHITTED, ("glass mirrors half", "glass mirrors nothing")), (DIRECT, ()))
    for mistake in ("cosine twice", "no cosine", "1 / d", "no pi", "no shadows", *of_glass)
]


@pytest.mark.cases(1)
@pytest.mark.parametrize(("text", "mistake"), SIMPLER, ids=[mistake for _, mistake in SIMPLER])
def test_a_mistake_of_simpler_integrators_is_named(text: str, mistake: str) -> None:
    found = diagnosis.likeliest(images(mistake, text), {}, path_lengths(Scene.parse(text)))
    assert found is not None
    expected = NAMES[mistake]
    of_all = expected.replace(" of lights without extent", "")
    if text is WHITTED and of_all in mistaken_paths.CHANGES:  # it has no other lights
        expected = of_all
    assert found.name == expected


@pytest.mark.slow
@pytest.mark.parametrize(
    ("sky", "text"),
    [("", SCENE), ("samples of the sky", SCENE), ("", GLASS), ("", DIRECT), ("", WHITTED)],
)
def test_a_right_path_tracer_has_none(sky: str, text: str) -> None:
    assert diagnosis.likeliest(images(sky, text), {}, path_lengths(Scene.parse(text))) is None


def test_the_parts_are_those_of_our_picture() -> None:
    """Both sums of parts: all light but what is seen, which no mistake changes."""
    scene = Scene.parse(SCENE)
    parts = mistaken_paths._traced(scene, 4, False, None)
    seen = render(scene.changed(integrator={"type": "path", "max_depth": 1}), spp=256).colour
    means = right(SCENE).mean(axis=(0, 1, 2))
    for light in (
        [p.points + p.met for p in parts],
        [p.points + p.lamps for p in parts],
    ):
        batches = (np.stack(light) + seen).mean(axis=(1, 2))
        error = batches.std(axis=0, ddof=1) / np.sqrt(len(batches))
        # Eight batches: 6 standard errors of Student's law with 7 degrees of freedom, 5e-4.
        assert np.all(np.abs(batches.mean(axis=0) - means) < 6.0 * error + 1e-3 * means)
