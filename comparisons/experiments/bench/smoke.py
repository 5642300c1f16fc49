"""Seconds that compiling adds to the suite `smoke`."""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from comparisons.experiments.bench.row import Row, within
from comparisons.experiments.bench.setting import Setting
from reference_rt.util.child_processes import tied
from reference_rt.util.errors import ReferenceRtError

SUITE, JOBS = "smoke", 2

ADDED = 60.0
"""The limit in seconds."""

_TIMEOUT = 1800.0


def measure(setting: Setting) -> list[Row]:
    """The row `smoke`: the suite with no kernel compiled, less the same suite once more."""
    with tempfile.TemporaryDirectory() as folder:
        seconds = []
        for k, state in enumerate(("cold", "warm")):
            setting.say(f"{SUITE}, {state}", 0.5 * k)
            seconds.append(_run(Path(folder), state, setting.scenes))
    title = f"suite {SUITE}, {JOBS} processes: with no kernel compiled, less once more"
    details = dict(zip(("cold", "warm"), seconds, strict=True))
    return [within("smoke", title, [seconds[0] - seconds[1]], ADDED, details=details)]


def _run(folder: Path, state: str, scenes: Path) -> float:
    command = [sys.executable, "-m", "reference_rt", "suite", SUITE]
    command += ["--jobs", str(JOBS), "-o", str(folder / state), "--scenes", str(scenes)]
    start = time.perf_counter()
    run = subprocess.run(
        command,
        env=os.environ | {"REFERENCE_RT_CACHE": str(folder / "cache")},
        capture_output=True,
        text=True,
        timeout=_TIMEOUT,
        **tied(),
        check=False,
    )
    if run.returncode != 0:
        last = (run.stderr.strip().splitlines() or ["no message"])[-1]
        raise ReferenceRtError(f"reference-rt suite {SUITE}: {last}")
    return time.perf_counter() - start
