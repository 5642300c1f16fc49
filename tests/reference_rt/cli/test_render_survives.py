"""Renders that are killed at any moment go on where they were, and end with the same file."""

import random
import re
import shutil
import signal
import subprocess
import sys

import pytest
from builders import SCENES
from command_line import invoke

PROGRAM = (
    # A shell's background jobs, and their children, are born deaf to Ctrl-C.
    "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
    "import sys, reference_rt.util.console as c\n"
    "call = c.ProgressLine.__call__\n"
    "def say(self, what, fraction):\n"
    "    call(self, what, fraction)\n"
    "    if what == 'render': print(fraction, flush=True)\n"
    "c.ProgressLine.__call__ = say\n"
    "from reference_rt.cli.main import main; main()"
)
BOX = str(SCENES / "cornell_box.yaml")


def start(*arguments):
    """A render, and the fraction that it had when it began to render."""
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, "render", BOX, *map(str, arguments)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    return process, float(process.stdout.readline() or "nan")


def killed(times, tmp_path, arguments, most):
    """Kill a render so often, after up to `most` tenths of a second of rendering, and return the
    fractions that it began with."""
    choose, begun = random.Random(24), []
    for _ in range(times):
        process, fraction = start(*arguments)
        begun.append(fraction)
        for _ in range(choose.randrange(most)):
            process.stdout.readline()
        process.kill()
        process.communicate(timeout=600)
    return begun


@pytest.mark.slow
@pytest.mark.parametrize(("times", "size", "most"), [(3, "256x256", 40), (50, "512x512", 25)])
def test_killed_at_any_moment(times, size, most, tmp_path):
    out, expected = tmp_path / "out.exr", tmp_path / "expected.exr"
    options = ("--size", size, "--spp", 48)
    assert invoke("render", BOX, "-o", expected, *options, "--no-checkpoint").exit_code == 0
    arguments = ("-o", out, *options, "--checkpoint", tmp_path / "stored")
    begun = killed(times, tmp_path, arguments, most)
    assert begun == sorted(begun)
    assert begun[-1] > 0.0
    process, _ = start(*arguments)
    _, errors = process.communicate(timeout=600)
    assert process.returncode == 0, errors
    assert out.read_bytes() == expected.read_bytes()


@pytest.mark.slow
def test_interrupted_and_resumed(tmp_path):
    """Ctrl-C stores what there is; --resume needs it."""
    out, expected, stored = tmp_path / "out.exr", tmp_path / "expected.exr", tmp_path / "stored"
    options = ("--size", "128x128", "--spp", 64, "--checkpoint", stored)
    nothing = invoke("render", BOX, "-o", out, *options, "--resume")
    assert nothing.exit_code == 2
    assert "has no samples of this scene" in nothing.stderr
    process, _ = start("-o", out, *options)
    while float(process.stdout.readline()) < 0.3:
        pass
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=600)
    assert process.returncode == 130
    last = errors.strip().splitlines()[-1]
    said = re.escape(f"error: interrupted; {out} is partial, ") + r".* of 64 samples per pixel"
    found = re.fullmatch(said + r"; --resume goes on from (\d+)%", last)
    assert found, last
    assert 30 <= int(found[1]) < 100
    process, fraction = start("-o", out, *options, "--resume")
    process.communicate(timeout=600)
    assert process.returncode == 0
    assert fraction == pytest.approx(int(found[1]) / 100, abs=0.006)
    assert invoke("render", BOX, "-o", expected, *options[:-2], "--no-checkpoint").exit_code == 0
    assert out.read_bytes() == expected.read_bytes()


def test_more_spp(tmp_path):
    out, expected = tmp_path / "out.exr", tmp_path / "expected.exr"
    options = ("--size", "40x30", "--checkpoint", tmp_path / "stored")
    assert invoke("render", BOX, "-o", out, *options, "--spp", 10).exit_code == 0
    assert invoke("render", BOX, "-o", out, *options, "--more-spp", 23).exit_code == 0
    assert invoke("render", BOX, "-o", expected, *options[:2], "--spp", 33).exit_code == 0
    assert out.read_bytes() == expected.read_bytes()


@pytest.mark.slow
def test_limits_and_previews(tmp_path):
    out, preview = tmp_path / "out.exr", tmp_path / "preview.png"
    options = ("--size", "32x32", "--spp", 100000)
    done = invoke("render", BOX, "-o", out, *options, "--target-error", "20%")
    assert done.exit_code == 0
    assert re.search(r"; target error reached: \d+ of 100000 .*; relative error \d", done.stderr)
    options = ("--size", "32x32", "--spp", 10**7)
    done = invoke("render", BOX, "-o", out, *options, "--time-limit", "5s", "--preview", preview)
    assert done.exit_code == 0
    assert re.search(r"; time limit reached: .* of 10000000 samples per pixel", done.stderr)
    assert preview.read_bytes().startswith(b"\x89PNG")
    done = invoke(
        "render", BOX, "-o", out, "--size", "32x32", "--spp", 32, "--target-error", "0.1%"
    )
    assert re.search(r"relative error .*, not 0.1 %: that takes about .* times", done.stderr)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--time-limit", "soon"], "--time-limit: expected a duration, such as 90s"),
        (["--time-limit", "0s"], "--time-limit: expected a duration"),
        (["--time-limit", "10x"], "--time-limit: expected a duration"),
        (["--target-error", "5"], "--target-error: expected a share"),
        (["--target-error", "0%"], "--target-error: expected a share"),
        (["--memory", "2"], "--memory: expected an amount of memory"),
        (["--memory", "1K"], "--memory: the scene and the program take"),
        (["--preview", "p.gif"], "p.gif: '.gif' is not supported"),
        (["--checkpoint", "CK", "--no-checkpoint"], "--no-checkpoint contradicts --checkpoint"),
        (["--no-checkpoint", "--resume"], "--no-checkpoint: a render that goes on needs"),
        (["--checkpoint", "CK", "--more-spp", "1"], "--more-spp: CK has no samples"),
        (["--threads", "2", "--workers", "2"], "--workers and --threads contradict each other"),
        (["--cluster", "nowhere.yaml"], "nowhere.yaml: cannot be read"),
    ],
)
def test_wrong_usage(arguments, said, refused, tmp_path):
    size = ["--size", "5000x5000"] if "--memory" in arguments else ["--size", "8x8"]
    folder = str(tmp_path / "stored")
    given = [folder if one == "CK" else one for one in arguments]
    line = refused(2, "render", BOX, "-o", str(tmp_path / "out.exr"), *size, *given)
    assert line.startswith(said.replace("CK", folder))


def test_a_checkpoint_that_cannot_be_written(refused, tmp_path):
    """Found before rendering."""
    file = tmp_path / "file"
    file.write_text("a file")
    line = refused(3, "render", BOX, "-o", str(tmp_path / "o.exr"), "--checkpoint", str(file))
    assert "cannot be written" in line


def test_a_disk_that_is_full(tmp_path):
    """Files of a checkpoint may have no byte: the render goes on without, and says so."""
    code = (
        "import resource, signal; signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "import reference_rt.rendering.framebuffer as c, reference_rt.rendering.render\n"
        "write = c.Checkpoint.write\n"
        "def full(self, k, band):\n"
        "    resource.setrlimit(resource.RLIMIT_FSIZE, (100, -1))\n"
        "    try: write(self, k, band)\n"
        "    finally: resource.setrlimit(resource.RLIMIT_FSIZE, (-1, -1))\n"
        "c.Checkpoint.write = full\n"
        "from reference_rt.cli.main import main; main()"
    )
    out, stored = tmp_path / "out.png", tmp_path / "stored"
    arguments = ["render", BOX, "-o", str(out), "--size", "40x40", "--checkpoint", str(stored)]
    done = subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "warning: the checkpoint is not complete: " in done.stderr
    assert "File too large" in done.stderr
    assert list(tmp_path.rglob("*.samples")) == []
    assert invoke(*arguments[:3], tmp_path / "other.png", *arguments[4:6]).exit_code == 0
    assert out.read_bytes() == (tmp_path / "other.png").read_bytes()
    shutil.rmtree(stored)
