"""Time of a process from its start to its first picture, by stage, with empty and full caches."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterable
from pathlib import Path

import platformdirs

from comparisons.experiments.convergence.methods import CYCLES, Method
from comparisons.experiments.convergence.store import Store
from comparisons.mitsuba.backend import LLVM, backend
from comparisons.mitsuba.llvm_libraries import LIBRARY
from reference_rt.rendering.render import Progress
from reference_rt.rendering.scene import Scene
from reference_rt.util.files import temporary_folder
from reference_rt.util.processes import tied

STAGES = ("start", "load", "build", "compile", "render")
"""start: the interpreter and what it imports;  load: the scene's file read, for Mitsuba also
translated;  build: tables and hierarchy, or `mitsuba.load_dict`;  compile: kernels compiled, or
read from the cache; of Mitsuba what the first picture takes more than the second;  render: the
second picture, with 16 samples per pixel."""

SPP = 16

TIMEOUT = 300.0
"""Time limit in seconds: compiling takes 10 s, a few times that on a busy machine."""


def starts_of(
    scene: Scene, methods: Iterable[Method], store: Store, say: Progress
) -> dict[str, dict[str, dict[str, float]]]:
    """Seconds by side, "cold" or "warm", and stage; a side whose processes failed has none.

    "cold" means empty caches of compiled kernels; the program files are in the system's file cache.
    """
    # Cycles comes in Blender, of which it is a small part: its start is not measured.
    sides = list(dict.fromkeys(method.side for method in methods if method.side != CYCLES))
    found: dict[str, dict[str, dict[str, float]]] = {}
    for number, side in enumerate(sides):
        say("starts of processes", number / len(sides))
        stored = store.fact(f"starts-{side}")
        times = stored if stored is not None else _start(scene, side)
        if times is None:
            found[side] = {}
            continue
        store.keep_fact(f"starts-{side}", times)
        found[side] = times
    if sides:
        say("starts of processes", 1.0)
    return found


def _start(scene: Scene, side: str) -> dict[str, dict[str, float]] | None:
    """Two processes one after the other, the first with empty caches."""
    with temporary_folder() as folder:
        path = folder / "scene.json"
        path.write_text(scene.to_json(), encoding="utf-8")
        environment = dict(os.environ)
        own = environment.get("REFERENCE_RT_CACHE") or platformdirs.user_cache_dir("reference_rt")
        environment["REFERENCE_RT_CACHE"] = str(folder) if side == "ours" else own
        if side != "ours":
            environment["HOME"] = str(folder)  # below which Dr.Jit keeps its kernels
        if side == LLVM:
            environment[LIBRARY] = str(backend().llvm_path)
        found = {}
        for state in ("cold", "warm"):
            times = _child(path, scene.folder, side, environment)
            if times is None:
                return None
            found[state] = times
    return found


def _child(
    path: Path, folder: Path, side: str, environment: dict[str, str]
) -> dict[str, float] | None:
    command = [sys.executable, "-m", "comparisons.experiments.convergence.start_worker"]
    command += [side, str(path), str(folder.resolve()), str(SPP)]
    begun = time.time()
    try:
        run = subprocess.run(
            [*command, repr(begun)],
            env=environment,
            capture_output=True,
            text=True,
            timeout=TIMEOUT,
            **tied(),
            check=True,
        )
        times = json.loads(run.stdout.splitlines()[-1])
    except (subprocess.SubprocessError, ValueError, IndexError):
        return None
    return {stage: float(times[stage]) for stage in STAGES}
