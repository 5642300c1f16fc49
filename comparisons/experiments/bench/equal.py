"""Ours against Mitsuba at equal samples and at equal error.

At equal samples: render times of the Cornell box, and two threads against one.  At equal error:
seconds to a relative error of 1 %, over the scenes that both renderers path trace.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from comparisons.experiments.bench.row import Row, Setting, against, alternate, seconds
from reference_rt.cameras.film import BoxFilter, Film
from reference_rt.integrators import Path as PathTracing
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import Sobol
from reference_rt.util.errors import ReferenceRtError, ReferenceUnavailableError

SCENE, SIZE, SPP = "cornell_box", 256, 64

VARIANTS = {"cornell_llvm": ("llvm_ad_rgb", 0.8), "cornell_scalar": ("scalar_rgb", 0.25)}
"""Variant of Mitsuba and goal, by row."""


def measure_samples(setting: Setting) -> list[Row]:
    """Both rows.  Raises ReferenceUnavailableError."""
    return [_samples_row(name, setting) for name in VARIANTS]


def cornell_box(setting: Setting) -> Scene:
    """The scene at the measured size; a quarter of the pixels for a quick run."""
    size = SIZE // 2 if setting.quick else SIZE
    film = Film(width=size, height=size, filter=BoxFilter())
    return setting.load(SCENE).changed(film=film, sampler=Sobol(spp=SPP))


def _samples_row(name: str, setting: Setting) -> Row:
    from comparisons.mitsuba import scene as mitsuba_scene
    from comparisons.mitsuba.backend import variant
    from comparisons.mitsuba.translate import load

    mitsuba_variant, goal = VARIANTS[name]
    scene = cornell_box(setting)
    size = scene.film.width
    with variant(mitsuba_variant):
        counterpart = load(scene)
        seeds = iter(range(1, 1000))

        def ours() -> object:
            return render(scene, tables=scene.tables, threads=setting.threads)

        def theirs() -> object:
            return mitsuba_scene.picture(counterpart.mi_scene, SPP, next(seeds))

        render(scene, tables=scene.tables, specialised=True), theirs()  # compile
        times = alternate(
            {"ours": lambda: seconds(ours), mitsuba_variant: lambda: seconds(theirs)},
            say=setting.say,
        )
    return against(
        name,
        f"{SCENE} {size}x{size}, {SPP} samples per pixel: time / Mitsuba {mitsuba_variant}",
        times["ours"],
        (f"Mitsuba {mitsuba_variant}", times[mitsuba_variant]),
        goal,
        details={"seconds": times, "threads": setting.threads, "sampler": "sobol / independent"},
    )


# ---- a second thread ----------------------------------------------------------------------------


def measure_threads(setting: Setting) -> list[Row]:
    """Samples per second of two threads against one.

    Raises ReferenceUnavailableError on a machine with one core.
    """
    if setting.threads < 2:
        raise ReferenceUnavailableError("two threads need two cores")
    scene = cornell_box(setting)
    samples = scene.film.width * scene.film.height * SPP / 1e6

    def rate(threads: int) -> float:
        return samples / seconds(lambda: render(scene, tables=scene.tables, threads=threads))

    render(scene, tables=scene.tables, specialised=True)  # compile
    rates = alternate({"2 threads": lambda: rate(2), "1 thread": lambda: rate(1)}, say=setting.say)
    return [
        against(
            "threads",
            f"{SCENE}: samples per second of two threads / of one",
            rates["2 threads"],
            ("one thread", rates["1 thread"]),
            1.9,
            unit="Msamples/s",
            better="higher",
            details={"rates": rates},
        )
    ]


TARGET = 0.01
"""Relative error: the square root of relMSE."""

SECONDS = 15.0
"""Time budget of a scene, for all methods together."""

QUICK = ("cornell_box", "many_lights", "mesh_knot", "textured_room")

DEFAULT, BEST, CYCLES = "mitsuba_llvm", "mitsuba_llvm_best", "cycles"
PEERS = {
    DEFAULT: "Mitsuba llvm, default sampler",
    BEST: "Mitsuba llvm, best sampler",
    CYCLES: "Cycles",
}
MEDIAN_GOAL, WORST_GOAL, BEST_GOAL = 0.5, 1.5, 1.0


def measure_error(setting: Setting) -> list[Row]:
    """Median and worst against the default sampler, median against the best one, and against
    Cycles where it is installed.

    Raises ReferenceUnavailableError.
    """
    from comparisons.experiments.convergence import reached

    scenes = path_traced(setting)
    found: dict[str, dict[str, float]] = {}
    left_out: dict[str, str] = {}
    extrapolated: dict[str, list[str]] = {}
    for k, (name, scene) in enumerate(scenes.items()):
        setting.say(name, k / len(scenes))
        try:
            targets = reached(scene, TARGET, SECONDS)
        except (ValueError, ReferenceRtError) as error:
            left_out[name] = str(error)
            continue
        found[name] = {who: target.seconds.value for who, target in targets.items()}
        extrapolated[name] = [
            who for who, target in targets.items() if target.how == "extrapolated"
        ]
    return rows(found, left_out, extrapolated)


def path_traced(setting: Setting) -> dict[str, Scene]:
    """The scenes of the standard suite that are path traced, and that Mitsuba can render."""
    from comparisons.mitsuba.translate import UntranslatableError, load
    from comparisons.suites.suite import load_suite

    found: dict[str, Scene] = {}
    for name in load_suite("standard").suite.scenes:
        scene = setting.load(name)
        if not isinstance(scene.integrator, PathTracing) or (setting.quick and name not in QUICK):
            continue
        try:
            load(scene)
        except UntranslatableError:
            continue
        found[name] = scene
    return found


def rows(
    found: dict[str, dict[str, float]],
    left_out: dict[str, str],
    extrapolated: Mapping[str, Sequence[str]] | None = None,
) -> list[Row]:
    """The rows from the times `found`, by scene and method.

    left_out: why other scenes have no times;  extrapolated: the methods whose time lies beyond the
    measured rungs, by scene.
    """
    guessed = extrapolated or {}
    against_default = _ratios(found, DEFAULT)
    against_best = _ratios(found, BEST)
    what = f"time to {TARGET:.0%} relative error"
    details: dict[str, Any] = {"target": TARGET, "seconds": found, "left_out": left_out}
    details["extrapolated"] = {name: list(who) for name, who in guessed.items() if who}
    against_cycles = _ratios(found, CYCLES)
    of_cycles = []
    if against_cycles:  # where it is installed
        title = f"{what}, median over {_scenes(against_cycles, CYCLES, guessed)}: / Cycles"
        args = found, CYCLES, against_cycles, MEDIAN_GOAL, details
        of_cycles = [_error_row("error_cycles", title, *args)]
    worst = max(against_default, key=lambda name: against_default[name], default="")
    return [
        _error_row("error_default",
             f"{what}, median over {_scenes(against_default, DEFAULT, guessed)}: / Mitsuba llvm, "
             "its default sampler",
             found, DEFAULT, against_default, MEDIAN_GOAL, details),
        Row(
            "error_default_worst",
            f"the same, the worst scene ({worst}{_worst(worst, DEFAULT, guessed)})",
            found.get(worst, {}).get("ours", math.nan),
            found.get(worst, {}).get(DEFAULT, math.nan),
            PEERS[DEFAULT],
            "s",
            against_default.get(worst, math.nan),
            WORST_GOAL,
            "lower",
            {},
            {"worst": worst, "ratios": against_default},
        ),
        _error_row("error_best",
             f"{what}, median over {_scenes(against_best, BEST, guessed)}: / Mitsuba llvm, "
             "its best sampler",
             found, BEST, against_best, BEST_GOAL, details),
        *of_cycles,
    ]  # fmt: skip


def _is_extrapolated(scene: str, peer: str, extrapolated: Mapping[str, Sequence[str]]) -> bool:
    """Whether one of the two times of a scene's ratio is extrapolated."""
    return bool({"ours", peer} & set(extrapolated.get(scene, ())))


def _scenes(
    ratios: Mapping[str, float], peer: str, extrapolated: Mapping[str, Sequence[str]]
) -> str:
    """ "scenes", or how many there are, and how many ratios are extrapolated."""
    number = sum(_is_extrapolated(scene, peer, extrapolated) for scene in ratios)
    return f"{len(ratios)} scenes ({number} extrapolated)" if number else "scenes"


def _worst(scene: str, peer: str, extrapolated: Mapping[str, Sequence[str]]) -> str:
    return ", extrapolated" if _is_extrapolated(scene, peer, extrapolated) else ""


def _ratios(found: dict[str, dict[str, float]], peer: str) -> dict[str, float]:
    """Ours / the peer's time, for scenes in which at least one of them reaches the target; the time
    of one that never does is infinite."""
    return {
        name: times["ours"] / times[peer]
        for name, times in found.items()
        if times.get(peer, 0.0) > 0.0
        and min(times.get("ours", math.inf), times[peer]) < math.inf
        and "ours" in times
    }


def _error_row(
    name: str,
    title: str,
    found: dict[str, dict[str, float]],
    peer: str,
    ratios: dict[str, float],
    goal: float,
    details: dict[str, Any],
) -> Row:
    """The row of medians over scenes of both times and their ratios, with quartiles over scenes."""
    low, median, high = (math.nan,) * 3
    ours = theirs = math.nan
    if ratios:
        values = list(ratios.values())
        # Quartiles that are values of scenes: one cannot interpolate to infinity.
        low = float(np.quantile(values, 0.25, method="lower"))
        median = float(np.median(values))
        high = float(np.quantile(values, 0.75, method="higher"))
        ours = float(np.median([found[scene]["ours"] for scene in ratios]))
        theirs = float(np.median([found[scene][peer] for scene in ratios]))
    return Row(
        name,
        title,
        ours,
        theirs,
        PEERS[peer],
        "s",
        median,
        goal,
        "lower",
        {"ratio": [low, high]},
        {**details, "ratios": ratios, "scenes": len(ratios)},
    )
