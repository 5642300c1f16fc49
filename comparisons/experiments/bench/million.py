"""A mesh of a million triangles: the time to build its tables, and the peak memory."""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from comparisons.experiments.bench.meshes import MILLION, blob, write_obj, write_ply
from comparisons.experiments.bench.row import Row, within
from comparisons.experiments.bench.setting import Setting
from comparisons.experiments.bench.timing import ROUNDS
from reference_rt.util.child_processes import tied
from reference_rt.util.errors import ReferenceRtError

BUILD_SECONDS, PEAK_MB = 6.0, 1000.0

_TIMEOUT = 600.0


def measure(setting: Setting) -> list[Row]:
    """Both rows, for the .ply file; numbers of the .obj file are among the details."""
    mesh = blob(MILLION)
    found: dict[str, list[dict[str, float]]] = {"ply": [], "obj": []}
    with tempfile.TemporaryDirectory() as folder:
        setting.say("writing the meshes", 0.0)
        files = {suffix: Path(folder) / f"million.{suffix}" for suffix in found}
        write_ply(files["ply"], mesh)
        write_obj(files["obj"], mesh)
        _run(files["ply"])  # compile
        for k in range(ROUNDS):
            for suffix, path in files.items():
                if suffix == "ply" or k == 0:  # reading .obj is slow, and has no row
                    setting.say(f".{suffix}, {len(mesh.faces):,} triangles", k / ROUNDS)
                    found[suffix].append(_run(path))
    count = f"{len(mesh.faces):,} triangles"
    details: dict[str, Any] = {"triangles": len(mesh.faces), "runs": found}
    return [
        within(
            "million_build",
            f"{count}: from positions and indices to tables for rays, BVH included",
            [run["build"] for run in found["ply"]],
            BUILD_SECONDS,
            details=details,
        ),
        within(
            "million_memory",
            f"{count}: peak memory of load, build and render, whole process",
            [run["peak"] for run in found["ply"]],
            PEAK_MB,
            unit="MB",
            details=details,
        ),
    ]


def _run(mesh: Path) -> dict[str, float]:
    """Run `million_worker`.  Raises ReferenceRtError."""
    run = subprocess.run(
        [sys.executable, "-m", "comparisons.experiments.bench.million_worker", str(mesh)],
        env=dict(os.environ),
        capture_output=True,
        text=True,
        timeout=_TIMEOUT,
        **tied(),
        check=False,
    )
    if run.returncode != 0:
        last = (run.stderr.strip().splitlines() or [f"ends by {run.returncode}"])[-1]
        raise ReferenceRtError(f"a million triangles: {last}")
    found: dict[str, float] = json.loads(run.stdout)
    return found
