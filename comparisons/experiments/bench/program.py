"""Wall-clock time of the whole process `reference-rt render`."""

import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from comparisons.experiments.bench.row import Row, within
from comparisons.experiments.bench.setting import Setting
from comparisons.experiments.bench.timing import ROUNDS
from reference_rt.util.child_processes import tied
from reference_rt.util.errors import ReferenceRtError

SIZE, SPP = "64x64", 16
PICTURE = f"{SIZE}, {SPP} samples per pixel"
"""A picture that renders in almost no time, so that everything else is measured."""

WARM_SECONDS = 1.5

WARM = ("cornell_box", "mesh_knot", "textured_room", "material_principled", "whitted_classic")
"""Scenes of the row `warm`: few shapes, many triangles, textures, a complex material, and no random
numbers."""

QUICK = ("cornell_box", "mesh_knot", "textured_room")

_TIMEOUT = 600.0

_PRINTED = re.compile(r"([\d.]+) s to build, ([\d.]+) s to compile.*?, ([\d.]+) s to render")


class Program:
    """Renders scenes in separate processes, which write to `folder`.

    `folder` has the byte code of our sources too, as after an installation by pip: with
    PYTHONDONTWRITEBYTECODE set, every process would compile all sources again.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.environment = dict(os.environ)
        self.environment.pop("PYTHONDONTWRITEBYTECODE", None)
        self.environment["PYTHONPYCACHEPREFIX"] = str(folder / "bytecode")

    def prepare(self) -> None:
        """Write the byte code."""
        self._run(["--help"], None)

    def render(self, scene: Path, cache: str | None = None) -> dict[str, float]:
        """Seconds of the whole process ("wall"), and the times that it prints ("build", ...), with
        the kernels of the folder `cache`, or the user's.  Raises ReferenceRtError if it fails."""
        picture = self.folder / "picture.png"
        start = time.perf_counter()
        options = ["--size", SIZE, "--spp", str(SPP), "-o", str(picture)]
        printed = self._run(["render", str(scene), *options], cache)
        found = {"wall": time.perf_counter() - start}
        if match := _PRINTED.search(printed):
            names = ("build", "compile", "render")
            found |= dict(zip(names, map(float, match.groups()), strict=True))
        return found

    def warm_up(self, cache: str) -> float:
        """Seconds of `reference-rt warm-up`."""
        start = time.perf_counter()
        self._run(["warm-up"], cache)
        return time.perf_counter() - start

    def _run(self, arguments: Sequence[str], cache: str | None) -> str:
        own = {} if cache is None else {"REFERENCE_RT_CACHE": str(self.folder / cache)}
        run = subprocess.run(
            [sys.executable, "-m", "reference_rt", *arguments],
            env=self.environment | own,
            capture_output=True,
            text=True,
            timeout=_TIMEOUT,
            **tied(),
            check=False,
        )
        if run.returncode != 0:
            last = (run.stderr.strip().splitlines() or ["no message"])[-1]
            raise ReferenceRtError(f"reference-rt {' '.join(arguments)}: {last}")
        return str(run.stderr)


def measure_warm(setting: Setting) -> list[Row]:
    """The row `warm`: the slowest of some scenes, each rendered several times."""
    names = [n for n in WARM if not setting.quick or n in QUICK]
    found: dict[str, list[dict[str, float]]] = {name: [] for name in names}
    with tempfile.TemporaryDirectory() as folder:
        program = Program(Path(folder))
        for name in names:
            setting.say(f"{name}, compiling", 0.0)
            program.render(setting.file(name))
        for k in range(ROUNDS):
            for i, name in enumerate(names):
                setting.say(name, (k + i / len(names)) / ROUNDS)
                found[name].append(program.render(setting.file(name)))
    walls = {name: [t["wall"] for t in times] for name, times in found.items()}
    medians = {name: float(np.median(wall)) for name, wall in walls.items()}
    worst = max(medians, key=lambda name: medians[name])
    title = f"reference-rt render, warm, {PICTURE}, whole process: worst of {len(names)} scenes"
    details = {"worst": worst, "medians": medians, "seconds": found}
    return [within("warm", title, walls[worst], WARM_SECONDS, details=details)]
