"""`reference-rt compare` as a whole: exit codes, results.json, the page, planted faults."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
from command_line import invoke
from typer.testing import Result

import comparisons.commands.register
import comparisons.compare.compare
import comparisons.translator
from comparisons.compare.budget import Budget, usual
from comparisons.compare.pictures import layers
from comparisons.mitsuba import scene as mitsuba_scene
from comparisons.renderers import ReferenceSampler
from comparisons.results.case import Case, exit_code
from comparisons.translator import UntranslatableError, load
from reference_rt.cameras.film import BoxFilter
from reference_rt.core.model import types_of
from reference_rt.integrators import RayCast, Whitted
from reference_rt.materials import Emissive
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import AnySampler, Grid, Independent, Sobol
from reference_rt.scene.build import build_tables

SCENES = Path(__file__).parents[3] / "scenes"


def compare(out: Path, *arguments: str) -> tuple[Result, Any]:
    result = invoke("compare", *arguments, "--out", out)
    path = out / "results.json"
    return result, json.loads(path.read_text()) if path.exists() else None


def compared_here(budget: Budget) -> Case:
    """What the worker of `compare` finds, in this process, where tests can plant faults."""
    scene = Scene.load(SCENES / "spheres_whitted.yaml")
    return comparisons.compare.compare.compare_scene(
        comparisons.compare.compare.Subject(scene), budget, lambda _: None
    )


def test_layers_are_the_hits_of_both_sides() -> None:
    scene = Scene.load(SCENES / "spheres_whitted.yaml")
    film = scene.film.model_copy(update={"width": 24, "height": 15})
    scene = scene.changed(film=film)
    tables, counterpart = build_tables(scene), comparisons.translator.load(scene)
    found = layers(scene, tables, counterpart)
    hit = found["distance"][0][..., 0] > 0.0
    assert 0 < hit.sum() < hit.size
    for name, (ours, theirs) in found.items():
        assert ours.shape == theirs.shape == (15, 24, 3)
        # Mitsuba's float32 has 6e-8; a ray at an edge may hit another surface.
        off = np.abs(ours - theirs).max(axis=-1) > 1e-4 * max(1.0, np.abs(ours).max())
        assert off.sum() <= 3, name
    lengths = np.linalg.norm(found["normal"][0], axis=-1)
    np.testing.assert_allclose(lengths, hit, atol=1e-12)
    # Of the sky alone.
    camera = scene.camera.model_copy(
        update={"target": tuple(scene.camera.eye + np.array([0, 9, 1]))}
    )
    scene = scene.changed(camera=camera)
    found = layers(scene, build_tables(scene), counterpart)
    assert not any(picture.any() for pair in found.values() for picture in pair)


@pytest.mark.parametrize("sampler", types_of(AnySampler), ids=lambda cls: cls.__name__)
@pytest.mark.parametrize("integrator", [Whitted(), RayCast()], ids=lambda one: one.type)
def test_pictures_without_noise_are_of_the_same_rays(
    integrator: Whitted | RayCast, sampler: type[Sobol | Independent | Grid]
) -> None:
    """Whichever samples the scene asks for: the points of random ones are our own."""
    scene = Scene.load(SCENES / "spheres_whitted.yaml")
    film = scene.film.model_copy(update={"width": 32, "height": 20})
    scene = scene.changed(integrator=integrator, sampler=sampler(spp=4), film=film)
    case = comparisons.compare.compare.compare_scene(
        comparisons.compare.compare.Subject(scene), Budget(), lambda _: None, rungs=("images",)
    )
    assert case.verdict == "agree", case.reason
    assert ("a grid of samples" in str(case.notes)) is (sampler is not Grid)


@pytest.mark.slow
def test_scenes_agree(tmp_path: Path) -> None:
    scenes = [str(SCENES / f"{name}.yaml") for name in ("spheres_whitted", "polygons_fill_rules")]
    result, found = compare(tmp_path, *scenes, "--size", "48x32")
    assert result.exit_code == 0, result.output
    assert found["schema"] == 2
    assert [case["verdict"] for case in found["cases"]] == ["agree", "agree"]
    case = found["cases"][0]
    assert set(case) >= {"scene", "verdict", "reason", "tiers", "metrics", "seconds"}
    of_light = ["direct", "sampling", "transport", "whitted", "statistics", "images"]
    assert list(case["tiers"]) == ["input", "files", "solids", "geometry", *of_light]
    assert set(case["metrics"]) >= {"ssim", "flip", "psnr", "rmse", "relmse", "mean_bias"}
    geometry = case["tiers"]["geometry"]
    assert (geometry["decided_ours"], geometry["undecided"]) == (0, 0)
    assert case["seconds"]["candidate"]["render"] > 0.0
    assert case["seconds"]["reference"]["render"] > 0.0
    assert "spheres_whitted" in (tmp_path / "report.html").read_text()


@pytest.mark.slow
def test_path_tracing_is_compared_by_replicates(tmp_path: Path) -> None:
    scene = str(SCENES / "cornell_box.yaml")
    small = [scene, "--size", "32x32", "--spp", "16", "--replicates", "4"]
    result, found = compare(tmp_path, *small, "--fixed")
    statistics = found["cases"][0]["tiers"]["statistics"]
    # 4 x 16 samples of 32 x 32 pixels are too few to tell half a percent: it must say so.
    assert found["cases"][0]["verdict"] == "inconclusive"
    assert statistics["status"] == "inconclusive"
    assert "smallest bias of the image mean seen with 99 % power" in statistics["reason"]
    assert result.exit_code == 1
    assert found["cases"][0]["again"].endswith(
        "--fresh --spp 16 --size 32x32 --replicates 4 --fixed"
    )
    # So it goes on, as long as it may.
    result, found = compare(tmp_path, *small, "--time-limit", "5")
    statistics = found["cases"][0]["tiers"]["statistics"]
    assert statistics["looks"] == len(statistics["replicates_at_looks"]) > 1
    assert statistics["replicates_at_looks"][0] == 4
    assert f"look {statistics['looks']}, at " in statistics["reason"]
    assert "4 replicates, and more until the question is decided or 5 s" in str(
        found["cases"][0]["notes"]
    )
    result, _ = compare(tmp_path, *small, "--time-limit", "5", "--fixed")
    assert result.exit_code == 2
    assert "--fixed and --time-limit; expected one of them" in result.output


@pytest.mark.slow
def test_wrong_light_differs_at_its_rung(monkeypatch: pytest.MonkeyPatch) -> None:
    translate = comparisons.translator.translate_light

    def brighter(light: Any, around: Any) -> dict[str, Any]:
        emitter = translate(light, around)
        assert emitter is not None
        if emitter["type"] == "point":
            emitter["intensity"]["value"] = [1.01 * x for x in emitter["intensity"]["value"]]
        return emitter

    monkeypatch.setattr(comparisons.translator, "translate_light", brighter)
    case = compared_here(Budget(size=(48, 32)))
    assert case.verdict == "differ"
    assert case.reason.startswith("direct:")
    status = {rung.name: rung.status for rung in case.rungs}
    assert status["geometry"] == "agree"
    assert status["whitted"] == "not-applicable"
    assert exit_code([case]) == 1


def test_type_without_translation_is_not_comparable(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(light: Any, around: Any) -> dict[str, Any]:
        raise UntranslatableError(light, "light")

    monkeypatch.setattr(comparisons.translator, "translate_light", refuse)
    case = compared_here(Budget())
    assert case.verdict == "not-comparable"
    assert "light Point" in case.reason
    assert exit_code([case]) == 1


@pytest.mark.slow
def test_without_mitsuba_exit_code_4(tmp_path: Path) -> None:
    code = (
        "import sys; sys.modules['mitsuba'] = None; import importlib.metadata as m;"
        "version = m.version;"
        "m.version = lambda n: version('no-such-package' if n == 'mitsuba' else n);"
        "from reference_rt.cli.main import main; main()"
    )
    scene = str(SCENES / "spheres_whitted.yaml")
    run = subprocess.run(
        [sys.executable, "-c", code, "compare", scene, "--out", str(tmp_path)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 4, run.stderr
    assert "pip install" in run.stderr
    assert "Traceback" not in run.stderr


@pytest.mark.cases(3)
@pytest.mark.parametrize(
    ("name", "spp"),
    [
        ("cornell_box", 16),
        ("cornell_box", 8),
        ("environment", 8),
        ("soft_shadows", 4),
        ("material_rough_dielectric", 8),
        ("textured_room", 8),
        ("veach_mis", 32),
    ],
)
def test_stratified_pictures_of_mitsuba_are_independent_and_unbiased(name, spp):
    """The permutations of `multijitter` are seeded by the seed plus the pixel's number times the
    samples per pixel: with successive seeds a picture would be that of so many seeds before, moved
    by a pixel, with a correlation of 0.4."""
    count, film = 48, {"width": 24, "height": 24, "filter": BoxFilter()}
    whole = Scene.load(SCENES / f"{name}.yaml")
    scene = whole.changed(film=whole.film.model_copy(update=film))
    drawn = {}
    for sampler in get_args(ReferenceSampler):
        counterpart = load(scene, sampler=sampler)
        made = mitsuba_scene.render(counterpart.mi_scene, count, spp, 0, sampler)
        pictures = made.pictures
        # Mitsuba rounds up to a grid of cells.
        assert made.spp == (35 if (sampler, spp) == ("multijitter", 32) else spp)
        assert sampler in str(counterpart.mi_scene.sensors()[0].sampler()).lower()
        drawn[sampler] = pictures
    a, b = drawn["independent"], drawn["multijitter"]
    noise = [x.mean(axis=(1, 2)).std(axis=0, ddof=1) / np.sqrt(count) for x in (a, b)]
    assert (np.abs(a.mean(axis=(0, 1, 2)) - b.mean(axis=(0, 1, 2))) < 5.0 * np.hypot(*noise)).all()
    medians = [np.median(x.var(axis=0)) for x in (a, b)]
    # In the box 0.55 and 0.67 by 16 and 8 samples; 1 by a sampler that stratifies nothing.
    assert medians[1] < (0.8 if name == "cornell_box" else 1.0) * medians[0]
    deviation = (b - b.mean(axis=0)).mean(axis=-1)
    spread = deviation.std(axis=0)
    z = np.divide(deviation, spread, out=np.zeros_like(deviation), where=spread > 1e-6)
    moved = z[spp:, :, :-1] * z[:-spp, :, 1:]
    # The mean of as many products of independent numbers.
    assert abs(moved.mean()) < 5.0 / np.sqrt(moved.size)


def small(name: str, side: int = 24, spp: int = 64) -> Scene:
    """A scene in few pixels."""
    whole = Scene.load(SCENES / f"{name}.yaml")
    film = whole.film.model_copy(update={"width": side, "height": side})
    sampler = whole.resolved_sampler.model_copy(update={"spp": spp})
    return whole.changed(film=film, sampler=sampler)


def test_what_was_used_is_said_and_is_the_same_again() -> None:
    """The number of replicates depends on their noise alone."""
    subject = comparisons.compare.compare.Subject(small("soft_shadows"))
    cases = [
        comparisons.compare.compare.compare_scene(
            subject, usual(limit=0.015), lambda _: None, rungs=("statistics",)
        )
        for _ in range(2)
    ]
    numbers = [
        next(rung for rung in case.rungs if rung.name == "statistics").numbers for case in cases
    ]
    (count,) = numbers[0]["replicates_at_looks"]
    assert 8 <= count <= 24
    assert numbers[0]["replicates_candidate"] == numbers[0]["replicates_reference"] == count
    assert max(numbers[0]["detectable_bias"].values()) <= 0.015
    said = f"{count} pictures by each renderer, of 16 samples per pixel (sobol) and of 16 (Mitsuba"
    assert sum(said in note for note in cases[0].notes) == 1
    assert numbers[0] == numbers[1]
    assert cases[0].images is not None
    assert cases[1].images is not None
    np.testing.assert_array_equal(cases[0].images.candidate, cases[1].images.candidate)
    np.testing.assert_array_equal(cases[0].images.reference, cases[1].images.reference)


def test_a_difference_is_shown_by_as_many_pictures_as_ever() -> None:
    """The first look decides it; its cause is found from more."""
    scene = small("soft_shadows")
    lamps = {
        name: material.model_copy(update={"radiance": (9.0, 9.0, 9.0)})
        for name, material in scene.materials.items()
        if isinstance(material, Emissive)
    }
    assert lamps
    case = comparisons.compare.compare.compare_scene(
        comparisons.compare.compare.Subject(
            scene, scene.changed(materials={**scene.materials, **lamps})
        ),
        usual(limit=0.06),
        lambda _: None,
        rungs=("statistics",),
    )
    assert case.verdict == "differ"
    numbers = next(rung for rung in case.rungs if rung.name == "statistics").numbers
    assert numbers["replicates_candidate"] < 24
    assert any("24 pictures by each renderer" in note for note in case.notes)


def test_media_have_independent_samples_of_mitsubas() -> None:
    """Its stratified samplers are biased there; the same of a scene without media are not."""
    for name, sampler in (("coloured_fog", "independent"), ("soft_shadows", "multijitter")):
        case = comparisons.compare.compare.compare_scene(
            comparisons.compare.compare.Subject(small(name)),
            usual(4, 2, fixed=True, limit=0.5),
            lambda _: None,
            rungs=("statistics",),
        )
        assert any(f"Mitsuba's {sampler}" in note for note in case.notes), case.notes


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({}, {"parts": 8, "replicates": 8, "most_first": 24, "seconds": 600.0}),
        ({"spp": 64}, {"parts": 1, "replicates": 8, "most_first": None, "seconds": 600.0}),
        ({"replicates": 5}, {"parts": 1, "replicates": 5, "most_first": None}),
        ({"spp": 64, "replicates": 5}, {"parts": 1, "replicates": 5, "most_first": None}),
        ({"fixed": True}, {"parts": 1, "replicates": 16, "seconds": None}),
        ({"fixed": True, "replicates": 5}, {"replicates": 5, "seconds": None}),
        ({"seconds": 5.0, "limit": 0.02}, {"seconds": 5.0, "limit": 0.02, "parts": 8}),
    ],
)
def test_what_is_given_is_kept(given: dict[str, Any], expected: dict[str, Any]) -> None:
    budget = usual(**given)
    assert {name: getattr(budget, name) for name in expected} == expected
    assert budget.reference_sampler == "multijitter"
