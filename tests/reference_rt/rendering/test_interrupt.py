"""Ctrl-C and kill while rendering: whole files or none, no temporary file, and the right exit
code."""

import re
import signal
import subprocess
import sys

import numpy as np
import pytest
from builders import SCENES
from command_line import invoke

import reference_rt as rt
from reference_rt.core.exr import read_exr

SPP = 100000


def start(folder, *extra):
    """A render that would take minutes, after it has begun to render."""
    # Loading kernels takes seconds or none: only the child itself knows when it has begun.
    code = (
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
    scene = str(SCENES / "cornell_box.yaml")
    process = subprocess.Popen(
        [sys.executable, "-c", code, "render", scene, "-o", str(folder / "out.exr"),
         "--spp", str(SPP), "--size", "64x64", *extra],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    while float(process.stdout.readline()) * SPP < 32.0:  # all pixels have their first samples
        pass
    return process


@pytest.mark.cases(1)
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c(number, tmp_path):
    """The picture so far, which says so in its header."""
    process = start(tmp_path)
    process.send_signal(number)
    _, errors = process.communicate(timeout=600)
    assert process.returncode == 128 + number
    assert "Traceback" not in errors
    out = tmp_path / "out.exr"
    assert list(tmp_path.iterdir()) == [out]
    channels, header = read_exr(out)
    said = header["partial"]
    assert re.fullmatch(r"(\d+ to )?\d+ of 100000 samples per pixel", said)
    assert errors.strip().splitlines()[-1] == f"error: interrupted; {out} is partial, {said}"
    # It is the picture: nearly that of other samples.
    scene = rt.Scene.load(SCENES / "cornell_box.yaml")
    whole = rt.render(scene, size=(64, 64), spp=64, seed=5).colour
    found = np.stack([channels[name] for name in "RGB"], axis=-1)
    # Means over 4096 pixels of at least 16 samples each, whose spread is a few times their mean.
    assert found.mean() == pytest.approx(whole.mean(), rel=0.05)


@pytest.mark.slow
def test_kill(tmp_path):
    """Nothing is at the output's place, and what was there before stays."""
    old = tmp_path / "out.exr"
    old.write_bytes(b"the old picture")
    process = start(tmp_path)
    process.kill()
    process.communicate(timeout=600)
    assert old.read_bytes() == b"the old picture"
    assert list(tmp_path.iterdir()) == [old]


def test_progress_without_a_terminal_is_lines(tmp_path):
    """No control characters, no carriage returns."""
    scene, output = SCENES / "spheres_whitted.yaml", tmp_path / "out.png"
    done = invoke("render", scene, "-o", output, "--size", "32x20")
    assert (done.exit_code, done.stdout) == (0, "")
    assert done.stderr.splitlines()[-1].startswith(f"{tmp_path}/out.png: 32 x 20, ")
    assert "\x1b" not in done.stderr
    assert "\r" not in done.stderr
