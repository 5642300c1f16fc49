"""Pictures without noise that take the reference's own samples: nothing else forgives what differs.

Trees of another depth differ in details of mirrors in mirrors, where footprints see much.
"""

from pathlib import Path

import numpy as np
import pytest
from test_edges import CENTRE, Triangles

from comparisons.compare.pictures import mitsuba_whitted
from comparisons.gate.request import gate
from comparisons.results.case import RungResult
from comparisons.rungs.edges import Edges, edges_rung
from comparisons.rungs.footprints import look_at
from comparisons.rungs.own_samples import (
    other_trees,
    permitted,
    samples_of,
    strays,
    uncut,
)
from comparisons.translator import load
from reference_rt.cameras.film import Film
from reference_rt.core.arrays import FloatArray
from reference_rt.integrators import Whitted
from reference_rt.rendering.image import srgb
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import Grid, Independent
from reference_rt.textures.image_file import linear

SCENES = Path(__file__).parents[3] / "scenes"


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene.load(SCENES / "spheres_whitted.yaml").changed(film=Film(width=80, height=50))


@pytest.fixture(scope="module")
def reference(scene: Scene) -> FloatArray:
    return picture(scene)


def picture(scene: Scene, deeper: int = 0) -> FloatArray:
    assert isinstance(scene.integrator, Whitted)
    depth = max(scene.integrator.max_depth + deeper, 0)
    integrator = scene.integrator.model_copy(update={"max_depth": depth})
    return render(scene.changed(integrator=integrator)).colour


def judged(scene: Scene, found: FloatArray, right: FloatArray, shown: bool = False) -> RungResult:
    look = look_at(scene)
    assert look is not None
    return edges_rung(
        found,
        right,
        Edges(
            look,
            samples=samples_of(scene),
            beside=uncut(scene),
            others=lambda: other_trees(scene),
        ),
        shown,
    )


def half(values: FloatArray) -> FloatArray:
    return values.astype(np.float16).astype(np.float64)


def codes(values: FloatArray) -> FloatArray:
    return linear(np.round(255.0 * srgb(np.clip(values, 0.0, 1.0))) / 255.0)


@pytest.mark.parametrize("deeper", [-1, 1, 5])
def test_trees_of_another_depth_differ(scene: Scene, reference: FloatArray, deeper: int) -> None:
    other = picture(scene, deeper)
    found = judged(scene, half(other), reference)
    assert found.status == "differ", found.reason
    assert "are those of" in found.reason
    assert (found.numbers["inside_wrong"], found.numbers["edge_wrong"]) == (0, 0)


@pytest.mark.parametrize("kind", ["half floats", "codes", "float32", "16 samples"])
def test_right_pictures_agree(scene: Scene, reference: FloatArray, kind: str) -> None:
    if kind == "float32":
        shown = mitsuba_whitted(scene, scene.tables, load(scene))
        assert np.any(shown != reference)
    elif kind == "16 samples":
        shown = picture(scene.changed(sampler=Grid(spp=16)))
    else:
        shown = (half if kind == "half floats" else codes)(reference)
    found = judged(scene, shown, reference, shown=kind == "codes")
    assert found.status == "agree", found.reason
    assert found.numbers["strays"] == 0


def test_rays_that_contribute_too_little_for_us(scene: Scene) -> None:
    """Which another renderer follows, all of them or some."""
    ours, every = (
        scene.changed(integrator=Whitted(max_depth=8, min_contribution=least))
        for least in (5e-4, 0.0)
    )
    right, whole = picture(ours), picture(every)
    for shown in (whole, 0.5 * (whole + right)):
        rung = judged(ours, half(shown), right)
        assert rung.status == "agree", rung.reason
        assert rung.numbers["strays"] == 0
    look = look_at(ours)
    assert look is not None
    alone = edges_rung(half(whole), right, Edges(look, samples=samples_of(scene)), False)
    assert alone.numbers["strays"] > permitted(right[..., 0].size)


def test_through_the_gate(scene: Scene) -> None:
    case = gate(picture(scene, -1), scene=scene)
    assert case.verdict == "differ"
    assert "are those of one reflection fewer" in case.reason


@pytest.mark.slow
@pytest.mark.parametrize("deeper", [-1, 1, 5])
@pytest.mark.parametrize(
    "path",
    [path for path in sorted(SCENES.glob("*.yaml")) if "type: whitted" in path.read_text()],
    ids=lambda path: path.stem,
)
def test_every_scene(path: Path, deeper: int) -> None:
    """If more pixels than may be strays change by more than half floats hide."""
    of = Scene.load(path)
    right, other = picture(of), picture(of, deeper)
    seen = np.abs(other - right) > 2.0**-10 * np.abs(right)
    if np.count_nonzero(seen.any(axis=-1)) <= permitted(seen[..., 0].size):
        return
    assert judged(of, half(other), right).status == "differ"


# ---- which pictures take the samples -------------------------------------------------------------


def of_triangles(scene: Triangles, found: FloatArray) -> tuple[np.ndarray, np.ndarray] | None:
    right = scene.picture()

    def beyond(values: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
        return np.asarray(values - np.clip(values, low - 1e-6 * low, high + 1e-6 * high))

    differs = np.asarray(beyond(found, right, right).any(axis=-1), np.bool_)
    corners = np.stack([np.roll(right, k, axis=axis) for k in (-1, 1) for axis in (0, 1)])
    step = np.asarray((np.ptp(corners, axis=0) > 0.05).any(axis=-1), np.bool_)
    return strays([scene.look], beyond, np.array([[0.5, 0.5]]), (found, right), differs, step)


@pytest.mark.parametrize("seed", range(6))
def test_rasterisers_do_not(seed: int) -> None:
    """Neither with vertices on a grid, from 4 to 6 bits, nor with other samples."""
    scene = Triangles(seed)
    for bits in (4, 5, 6):
        moved = scene.snapped(bits, cut=seed % 2 == 0)
        shift = np.abs(moved - scene.corners).mean()
        found = of_triangles(scene, scene.picture(corners=moved, shift=(shift, shift)))
        assert found is None
    assert of_triangles(scene, scene.picture([(4, 4), (-4, -4)])) is None


def test_a_fault_where_footprints_see_much_is_a_stray() -> None:
    scene = Triangles(3)
    right = scene.picture(CENTRE)
    wrong = right.copy()
    wrong[20:26, 30:36] *= 1.05
    found = of_triangles(scene, wrong)
    assert found is not None
    assert sorted(zip(*(x.tolist() for x in found), strict=True)) == [
        (y, x) for y in range(20, 26) for x in range(30, 36)
    ]


def test_too_few_pixels_that_tell() -> None:
    flat = np.ones((4, 5, 3))

    def look(at: FloatArray) -> tuple[FloatArray, FloatArray]:
        return np.ones((*at.shape[:-1], 3)), np.ones(at.shape[:-1])

    def beyond(values: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
        return np.asarray(values - np.clip(values, low, high))

    differs = np.zeros((4, 5), bool)
    differs[1, 1] = True
    assert (
        strays([look], beyond, np.array([[0.5, 0.5]]), (flat * 1.1, flat), differs, ~differs)
        is None
    )


def test_samples_of_grids_alone(scene: Scene) -> None:
    places = samples_of(scene)
    assert places is not None
    assert places.tolist() == [[0.25, 0.25], [0.75, 0.25], [0.25, 0.75], [0.75, 0.75]]
    assert samples_of(scene.changed(integrator={"type": "path"}, sampler=Independent())) is None
