"""What is left of pictures beyond Mitsuba's precision: a fault elsewhere, or a larger, shows."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from comparisons.compare import pictures
from comparisons.compare.budget import Budget
from comparisons.compare.compare import Subject, compare_scene
from comparisons.compare.judge import Rendered, of_replicates
from comparisons.compare.precision import pixels_beyond, rest_of
from comparisons.mitsuba.counterpart import Counterpart
from comparisons.results.case import FloatArray, Images
from comparisons.rungs.limited import Rest
from comparisons.translator import load
from reference_rt.materials import Diffuse
from reference_rt.rendering.scene import Scene

PANE = """
camera: {{type: perspective, eye: [0.3, -1, 4], target: [0, 0, 0], up: [0, 1, 0], fov: 40}}
film: {{width: 32, height: 24}}
sampler: {sampler}
integrator: {integrator}
materials:
  floor: {{type: diffuse, reflectance: [0.6, 0.4, 0.3]}}
  pane: {{type: thin_dielectric}}
shapes:
  - {{type: rectangle, material: floor, transform: [{{scale: 3}}]}}
  - {{type: rectangle, material: pane,
     transform: [{{scale: [{half}, 4, 1]}}, {{translate: [{left}, 0, {gap}]}}]}}
  - {{type: sphere, material: floor, center: [0.6, 0.2, 0.4], radius: 0.4}}
lights:
  - {{type: point, position: [1, 1, 3], intensity: 10}}
  - {{type: constant, radiance: 0.2}}
"""
"""A pane of glass on a floor, nearer than rays start off it: in Mitsuba light reaches the floor
below, as shadow rays begin above the pane."""

TREES = ("{type: whitted}", "{type: grid, spp: 4}", 1e-7)
PATHS = ("{type: path, max_depth: 4}", "{type: sobol, spp: 16}", 2e-5)


def pane(kind: tuple[str, str, float], half: float = 1.5, left: float = -2.0) -> Scene:
    integrator, sampler, gap = kind
    return Scene.parse(PANE.format(**locals()))


class Case:
    """A scene, and the pictures of both sides."""

    def __init__(self, scene: Scene) -> None:
        self.scene, self.counterpart = scene, load(scene)
        self.right = _rendered(scene, self.counterpart)

    def rest(self, change: Callable[[FloatArray], FloatArray], share: float = 0.0) -> Rest:
        """What is left if our pictures (replicates, height, width, 3) are changed."""
        if self.right.replicates is None:
            ours = change(self.right.images.candidate[np.newaxis])[0]
            rendered = replace(self.right, images=Images(ours, self.right.images.reference))
        else:
            ours, theirs = self.right.replicates
            rendered = of_replicates(change(ours), theirs, {})
        return rest_of(self.scene, self.scene.tables, self.counterpart, 0.02, rendered, share)


def _rendered(scene: Scene, counterpart: Counterpart) -> Rendered:
    if scene.integrator.deterministic:
        return pictures.whitted(scene, scene.tables, counterpart)
    both = pictures.Replicates(scene, scene.tables, counterpart, Budget(), 1, 8, print)
    both.grow(8)
    return both.rendered()


@pytest.fixture(scope="module")
def trees() -> Case:
    return Case(pane(TREES))


@pytest.fixture(scope="module")
def paths() -> Case:
    return Case(pane(PATHS))


def _right_half(factor: float) -> Callable[[FloatArray], FloatArray]:
    """Beside the pane."""

    def change(p: FloatArray) -> FloatArray:
        p = p.copy()
        p[:, :, 20:] *= factor
        return p

    return change


FAULTS: dict[str, Callable[[FloatArray], FloatArray]] = {
    "brighter": lambda p: 1.5 * p,
    "darker beside the pane": _right_half(0.6),
    "mirrored": lambda p: p[:, :, ::-1],
    "upside down": lambda p: p[:, ::-1],
    "channels exchanged": lambda p: p[..., ::-1],
    "moved": lambda p: np.roll(p, 3, axis=2),
    "black": np.zeros_like,
}


def _as_it_is(p: FloatArray) -> FloatArray:
    return p


def test_pictures_of_trees_agree_but_for_what_is_beyond_precision(trees: Case) -> None:
    images = trees.right.images
    off = np.abs(images.candidate - images.reference).max(axis=2)
    assert (off > 0.1 * images.reference.mean()).mean() > 0.2
    found = trees.rest(_as_it_is)
    assert found == Rest("agree", "of 200 pixels that differ, precision does not explain 0")


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_of_a_picture_of_trees_is_not_explained(trees: Case, name: str) -> None:
    found = trees.rest(FAULTS[name])
    assert found.status == "differ", found.reason


def test_noisy_pictures_agree_but_for_what_is_beyond_precision(paths: Case) -> None:
    means = [side.mean() for side in paths.right.replicates or ()]
    assert means[0] < 0.9 * means[1]
    found = paths.rest(_as_it_is, 0.05)
    assert found.status == "agree", found.reason


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_of_noisy_pictures_is_not_explained(paths: Case, name: str) -> None:
    found = paths.rest(FAULTS[name], 0.05)
    assert found.status == "differ", found.reason


def test_light_that_is_scattered_may_differ_as_often_as_rays_go_wrong(paths: Case) -> None:
    """By twice the share: 0.3 with a share of 0.2, not with one of 0.1."""
    assert paths.rest(_right_half(1.3), 0.2).status == "agree"
    assert paths.rest(_right_half(1.3), 0.1).status == "differ"


EDGE_ON = """
camera: {type: perspective, eye: [0, 0, 4], target: [0, 0, 0], up: [0, 1, 0], fov: 20}
film: {width: 15, height: 11}
integrator: {type: direct}
materials: {glass: {type: principled, spec_trans: 0.9}}
shapes:
  - {type: box, material: glass,
     transform: [{scale: [1, 0.4, 2e-5]}, {rotate: {axis: [0, 1, 0], degrees: 89.7}}]}
lights: [{type: constant, radiance: 1}]
"""
"""A sheet of glass thinner than Mitsuba's ray epsilon, a tenth of a pixel wide in the middle."""


def test_a_sheet_seen_edge_on_is_found() -> None:
    scene = Scene.parse(EDGE_ON)
    found = pixels_beyond(scene, scene.tables, load(scene))
    assert found[2:9, 7].all()
    assert not np.delete(found, 7, axis=1).any()


@pytest.mark.parametrize("kind", [TREES, PATHS])
def test_a_fault_of_our_light_is_not_explained(kind: tuple[str, str, float]) -> None:
    """A darker ball: each of our pixels is the mean of our trees, which Mitsuba's are not."""
    right = pane(kind)
    darker = Diffuse(reflectance=(0.3, 0.2, 0.15))
    ball = right.shapes[2].model_copy(update={"material": "ball"})
    shapes = (*right.shapes[:2], ball)
    wrong = right.changed(shapes=shapes, materials={**right.materials, "ball": darker})
    counterpart = load(right)
    rendered = _rendered(wrong, counterpart)
    found = rest_of(wrong, wrong.tables, counterpart, 0.02, rendered, 0.02)
    assert found.status == "differ", found.reason


@pytest.mark.parametrize("kind", [TREES, PATHS])
def test_pictures_of_which_too_little_is_left_are_open(kind: tuple[str, str, float]) -> None:
    """The pane covers the floor."""
    found = Case(pane(kind, half=9.0, left=0.0)).rest(_as_it_is, 0.05)
    assert found.status == "inconclusive", found.reason
    assert "too few are left" in found.reason


@pytest.mark.parametrize("kind", [TREES, PATHS])
def test_the_verdict_of_a_right_renderer_is_limited(kind: tuple[str, str, float]) -> None:
    budget = Budget(spp=16, replicates=8, pixels=300, light_pixels=100, limit=0.02)
    case = compare_scene(Subject(pane(kind)), budget, lambda line: None, 1)
    assert case.verdict == "reference-limited", case.reason
    statuses = {rung.name: rung.status for rung in case.rungs}
    assert statuses["images"] == "reference-limited"
