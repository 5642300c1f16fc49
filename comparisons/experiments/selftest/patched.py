"""Runs a worker module in a process whose `reference_rt` is a copy with one changed file."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import reference_rt
from reference_rt.util.errors import ReferenceRtError
from reference_rt.util.files import temporary_folder
from reference_rt.util.processes import tied

PACKAGE = Path(reference_rt.__file__).resolve().parent


def run_patched(
    file: str,
    text: str,
    worker: str,
    task: Mapping[str, Any],
    seconds: float,
    environment: Mapping[str, str] | None = None,
) -> Any:
    """What the module `worker` answers to `task`, both JSON, if `file` of the package has `text`.

    The copy has a kernel cache of its own.  Raises subprocess.TimeoutExpired after so many seconds,
    and ReferenceRtError with the last line of the worker's errors if it fails.
    """
    with temporary_folder() as folder:
        package = folder / "reference_rt"
        skipped = shutil.ignore_patterns("__pycache__", "*.nbi", "*.nbc")
        shutil.copytree(PACKAGE, package, ignore=skipped)
        (package / file).write_text(text, encoding="utf-8")
        path = os.pathsep.join(filter(None, (str(folder), os.environ.get("PYTHONPATH", ""))))
        own = {"PYTHONPATH": path, "REFERENCE_RT_CACHE": f"{folder}/cache"}
        return run_worker(worker, task, {**(environment or {}), **own}, seconds)


def run_worker(
    worker: str, task: Mapping[str, Any], environment: Mapping[str, str], seconds: float | None
) -> Any:
    """What the module answers to `task`, with these variables besides the present ones.  Raises as
    `run_patched`."""
    run = subprocess.run(
        # -P: do not import from the current folder, which may have a reference_rt.
        [sys.executable, "-P", "-m", worker],
        input=json.dumps(task),
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=seconds,
        **tied(),
        check=False,
    )
    if run.returncode != 0:
        lines = [line for line in run.stderr.splitlines() if line.strip()]
        raise ReferenceRtError(lines[-1] if lines else f"exit code {run.returncode}")
    return json.loads(run.stdout)
