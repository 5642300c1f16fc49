"""Ctrl-C and kill while rendering: no partial and no temporary file, and the right exit code."""

import signal
import subprocess
import sys
import time

from builders import SCENES

PROGRAM = [sys.executable, "-c", "from reference_rt.cli.main import main; main()"]


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
        "    if what == 'render': print('rendering', flush=True)\n"
        "c.ProgressLine.__call__ = say\n"
        "from reference_rt.cli.main import main; main()"
    )
    scene = str(SCENES / "cornell_box.yaml")
    process = subprocess.Popen(
        [sys.executable, "-c", code, "render", scene, "-o", str(folder / "out.exr"),
         "--spp", "100000", "--size", "64x64", *extra],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stdout.readline() == "rendering\n"
    return process


def test_ctrl_c(tmp_path):
    process = start(tmp_path)
    began = time.monotonic()
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=240)
    assert process.returncode == 130
    # The whole render takes minutes on any machine: it did not run on.
    assert time.monotonic() - began < 30
    lines = errors.strip().splitlines()
    assert lines[-1] == "error: interrupted; nothing unfinished was written"
    assert "Traceback" not in errors
    assert list(tmp_path.iterdir()) == []


def test_kill(tmp_path):
    """Nothing is at the output's place, and what was there before stays."""
    old = tmp_path / "out.exr"
    old.write_bytes(b"the old picture")
    process = start(tmp_path)
    process.kill()
    process.communicate(timeout=240)
    assert old.read_bytes() == b"the old picture"
    assert list(tmp_path.iterdir()) == [old]


def test_progress_without_a_terminal_is_lines(tmp_path):
    """No control characters, no carriage returns."""
    arguments = ["render", str(SCENES / "spheres_whitted.yaml"), "-o", str(tmp_path / "out.png"),
                 "--size", "32x20"]  # fmt: skip
    done = subprocess.run([*PROGRAM, *arguments], capture_output=True, text=True, check=True)
    assert done.stdout == ""
    assert done.stderr.splitlines()[-1].startswith(f"{tmp_path}/out.png: 32 x 20, ")
    assert "\x1b" not in done.stderr
    assert "\r" not in done.stderr
