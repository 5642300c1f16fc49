"""Measures how well `light` and `path` agree: the means of pictures from both ends of the paths.

`python docs/measure_both_ends.py STORE.jsonl [NAME...] [--seconds S]` measures the scenes NAME
(default: all of scenes/) that the store lacks, that were left out since they take more than S CPU
seconds (default: 120), or whose interval of half as many is not within the goal, and writes the
table of docs/results/both_ends.md from the store.

Of each scene a small picture, with its own filter, is rendered by its integrator (`path` with at
most 5 edges where that is Whitted's, which knows no light transport), and by `light` without
caustics of points, which has the same expectation. Light that reaches the camera straight from a
lamp or the sky is computed by the same code in both, and would hide what is to be seen: each side's
picture of one edge, with the same seed, is subtracted. What is compared is the mean, over pixels
and channels, of the light that surfaces scatter.

A pilot measures each side's variance and time, and is thrown away. Then each side renders
REPLICATES pictures with seeds of their own; the noisier side is given more samples, as the best
division of the time asks. The interval is Welch's, of 99 %.
"""

import argparse
import json
import math
import time
import zlib
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from docs_pages import DOCS
from scipy import stats

from comparisons.integrators import particles_of
from comparisons.renderers import NoCounterpartError
from comparisons.report.table import table_of
from comparisons.report.templates import check, rewrite
from comparisons.runs.provenance import ours as provenance
from reference_rt.cameras.film import Film
from reference_rt.integrators import Direct
from reference_rt.integrators import Path as ByPaths
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import Sobol
from reference_rt.util.errors import SceneError

SCENES, PAGE = DOCS.parent / "scenes", DOCS / "results" / "both_ends.md"

LONGER = 24
"""Pixels along the longer side of a picture."""

PILOT, REPLICATES = 12, 24

LEVEL = 0.99
WITHIN = 0.003
"""What the whole interval is to lie within, of the mean."""

AIM = 0.5 * WITHIN
"""Half of the interval that is asked for, which the pilot knows to a fifth: one as wide, of a right
renderer, lies within WITHIN in 99 of 100 cases."""

REACHED = 0.99
"""The part of the pixels that paths light which particles must reach, too."""

LEAST = 0.05
"""The part of the seconds that is used even if less is needed."""

FIRST_SEED = 9 << 40
"""Far from the seeds of users and of other experiments."""


class Means(NamedTuple):
    """Of replicates: the light that surfaces scatter, and all light, each as the mean of a picture;
    reached (height, width): whether a pixel has scattered light in any of them."""

    scattered: list[float]
    everything: list[float]
    reached: npt.NDArray[np.bool_]


class Side(NamedTuple):
    """Pictures by one integrator.  first: the picture of one edge, of which `whole` has more."""

    whole: Scene
    first: Scene

    def means(self, spp: int, seed: int, count: int) -> Means:
        """Of so many replicates."""
        scattered, everything = [], []
        seen: Any = 0.0
        for k in range(count):
            sampler = Sobol(spp=spp, seed=seed + k)
            pictures = [scene.changed(sampler=sampler) for scene in self]
            whole, first = (
                render(one, tables=self.whole.tables, threads=1).colour for one in pictures
            )
            scattered.append(float((whole - first).mean()))
            everything.append(float(whole.mean()))
            seen = seen + np.abs(whole - first).sum(axis=-1)
        return Means(scattered, everything, seen > 0.0)


def sides(scene: Scene) -> tuple[Side, Side]:
    """By paths and by particles.  Raises NoCounterpartError."""
    integrator: Any = scene.integrator
    sampler: Any = scene.resolved_sampler
    if not isinstance(integrator, ByPaths | Direct):
        integrator, sampler = ByPaths(max_depth=5), Sobol()
    integrator = integrator.model_copy(update={"hide_emitters": False})
    share = LONGER / max(scene.film.width, scene.film.height)
    small = {
        "width": max(1, round(share * scene.film.width)),
        "height": max(1, round(share * scene.film.height)),
        "layers": (),
    }
    film: Film = scene.film.model_copy(update=small)
    light = particles_of(integrator)

    def side(whole: Any) -> Side:
        edge = type(whole) if not isinstance(whole, Direct) else ByPaths
        return Side(
            scene.changed(film=film, integrator=whole, sampler=sampler),
            scene.changed(film=film, integrator=edge(max_depth=1), sampler=sampler),
        )

    return side(integrator), side(light)


def pilot(side: Side, seconds: float, seed: int) -> tuple[float, float, float]:
    """Variance of a sample per pixel, its seconds, and the mean, in so many seconds."""
    spp = 1
    side.means(spp, seed, 1)  # compiles
    while True:
        began = time.process_time()
        side.means(spp, seed, 1)
        spent = time.process_time() - began
        if spent >= 0.5 * seconds / PILOT:
            break
        spp *= 2
    began = time.process_time()
    values = side.means(spp, seed + 1, PILOT).scattered
    spent = (time.process_time() - began) / PILOT
    return float(np.var(values, ddof=1)) * spp, spent / spp, float(np.mean(values))


def measured(name: str, seconds: float, last: dict[str, Any]) -> dict[str, Any]:
    """A row of the store.  last: the one that was not enough, whose noise is better known than a
    pilot's; {} for none."""
    scene = Scene.load(SCENES / f"{name}.yaml")
    # So that scenes have unrelated noise, and each look at one.
    own = FIRST_SEED + (zlib.crc32(f"{name} {seconds:g}".encode()) << 12)
    if scene.tables.lights.choice is None:
        return {"scene": name, "refused": "no lamp"}
    try:
        both = sides(scene)
        found = [pilot(side, 0.04 * seconds, own + 1000 * k) for k, side in enumerate(both)]
    except (NoCounterpartError, SceneError) as error:
        return {"scene": name, "refused": getattr(error, "message", str(error))}
    mean = found[0][2]
    if not mean > 0.0:
        return {"scene": name, "refused": "surfaces scatter no light"}
    quantile = float(stats.t.isf((1.0 - LEVEL) / 2.0, 2 * REPLICATES - 2))
    roots = [math.sqrt(variance * spent) for variance, spent, _ in found]
    needed = (sum(roots) * quantile / (WITHIN * mean)) ** 2  # seconds for half of an interval
    row: dict[str, Any] = {
        "scene": name,
        "integrator": both[0].whole.integrator.type,
        "needed": needed,
    }
    if needed > seconds:
        return row
    used = min(max(needed * (WITHIN / AIM) ** 2, LEAST * seconds), seconds)
    began = time.process_time()
    means, spps = [], []
    for k, (side, (_, spent, _)) in enumerate(zip(both, found, strict=True)):
        share = roots[k] / sum(roots)
        spp = max(1, round(share * used / (REPLICATES * spent)))
        means.append(side.means(spp, own + 1000 * (k + 2), REPLICATES))
        spps.append(spp)
    a, b = (np.array(found.scattered) for found in means)
    spread = [float(np.var(x, ddof=1)) / REPLICATES for x in (a, b)]
    deviation = math.sqrt(sum(spread))
    freedom = sum(spread) ** 2 / sum(s * s / (REPLICATES - 1) for s in spread)
    mean = float(a.mean())
    half = float(stats.t.isf((1.0 - LEVEL) / 2.0, freedom)) * deviation / mean
    bias = (float(b.mean()) - mean) / mean
    return {
        **row,
        "bias": bias,
        "half": half,
        "p": 2.0 * float(stats.t.sf(abs(bias * mean) / deviation, freedom)),
        "share": mean / float(np.mean(means[0].everything)),
        "reached": float(means[1].reached[means[0].reached].mean()),
        "asked": seconds,
        "spp": spps,
        "seconds": time.process_time() - began,
    }


def is_known(row: dict[str, Any]) -> bool:
    """Whether particles reach what the camera sees, without which the interval means nothing."""
    return "bias" in row and row["reached"] >= REACHED


def is_within(row: dict[str, Any]) -> bool:
    return is_known(row) and abs(row["bias"]) + row["half"] <= WITHIN


def shown(row: dict[str, Any]) -> list[str]:
    """A row of the table."""
    if "refused" in row:
        return [row["scene"], "", "", "", "", row["refused"]]
    if "bias" not in row:
        needed = f"would take some {row['needed']:.2g} s"
        return [row["scene"], row["integrator"], "", "", "", needed]
    if not is_known(row):
        few = f"particles reach {row['reached']:.0%} of the lit pixels"
        return [row["scene"], row["integrator"], f"{row['share']:.0%}", "", "", few]
    return [
        row["scene"],
        row["integrator"],
        f"{row['share']:.0%}",
        f"{100.0 * row['bias']:+.3f} ± {100.0 * row['half']:.3f} %",
        f"{row['seconds']:.2g}",
        f"within {100.0 * WITHIN:g} %" if is_within(row) else "",
    ]


def write(rows: list[dict[str, Any]]) -> None:
    """The table."""
    rows = sorted(rows, key=lambda row: ("refused" in row, not is_known(row), row["scene"]))
    head = ("scene", "integrator", "scattered", "bias of `light`", "CPU s", "")
    machine, day = (str(provenance()[key]) for key in ("machine", "date"))
    found = [row for row in rows if is_known(row)]
    text = [
        *table_of(head, map(shown, rows)).markdown(),
        "",
        f"{sum(map(is_within, rows))} scenes within ±{100.0 * WITHIN:g} %; the least p-value of "
        f"no bias, of {len(found)}, is {min((row['p'] for row in found), default=1.0):.2g}. "
        f"`python docs/measure_both_ends.py STORE.jsonl`; {machine}, {day[:10]}.",
        "",
    ]
    rewrite(PAGE, "both ends", "\n".join(text))


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("store", type=Path)
    parser.add_argument("names", nargs="*")
    parser.add_argument("--seconds", type=float, default=120.0)
    asked = parser.parse_args()
    check(PAGE, "both ends")
    names = asked.names or sorted(path.stem for path in SCENES.glob("*.yaml"))
    rows = {}
    if asked.store.exists():
        rows = {row["scene"]: row for row in map(json.loads, asked.store.read_text().splitlines())}
    for name in names:
        last = rows.get(name, {"needed": 0.0})
        if "refused" in last or is_within(last):
            continue
        if max(last["needed"], 2.0 * last.get("asked", 0.0)) <= asked.seconds:
            rows[name] = measured(name, asked.seconds, last)
            print(json.dumps(rows[name]), flush=True)
            with asked.store.open("a") as file:
                file.write(json.dumps(rows[name]) + "\n")
    write(list(rows.values()))


if __name__ == "__main__":
    main()
