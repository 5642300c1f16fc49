"""Baselines: accepted with a reason, never in CI; edited and stale ones are refused."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import invoke
from typer.testing import Result

from comparisons.gate import baselines
from comparisons.gate.baselines import BaselineEditedError, BaselineMissingError
from comparisons.gate.digest import scene_digest
from reference_rt.core.arrays import FloatArray
from reference_rt.core.exr import write_exr
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import UsageError

SCENE = """\
film: {width: 8, height: 6}
sampler: {type: sobol, spp: 4}
materials: {grey: {type: diffuse, reflectance: 0.5}}
shapes: [{type: sphere, radius: 1, material: grey}]
lights: [{type: constant, radiance: 1}]
"""


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working folder is the test's own, and it is not CI's."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("CI", raising=False)
    (tmp_path / "scene.yaml").write_text(SCENE)
    return tmp_path


@pytest.fixture
def files() -> list[str]:
    """Four replicates."""
    rng = np.random.default_rng(1)
    names = [f"c{k}.exr" for k in range(4)]
    for k, name in enumerate(names):
        write(name, rng.uniform(0.5, 1.5, (6, 8, 3)), {"software": "mine 2.1", "seed": str(k)})
    return names


def write(name: str, picture: FloatArray, header: dict[str, str] | None = None) -> None:
    planes = {channel: picture[..., k] for k, channel in enumerate("RGB")}
    write_exr(Path(name), planes, header or {})


def run(*arguments: str) -> Result:
    return invoke("accept", *arguments)


def accepted(files: list[str], *more: str) -> Result:
    return run(*files, "--name", "ball", "--reason", "looks right", *more)


def record() -> Any:
    return json.loads(Path("baselines/ball/baseline.json").read_text())


def test_what_is_accepted_comes_back(files: list[str]) -> None:
    result = accepted(files, "--scene", "scene.yaml")
    assert result.exit_code == 0, result.output
    assert "baselines/ball: accepted" in result.output
    pictures = np.stack([_read(name) for name in files])
    found = baselines.load(Path("baselines"), "ball").reference()
    np.testing.assert_array_equal(found.pictures, pictures)
    assert not found.noise_free
    written = record()
    assert written["reason"] == "looks right"
    assert (written["width"], written["height"], written["replicates"]) == (8, 6, 4)
    assert written["scene"]["file"] == "scene.yaml"
    assert written["sources"][2]["header"]["software"] == "mine 2.1"
    assert written["sources"][2]["header"]["seed"] == "2"
    assert set(written["versions"]) == {"reference_rt", "numpy", "numba", "python"}
    assert written["machine"]
    assert written["date"].startswith("20")
    assert set(written["files"]) == {f"picture-0{k}.exr" for k in range(4)}
    assert sorted(p.name for p in Path("baselines").iterdir()) == ["ball"]


def _read(name: str) -> FloatArray:
    from comparisons.gate.pictures_in import read_candidate

    return read_candidate(Path(name)).radiance


def test_of_many_pictures_groups_are_kept() -> None:
    pictures = np.random.default_rng(1).uniform(0.5, 1.5, (20, 6, 8, 3))
    names = [f"c{k:02d}.exr" for k in range(20)]
    for name, picture in zip(names, pictures, strict=True):
        write(name, picture)
    assert accepted(names).exit_code == 0
    found = baselines.load(Path("baselines"), "ball").reference().pictures
    assert len(found) == baselines.MOST_KEPT
    np.testing.assert_allclose(found[0], pictures[:3].mean(axis=0), rtol=1e-6)
    np.testing.assert_allclose(found[7], pictures[18:].mean(axis=0), rtol=1e-6)
    assert record()["replicates"] == 20


def test_one_picture_has_no_variance(files: list[str]) -> None:
    result = accepted(files[:1])
    assert result.exit_code == 0
    assert "note: the noise of a single picture is unknown" in result.output
    assert set(record()["files"]) == {"picture-00.exr"}
    assert not baselines.load(Path("baselines"), "ball").reference().noise_free
    assert "note" not in accepted(files[:1], "--noise-free").output
    assert baselines.load(Path("baselines"), "ball").reference().noise_free


def test_a_former_one_is_remembered(files: list[str]) -> None:
    accepted(files)
    old = record()
    assert run(files[0], "--name", "ball", "--reason", "lamp moved").exit_code == 0
    (former,) = record()["history"]
    assert former == {key: old[key] for key in ("date", "reason", "files")}
    assert sorted(p.name for p in Path("baselines/ball").iterdir()) == [
        "baseline.json",
        "picture-00.exr",
    ]


@pytest.mark.parametrize("value", ["true", "1", "yes"])
def test_never_in_ci(files: list[str], monkeypatch: pytest.MonkeyPatch, value: str) -> None:
    monkeypatch.setenv("CI", value)
    result = accepted(files)
    assert result.exit_code == 2
    assert "baselines cannot be accepted in CI" in result.output
    assert not Path("baselines").exists()


def test_ci_that_is_off_is_none(files: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CI", "false")
    assert accepted(files).exit_code == 0


def test_what_is_not_accepted(files: list[str]) -> None:
    picture = np.ones((6, 8, 3))
    write("black.exr", 0.0 * picture)
    write("other.exr", np.ones((6, 9, 3)))
    picture[3, 4, 1] = np.nan
    write("nan.exr", picture)
    for arguments, code, message in (
        (
            [files[0], "--name", "../x", "--reason", "r"],
            2,
            "'../x' is not a valid name of a baseline",
        ),
        ([files[0], "--name", ".hidden", "--reason", "r"], 2, "'.hidden' is not a valid name"),
        ([files[0], "--name", "ball", "--reason", "  "], 2, "--reason: is empty; expected why"),
        ([files[0], "--name", "ball"], 2, "with --name and --reason"),
        (["--name", "ball", "--reason", "r"], 2, "expected CANDIDATE..."),
        (["nan.exr", "--name", "ball", "--reason", "r"], 3, "1 pixel is not finite"),
        (["black.exr", "--name", "ball", "--reason", "r"], 3, "is black throughout"),
        ([*files, "other.exr", "--name", "b", "--reason", "r"], 3, "is 9 x 6 pixels; expected 8"),
        (["other.exr", "--scene", "scene.yaml", "--name", "b", "--reason", "r"], 3, "size of the"),
        (
            [*files, "--noise-free", "--name", "ball", "--reason", "r"],
            2,
            "4 candidates without noise",
        ),
        (["none.exr", "--name", "ball", "--reason", "r"], 3, "there is no such file"),
        (["--list", "--name", "ball"], 2, "--list and --unused write no baseline"),
    ):
        result = run(*arguments)
        assert (result.exit_code, message in result.output) == (code, True), result.output
    assert not Path("baselines").exists()


@pytest.mark.parametrize(
    "edit", ["picture", "bit", "missing", "reason", "digest", "field", "rubbish"]
)
def test_edited_by_hand(files: list[str], edit: str) -> None:
    accepted(files, "--scene", "scene.yaml")
    folder = Path("baselines/ball")
    if edit == "picture":
        write(str(folder / "picture-00.exr"), np.ones((6, 8, 3)))
    elif edit == "bit":
        content = bytearray((folder / "picture-03.exr").read_bytes())
        content[-1] ^= 1
        (folder / "picture-03.exr").write_bytes(content)
    elif edit == "missing":
        (folder / "picture-03.exr").unlink()
    elif edit == "rubbish":
        (folder / "baseline.json").write_text("rubbish")
    else:
        written = record()
        if edit == "reason":
            written["reason"] = "looks better"
        elif edit == "digest":
            written["files"]["picture-00.exr"] = "0" * 64
        else:
            del written["seal"], written["files"]
        (folder / "baseline.json").write_text(json.dumps(written))
    with pytest.raises(
        BaselineEditedError, match=r"has changed since .*accepte?d?.*; restore it, or acc"
    ):
        baselines.load(Path("baselines"), "ball").reference()
    assert BaselineEditedError.exit_code == 3
    # Accepting anew is the way out.
    assert accepted(files).exit_code == 0
    baselines.load(Path("baselines"), "ball").reference()


@pytest.mark.parametrize("name", ["../ball2/picture-00.exr", "/etc/passwd", "a/../picture-00.exr"])
def test_a_strangers_one_names_files_beside_it(files: list[str], name: str) -> None:
    accepted(files)
    found = baselines.load(Path("baselines"), "ball")
    named = found.record.model_copy(update={"files": {name: "0" * 64}})
    with pytest.raises(BaselineEditedError, match="expected names like picture-00"):
        baselines.Baseline(named, found.folder).reference()


def test_a_missing_one_says_how_it_is_accepted() -> None:
    with pytest.raises(BaselineMissingError, match="there is no baseline 'ball' in") as caught:
        baselines.load(Path("baselines"), "ball", ["out/a b.exr"])
    told = "reference-rt accept 'out/a b.exr' --name ball --baselines baselines --reason"
    assert told in str(caught.value)
    assert caught.value.exit_code == 4
    with pytest.raises(UsageError, match="is not a valid name of a baseline"):
        baselines.load(Path("baselines"), "../scene")


def test_a_stale_one_is_refused(files: list[str]) -> None:
    accepted(files, "--scene", "scene.yaml")
    found = baselines.load(Path("baselines"), "ball")
    baselines.check_fresh(found, scene_digest(Scene.load("scene.yaml")), "the scene")
    Path("scene.yaml").write_text(SCENE.replace("radius: 1", "radius: 2"))
    with pytest.raises(BaselineMissingError, match="is stale: the scene has changed since it was"):
        baselines.check_fresh(found, scene_digest(Scene.load("scene.yaml")), "the scene")


def test_list_and_unused(files: list[str]) -> None:
    assert run("--list").output == ""
    accepted(files, "--scene", "scene.yaml")
    run(files[0], "--name", "other", "--reason", "why not")
    told = run("--list").output.splitlines()
    assert len(told) == 2
    assert told[0].startswith("ball: 20")
    assert ": scene.yaml: 4 pictures of 8 x 6: looks right" in told[0]
    assert ": no scene: 1 picture of 8 x 6: why not" in told[1]
    Path("scene.yaml").write_text(SCENE.replace("radius: 1", "radius: 2"))
    assert ": scene.yaml (stale): " in run("--list").output
    Path("scene.yaml").write_text("rubbish")
    assert ": scene.yaml (cannot be read): " in run("--list").output
    Path("scene.yaml").unlink()
    assert ": scene.yaml (not found): " in run("--list").output

    for k, used in enumerate(({"baseline": "ball"}, {}, None)):
        path = Path(f"out/{k}/results.json")
        path.parent.mkdir(parents=True)
        path.write_text(json.dumps({"provenance": used}))
    result = run("--unused", "out")
    assert result.exit_code == 1
    assert result.output.startswith("other: 20")
    assert len(result.output.splitlines()) == 1
    Path("out/1/results.json").write_text(json.dumps({"provenance": {"baseline": "other"}}))
    result = run("--unused", "out")
    assert (result.exit_code, result.output) == (0, "")


def test_the_digest_is_of_what_the_picture_depends_on(here: Path) -> None:
    first = scene_digest(Scene.parse(SCENE))
    same = SCENE.replace("spp: 4", "spp: 64") + "hierarchy: none\ndescription: a ball\n"
    assert scene_digest(Scene.parse(same)) == first
    assert scene_digest(Scene.parse(SCENE.replace("radius: 1", "radius: 2"))) != first
    grid = SCENE.replace("sobol", "grid") + "integrator: {type: whitted}\n"
    point = "{type: point, position: [0, 3, 0], intensity: 1}"
    lamp = grid.replace("whitted", "direct").replace("{type: constant, radiance: 1}", point)
    for text in (grid, lamp):
        assert scene_digest(Scene.parse(text)) != scene_digest(
            Scene.parse(text.replace("spp: 4", "spp: 16"))
        )
    with_file = SCENE.replace("type: sphere, radius: 1", "type: mesh, file: m.gltf")
    digests = set()
    for mesh, buffer in (("{}", b"1"), ('{"uri": "b.bin"}', b"1"), ('{"uri": "b.bin"}', b"2")):
        (here / "m.gltf").write_text(mesh)
        (here / "b.bin").write_bytes(buffer)
        digests.add(scene_digest(Scene.parse(with_file, folder=here)))
    assert len(digests) == 3


@pytest.mark.parametrize(
    ("count", "noise", "limit", "told"),
    [
        (4, 0.3, "0.005", True),
        (4, 0.3, "0.9", False),
        (8, 0.001, "0.005", False),
        (8, 0.001, "0.0005", True),  # below the margin
    ],
)
def test_too_few_pictures_for_the_limit_are_told(
    count: int, noise: float, limit: str, told: bool
) -> None:
    rng = np.random.default_rng(3)
    names = [f"n{k}.exr" for k in range(count)]
    for name in names:
        write(name, 1.0 + noise * rng.standard_normal((16, 16, 3)))
    output = accepted(names, "--limit", limit).output
    assert (f"a limit of {100 * float(limit):g} % cannot be reached with" in output) == told, output
    if told and float(limit) > 0.001:
        assert "even with a candidate without noise, a bias below" in output
        assert "times the replicates of the reference, or " in output


def test_a_scene_of_another_size(files: list[str]) -> None:
    """The size is remembered: the scene of the baseline is the one that was shown."""
    for k in range(4):
        write(f"s{k}.exr", np.random.default_rng(k).uniform(0.5, 1.5, (3, 4, 3)))
    small = [f"s{k}.exr" for k in range(4)]
    assert accepted(small, "--scene", "scene.yaml").exit_code == 3
    assert accepted(small, "--size", "4x3").exit_code == 2
    assert accepted(small, "--scene", "scene.yaml", "--size", "4x3", "--spp", "9").exit_code == 0
    found = baselines.load(Path("baselines"), "ball")
    scene = baselines.scene_of(found.record, Path("baselines"))
    assert scene is not None
    assert (scene.film.width, scene.film.height) == (4, 3)
    baselines.check_fresh(found, scene_digest(scene), "the scene")
    assert "(stale)" not in run("--list").output
