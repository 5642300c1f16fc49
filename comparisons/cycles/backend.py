"""Runs Cycles: finds its Python, and has one process of it render all replicates of a scene."""

import json
import os
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from comparisons.cycles.translate import write
from comparisons.runs.processes import Children
from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import ReferenceUnavailableError

PYTHON = "REFERENCE_RT_CYCLES"
"""The environment variable that names the Python which has Blender.  It is not ours, since Blender
needs an older NumPy."""

HOW = (
    "python3.11 -m venv cycles && cycles/bin/pip install bpy==5.0.1 && export "
    f"{PYTHON}=$PWD/cycles/bin/python"
)

SECONDS = 600.0
"""Time limit of one picture: against hanging, not against slow machines."""


def interpreter() -> str:
    """The path of the Python that has Blender.  Raises ReferenceUnavailableError."""
    named = os.environ.get(PYTHON, "")
    if not named:
        raise ReferenceUnavailableError(f"Cycles is not installed; to get it: {HOW}")
    found = shutil.which(Path(named).expanduser())
    if found is None:
        raise ReferenceUnavailableError(f"{PYTHON}={named}: no such program; expected: {HOW}")
    return str(Path(found).absolute())  # not resolved: a venv is known by the link's name


class Cycles:
    """A scene in Cycles.  A context manager: afterwards there is no process.

    version: Blender's, known after the first picture;  seconds: of each picture, wall clock.
    """

    def __init__(self, scene: Scene, threads: int | None = None) -> None:
        """Raises ReferenceUnavailableError, IneligibleError, SceneError."""
        self._command = (interpreter(), str(Path(__file__).with_name("worker.py")))
        self._folder = tempfile.TemporaryDirectory(prefix="reference-rt-cycles-")
        self._children = Children()
        self.version, self.seconds = "", list[float]()
        try:
            write(scene, Path(self._folder.name), threads)
        except BaseException:
            self._folder.cleanup()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._children.close()
        self._folder.cleanup()

    def render(
        self, count: int, spp: int, seed: int = 0, say: Callable[[str], None] = lambda line: None
    ) -> FloatArray:
        """Pictures (count, height, width, 3) of independent seeds: linear radiance.  Raises
        ReferenceUnavailableError if Cycles cannot be run, crashes or hangs."""
        found = []
        for k in range(count):
            out = Path(self._folder.name, "picture.npy")
            request = {
                "scene": self._folder.name,
                "seed": (seed + k) % 2**31,
                "spp": spp,
                "out": str(out),
            }
            ended = self._children.carry_out(self._command, "", json.dumps(request), SECONDS, say)
            if ended.failure is not None:
                raise ReferenceUnavailableError(f"Cycles: {ended.failure}")
            about = json.loads(out.with_name(out.name + ".json").read_text(encoding="utf-8"))
            self.version = about["version"]
            self.seconds.append(about["seconds"])
            found.append(np.load(out).astype(np.float64))
        return np.stack(found)
