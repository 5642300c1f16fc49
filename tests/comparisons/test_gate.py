"""The gate as a whole: right pictures pass, wrong and unusable ones do not, and each says why."""

import json
import shlex
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer
from junitparser import JUnitXml
from typer.testing import CliRunner, Result

from comparisons.commands.accept import accept
from comparisons.commands.gate import gate
from comparisons.gate import reference
from reference_rt.exr import write_exr
from reference_rt.image import srgb, write_png
from reference_rt.render import render
from reference_rt.scene import Scene
from reference_rt.shapes.shape import FloatArray

SCENE = """\
film: {width: 32, height: 32}
camera: {type: perspective, eye: [0, 0, 4], target: [0, 0, 0], fov: 40}
sampler: {type: sobol, spp: 16}
materials:
  grey: {type: diffuse, reflectance: 0.5}
  lamp: {type: emissive, radiance: [60, 50, 20]}
shapes:
  - {type: sphere, radius: 1, material: grey}
  - {type: sphere, center: [2, 2, 2], radius: 0.5, material: lamp}
lights:
  - {type: constant, radiance: [0.5, 0.4, 0.3]}
"""
LIMIT = "0.01"


@pytest.fixture(scope="module")
def references(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One folder of references for all tests."""
    return tmp_path_factory.mktemp("references")


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, references: Path) -> Path:
    """The working folder is the test's own, and it is not CI's."""
    for name in ("CI", "GITHUB_ACTIONS", "GITHUB_STEP_SUMMARY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(reference, "cache_folder", lambda: references)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "ball.yaml").write_text(SCENE)
    return tmp_path


def pictures(scene: str = SCENE, count: int = 4, spp: int = 256) -> FloatArray:
    described = Scene.parse(scene)
    sampler = described.resolved_sampler
    return np.stack(
        [
            render(
                described.changed(sampler=sampler.model_copy(update={"seed": 70 + k, "spp": spp}))
            ).colour
            for k in range(count)
        ]
    )


@pytest.fixture(scope="module")
def right() -> FloatArray:
    return pictures()


def run(*arguments: str) -> tuple[Result, Any]:
    """`gate` with these, and the case in its results.json."""
    app = typer.Typer()
    app.command()(gate)
    result = CliRunner().invoke(app, [*arguments, "--limit", LIMIT])
    path = Path("out/results.json")
    return result, json.loads(path.read_text()) if path.exists() else None


def write(name: str, picture: FloatArray, names: str = "RGB") -> str:
    write_exr(Path(name), {n: picture[..., k % 3] for k, n in enumerate(names)}, {})
    return name


def files(replicates: FloatArray) -> list[str]:
    return [write(f"c{k}.exr", picture) for k, picture in enumerate(replicates)]


def status(found: Any, rung: str) -> str:
    return str(found["cases"][0]["tiers"][rung]["status"])


# ---- verdicts -----------------------------------------------------------------------------------


def test_right_pictures_pass(right: FloatArray, monkeypatch: pytest.MonkeyPatch) -> None:
    result, found = run(*files(right), "--scene", "ball.yaml", "--junit", "junit.xml")
    assert result.exit_code == 0, result.output
    assert "ball: agree: " in result.stdout
    case = found["cases"][0]
    assert (case["scene"], case["verdict"]) == ("ball", "agree")
    assert list(case["tiers"]) == ["input", "statistics", "images"]
    assert all(tier["status"] == "agree" for tier in case["tiers"].values())
    assert case["sides"] == {"candidate": "candidate's", "reference": "reference_rt's"}
    assert found["provenance"]["candidates"] == [f"c{k}.exr" for k in range(4)]
    assert "ball" in Path("out/report.html").read_text()
    assert JUnitXml.fromfile("junit.xml").tests == 1
    assert JUnitXml.fromfile("junit.xml").failures == 0

    def refuse(*arguments: object, **more: object) -> None:
        raise AssertionError("the reference is in the cache")

    monkeypatch.setattr(reference, "render", refuse)
    assert run(*files(right), "--scene", "ball.yaml")[0].exit_code == 0


def test_one_percent_more_fails(right: FloatArray) -> None:
    replicates = files(1.02 * right)
    result, found = run(*replicates, "--scene", "ball.yaml", "--junit", "junit.xml")
    assert result.exit_code == 1, result.output
    assert "ball: differ: statistics: " in result.stdout
    assert "likeliest cause: " in result.stdout
    assert "gain" in found["cases"][0]["cause"]["name"]
    assert found["cases"][0]["worst"]
    assert JUnitXml.fromfile("junit.xml").failures == 1
    one = write("one.exr", 1.01 * right.mean(axis=0))
    result, found = run(one, "--scene", "ball.yaml", "--limit", "0.005")
    assert result.exit_code == 1


def test_a_lost_light_is_named(right: FloatArray) -> None:
    unlit = pictures(SCENE.replace("[0.5, 0.4, 0.3]", "[0, 0, 0]"))
    result, found = run(*files(unlit), "--scene", "ball.yaml")
    assert result.exit_code == 1
    assert "lights[0] (constant)" in str(found["cases"][0]["cause"])


def test_a_single_noisy_picture_is_inconclusive() -> None:
    noisy = pictures(count=1, spp=1) * np.random.default_rng(1).exponential(1.0, (32, 32, 1))
    result, found = run(*files(noisy), "--scene", "ball.yaml")
    assert result.exit_code == 1, result.output
    assert "ball: inconclusive: statistics: " in result.stdout
    assert status(found, "statistics") == "inconclusive"
    assert status(found, "images") == "not-applicable"


def test_references_from_files(right: FloatArray) -> None:
    candidates, judges = files(right[:2]), [write(f"r{k}.exr", right[2 + k]) for k in range(2)]
    options = [word for judge in judges for word in ("--reference", judge)]
    result, found = run(*candidates, *options)
    assert found["cases"][0]["scene"] == "r0"
    assert status(found, "input") == "agree", result.output
    assert found["cases"][0]["verdict"] in ("agree", "inconclusive")
    # A mean, and how exact it is.
    mean = write("mean.exr", right.mean(axis=0))
    variance = write("var.exr", right.var(axis=0, ddof=1) / len(right))
    result, found = run(*files(pictures(spp=1024)), "--reference", mean, "--variance", variance)
    assert (result.exit_code, status(found, "images")) == (0, "agree"), result.output
    result, _ = run(*files(1.03 * right), "--reference", mean, "--variance", variance)
    assert result.exit_code == 1
    assert "differ: statistics" in result.output


@pytest.mark.parametrize("suffix", ["exr", "npy", "png"])
def test_pictures_without_noise(suffix: str) -> None:
    scene = SCENE.replace("sobol", "grid") + "integrator: {type: whitted}\n"
    sun = "type: directional, direction: [-1, -1, -1], irradiance:"
    scene = scene.replace("type: constant, radiance: [0.5, 0.4, 0.3]", f"{sun} [9, 5, 4]")
    Path("ball.yaml").write_text(scene)
    picture = render(Scene.parse(scene)).colour
    assert picture.max() > 1.0  # which 8 bits do not hold

    def written(name: str, values: FloatArray) -> str:
        if suffix == "exr":
            return write(f"{name}.exr", values)
        if suffix == "npy":
            np.save(f"{name}.npy", values)
        else:
            write_png(Path(f"{name}.png"), srgb(values), {})
        return f"{name}.{suffix}"

    result, found = run(written("right", picture), "--scene", "ball.yaml")
    assert result.exit_code == 0, result.output
    assert status(found, "statistics") == "not-applicable"
    assert ("8 bits of sRGB" in str(found["cases"][0]["notes"])) == (suffix == "png")
    result, _ = run(written("wrong", 1.02 * picture), "--scene", "ball.yaml")
    assert result.exit_code != 0
    both = [write("a.exr", picture), write("b.exr", picture)]
    result, _ = run(*both, "--scene", "ball.yaml")
    assert (result.exit_code, "of a picture without noise" in result.output) == (2, True)


# ---- bad input ----------------------------------------------------------------------------------


def bad_pictures(picture: FloatArray) -> dict[str, tuple[str, str]]:
    """Name of a file, and what is said about it."""
    whole = Path(write("whole.exr", picture)).read_bytes()
    holed = picture.copy()
    holed[3, 4, 1] = np.nan
    Path("truncated.exr").write_bytes(whole[:-50])
    Path("empty.exr").write_bytes(b"")
    Path("text.exr").write_text("not an image")
    Path("bomb.pfm").write_bytes(b"PF\n400000 400000\n-1\n")
    return {
        "size": (write("size.exr", picture[:, 1:]), "is 31 x 32 pixels; expected 32 x 32"),
        "channels": (write("channels.exr", picture, "AZ"), "has channels A, Z; expected R, G, B"),
        "nan": (write("nan.exr", holed), "not finite"),
        "empty": ("empty.exr", "is empty; expected an image"),
        "truncated": ("truncated.exr", "is truncated or damaged; expected a whole EXR image"),
        "not an image": ("text.exr", "is not an image that can be read"),
        "bomb": ("bomb.pfm", "declares 400000 x 400000 pixels"),
        "none": ("none.exr", "there is no such file"),
        "black": (write("black.exr", 0.0 * picture), "black"),
        "transparent": (transparent(picture), "transparent"),
    }


def transparent(picture: FloatArray) -> str:
    planes = {name: picture[..., k] for k, name in enumerate("RGB")}
    write_exr(Path("transparent.exr"), planes | {"A": 0.0 * picture[..., 0]}, {})
    return "transparent.exr"


BAD = (
    "size",
    "channels",
    "nan",
    "empty",
    "truncated",
    "not an image",
    "bomb",
    "none",
    "black",
    "transparent",
)


@pytest.mark.parametrize("name", BAD)
@pytest.mark.parametrize("replicated", [False, True])
def test_bad_pictures_have_their_message(right: FloatArray, name: str, replicated: bool) -> None:
    file, message = bad_pictures(right[3])[name]
    given = [*files(right[:3]), file] if replicated else [file]
    result, found = run(*given, "--scene", "ball.yaml", "--junit", "junit.xml")
    assert result.exit_code == 3, result.output
    assert message in result.output
    case = found["cases"][0]
    assert case["verdict"] == "invalid"
    assert message in case["reason"]
    assert JUnitXml.fromfile("junit.xml").errors == 1
    assert Path("out/report.html").exists()


def test_a_bad_reference(right: FloatArray) -> None:
    for name, (file, message) in bad_pictures(right[3]).items():
        result, _ = run(*files(right[:2]), "--reference", file)
        if name == "size":
            assert "c0.exr: is 32 x 32 pixels; expected 31 x 32, as the reference" in result.output
        elif name in BAD[3:8]:
            assert message in result.output
        if name != "transparent":  # which says nothing against a reference's radiance
            assert result.exit_code == 3, (name, result.output)


def test_eight_bits_of_a_noisy_picture_are_no_radiance(right: FloatArray) -> None:
    names = [f"c{k}.png" for k in range(4)]
    for name, picture in zip(names, right, strict=True):
        write_png(Path(name), srgb(picture), {})
    result, _ = run(*names, "--scene", "ball.yaml")
    assert result.exit_code == 3, result.output
    assert "8-bit sRGB codes" in result.output


def test_replicates_must_be_independent(right: FloatArray) -> None:
    result, _ = run(*files(right[[0, 0, 1]]), "--scene", "ball.yaml")
    assert result.exit_code == 3, result.output
    assert "invalid: input: " in result.output


def test_wrong_usage(right: FloatArray) -> None:
    candidate = write("c.exr", right[0])
    for arguments, message in (
        ([candidate], "expected a scene, a reference or a baseline"),
        (["--scene", "ball.yaml"], "expected either candidates or --command"),
        ([candidate, "--command", "x {output}"], "expected either candidates or --command"),
        ([candidate, "--scene", "ball.yaml", "--spp", "3"], "--spp: is for --command"),
        ([candidate, "--scene", "ball.yaml", "--variance", "v.exr"], "variance without a referen"),
        ([candidate, "--reference", candidate, "--baseline", "b"], "a reference and a baseline"),
        ([candidate, "--baseline", "../b"], "'../b' is no name of a baseline"),
        (["--command", "x {outptu}", "--scene", "ball.yaml"], "there is no {outptu}"),
        (["--command", "x {scene}", "--scene", "ball.yaml"], "has no {output}"),
    ):
        result, found = run(*arguments)
        assert (result.exit_code, message in result.output) == (2, True), result.output
        assert found is None
    result, _ = run(candidate, "--scene", "none.yaml")
    assert (result.exit_code, "none.yaml: cannot be read" in result.output) == (3, True)


# ---- driving a renderer -------------------------------------------------------------------------

RENDERER = """\
import sys, time
from pathlib import Path
import numpy as np
how, output, seed = sys.argv[1], Path(sys.argv[2]), int(sys.argv[3])
if how == "hangs":
    time.sleep(60)
if how == "crashes":
    sys.exit("out of light")
if how in ("right", "wrong"):
    picture = np.load("right.npy")[seed - 1]
    with output.open("wb") as file:
        np.save(file, picture if how == "right" else 1.05 * picture)
if how == "beside":
    np.save(output.with_name("other.npy"), np.ones((2, 2, 3)))
if how == "stale":
    np.save("candidate-00.npy", np.load("right.npy")[0])
"""


def drive(how: str, *more: str) -> tuple[Result, Any]:
    Path("renderer.py").write_text(RENDERER)
    command = (
        f"{shlex.quote(sys.executable)} renderer.py {how} {{output}} {{seed}} {{scene}} {{spp}}"
    )
    return run("--command", command, "--scene", "ball.yaml", "--suffix", ".npy", *more)


@pytest.mark.parametrize(
    ("how", "code", "verdict"), [("right", 0, "agree"), ("wrong", 1, "differ")]
)
def test_a_renderer_is_driven(right: FloatArray, how: str, code: int, verdict: str) -> None:
    np.save("right.npy", right)
    result, found = drive(how, "--replicates", "4")
    assert result.exit_code == code, result.output
    assert found["cases"][0]["verdict"] == verdict
    assert "candidate 4 of 4, seed 4" in result.output
    assert len(list(Path("out/candidates").iterdir())) == 4
    assert found["provenance"]["command"].endswith("{output} {seed} {scene} {spp}")


@pytest.mark.parametrize(
    ("how", "message"),
    [
        ("hangs", "hung with seed 1: not done after 1 s, and was killed"),
        ("crashes", "failed with seed 1: exit code 1, expected 0; it said: out of light"),
        ("nothing", "ended well with seed 1, but wrote nothing; expected candidate-00.npy"),
        ("beside", "wrote to another place with seed 1: other.npy in the same folder"),
        ("stale", "wrote to another place with seed 1: candidate-00.npy in the working folder"),
    ],
)
def test_a_renderer_that_fails(right: FloatArray, how: str, message: str) -> None:
    np.save("right.npy", right)
    Path("out/candidates").mkdir(parents=True)  # as an earlier run leaves them
    np.save("out/candidates/candidate-00.npy", right[0])
    result, found = drive(how, "--time-limit", "1")
    assert result.exit_code == 4, result.output
    assert message in result.output
    assert message in found["cases"][0]["reason"]
    assert found["cases"][0]["verdict"] == "not-comparable"
    assert not list(Path("out/candidates").iterdir())


# ---- baselines ----------------------------------------------------------------------------------


def test_a_baseline_from_nothing_to_stale(right: FloatArray) -> None:
    candidates = files(right)
    result, found = run(*candidates, "--baseline", "ball")
    assert result.exit_code == 4
    told = "reference-rt accept c0.exr c1.exr c2.exr c3.exr --name ball --baselines baselines"
    assert told in result.output
    assert found["cases"][0]["verdict"] == "not-comparable"
    assert not Path("baselines").exists()

    app = typer.Typer()
    app.command()(accept)
    arguments = [*shlex.split(told)[2:], "--reason", "looked at it", "--scene", "ball.yaml"]
    assert CliRunner().invoke(app, arguments).exit_code == 0
    others = files(pictures(spp=512))
    result, found = run(*others, "--baseline", "ball")
    assert result.exit_code == 0, result.output
    assert found["provenance"]["baseline"] == "ball"
    assert found["cases"][0]["sides"]["reference"] == "the baseline's, ball"
    assert CliRunner().invoke(app, ["--unused", "out"]).exit_code == 0
    result, _ = run(*files(1.03 * right), "--baseline", "ball")
    assert result.exit_code == 1
    assert "ball: differ: " in result.output

    Path("ball.yaml").write_text(SCENE.replace("radius: 1", "radius: 1.1"))
    result, _ = run(*candidates, "--baseline", "ball")
    assert (result.exit_code, "is stale: the scene 'ball' has changed" in result.output) == (
        4,
        True,
    )
    Path("ball.yaml").write_text(SCENE)
    write("baselines/ball/picture-02.exr", 1.03 * right.mean(axis=0))
    result, found = run(*candidates, "--baseline", "ball")
    assert result.exit_code == 3
    assert "picture-02.exr: is not what was accepted (SHA-256 differs)" in result.output
    assert found["cases"][0]["verdict"] == "invalid"


# ---- CI -----------------------------------------------------------------------------------------


def test_github_sees_it(right: FloatArray, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", "summary.md")
    result, _ = run(*files(1.05 * right), "--scene", "ball.yaml")
    assert "::error file=ball.yaml,title=ball%3A differ::statistics: " in result.stdout
    assert "differ" in Path("summary.md").read_text()
