"""`reference-rt derivative` and `explain --parameters`: files, numbers, words, errors."""

import json
from pathlib import Path

import numpy as np
import pytest
from builders import SCENES
from command_line import invoke

from reference_rt import Scene, derivative, read_image
from reference_rt.cli import derivative as command
from reference_rt.scene.parameters import parameters

OUTLINE = SCENES / "truth" / "sphere_outline.yaml"
SMALL = ("--size", "8x6", "--spp", "64")


def test_it_writes_files_and_prints_numbers(tmp_path: Path) -> None:
    file = tmp_path / "new" / "d.exr"
    done = invoke("derivative", OUTLINE, "shapes[0].radius", "-o", file, "--json", *SMALL)
    assert done.exit_code == 0, done.output
    assert [*file.parent.iterdir()] == [file]
    numbers = json.loads(done.stdout)
    expected = derivative(OUTLINE, "shapes[0].radius", size=(8, 6), spp=64)
    assert numbers["mean"] == expected.replicates.mean(axis=(1, 2)).mean(axis=0).tolist()
    assert numbers["parameter"] == "shapes[0].radius"
    assert (numbers["value"], numbers["step"], numbers["side"]) == (0.7, 2.0**-9, "central")
    assert (numbers["spp"], numbers["replicates"]) == (64, 16)
    read = read_image(file, "truncation")
    assert np.array_equal(read, expected.truncation.astype(np.float32))
    assert "by shapes[0].radius, step 0.00195312: mean" in done.stderr
    assert all(f"warning: {text}" in done.stderr for text in numbers["warnings"])


def test_same_bytes_for_any_number_of_threads(tmp_path: Path) -> None:
    for suffix in ("exr", "png"):
        for threads in (1, 2):
            out = tmp_path / f"{threads}.{suffix}"
            done = invoke(
                "derivative", OUTLINE, "camera.fov", "-o", out, "--threads", threads, *SMALL
            )
            assert done.exit_code == 0
        assert (tmp_path / f"1.{suffix}").read_bytes() == (tmp_path / f"2.{suffix}").read_bytes()


def test_a_value_at_its_bound_is_said() -> None:
    done = invoke("derivative", OUTLINE, "camera.near", "--json", *SMALL)
    assert json.loads(done.stdout)["side"] == "forward"
    assert "forward (the value is at a bound)" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("shapes[0].radiu", "--json"), "did you mean 'radius'"),
        (("shapes[0].radius", "--json", "--step", "0.5"), "crosses a bound"),
        (("shapes[0].radius", "--json", "--step", "-1"), "expected a number above 0"),
        (("shapes[0].radius", "-o", "d.jpg"), "expected .exr or .png"),
        (("shapes[0].radius",), "expected --output, --json or both"),
    ],
)
def test_wrong_usage_is_one_line(
    arguments: tuple[str, ...], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    done = invoke("derivative", OUTLINE, *arguments, *SMALL)
    assert done.exit_code == 2
    assert said in done.output
    assert len(done.output.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_an_interruption_writes_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(command, "differentiated", interrupted)
    done = invoke("derivative", OUTLINE, "camera.fov", "-o", tmp_path / "d.exr", *SMALL)
    assert done.exit_code == 130
    assert "nothing unfinished was written" in done.output
    assert list(tmp_path.iterdir()) == []


def test_explain_lists_what_can_be_asked() -> None:
    done = invoke("explain", "--parameters", OUTLINE)
    listed = [line.partition(" = ")[0] for line in done.stdout.splitlines()]
    assert listed == [one.path for one in parameters(Scene.load(OUTLINE))]
    assert "shapes[0].radius = 0.7" in done.stdout


def test_the_numbers_of_a_mesh_are_counted(tmp_path: Path) -> None:
    path = tmp_path / "mesh.yaml"
    corners = [[k, k * k, 0] for k in range(9)]
    path.write_text(f"shapes: [{{type: mesh, vertices: {corners}, faces: [[0, 1, 2]]}}]\n")
    lines = invoke("explain", "--parameters", path).stdout.splitlines()
    assert sum("vertices" in line for line in lines) == 12
    assert "  and 15 more numbers of it" in lines
