"""`reference-rt warm-up`: what is compiled is kept, counted, and found by the next process."""

import io
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numba
import pytest
from builders import SCENES
from rich.console import Console

import reference_rt as rt
from reference_rt.cli.explain import kernels_of
from reference_rt.cli.warm_up import CountBar
from reference_rt.rendering.kernels import cost
from reference_rt.rendering.warm_up import all_calls, picture_calls

pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")

_FEW = """
import signal; signal.signal(signal.SIGINT, signal.default_int_handler)
import reference_rt as rt
import reference_rt.cli.warm_up as command
from reference_rt.rendering.kernels import cost
from reference_rt.rendering.warm_up import picture_calls

scenes = [rt.Scene(shapes=(rt.Sphere(),), integrator=i()) for i in (rt.Path, rt.Direct, rt.Whitted)]
calls = {{call for scene in scenes for call in picture_calls(scene)}}
in_order = sorted(calls, key=lambda c: (-cost(c), c[0].__name__, str(c[1])))
command.all_calls = lambda: in_order[{first}:]
from reference_rt.cli.main import main; main()
"""
"""The program, to which the linked kernels of three small scenes are all that there are; from
number `first` on, of which the last take least time."""

_COUNTS = r"(\S+): (\d+) kernels compiled, (\d+) were in the cache, \d+\.\d s\n"


def program(folder, *arguments, first=0, **environment):
    return [sys.executable, "-c", _FEW.format(first=first), *map(str, arguments)], {
        **os.environ,
        "REFERENCE_RT_CACHE": str(folder),
        **environment,
    }


def warm_up(folder, *arguments, first=-4, **environment):
    command, env = program(folder, "warm-up", *arguments, first=first, **environment)
    return subprocess.run(command, env=env, capture_output=True, text=True, check=False)


def counts(done):
    assert done.returncode == 0, done.stderr
    folder, compiled, cached = re.fullmatch(_COUNTS, done.stdout).groups()
    return folder, int(compiled), int(cached)


@pytest.mark.slow
@pytest.mark.parametrize("threads", ["1", "2"])
def test_what_is_compiled_is_kept(threads, tmp_path):
    done = warm_up(tmp_path, "--threads", threads)
    folder, compiled, cached = counts(done)
    assert (compiled, cached) == (4, 0)
    assert folder.startswith(str(tmp_path))
    kept = sorted(Path(folder).iterdir())
    assert len(kept) == 4
    assert done.stderr == "compiling 4 kernels\n"
    again = warm_up(tmp_path, "--threads", threads)
    assert counts(again) == (folder, 0, 4)
    assert again.stderr == ""
    assert sorted(Path(folder).iterdir()) == kept


SPHERE = """\
shapes: [{type: sphere}]
integrator: {type: ray_cast}
film: {width: 4, height: 4}
"""


@pytest.mark.slow
def test_the_kernels_of_a_scene(tmp_path):
    """After that `explain` says so, and a render compiles nothing."""
    scene, folder = tmp_path / "scene.yaml", tmp_path / "cache"
    scene.write_text(SPHERE)
    explain, env = program(folder, "explain", scene, COLUMNS="200")

    def explained():
        page = subprocess.run(explain, env=env, capture_output=True, text=True, check=True).stdout
        (compiled,) = re.findall(r"^ compiled +(\d+ of \d+)", page, re.MULTILINE)
        return compiled

    needed = len(picture_calls(rt.Scene.load(scene)))
    assert explained() == f"0 of {needed}"
    own, compiled, _ = counts(warm_up(folder, scene))
    assert compiled >= needed
    assert explained() == f"{needed} of {needed}"
    before = sorted(Path(own).iterdir())
    command, env = program(folder, "render", scene, "-o", tmp_path / "out.png")
    subprocess.run(command, env=env, capture_output=True, check=True)
    assert sorted(Path(own).iterdir()) == before


def test_a_scene_that_is_wrong(tmp_path):
    scene = tmp_path / "scene.yaml"
    scene.write_text("shapes: [{type: cube}]")
    done = warm_up(tmp_path / "cache", scene)
    assert done.returncode == 3
    assert done.stderr.startswith(f"error: {scene}:1: shapes[0]")
    assert done.stdout == ""


def test_a_cache_that_cannot_be_written(tmp_path):
    file = tmp_path / "file"
    file.write_text("")
    done = warm_up(file / "cache")
    assert (done.returncode, done.stdout) == (3, "")
    assert done.stderr == (
        f"error: kernels cannot be kept: {file}/cache/kernels/kernel: cannot be written: {file} "
        "is a file; expected a folder (REFERENCE_RT_CACHE selects another)\n"
    )


def test_without_a_compiler(tmp_path):
    done = warm_up(tmp_path, NUMBA_DISABLE_JIT="1")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("error: NUMBA_DISABLE_JIT is set")


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere there is one process")
def test_ctrl_c_keeps_what_is_compiled(tmp_path):
    command, env = program(tmp_path, "warm-up", "--threads", "2")
    process = subprocess.Popen(command, env=env, stdout=-1, stderr=-1, text=True)
    while process.poll() is None and not [*tmp_path.glob("kernels/*/tiles.render_tile-*")]:
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    output, errors = process.communicate(timeout=600)
    assert process.returncode == 130
    assert output == ""
    lines = errors.splitlines()
    assert lines[0].startswith("compiling ")
    assert lines[1:] == ["error: interrupted; nothing unfinished was written"]
    assert [*tmp_path.glob("kernels/*/tiles.render_tile-*")]


@pytest.mark.slow
def test_a_bar_with_a_count():
    """Its fraction is that of the time, of which the first kernels take most."""
    written = io.StringIO()
    calls = all_calls()
    half = sum(map(cost, calls)) / 2
    done, spent = 0, 0.0
    while spent < half:
        spent += cost(calls[done])
        done += 1
    assert done < len(calls) / 4
    bar = CountBar(Console(file=written, force_terminal=True, width=120))
    with bar:
        bar.begin(calls)
        bar(done, len(calls))
        bar._bar.refresh()
        (task,) = bar._bar.tasks
        assert 50 <= task.percentage < 52
        bar(len(calls), len(calls))
        assert task.percentage == pytest.approx(100, rel=1e-12)  # a sum of hundreds of numbers
    assert f"compiling {done + 1} of {len(calls)}" in written.getvalue()


@pytest.mark.parametrize("name", ["csg_mesh", "instances", "textured_room", "whitted_classic"])
def test_the_kernels_of_a_scene_in_words(name):
    """Every type that the scene has is named, and no operation by an empty word."""
    scene = rt.Scene.load(SCENES / f"{name}.yaml")
    lines = dict(kernels_of(scene))
    fields = [field for field, t in scene.tables.geometry.shapes._asdict().items() if t is not None]
    assert fields
    assert {*fields, "geometry", "compiled"} <= set(lines)
    assert any(what.startswith("driver of ") for what in lines)
    for words in lines.values():
        assert all(part.strip() for part in words.split(","))
        assert "_" not in words
