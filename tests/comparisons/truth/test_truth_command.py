"""`reference-rt truth`, and `reference-rt gate --truth`."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from command_line import invoke
from PIL import Image

from comparisons.truth.case import AREAS, cases
from comparisons.truth.outputs import Row, exit_code, markdown, scores
from comparisons.truth.renderers import load, ours

SCENES = Path(__file__).parents[3] / "scenes" / "truth"
CASE = cases()["perspective"]

RENDERER = """
import sys
import numpy as np
from pathlib import Path
from comparisons.truth.case import cases
scene, output, seed = sys.argv[1:]
name = Path(scene).stem
if name == "glass_reflection":
    sys.exit("glass is not supported")
pixels = np.nan_to_num(cases()[name].compute().pixels)
factor = 0.5 if name == "glass_boundary" else 1.0
rng = np.random.default_rng(int(seed))
np.save(output, factor * pixels * (1.0 + 1e-3 * rng.normal(size=pixels.shape)))
"""


@pytest.fixture
def run(tmp_path, monkeypatch):
    """Run a command in a folder of its own; its exit code and its output."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scenes").mkdir()
    (tmp_path / "scenes" / "truth").symlink_to(SCENES)

    def call(*arguments):
        found = invoke(*arguments)
        return found.exit_code, " ".join(found.output.split())

    return call


def results(folder="out"):
    return json.loads((Path(folder) / "results.json").read_text())


def test_truth_writes_its_outputs(run):
    Path("page.md").write_text("<!-- truth -->\n<!-- end -->\n")
    code, output = run(
        "truth", "perspective", "point_over_*", "--renderer", "ours", "--spp", 64,
        "--out", "out", "--markdown", "page.md",
    )  # fmt: skip
    assert code == 0, output
    document = results()
    assert [row["case"] for row in document["rows"]] == [
        "perspective", "point_over_floor", "point_over_slope"
    ]  # fmt: skip
    for row in document["rows"]:
        assert row["status"] == "right"
        assert abs(np.array(row["value"]) / row["expected"] - 1.0).max() < 0.01
        assert row["errors"] < row["threshold"]
    assert document["areas"] == [["rays", "ours", 1, 1], ["photometry", "ours", 2, 2]]
    assert document["false_alarm"] == 1e-4
    assert "truth: 3 of 3" in Path("out/truth-ours.svg").read_text()
    page = Path("page.md").read_text()
    assert f"(pictures/truth/perspective.png) | `perspective`: {CASE.tests}<br>" in page
    assert f"{CASE.formula}<br>{CASE.derivation}<br>ours: " in page


def test_the_page_in_a_browser(run, check_page):
    np.save("a.npy", CASE.compute().pixels / 2.0)
    run("gate", "--truth", "perspective", "a.npy")
    check_page(Path("out/report.html").absolute())


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["truth", "nothing"], "there is no case 'nothing'; expected all, a pattern"),
        (
            ["truth", "--renderer", "pbrt"],
            "--renderer: expected ours, mitsuba, both, cycles or povray",
        ),
        (["gate", "--truth", "nothing", "a.npy"], "--truth: there is no case 'nothing'"),
        (["gate", "--truth", "all", "a.npy"], "is 166 cases; expected one, or --command"),
        (["gate", "--truth", "slab"], "expected either candidates, --command, --browser or --pair"),
        (
            ["gate", "--truth", "slab", "a.npy", "--scene", "x.yaml"],
            "--scene: does not apply to --truth",
        ),
        (["gate", "--truth", "slab", "a.npy", "--rim", 2], "--rim: does not apply to --truth"),
        (["gate", "--truth", "slab", "--command", "prog"], "--command: has no {output}"),
    ],
)
def test_wrong_usage(run, arguments, words):
    code, output = run(*arguments)
    assert code == 2
    assert words in output


@pytest.mark.parametrize("kind", ["float", "noisy", "half-bright", "8 bits", "another size"])
def test_pictures_against_the_formula(run, kind):
    pixels = CASE.compute().pixels
    rng = np.random.default_rng(1)
    files, expected = ["a.npy"], ("right", 0)
    if kind == "noisy":
        noise = rng.normal(0.0, 0.02, (4, *pixels.shape))
        np.save("a.npy", pixels + noise)
    elif kind == "half-bright":
        np.save("a.npy", pixels / 2.0)
        expected = ("off", 1)
    elif kind == "8 bits":
        Image.fromarray(np.uint8(pixels.clip(0, 1) * 255)).save("a.png")
        files, expected = ["a.png"], ("invalid", 3)
    elif kind == "another size":
        np.save("a.npy", pixels[:-1])
        expected = ("invalid", 3)
    else:
        np.save("a.npy", pixels.astype(np.float32))
    code, output = run("gate", "--truth", "perspective", *files)
    (row,) = results()["rows"]
    assert (row["status"], code) == expected, output


def test_a_score_card_of_a_renderer(run):
    """Right, half as bright, and one that it cannot do: each case has its verdict."""
    Path("renderer.py").write_text(RENDERER)
    command = f"{sys.executable} renderer.py {{scene}} {{output}} {{seed}}"
    code, output = run(
        "gate", "--truth", "glass_*n*", "--command", command, "--suffix", ".npy",
        "--replicates", 2,
    )  # fmt: skip
    document = results()
    found = {row["case"]: row["status"] for row in document["rows"]}
    assert found == {
        "glass_furnace": "right",
        "glass_reflection": "not run",
        "glass_boundary": "off",
        "glass_from_inside": "right",
    }, output
    assert document["areas"] == [["materials", "candidate", 2, 4]]
    assert "glass is not supported" in output
    assert "2 of 4" in output
    assert code == 4


def test_exit_codes_and_scores():
    def row(status, renderer="ours"):
        return Row(CASE, renderer, status, "why")

    assert exit_code([]) == 4
    assert exit_code([row("right"), row("not comparable")]) == 0
    for status, code in (("off", 1), ("noisy", 1), ("invalid", 3), ("not run", 4)):
        assert exit_code([row("right"), row("off"), row(status)]) == code
    rows = [row("right"), row("off", "mitsuba"), row("not comparable", "other")]
    assert scores(rows) == [("rays", "ours", 1, 1), ("rays", "mitsuba", 0, 1)]
    text = markdown(rows, {"machine": "m", "cores": 2, "date": "2026-11-25T00:00"})
    assert f"| {AREAS['rays']} | 1 of 1 | 0 of 1 |  |" in text


def test_the_fixture_of_pytest(truth_gate, tmp_path):
    """Right pictures pass, as arrays and as files; others fail with the reason."""
    scene = load(SCENES / "point_over_floor.yaml", 16)
    pictures = ours(scene)
    truth_gate("point_over_floor", pictures)
    paths = [tmp_path / f"{k}.npy" for k in range(len(pictures))]
    for path, picture in zip(paths, pictures, strict=True):
        np.save(path, picture)
    truth_gate("point_over_floor", paths)
    for wrong in (0.9 * pictures, [*paths[:2], tmp_path / "dim.npy"]):
        np.save(tmp_path / "dim.npy", 0.5 * pictures[0])
        with pytest.raises(pytest.fail.Exception, match=r"point_over_floor: (off|noisy)"):
            truth_gate("point_over_floor", wrong)
