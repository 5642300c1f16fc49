"""Hostile rays to `query.intersect`: their rays, the length of their directions, their time.

Law. a ray of which a number is not finite, or whose direction is 0, misses.  Any other misses or
hits, and a hit is finite throughout, with unit normals.  t counts in units of |d|: a direction
2^k times as long gives 2^-k times t, bit for bit, and the rest as it was.
"""

import time
from functools import cache

import numpy as np

from comparisons.experiments.fuzz.assets import write_files
from comparisons.experiments.stability.harness.outcomes import (
    OURS,
    FloatArray,
    Outcome,
    Outcomes,
    outcome,
)
from comparisons.experiments.stability.harness.series import Draw, Sweep, alone, series
from comparisons.experiments.stability.hostile.bases import BASES
from comparisons.experiments.stability.hostile.damage import NUMBERS, as_text
from comparisons.geometry.exact.dyadic import BoolArray
from reference_rt.rendering import query
from reference_rt.rendering.query import Intersections
from reference_rt.rendering.scene import Scene
from reference_rt.util.files import temporary_folder

UNIT = 1e-12
"""How far the length of a unit normal may be from 1: some thousand roundings, of shapes that are
stretched by 10 at most."""


@cache
def _scene() -> Scene:
    """All shapes, solids and instances; its files are read at once."""

    with temporary_folder() as folder:
        write_files(folder)
        scene = Scene.parse(as_text(BASES["shapes"]), folder=folder)
        _ = scene.tables
    return scene


def ordinary(rng: np.random.Generator, n: int) -> tuple[FloatArray, FloatArray]:
    """From around the scene into it."""
    o = rng.uniform(-8.0, 8.0, (n, 3))
    return o, rng.uniform(-3.0, 3.0, (n, 3)) - o


def hostile(rng: np.random.Generator, n: int, magnitude: float) -> tuple[FloatArray, FloatArray]:
    """Ordinary ones, of which one to six rays are hostile: of the list, or `magnitude` or its
    inverse with either sign."""
    o, d = ordinary(rng, n)
    rays = np.concatenate([o, d], axis=1)
    listed = rng.choice(np.array(NUMBERS), (n, 6))
    scaled = rng.choice([magnitude, 1.0 / magnitude], (n, 6)) * rng.choice([-1.0, 1.0], (n, 6))
    new = np.where(rng.random((n, 6)) < 0.3, listed, scaled)
    chosen = rng.random((n, 6)) < rng.uniform(0.1, 1.0, (n, 1))
    rays = np.where(chosen, new, rays)
    return np.ascontiguousarray(rays[:, :3]), np.ascontiguousarray(rays[:, 3:])


def undefined(hits: Intersections, o: FloatArray, d: FloatArray) -> BoolArray:
    """Which answers (n,) are not what the law allows."""
    met = hits.shape >= 0
    invalid = ~np.isfinite(o).all(axis=1) | ~np.isfinite(d).all(axis=1) | ~d.any(axis=1)
    wrong = np.where(met, ~(np.isfinite(hits.t) & (hits.t > 0.0)), hits.t != np.inf)
    wrong |= met & invalid
    for values in (hits.p, hits.n, hits.ns, hits.uv):
        wrong |= met & ~np.isfinite(values).all(axis=1)
    with np.errstate(all="ignore"):
        for normals in (hits.n, hits.ns):
            wrong |= met & ~(np.abs(np.linalg.norm(normals, axis=1) - 1.0) < UNIT)
    return wrong


def _judged(wrong: BoolArray, o: FloatArray, d: FloatArray, hits: Intersections) -> Outcome:
    shown = {
        "o": o,
        "d": d,
        "came": lambda k: f"t {hits.t[k]!r} shape {hits.shape[k]} n {hits.n[k].tolist()}",
        "expected": "a miss or a hit that is finite throughout",
    }
    return outcome(wrong, shown)


@series(
    Sweep(
        "magnitude of numbers",
        (1e0, 1e9, 1e50, 1e100, 1e150, 1e200, 1e250, 1e300),
        (1e9, 1e150, 1e300),
        *(20_000, 100_000),
    )
)
def rays(draw: Draw, x: float) -> Outcomes:
    """Rays in a scene of all shapes, of which one to six numbers are x, 1/x or from the list of
    hostile ones, NaN and infinity among them. A hit that is not finite throughout breaks the law,
    and one of a ray that is none."""
    o, d = hostile(draw.rng, draw.cases, x)
    hits = query.intersect(_scene().tables, o, d)
    return {OURS: _judged(undefined(hits, o, d), o, d, hits)}


@series(
    Sweep(
        "log2 of a direction's length",
        (8.0, 32.0, 64.0, 128.0, 256.0, 500.0, 900.0, 1000.0),
        (64.0, 500.0, 900.0),
        *(10_000, 50_000),
    )
)
def lengths(draw: Draw, x: float) -> Outcomes:
    """Directions 2^x and 2^-x times as long: t must be 2^-x and 2^x times what it was, bit for
    bit, and all else the same."""
    o, d = ordinary(draw.rng, draw.cases)
    power = np.where(np.arange(len(o)) % 2 == 0, int(x), -int(x))
    scaled = np.ldexp(d, power[:, None])
    tables = _scene().tables
    once, again = query.intersect(tables, o, d), query.intersect(tables, o, scaled)
    with np.errstate(all="ignore"):
        wrong = np.ldexp(again.t, power) != once.t
        for name in ("shape", "primitive", "part", "instance", "n", "ns", "uv"):
            same = getattr(once, name) == getattr(again, name)
            wrong |= ~(same.all(axis=1) if same.ndim == 2 else same)
    return {OURS: _judged(wrong, o, scaled, again)}


MOST_TIME = 2.0
"""Times that hostile rays may take in comparison with ordinary ones."""

REPEATS = 7


@series(alone(20_000, 100_000), "time", unit="times the time of ordinary rays")
def speed(draw: Draw, _: float) -> Outcomes:
    """Hostile rays in comparison with ordinary ones through the same scene: no more than twice as
    long."""
    # The least of several times each, in turns: what else the machine does can only add.  Of the
    # hostile rays, those that are rays: others take no time at all.
    tables = _scene().tables
    o, d = hostile(draw.rng, 20 * draw.cases, 1.0)
    valid = np.isfinite(o).all(axis=1) & np.isfinite(d).all(axis=1) & d.any(axis=1)
    sets = [ordinary(draw.rng, draw.cases), (o[valid][: draw.cases], d[valid][: draw.cases])]
    took = np.full((REPEATS, 2), np.inf)
    for repeat in range(REPEATS):
        for k, (origins, directions) in enumerate(sets):
            if repeat == 0:
                query.first_hits(tables, origins, directions, threads=1)  # compiles
            start = time.perf_counter()
            query.first_hits(tables, origins, directions, threads=1)
            took[repeat, k] = (time.perf_counter() - start) / len(origins)
    ordinary_time, hostile_time = took.min(axis=0)
    ratio = float(hostile_time / ordinary_time)
    return {OURS: Outcome(1, int(ratio > MOST_TIME), ratio)}
