"""Suites whose workers run what `suite_runners` does in the place of `compare`."""

import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from comparisons.suites.run import Options, run_suite
from comparisons.suites.suite import Source, parse_suite, plan

SCENES = Path(__file__).parents[2] / "scenes"
RUNNER = "suite_runners:by_name"
RAY_CAST = "integrator: {type: ray_cast}\n"
NOISY = "integrator: {type: path}\n"


def scenes(folder: Path, *names: str, text: str = RAY_CAST) -> Path:
    folder.mkdir(exist_ok=True)
    for name in names:
        (folder / f"{name}.yaml").write_text(text)
    return folder


def suite(text: str = "about: a test\n") -> Source:
    return Source(parse_suite(text, "test.yaml"), "test", "test.yaml", "test.yaml", text)


def run_in(out: Path, folder: Path, text: str = "about: a test\n", only=(), **options):
    source = suite(text)
    rungs = options.get("rungs", ())
    planned = plan(source, folder, only, rungs)
    return run_suite(source, planned, Options(out, runner=RUNNER, **options))


def signal_in_the_next_case(
    process: subprocess.Popen[Any], number: int, is_first_done: Callable[[], bool]
) -> list[str]:
    """Send a program a signal in its second case: the ids of its workers."""
    deadline = time.monotonic() + 600.0
    while not is_first_done():
        assert time.monotonic() < deadline
        assert process.poll() is None
        time.sleep(0.05)
    time.sleep(0.5)  # until the next case has begun
    tasks = Path(f"/proc/{process.pid}/task").glob("*/children")
    workers = [child for children in tasks for child in children.read_text().split()]
    process.send_signal(number)
    return workers


def processes(found) -> dict[str, int]:
    return {case.scene: case.rungs[0].numbers["process"] for case in found.cases}
