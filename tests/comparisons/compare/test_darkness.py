"""Two black pictures are alike whatever the renderers do: they are `inconclusive`, with the likely
reason, unless the scene has no light."""

import numpy as np
import pytest
from command_line import invoke
from gate_checks import files, run, write

from comparisons.compare.budget import Budget
from comparisons.compare.compare import Subject, compare_scene
from comparisons.compare.darkness import lit, plain, why_dark
from comparisons.gate.request import gate
from comparisons.results.case import Images, RungResult
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import ImageError

pytestmark = pytest.mark.filterwarnings("ignore")

VIEW = """
camera: {{type: perspective, eye: [0, 0, {eye}], target: [0, 0, 0], fov: 80, near: {near}}}
film: {{width: 12, height: 8}}
sampler: {{type: {sampler}}}
integrator: {{{integrator}}}
materials:
  grey: {{type: diffuse, reflectance: 0.5}}
  lamp: {{type: emissive, radiance: {lamp}}}
shapes:
  - {{type: sphere, material: grey}}
  - {{type: disk, material: lamp, transform: [{{translate: [0, 0, -5]}}]}}
lights: [{lights}]
"""

SKY, POINT = "{type: constant, radiance: 1}", "{type: point, position: [0, 0, 4], intensity: 1}"
DARK = "{type: constant, radiance: 0}, {type: point, position: [0, 0, 4], intensity: 0}"


def scene(
    eye: float = 3.0,
    near: float = 0.0,
    integrator: str = "type: path, max_depth: 2",
    lamp: float = 0.0,
    lights: str = SKY,
) -> Scene:
    is_still = "whitted" in integrator or "ray_cast" in integrator
    sampler = "grid, spp: 1" if is_still else "sobol, spp: 4"
    given = {"near": near, "integrator": integrator, "lamp": lamp, "lights": lights}
    return Scene.parse(VIEW.format(eye=eye, sampler=sampler, **given))


FROM_BEHIND = "from behind alone"
REASONS: dict[str, tuple[Scene, str]] = {
    "near cuts the sphere": (scene(eye=1.2, near=0.5), FROM_BEHIND),
    "within the sphere": (scene(eye=0.5, integrator="type: direct"), FROM_BEHIND),
    "everything before the near plane": (
        scene(near=50.0, lights=POINT), "no ray of the camera beyond the near plane, at 50, meets",
    ),
    "one edge": (scene(integrator="type: path, max_depth: 1"), "max_depth 1"),
    "no light reaches": (
        scene(lights="{type: point, position: [0, 0, -4], intensity: 1}"),
        "no light reaches what the camera sees",
    ),
    "whitted, an environment behind": (
        scene(eye=1.2, near=0.5, integrator="type: whitted"), FROM_BEHIND,
    ),
    "cast, nothing met": (
        scene(near=50.0, integrator="type: ray_cast", lights=""), "no ray of the camera",
    ),
    "no light": (scene(lights=""), ""),
    "lights of no power": (scene(lights=DARK), ""),
    "ambient without whitted": (scene(lights="{type: ambient, radiance: 1}"), ""),
    "cast, a surface met": (scene(integrator="type: ray_cast", lights=""), ""),
}  # fmt: skip


@pytest.mark.parametrize("name", REASONS)
def test_likely_reasons(name: str) -> None:
    of, reason = REASONS[name]
    found = why_dark(of)
    assert reason in found
    assert bool(reason) == bool(found)


def test_the_result_of_the_input() -> None:
    black, one = np.zeros((4, 5, 3)), np.zeros((4, 5, 3))
    one[2, 3, 1] = 1e-9
    right, wrong = RungResult("input", "agree", "fine"), RungResult("input", "invalid", "not")
    unknown = lit(right, Images(black, black), None)
    assert unknown.status == "inconclusive"
    assert "both pictures are black throughout" in unknown.reason
    assert "whether the scene has light is not known" in unknown.reason
    assert lit(right, Images(black, black), lambda: "x").status == "inconclusive"
    dark = lit(right, Images(black, black), lambda: "")
    assert (dark.status, dark.reason) == ("agree", "fine, all black: the scene has no light")
    for images in (Images(one, black), Images(black, one)):
        assert lit(right, images, lambda: "x") is right
    assert lit(wrong, Images(black, black), lambda: "x") is wrong


@pytest.mark.parametrize(
    "integrator", ["type: path, max_depth: 2", "type: whitted", "type: ray_cast"]
)
def test_compare(integrator: str) -> None:
    """With noise and without; a scene that has no light agrees."""
    budget = Budget(pixels=20, light_pixels=16, replicates=2, spp=1, seconds=None)
    near = 50.0 if "ray_cast" in integrator else 0.5
    case = compare_scene(Subject(scene(1.2, near, integrator)), budget, lambda line: None, 1)
    assert case.verdict == "inconclusive", case.reason
    assert case.reason.startswith("input: both pictures are black throughout")
    if "ray_cast" not in integrator:
        without = Subject(scene(1.2, 0.5, integrator, lights=""))
        case = compare_scene(without, budget, lambda line: None, 1)
        assert case.verdict == "agree", case.reason


def test_one_colour_and_empty_layers_are_said() -> None:
    """Nothing but the sky is seen: that agrees, and says what it shows."""
    sky = scene(near=50.0)
    sky = sky.changed(film=sky.film.model_copy(update={"layers": ("albedo", "normal")}))
    budget = Budget(pixels=20, light_pixels=16, replicates=2, spp=1, seconds=None)
    case = compare_scene(Subject(sky), budget, lambda line: None, 1)
    assert case.verdict == "agree", case.reason
    assert any("of one colour throughout, (1, 1, 1)" in note for note in case.notes)
    (layers,) = [rung for rung in case.rungs if rung.name == "layers"]
    assert "albedo and normal: 0 in every pixel of both" in layers.reason
    rng = np.random.default_rng(1)
    varied = rng.uniform(size=(4, 5, 3))
    flat = np.ones((4, 5, 3))
    assert plain(Images(flat, 2.0 * flat))
    for images in (Images(varied, flat), Images(flat, varied), Images(flat[:1, :1], flat[:1, :1])):
        assert not plain(images)
    assert not plain(Images(0.0 * flat, flat))


BLACK = np.zeros((8, 12, 3))


@pytest.mark.usefixtures("gate_folder")
def test_gate_refuses_a_black_reference() -> None:
    names = files(np.stack([BLACK] * 2))
    for given in (["--reference", write("r.exr", BLACK)], ["--reference", *names]):
        result, _ = run(names[0], *given)
        assert result.exit_code == 3, result.output
        assert "is black throughout; expected a picture" in " ".join(result.output.split())
    accepted = invoke("accept", *names, "--name", "night", "--reason", "seen")
    assert accepted.exit_code == 3, accepted.output
    with pytest.raises(ImageError, match="black"):
        gate(BLACK, reference=BLACK)


def test_gate_of_a_scene() -> None:
    for of, verdict in ((scene(1.2, 0.5), "inconclusive"), (scene(lights=""), "agree")):
        case = gate([BLACK, BLACK], scene=of)
        assert case.verdict == verdict, case.reason
    still = scene(1.2, 0.5, "type: whitted")
    assert gate(BLACK, scene=still).verdict == "inconclusive"
    assert gate(BLACK, scene=still.changed(lights=())).verdict in ("agree", "unchanged")
