"""Runs Cycles: finds its Python, and has one process of it render all replicates of a scene."""

import functools
import json
import os
import shutil
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from comparisons.cycles.translate import write
from comparisons.renderers import NoCounterpartError, Replicates
from comparisons.runs.processes import Children
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import ReferenceUnavailableError
from reference_rt.util.files import temporary_folder
from reference_rt.util.processes import tied

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


@functools.cache
def _version(python: str) -> str:
    """Blender's version there.  Raises ReferenceUnavailableError."""
    asked = "import importlib.metadata as m; print(m.version('bpy'))"
    run = subprocess.run(
        [python, "-c", asked], capture_output=True, text=True, check=False, **tied()
    )
    if run.returncode != 0:
        told = (run.stderr.strip().splitlines() or ["no Blender"])[-1]
        raise ReferenceUnavailableError(f"{PYTHON}={python}: {told}; expected: {HOW}")
    return str(run.stdout.strip())


@dataclass(frozen=True)
class Cycles:
    """`comparisons.renderers.Renderer`: one process renders all replicates of a scene."""

    title: str = "Cycles"

    def version(self) -> str:
        return f"Blender {_version(interpreter())}, CPU"

    @contextmanager
    def load(self, scene: Scene, threads: int | None = None) -> Iterator["_Loaded"]:
        command = (interpreter(), str(Path(__file__).with_name("worker.py")))
        with temporary_folder() as folder:
            try:
                write(scene, folder, threads)
            except NoCounterpartError as error:
                raise NoCounterpartError(f"Cycles has no equal of {error}") from None
            children = Children()
            try:
                yield _Loaded(command, folder, children)
            finally:
                children.close()


class _Loaded(NamedTuple):
    command: tuple[str, str]
    folder: Path
    children: Children

    def render(
        self, count: int, spp: int, seed: int = 0, say: Callable[[str], None] = lambda line: None
    ) -> Replicates:
        pictures, seconds = [], []
        for k in range(count):
            out = self.folder / "picture.npy"
            request = {
                "scene": str(self.folder),
                "seed": (seed + k) % 2**31,
                "spp": spp,
                "out": str(out),
            }
            ended = self.children.carry_out(self.command, "", json.dumps(request), SECONDS, say)
            if ended.failure is not None:
                raise ReferenceUnavailableError(f"Cycles: {ended.failure}")
            about = json.loads(out.with_name(out.name + ".json").read_text(encoding="utf-8"))
            seconds.append(about["seconds"])
            pictures.append(np.load(out).astype(np.float64))
        return Replicates(np.stack(pictures), np.array(seconds), spp)


RENDERER = Cycles()
