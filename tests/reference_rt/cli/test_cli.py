"""The program: exit codes, options, and the files that it writes."""

import errno
import json
import subprocess
import sys
from unittest import mock

import numpy as np
import pytest
from builders import SCENES
from command_line import invoke

from reference_rt.core.exr import read_exr

SPHERES = str(SCENES / "spheres_whitted.yaml")
SMALL = ("--size", "16x10")


@pytest.mark.parametrize("suffix", ["exr", "png"])
def test_render(suffix, tmp_path):
    out = tmp_path / "new" / "folder" / f"out.{suffix}"
    result = invoke("render", SPHERES, "-o", out, *SMALL)
    assert result.exit_code == 0
    assert result.stdout == ""
    assert list(out.parent.iterdir()) == [out]


def test_same_scene_same_bytes(tmp_path):
    for suffix in ("exr", "png"):
        for name, threads in (("a", 1), ("b", 2)):
            done = invoke("render", SPHERES, "-o", tmp_path / f"{name}.{suffix}", *SMALL,
                       "--threads", threads)  # fmt: skip
            assert done.exit_code == 0
        assert (tmp_path / f"a.{suffix}").read_bytes() == (tmp_path / f"b.{suffix}").read_bytes()


def test_options_change_the_scene(tmp_path):
    box = SCENES / "cornell_box.yaml"
    done = invoke(
        "render", box, "-o", tmp_path / "a.exr", "--size", "7x5", "--spp", "3", "--seed", "9"
    )
    assert done.exit_code == 0
    channels, header = read_exr(tmp_path / "a.exr")
    assert channels["R"].shape == (5, 7)
    assert json.loads(header["sampler"]) == {"type": "sobol", "spp": 3, "seed": 9}
    done = invoke(
        "render", box, "-o", tmp_path / "b.exr", "--size", "7x5", "--integrator", "ray_cast"
    )
    assert done.exit_code == 0
    channels, header = read_exr(tmp_path / "b.exr")
    assert json.loads(header["integrator"])["type"] == "ray_cast"
    assert {"distance.Z", "normal.X", "id.V"} <= set(channels)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--size", "4"], "--size: expected WIDTHxHEIGHT"),
        (["--size", "axb"], "--size: expected WIDTHxHEIGHT"),
        (["--size", "-4x4"], "--size: expected WIDTHxHEIGHT"),
        (["--size", "4x4x4"], "--size: expected WIDTHxHEIGHT"),
        (["--size", "9" * 5000 + "x4"], "--size: expected WIDTHxHEIGHT"),
        (["--size", "0x4"], "--size: expected greater than or equal to 1"),
        (["--spp", "0"], "--spp: expected greater than or equal to 1"),
        (["--spp", "3"], "--spp: expected a square number of samples (1, 4, 9, ...), got 3"),
        (
            ["--integrator", "photon"],
            "--integrator: expected one of ray_cast, whitted, direct, path",
        ),
        (["--integrator", "path", "--seed", "-1"], "--seed: expected greater than or equal to 0"),
        (["-o", "picture.jpg"], "picture.jpg: '.jpg' is not supported; expected .exr or .png"),
        (["-o", "picture"], "picture: '' is not supported; expected .exr or .png"),
    ],
)
def test_wrong_usage(arguments, said, refused, tmp_path):
    line = refused(2, "render", SPHERES, "-o", str(tmp_path / "out.exr"), *arguments)
    assert line.startswith(said)


@pytest.mark.parametrize(
    "arguments",
    [[], ["nope"], ["render"], ["render", SPHERES], ["explain"], ["schema", "--deep"],
     ["render", SPHERES, "-o", "a.png", "--spp", "many"],
     ["render", SPHERES, "-o", "a.png", "--threads", "0"]],
)  # fmt: skip
def test_usage_that_the_parser_refuses(arguments, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = invoke(*arguments)
    assert result.exit_code == 2
    assert "Traceback" not in result.output
    assert list(tmp_path.iterdir()) == []


def test_unwritable_outputs(refused, tmp_path):
    """Found before rendering, which nobody then waits for in vain."""
    file, folder = tmp_path / "file", tmp_path / "folder.png"
    file.write_text("a file")
    folder.mkdir()
    said = refused(3, "render", SPHERES, "-o", str(file / "out.exr"))
    assert said.startswith(f"{file}/out.exr: cannot be written: ")
    said = refused(3, "render", SPHERES, "-o", str(folder))
    assert said == f"{folder}: is a folder; expected the name of a file"
    said = refused(3, "render", SPHERES, "-o", str(tmp_path / ("long" * 100 + ".png")))
    assert "File name too long" in said
    assert file.read_text() == "a file"


def test_a_huge_picture(refused, tmp_path):
    said = refused(
        3, "render", SPHERES, "-o", str(tmp_path / "a.exr"), "--size", "99999999x99999999"
    )
    assert said.startswith(f"{SPHERES}:3: film: 99999999 x 99999999 pixels need ")


def test_pixels_that_are_not_finite(tmp_path):
    """They are written, told, and the exit code says so: four times 1e308 overflows."""
    scene, out = tmp_path / "bright.yaml", tmp_path / "out.exr"
    scene.write_text(
        "camera: {type: orthographic}\n"
        "film: {width: 4, height: 4}\n"
        "sampler: {type: sobol, spp: 4}\n"
        "materials: {sun: {type: emissive, radiance: 1.0e+308}}\n"
        "shapes: [{type: rectangle, material: sun, transform: [{scale: 5}]}]\n"
    )
    result = invoke("render", scene, "-o", out)
    assert result.exit_code == 3
    assert result.stderr.splitlines()[-1] == (
        f"error: {out}: 16 pixels are not finite; "
        "(column, row): (0, 0), (1, 0), (2, 0), (3, 0), ..."
    )
    assert np.isinf(read_exr(out)[0]["R"]).all()


@pytest.mark.parametrize("command", [[], ["render"], ["explain"], ["schema"]])
def test_help(command):
    result = invoke(*command, "--help")
    assert result.exit_code == 0
    assert "Usage" in result.stdout
    assert result.stderr == ""


def test_an_internal_error_is_one_line(refused, monkeypatch, tmp_path):
    monkeypatch.setattr("reference_rt.rendering.scene.Scene.load", lambda *_: 1 / 0)
    result = invoke("explain", SPHERES)
    assert result.exit_code == 5
    assert result.stderr == (
        "error: internal error: ZeroDivisionError: division by zero; please report it\n"
    )


@pytest.mark.parametrize("error", [MemoryError(), OSError(errno.ENOMEM, "no memory")])
def test_what_does_not_fit_into_memory(refused, monkeypatch, error):
    monkeypatch.setattr("reference_rt.rendering.scene.Scene.load", mock.Mock(side_effect=error))
    result = invoke("explain", SPHERES)
    assert result.exit_code == 3
    assert "the scene does not fit into memory, which is limited to" in result.stderr


def test_schema_is_json():
    assert json.loads(invoke("schema").stdout)["title"] == "Scene"


def test_an_error_that_an_interruption_causes():
    """LLVM drops Python's exception, and fails for want of what its callback should have made."""
    code = """
import os, signal
signal.signal(signal.SIGINT, signal.default_int_handler)
from reference_rt.cli import main as program

@program.app.command()
@program.guarded
def fail():
    try:
        os.kill(os.getpid(), signal.SIGINT)
    except KeyboardInterrupt:
        pass
    raise RuntimeError("no compiled object yet")

program.main()
"""
    done = subprocess.run(
        [sys.executable, "-c", code, "fail"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 130
    assert done.stderr == "error: interrupted; nothing unfinished was written\n"
