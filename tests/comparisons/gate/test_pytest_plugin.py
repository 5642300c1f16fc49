"""The pytest plugin from outside: test modules that use it, run by pytest itself."""

import json
import re

import numpy as np
import pytest
from command_line import invoke
from gate_checks import BALL, PLUGIN

pytest_plugins = ["pytester"]

SCENE = (
    BALL
    + """\
film: {width: 32, height: 32}
sampler: {type: independent, spp: 16}
lights: [{type: constant, radiance: [1, 0.5, 0.25]}]
"""
)

MODULE = """
import numpy as np

from reference_rt import Scene, render

SCENE = "scenes/ball.yaml"


def my_renderer(scene, gain=1.0, count=8, spp=64, first=100):
    described = Scene.load(scene)
    seeds = [described.changed(sampler={"type": "sobol", "spp": spp, "seed": first + k})
             for k in range(count)]
    return gain * np.stack([render(seeded).colour for seeded in seeds])
"""


@pytest.fixture
def project(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> pytest.Pytester:
    """A folder with a scene and a renderer."""
    monkeypatch.delenv("CI", raising=False)
    (pytester.path / "scenes").mkdir()
    (pytester.path / "scenes" / "ball.yaml").write_text(SCENE)
    pytester.makepyfile(renderer=MODULE)
    return pytester


def run(project: pytest.Pytester, body: str, *options: str) -> pytest.RunResult:
    """A test module `test_it.py` with this body."""
    project.makepyfile(test_it=f"import numpy as np\nfrom renderer import *\n\n{body}")
    # In a process of its own: pytest within pytest would forget the compiler that it imports.
    return project.runpytest_subprocess(*PLUGIN, "-p", "no:cacheprovider", *options)


@pytest.mark.slow
def test_right_pictures_pass_and_wrong_ones_say_why(project: pytest.Pytester) -> None:
    result = run(
        project,
        """
def test_right(image_gate):
    case = image_gate(my_renderer(SCENE), scene=SCENE)
    assert case.verdict == "agree"

def test_gain(image_gate):
    image_gate(my_renderer(SCENE, gain=1.01), scene=SCENE)

def test_one_noisy_picture(image_gate):
    image_gate(my_renderer(SCENE, count=1, spp=1), scene=SCENE)
""",
        "-v",
    )
    result.assert_outcomes(passed=1, failed=2)
    text = result.stdout.str()
    assert "image_gate: differ: likeliest cause: constant gain of " in text
    assert "statistics: the image mean differs: " in text
    assert "gain" in text
    assert re.search(r"bias of the mean \(R, G, B\): \+(0.9|1)", text)
    assert "image_gate: inconclusive: a single picture does not show its noise" in text
    result.stdout.fnmatch_lines(
        ["E *pictures: image-gate/*/pictures.exr; page: image-gate/*/report.html"]
    )
    # The line of the test is what is shown, none of the plugin's own.
    assert "image_gate(my_renderer(SCENE, gain=1.01), scene=SCENE)" in text
    assert "pytest_plugin.py" not in text.replace("test_pytest_plugin.py", "")

    by_test = {
        name: next((project.path / "image-gate").glob(f"test_it.py-{name}-*-1"))
        for name in ("test_right", "test_gain", "test_one_noisy_picture")
    }
    names = {test: sorted(p.name for p in path.iterdir()) for test, path in by_test.items()}
    assert names["test_right"] == ["results.json"]
    kept = [f"candidate-0{k}.exr" for k in range(8)]
    written = ["case.json", "pictures.exr", "report.html", "results.json"]
    assert names["test_gain"] == sorted([*kept, *written])
    results = json.loads((by_test["test_gain"] / "results.json").read_text())
    assert results["cases"][0]["verdict"] == "differ"
    assert results["cases"][0]["scene"] == "test_it.py::test_gain"


@pytest.mark.slow
def test_references_files_and_errors(project: pytest.Pytester) -> None:
    picture = np.random.default_rng(1).uniform(0.2, 1.0, (32, 32, 3))
    np.save(project.path / "right.npy", picture)
    np.save(project.path / "small.npy", picture[1:])
    picture[3, 4, 1] = np.nan
    np.save(project.path / "nan.npy", picture)
    result = run(
        project,
        """
import pytest

RIGHT = np.load("right.npy")

def test_equal(image_gate):
    image_gate("right.npy", reference=RIGHT, noise_free=True)
    image_gate(RIGHT, reference="right.npy", noise_free=True)

def test_gain(image_gate):
    image_gate(1.02 * RIGHT, reference=RIGHT, noise_free=True)

FRAMED = RIGHT.copy()
FRAMED[:, :2] *= 0.5

def test_without_the_rim(image_gate):
    image_gate(FRAMED, reference=RIGHT, noise_free=True, rim=2)

def test_with_a_part_of_it(image_gate):
    image_gate(FRAMED, reference=RIGHT, noise_free=True, rim=1)

@pytest.mark.parametrize("file", ["nan.npy", "small.npy", "none.npy"])
def test_file(image_gate, file):
    image_gate(file, reference=RIGHT, noise_free=True)

def test_bytes(image_gate):
    image_gate(np.zeros((32, 32, 3), np.uint8), scene=SCENE)

def test_no_judge(image_gate):
    image_gate(RIGHT)

def test_no_scene(image_gate):
    image_gate(RIGHT, scene="scenes/none.yaml")
""",
    )
    result.assert_outcomes(passed=2, failed=8)
    text = result.stdout.str()
    for message in (
        "image_gate: differ: likeliest cause: constant gain of 1.02; FLIP 0.0",
        "image_gate: invalid: nothing can be said: 1 pixel of the candidate not finite",
        "image_gate: small.npy: is 32 x 31 pixels; expected 32 x 32",
        "image_gate: none.npy: there is no such file",
        "image_gate: array: holds uint8; expected floats",
        "image_gate: nothing to compare with; expected a scene, reference or baseline",
        "none.yaml: cannot be read: No such file",
    ):
        assert message in text, message


@pytest.mark.slow
def test_baselines(project: pytest.Pytester) -> None:
    body = """
def test_ball(image_gate):
    image_gate(my_renderer(SCENE, gain=GAIN, first=FIRST), baseline="ball", limit=0.01)
"""
    options = ("--image-gate-baselines", "accepted", "--image-gate-out", "seen")
    first = run(project, "GAIN, FIRST = 1.0, 100\n" + body, *options)
    first.assert_outcomes(failed=1)
    text = first.stdout.str()
    assert "image_gate: there is no baseline 'ball' in" in text
    assert "reference-rt accept " in text
    assert not (project.path / "accepted").exists()

    # What it says, done.
    kept = sorted(str(path) for path in (project.path / "seen").glob("*/candidate-*.exr"))
    assert len(kept) == 8
    arguments = [*kept, "--name", "ball", "--baselines", "accepted", "--reason", "looked at it"]
    result = invoke("accept", *arguments, "--scene", "scenes/ball.yaml")
    assert result.exit_code == 0, result.output

    second = run(
        project,
        # Other seeds: with the baseline's own the two sides would share their noise.
        "GAIN, FIRST = 1.0, 200\n"
        + body
        + body.replace("ball(", "wrong(").replace("GAIN,", "1.05,"),
        *options,
    )
    second.assert_outcomes(passed=1, failed=1)
    assert "image_gate: differ: " in second.stdout.str()
    results = json.loads(next((project.path / "seen").glob("*test_ball*/results.json")).read_text())
    assert results["provenance"]["baseline"] == "ball"
    (project.path / "scenes" / "ball.yaml").write_text(SCENE.replace("radius: 1", "radius: 1.1"))
    stale = run(project, "GAIN, FIRST = 1.0, 200\n" + body, *options)
    stale.assert_outcomes(failed=1)
    assert "the baseline 'ball' is stale: the scene 'ball' has changed" in stale.stdout.str()


@pytest.mark.slow
def test_folders_are_unique_under_xdist(project: pytest.Pytester) -> None:
    project.makepyfile(
        test_many="""
import numpy as np
import pytest

@pytest.mark.parametrize("name", ["a/b", "a b", "a-b", "a.b"])
def test_gain(image_gate, name):
    picture = np.random.default_rng(1).uniform(0.2, 1.0, (32, 32, 3))
    image_gate(1.02 * picture, reference=picture, noise_free=True)
"""
    )
    result = project.runpytest_subprocess(*PLUGIN, "-n", "2")
    result.assert_outcomes(failed=4)
    assert len(list((project.path / "image-gate").glob("*/report.html"))) == 4


def test_the_plugin_is_light(project: pytest.Pytester) -> None:
    project.makepyfile(
        test_light="""
import sys

def test_it(request):
    assert "comparisons.gate.pytest_plugin" in sys.modules
    heavy = {"numba", "scipy", "mitsuba", "numpy", "pydantic", "skimage", "PIL"}
    assert not heavy & set(sys.modules)
"""
    )
    result = project.runpytest_subprocess(*PLUGIN, "-p", "no:hypothesispytest", "-p", "no:randomly")
    result.assert_outcomes(passed=1)


def test_options_are_documented(project: pytest.Pytester) -> None:
    text = project.runpytest_subprocess(*PLUGIN, "--help").stdout.str()
    for option in ("--image-gate-out=DIR", "--image-gate-baselines=DIR"):
        assert option in text


FAILURES = """
import pytest

RIGHT = np.load("right.npy")

@pytest.mark.parametrize("how", [
    "differs", "noisy", "no file", "no scene", "broken scene", "bytes", "nan", "size", "no judge",
    "no baseline", "bad name", "two judges", "variance", "limit", "unwritable", "nothing", "text",
])
def test_it(image_gate, how):
    if how == "differs":
        image_gate(1.5 * RIGHT, reference=RIGHT, noise_free=True)
    elif how == "noisy":
        image_gate(RIGHT[None].repeat(2, 0) + NOISE, reference=list(RIGHT + 2 * NOISE[::-1]))
    elif how == "no file":
        image_gate("none.npy", reference=RIGHT)
    elif how == "no scene":
        image_gate(RIGHT, scene="none.yaml")
    elif how == "broken scene":
        image_gate(RIGHT, scene="broken.yaml")
    elif how == "bytes":
        image_gate(RIGHT.astype("u1"), reference=RIGHT)
    elif how == "nan":
        image_gate(np.nan * RIGHT, reference=RIGHT)
    elif how == "size":
        image_gate(RIGHT[1:], reference=RIGHT)
    elif how == "no judge":
        image_gate(RIGHT)
    elif how == "no baseline":
        image_gate(RIGHT, baseline="none")
    elif how == "bad name":
        image_gate(RIGHT, baseline="../none")
    elif how == "two judges":
        image_gate(RIGHT, baseline="none", reference=RIGHT)
    elif how == "variance":
        image_gate(RIGHT, reference=RIGHT, variance="none.exr")
    elif how == "limit":
        image_gate(RIGHT, reference=RIGHT, limit=2.0)
    elif how == "unwritable":
        image_gate._out = image_gate._root / "right.npy"  # a file
        image_gate(RIGHT, reference=RIGHT)
    elif how == "nothing":
        image_gate([], reference=RIGHT)
    else:
        image_gate(np.array("text"), reference=RIGHT)
"""


@pytest.mark.slow
def test_no_failure_shows_frames_of_the_gate(project: pytest.Pytester) -> None:
    """Of whatever kind it is: what is shown is the line of the test, and the message."""
    rng = np.random.default_rng(1)
    np.save(project.path / "right.npy", rng.uniform(0.2, 1.0, (32, 32, 3)))
    np.save(project.path / "noise.npy", rng.normal(0.0, 0.2, (2, 32, 32, 3)))
    (project.path / "broken.yaml").write_text("camera: {}")
    body = FAILURES.replace("RIGHT =", 'NOISE = np.load("noise.npy")\nRIGHT =', 1)
    result = run(project, body)
    result.assert_outcomes(failed=17)
    text = result.stdout.str()
    assert len(re.findall("^E +Failed: image_gate: ", text, re.MULTILINE)) == 17
    for frame in ("comparisons/", "reference_rt/", "numpy/", "During handling", "Traceback"):
        assert frame not in text.replace("image_gate needs", ""), frame
