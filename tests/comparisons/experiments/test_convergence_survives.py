"""A convergence that is killed at any moment goes on where it was, and has the same bits."""

import random
import shutil
import subprocess
import sys
import time

import numpy as np
import pytest
from builders import SCENES

PROGRAM = (
    "from comparisons.experiments.convergence import methods\n"
    "methods.STORED_EVERY = 0.0\n"  # after each sweep, not each 15 s
    "from reference_rt.cli.main import main; main()"
)


def command(out):
    options = ["--only", "ours", "--size", "16x16", "--max-spp", "64"]
    options += ["--replicates", "64", "--time-limit", "3600"]
    scene = str(SCENES / "cornell_box.yaml")
    return [sys.executable, "-c", PROGRAM, "converge", scene, "-o", str(out), *options]


def pictures(out):
    found = {}
    for path in sorted((out / "rungs" / "cornell_box").glob("ours-*.npz")):
        with np.load(path) as arrays:
            for name in ("asked", "spp", "reference", "mse", "relmse", "mean", "squares"):
                found[path.name, name] = arrays[name].tobytes()
    return found


@pytest.mark.slow
@pytest.mark.parametrize("times", [3, 50])
def test_killed_at_any_moment(times, tmp_path):
    """Kill it some time after it has stored the pictures of a sweep, or at its start."""
    out, whole, choose = tmp_path / "out", tmp_path / "whole", random.Random(24)
    first = out / "rungs" / "cornell_box" / "ours-4.npz"
    for k in range(times):
        before = first.stat().st_mtime_ns if first.exists() else 0
        with subprocess.Popen(command(out), stderr=subprocess.DEVNULL) as process:
            while k % 5 and process.poll() is None:
                if first.exists() and first.stat().st_mtime_ns != before:
                    break
                time.sleep(0.01)
            time.sleep(choose.uniform(0.0, 0.3 if k % 5 else 5.0))
            process.kill()
    done = subprocess.run(command(out), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    # Which rungs there are depends on the times of trials: the same ones.
    folder = whole / "rungs" / "cornell_box"
    folder.mkdir(parents=True)
    for name in ("key.json", "plan.json"):
        shutil.copy(out / "rungs" / "cornell_box" / name, folder / name)
    subprocess.run(command(whole), capture_output=True, check=True)
    assert len(pictures(out)) >= 5 * 7
    assert pictures(out) == pictures(whole)
