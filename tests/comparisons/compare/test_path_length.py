"""Paths of a wrong length are recognised, and nothing else is taken for them."""

from pathlib import Path

import numpy as np
import pytest

from comparisons.compare import diagnosis
from comparisons.compare.judge import of_replicates
from comparisons.compare.path_length import USUAL, path_lengths
from comparisons.gate.pictures_in import Picture
from comparisons.gate.request import Request, gated
from comparisons.results.case import FloatArray, Images
from reference_rt.integrators import Light, RayCast, Whitted
from reference_rt.lights import Point
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene

SCENES = Path(__file__).parents[3] / "scenes"
SIDE, OWN = 48, 6


@pytest.fixture(scope="module")
def scene() -> Scene:
    box = Scene.load(SCENES / "cornell_box.yaml")
    return at_length(
        box.changed(film=box.film.model_copy(update={"width": SIDE, "height": SIDE})), OWN
    )


@pytest.fixture(scope="module")
def reference(scene: Scene) -> FloatArray:
    return replicates(scene, 1000, 8, 512)


def at_length(scene: Scene, length: int | None) -> Scene:
    return scene.changed(integrator=scene.integrator.model_copy(update={"max_depth": length}))


def replicates(scene: Scene, seed: int, count: int = 8, spp: int = 256) -> FloatArray:
    sampler = scene.resolved_sampler.model_copy(update={"spp": spp})
    return np.stack(
        [
            render(scene.changed(sampler=sampler.model_copy(update={"seed": seed + k}))).colour
            for k in range(count)
        ]
    )


def images(candidate: FloatArray, reference: FloatArray) -> Images:
    return of_replicates(candidate, reference, {}).images


@pytest.mark.slow
@pytest.mark.parametrize(
    ("length", "name"),
    [
        (OWN - 1, "paths are one edge too short"),
        (OWN + 1, "paths are one edge too long"),
        (2, "direct light alone"),
        (None, "paths have no limit"),
    ],
)
def test_a_wrong_length_is_named(
    scene: Scene, reference: FloatArray, length: int | None, name: str
) -> None:
    lengths = path_lengths(scene)
    assert lengths is not None
    found = images(replicates(at_length(scene, length), 1), reference)
    cause = diagnosis.likeliest(found, {}, lengths)
    assert cause is not None
    assert cause.name == name
    assert cause.explained > 0.9
    other = "without a limit" if length is None else f"with max_depth {length};"
    assert f"rendered {other}" in cause.evidence


@pytest.mark.slow
@pytest.mark.parametrize("length", USUAL[:4])
def test_a_limit_where_there_is_none(scene: Scene, length: int) -> None:
    endless = at_length(scene, None)
    found = images(replicates(at_length(scene, length), 1), replicates(endless, 1000))
    cause = diagnosis.likeliest(found, {}, path_lengths(endless) or (lambda reference: iter(())))
    assert cause is not None
    expected = "direct light alone" if length == 2 else f"paths end at edge {length}"
    assert cause.name == expected


@pytest.mark.slow
@pytest.mark.parametrize("fault", ["gain", "red", "shift", "none"])
def test_other_causes_are_not_taken_for_it(scene: Scene, reference: FloatArray, fault: str) -> None:
    candidate = replicates(scene, 1)
    if fault == "gain":
        candidate *= 1.02
    elif fault == "red":
        candidate[..., 0] *= 0.98
    elif fault == "shift":
        candidate = np.roll(candidate, 1, axis=2)
    cause = diagnosis.likeliest(
        images(candidate, reference), {}, path_lengths(scene) or (lambda reference: iter(()))
    )
    name = "" if cause is None else cause.name
    assert {"gain": "constant gain", "red": "gain of red", "shift": "shift", "none": ""}[
        fault
    ] in name
    assert "path" not in name
    assert (cause is None) == (fault == "none")


@pytest.mark.parametrize("integrator", [Light(), RayCast()])
def test_other_integrators_have_no_such_lengths(scene: Scene, integrator: object) -> None:
    assert path_lengths(scene.changed(integrator=integrator, sampler=None)) is None


def test_ray_trees_have_mistakes_but_no_lengths(scene: Scene, reference: FloatArray) -> None:
    lit = scene.changed(
        integrator=Whitted(), sampler=None, lights=(Point(position=(0, 0, 0.5), intensity=1),)
    )
    found = path_lengths(lit)
    assert found is not None
    families = {hypothesis.family for hypothesis in found(reference.mean(axis=0))}
    assert families == {"mistaken paths"}


@pytest.mark.slow
def test_the_gate_names_it(scene: Scene, reference: FloatArray) -> None:
    wrong = replicates(at_length(scene, OWN - 1), 1)
    request = Request(scene=scene, references=tuple(Picture(p) for p in reference))
    case = gated(request, [Picture(picture) for picture in wrong])
    assert case.verdict == "differ"
    assert case.cause is not None
    assert case.cause.name == "paths are one edge too short"
