"""What the suites' workers run in tests in the place of `compare`: by the scene's name, cases
that agree, raise, print, hang, or end the process."""

import os
import signal
import subprocess
import sys
import time

import numpy as np

from comparisons.compare.budget import Budget
from comparisons.results.case import Case, Images, RungResult
from reference_rt.util.errors import ReferenceUnavailableError, SceneError


def steady(scene, budget: Budget, say, threads, rungs) -> Case:
    """A case that is a function of the scene's name, after up to a fifth of a second."""
    chosen = np.random.default_rng([*scene.name.encode()])
    time.sleep(chosen.uniform(0.02, 0.2))
    images = Images(*chosen.uniform(size=(2, 5, 4, 3)).astype(np.float32))
    reason = f"rays {chosen.integers(1000)}"
    rungs = (RungResult("geometry", "agree", reason, {"distance": chosen.uniform()}),)
    with (scene.folder / "log").open("a") as log:
        log.write(f"{scene.name}\n")
    return Case(scene.name, "agree", f"geometry: {reason}", rungs, None, {}, images)


def by_name(scene, budget: Budget, say, threads, rungs) -> Case:
    name = scene.name
    say("begins")
    if name.startswith("crash"):
        os.kill(os.getpid(), signal.SIGSEGV)
    if name.startswith("exit"):
        print("the last word", file=sys.stderr, flush=True)
        os._exit(7)
    if name.startswith("hang"):
        time.sleep(600.0)
    if name.startswith("raise"):
        raise KeyError("no such\nthing")
    if name.startswith("scene_error"):
        raise SceneError("is not what it must be", file="x.yaml", line=3)
    if name.startswith("unavailable"):
        raise ReferenceUnavailableError("no reference here")
    if name.startswith("print"):
        print('{"done": true}')
        print("stray", flush=True)
        os.write(1, b'\xff\xfe{"failed": "no"}\n')
        subprocess.run([sys.executable, "-c", "print('stray too')"], check=True)
    if name.startswith("wait"):
        while (scene.folder / "wait").exists():
            time.sleep(0.05)
    if name.startswith("tables"):
        _ = scene.tables
    if name.startswith("warn"):
        scene.warn("is odd", "integrator")
    if name.startswith("slow"):
        time.sleep(1.5)
    status = "differ" if name.startswith("differ") else "agree"
    # As of a ray-cast scene, which has no light.
    rungs = (
        RungResult("geometry", status, "rays", {"process": os.getpid(), "threads": threads}),
        RungResult("whitted", "not-applicable", "no light"),
    )
    images = Images(np.full((2, 3, 3), 0.5), np.full((2, 3, 3), 0.25))
    seconds = {"candidate": {"render": 0.5}, "reference": {}}
    return Case(name, status, f"geometry: {status}", rungs, None, seconds, images)
