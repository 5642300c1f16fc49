"""Wall-clock time of whole processes: `reference-rt render` warm, first renders with kernels still
to be compiled, `warm-up`, and the suite `smoke`."""

import os
import re
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.experiments.bench.row import ROUNDS, Row, Setting, within
from reference_rt.util.errors import ReferenceRtError
from reference_rt.util.files import temporary_folder
from reference_rt.util.processes import tied

# ---- the suite smoke ----------------------------------------------------------------------------


SUITE, JOBS = "smoke", 2

ADDED = 60.0
"""The limit in seconds."""

_SUITE_TIMEOUT = 1800.0


def measure_smoke(setting: Setting) -> list[Row]:
    """The row `smoke`: the suite with no kernel compiled, less the same suite once more."""
    with temporary_folder() as folder:
        seconds = []
        for k, state in enumerate(("cold", "warm")):
            setting.say(f"{SUITE}, {state}", 0.5 * k)
            seconds.append(_suite(folder, state, setting.scenes))
    title = f"suite {SUITE}, {JOBS} processes: with no kernel compiled, less once more"
    details = dict(zip(("cold", "warm"), seconds, strict=True))
    return [within("smoke", title, [seconds[0] - seconds[1]], ADDED, details=details)]


def _suite(folder: Path, state: str, scenes: Path) -> float:
    command = [sys.executable, "-m", "reference_rt", "suite", SUITE]
    command += ["--jobs", str(JOBS), "-o", str(folder / state), "--scenes", str(scenes)]
    start = time.perf_counter()
    run = subprocess.run(
        command,
        env=os.environ | {"REFERENCE_RT_CACHE": str(folder / "cache")},
        capture_output=True,
        text=True,
        timeout=_SUITE_TIMEOUT,
        **tied(),
        check=False,
    )
    if run.returncode != 0:
        last = (run.stderr.strip().splitlines() or ["no message"])[-1]
        raise ReferenceRtError(f"reference-rt suite {SUITE}: {last}")
    return time.perf_counter() - start


# ---- the program in separate processes ----------------------------------------------------------


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
    with temporary_folder() as folder:
        program = Program(folder)
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


# ---- first renders ------------------------------------------------------------------------------


WORST_EVER, MEDIAN_EVER = 8.0, 5.0
"""Limits of the first render ever, in seconds."""

WORST_NEW, MEDIAN_NEW = 4.0, 1.5
"""Limits of the first render of a new kind of scene, in seconds over the second."""

WARMING, AFTER_WARMING = 120.0, 0.5
"""Limits of `warm-up`, and of a first render after it over the second."""

KNOWN = (
    "cornell_box",
    "veach_mis",
    "soft_shadows",
    "spheres_whitted",
    "material_conductor",
    "light_spot",
    "csg_dice",
    "polygons_fill_rules",
    "filter_gaussian",
    "camera_orthographic",
)
"""The scenes that are rendered before a new kind: one of each folder of features, no textures, no
meshes."""

NEW = (
    "mesh_knot",
    "material_plastic",
    "environment",
    "textured_room",
    "caustic_glass",
    "many_lights",
)
"""New kinds of scenes, rendered one after another."""


def measure_ever(setting: Setting) -> list[Row]:
    """The rows `cold` and `cold_median`: every scene once, each with an empty cache.  Compiling
    takes so long that one run is enough."""
    names = [n for n in setting.names() if not setting.quick or n in QUICK]
    found: dict[str, dict[str, float]] = {}
    with temporary_folder() as folder:
        program = Program(folder)
        program.prepare()
        for k, name in enumerate(names):
            setting.say(f"{name}, no kernels", k / len(names))
            found[name] = program.render(setting.file(name), f"cold-{k}")
    walls = {name: times["wall"] for name, times in found.items()}
    details = {"scenes": len(walls), "seconds": found}
    title = f"first render ever, no kernels compiled, {PICTURE}"
    return _worst_and_median("cold", title, walls, (WORST_EVER, MEDIAN_EVER), details)


def measure_new(setting: Setting) -> list[Row]:
    """The rows `new_kind` and `new_kind_median`: scenes of new kinds after those of KNOWN, in this
    order with one cache; the first render of each less the second."""
    over: dict[str, float] = {}
    found: dict[str, list[dict[str, float]]] = {}
    known = QUICK[:1] if setting.quick else KNOWN
    with temporary_folder() as folder:
        program = Program(folder)
        program.prepare()
        for k, name in enumerate(known):
            setting.say(f"{name}, to be known", k / (len(known) + len(NEW)))
            program.render(setting.file(name), "cache")
        for k, name in enumerate(NEW):
            setting.say(f"{name}, of a new kind", (len(known) + k) / (len(known) + len(NEW)))
            found[name] = [program.render(setting.file(name), "cache") for _ in range(2)]
            first, second = (times["wall"] for times in found[name])
            over[name] = first - second
    title = f"first render of a new kind of scene after {len(known)} others, over the second"
    limits = (WORST_NEW, MEDIAN_NEW)
    return _worst_and_median("new_kind", title, over, limits, {"seconds": found})


def measure_warmed(setting: Setting) -> list[Row]:
    """The rows `warm_up` and `after_warm_up`: `reference-rt warm-up`, and then the first render of
    every scene less the second."""
    names = [n for n in setting.names() if not setting.quick or n in QUICK]
    over: dict[str, float] = {}
    found: dict[str, list[dict[str, float]]] = {}
    with temporary_folder() as folder:
        program = Program(folder)
        program.prepare()
        setting.say("warm-up", 0.0)
        seconds = program.warm_up("cache")
        for k, name in enumerate(names):
            setting.say(f"{name}, warmed up", k / len(names))
            found[name] = [program.render(setting.file(name), "cache") for _ in range(2)]
            first, second = (times["wall"] for times in found[name])
            over[name] = first - second
    worst = max(over, key=lambda name: over[name])
    details: dict[str, Any] = {"worst": worst, "median": float(np.median([*over.values()]))}
    title = f"first render after warm-up, over the second: worst of {len(over)} scenes"
    return [
        within("warm_up", "reference-rt warm-up, nothing compiled", [seconds], WARMING),
        within(
            "after_warm_up",
            title,
            [over[worst]],
            AFTER_WARMING,
            details=details | {"seconds": found},
        ),
    ]


def _worst_and_median(
    name: str,
    title: str,
    seconds: dict[str, float],
    limits: Sequence[float],
    details: dict[str, Any],
) -> list[Row]:
    """A row of the worst scene and one of the median."""
    worst = max(seconds, key=lambda scene: seconds[scene])
    middle = float(np.median([*seconds.values()]))
    more = details | {"worst": worst, "median": middle}
    count = len(seconds)
    return [
        within(name, f"{title}: worst of {count}", [seconds[worst]], limits[0], details=more),
        within(f"{name}_median", f"{title}: median of {count}", [middle], limits[1]),
    ]
