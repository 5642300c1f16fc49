"""Pictures that went through a tone curve: judged as displayed, and the curve is recognised.

The formulas are checked against three.js's own shaders in `test_gate_three.py`."""

from pathlib import Path

import numpy as np
import pytest
from gate_checks import run
from PIL import Image
from test_edges import HEIGHT, OTHERS, RULES, SCENE, WIDTH, Triangles

from comparisons.gate.shown_curve import estimated
from comparisons.gate.tone_curves import CURVES, ToneCurve, curve_of
from comparisons.results.case import RungResult
from comparisons.rungs.edges import DARK, TOLERANCE, Edges, edges_rung
from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.image import srgb
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.textures.image_file import linear
from reference_rt.util.errors import ImageError, UsageError

SPACES = ("before", "after", "as codes")


def rounded(shown: FloatArray) -> FloatArray:
    return linear(np.round(255.0 * srgb(shown)) / 255.0)


def displayed(
    scene: Triangles,
    curve: ToneCurve,
    samples: object,
    space: str = "before",
    shift: tuple[float, float] = (0.0, 0.0),
    gain: float = 1.0,
) -> FloatArray:
    """8-bit codes of samples that are averaged before the curve, after it, or as codes."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH] + 0.5
    at = np.stack([x, y], axis=-1) + np.array(shift)
    found = [gain * scene.look(at + np.array(s) / 16.0)[0] for s in np.asarray(samples)]
    if space == "before":
        return rounded(curve(np.asarray(np.mean(found, axis=0))))
    encode, decode = (srgb, linear) if space == "as codes" else (np.asarray, np.asarray)
    return rounded(decode(np.mean([encode(curve(one)) for one in found], axis=0)))


def judged(scene: Triangles, curve: ToneCurve, candidate: FloatArray) -> RungResult:
    reference = scene.picture()
    steep, floor = curve.errors(reference, DARK)
    edges = Edges(scene.look, TOLERANCE * steep, curve, floor)
    return edges_rung(candidate, curve(reference), edges, displayed=True)


def saturated(name: str) -> tuple[Triangles, ToneCurve]:
    """Colours with which ACES and AgX make mixtures brighter or darker than both."""
    scene = Triangles(list(CURVES).index(name))
    scene.colours **= 3.0
    return scene, ToneCurve(name, CURVES[name], 2.0)


@pytest.mark.cases(len(CURVES))
@pytest.mark.parametrize("space", SPACES)
@pytest.mark.parametrize("name", CURVES)
def test_right_pictures_agree(name: str, space: str) -> None:
    scene, curve = saturated(name)
    samples = [RULES["4 samples"], OTHERS["3 x 3"], RULES["8 samples"]][SPACES.index(space)]
    found = judged(scene, curve, displayed(scene, curve, samples, space))
    assert found.status == "agree", found.reason
    assert found.numbers["edge"] > 200


@pytest.mark.cases(3)
@pytest.mark.parametrize("name", CURVES)
def test_faults_are_seen(name: str) -> None:
    scene, curve = saturated(name)
    wrong = displayed(scene, curve, RULES["4 samples"], shift=(0.5, 0.0))
    assert judged(scene, curve, wrong).status == "differ"
    wrong = displayed(scene, curve, RULES["4 samples"], gain=1.05)
    assert judged(scene, curve, wrong).numbers["inside_wrong"] > 100


@pytest.mark.parametrize(
    ("name", "a", "b", "channel"),
    [
        ("neutral", [0.01, 0.01, 1.5], [1.5, 0.01, 0.01], 1),
        ("aces", [0.004, 0.04, 1.3], [0.004, 0.4, 0.01], 0),
        ("agx", [0.004, 2.3, 4.0], [0.5, 0.01, 0.005], 0),
    ],
)
def test_a_mixture_is_darker_than_both_of_its_colours(
    name: str, a: list[float], b: list[float], channel: int
) -> None:
    """Half of each pixel on the edge is of one colour, half of the other."""
    curve = curve_of(name)
    scene = Triangles(0, 1)
    scene.corners[0] = [[30.5, -1e4], [30.5, 1e4], [1e4, 0.0]]
    scene.colours[:] = a, b
    scene.slopes[:] = 0.0
    mixed = displayed(scene, curve, OTHERS["two beside each other"])
    left, edge, right = 255.0 * srgb(mixed[5, [20, 30, 40], channel])
    assert edge < min(left, right) - 10.0
    found = judged(scene, curve, mixed)
    assert found.numbers["edge"] == HEIGHT
    assert not found.numbers["edge_wrong"], found.reason


@pytest.mark.parametrize("name", CURVES)
def test_errors_of_radiance_are_within_the_tolerance_behind_the_curve(name: str) -> None:
    rng = np.random.default_rng(5)
    radiance = 10.0 ** rng.uniform(-3.0, 1.0, (40, 50, 3))
    curve = ToneCurve(name, CURVES[name], 0.7)
    steep, floor = curve.errors(radiance, DARK)
    scale = np.maximum(radiance, DARK * radiance.mean(axis=(0, 1)))
    shown = curve(radiance)
    for _ in range(20):
        sign = rng.choice([-1.0, 1.0], radiance.shape)
        error = np.abs(curve(np.maximum(radiance + 1e-4 * sign * scale, 0.0)) - shown)
        # Difference quotients of 1e-4: the second derivative is a few percent of the first.
        assert np.all(error <= 1.05 * 1e-4 * steep * np.maximum(shown, floor))


@pytest.mark.cases(4)
@pytest.mark.parametrize("name", CURVES)
def test_curves_are_recognised(name: str) -> None:
    """From codes, a fifth of which shows something else."""
    reference = Triangles(3).picture() * [2.0, 1.0, 0.5]
    for exposure in (1.0, 0.6, 0.477):
        curve = ToneCurve(name, CURVES[name], exposure)
        candidate = rounded(curve(reference))
        candidate[::5] = 0.5
        assert str(estimated(candidate, reference)) == str(curve)
    assert estimated(reference**0.8, reference) is None
    assert estimated(np.full_like(reference, np.nan), reference) is None


def written(curve: ToneCurve, gain: float = 1.0) -> str:
    picture = curve(gain * render(Scene.parse(SCENE)).colour)
    codes = np.round(255.0 * srgb(picture)).astype(np.uint8)
    Image.fromarray(codes).save("a.png")
    Path("scene.yaml").write_text(SCENE)
    return "a.png"


def gated(*more: str, code: int) -> dict:
    result, found = run("a.png", "--scene", "scene.yaml", *more)
    assert result.exit_code == code, result.output
    return {**found["cases"][0], "said": result.output}


@pytest.mark.usefixtures("gate_folder")
def test_declared_and_undeclared() -> None:
    written(curve_of("agx:0.6"))
    gated("--tone-curve", "agx:0.6", code=0)
    case = gated(code=1)
    assert case["cause"]["name"] == "the tone curve agx:0.6"
    assert "with --tone-curve agx:0.6 the pictures agree" in case["cause"]["evidence"]
    case = gated("--tone-curve", "estimate", code=0)
    assert "no difference was found up to the tone curve agx at exposure 0.6" in case["said"]
    assert any("was estimated" in note for note in case["notes"])


@pytest.mark.usefixtures("gate_folder")
def test_another_curve_and_another_exposure_are_named() -> None:
    written(curve_of("agx:0.6"), 1.05)
    case = gated("--tone-curve", "agx:0.6", code=1)
    assert case["cause"]["name"] == "constant gain of 1.05 before the tone curve"
    case = gated("--tone-curve", "aces", code=1)
    assert case["cause"]["name"] == "the tone curve agx:0.63"


@pytest.mark.usefixtures("gate_folder")
def test_a_curve_in_a_file() -> None:
    """Of so many points that what is between them is within the tolerance."""
    at = np.linspace(0.0, 8.0, 4001)
    pairs = zip(at, srgb(curve_of("reinhard")(at)), strict=True)
    lines = ["# linear, stored", *(f"{x}, {y}" for x, y in pairs)]
    Path("table.csv").write_text("\n".join(lines))
    written(curve_of("reinhard:0.6"))
    gated("--tone-curve", "table.csv:0.6", code=0)
    gated("--tone-curve", "table.csv", code=1)


@pytest.mark.usefixtures("gate_folder")
@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("agxx", "there is no agxx; expected linear, .*exponential, a file, or estimate"),
        ("agx:-1", "agx:-1 has the exposure -1; expected a number > 0"),
        ("agx:nan", "has the exposure nan"),
        ("one", "one: is no tone curve; expected lines of two numbers"),
        ("text", "text: is no tone curve: could not convert .*expected lines"),
        ("back", "back: has values that do not rise"),
        ("falls", "falls: falls; expected"),
    ],
)
def test_wrong_curves_are_refused(text: str, message: str) -> None:
    for name, lines in (("one", "0 0"), ("text", "0 0\na b"), ("falls", "0 1\n1 0.5")):
        Path(name).write_text(lines)
    Path("back").write_text("0 0\n0 1")
    with pytest.raises((UsageError, ImageError), match=message):
        curve_of(text)


@pytest.mark.usefixtures("gate_folder")
def test_pictures_with_noise_have_no_tone_curve() -> None:
    written(curve_of("agx"))
    Path("scene.yaml").write_text(SCENE.replace("whitted, max_depth: 2", "path"))
    result, _ = run("a.png", "--scene", "scene.yaml", "--tone-curve", "agx")
    assert result.exit_code == 2
    assert "--tone-curve: the pictures have noise" in result.output
