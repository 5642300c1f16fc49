"""Seconds of first renders: with no kernel compiled, of a new kind of scene, after `warm-up`."""

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.experiments.bench.program import PICTURE, QUICK, Program
from comparisons.experiments.bench.row import Row, within
from comparisons.experiments.bench.setting import Setting

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
    with tempfile.TemporaryDirectory() as folder:
        program = Program(Path(folder))
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
    with tempfile.TemporaryDirectory() as folder:
        program = Program(Path(folder))
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
    with tempfile.TemporaryDirectory() as folder:
        program = Program(Path(folder))
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
