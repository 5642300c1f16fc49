"""Times all methods of a family in all settings of its series, in nanoseconds per ray; the methods
take turns.
"""

import math
import time
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, get_args

import numpy as np

import reference_rt as rt
from comparisons.experiments.methods.errors import barycentric_error
from comparisons.geometry.affine import across, unit_rows, unit_vectors
from reference_rt import textbook
from reference_rt.accel import bvh
from reference_rt.core import transform
from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.render import Progress
from reference_rt.textbook import (
    BoxParameters,
    CsgParameters,
    Method,
    PolygonParameters,
    SceneParameters,
    SphereParameters,
    TriangleParameters,
)
from reference_rt.util.files import temporary_folder

SHAPES = 8
"""Of each setting, at random."""


class Draw(NamedTuple):
    """What a setting is drawn from: the random generator, the number of rays, and a folder for mesh
    files."""

    rng: np.random.Generator
    rays: int
    folder: Path


class Trial(NamedTuple):
    """A shape, by the parameters that its family's methods take, and rays o, d (n, 3) in random
    order."""

    part: Any
    o: FloatArray
    d: FloatArray


class Series(NamedTuple):
    """Trials `make(draw, x)` for each x of `values`;  axis: what x is, "" for a single setting."""

    family: str
    name: str
    axis: str
    values: tuple[float, ...]
    make: Callable[[Draw, float], list[Trial]]

    @property
    def about(self) -> str:
        """A sentence for the page."""
        return " ".join((self.make.__doc__ or "").split())


def _outside(rng: np.random.Generator, n: int, middle: FloatArray) -> FloatArray:
    """Origins (n, 3) three units away from a point, all around."""
    return middle + 3.0 * unit_vectors(rng, n)


def spheres(draw: Draw, _: float) -> list[Trial]:
    """From three radii away, at points in and around a unit sphere; half of the rays hit."""
    trials = []
    for _shape in range(SHAPES):
        center = draw.rng.uniform(-1.0, 1.0, 3)
        o = _outside(draw.rng, draw.rays // SHAPES, center)
        aim = np.sqrt(draw.rng.uniform(0.0, 2.0, (len(o), 1)))
        d = center + aim * across(draw.rng, center - o) - o
        trials.append(Trial(SphereParameters(center, 1.0), o, d))
    return trials


def boxes(draw: Draw, _: float) -> list[Trial]:
    """From three units away, at points in and around a box."""
    lower, upper = np.array([-1.1, -0.7, 0.3]), np.array([0.9, 1.3, 1.7])
    o = _outside(draw.rng, draw.rays, 0.5 * (lower + upper))
    d = draw.rng.uniform(1.2 * lower - 0.2 * upper, 1.2 * upper - 0.2 * lower, o.shape) - o
    return [Trial(BoxParameters(lower, upper), o, d)]


def triangles(draw: Draw, _: float) -> list[Trial]:
    """From three units away, at points in and around triangles of about that size."""
    trials = []
    for _shape in range(SHAPES):
        v = unit_vectors(draw.rng, 3)
        o = _outside(draw.rng, draw.rays // SHAPES, v.mean(axis=0))
        share = draw.rng.dirichlet((1.0, 1.0, 1.0), len(o)) * 2.0 - 1.0 / 3.0
        trials.append(Trial(TriangleParameters(*v), o, share @ v - o))
    return trials


def slivers(draw: Draw, aspect: float) -> list[Trial]:
    """Triangles of length 1, ever thinner, turned any way; from some units away, at points in and
    around them.  Errors are those of the barycentrics."""
    trials = []
    for _shape in range(SHAPES):
        along = unit_vectors(draw.rng, 1)
        height = across(draw.rng, along)[0] / aspect
        v0 = draw.rng.uniform(-1.0, 1.0, 3)
        v = np.stack([v0, v0 + along[0], v0 + draw.rng.uniform(0.2, 0.8) * along[0] + height])
        o = _outside(draw.rng, draw.rays // SHAPES, v.mean(axis=0))
        share = draw.rng.dirichlet((1.0, 1.0, 1.0), len(o)) * 2.0 - 1.0 / 3.0
        trials.append(Trial(TriangleParameters(*v), o, share @ v - o))
    return trials


def polygons(draw: Draw, vertices: float) -> list[Trial]:
    """Gears with teeth of random height, at points in and around them, up to 60° from the
    normal."""
    trials, n = [], int(vertices)
    angles = 2.0 * np.pi * (np.arange(n) + 0.5) / n
    for _shape in range(SHAPES):
        plane = np.stack([x := unit_vectors(draw.rng, 1)[0], across(draw.rng, x[None])[0]])
        radii = np.where(np.arange(n) % 2 == 0, 1.0, draw.rng.uniform(0.4, 0.9, n))
        ring = (radii[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)) @ plane
        target = draw.rng.uniform(-1.0, 1.0, (draw.rays // SHAPES, 2)) @ plane
        normal = np.broadcast_to(unit_rows(np.cross(*plane)), target.shape)
        cosine = draw.rng.uniform(0.5, 1.0, (len(target), 1))
        d = -3.0 * (cosine * normal + np.sqrt(1.0 - cosine**2) * across(draw.rng, normal))
        trials.append(Trial(PolygonParameters([ring]), target - d, d))
    return trials


def solids(draw: Draw, operands: float) -> list[Trial]:
    """Spheres and rotated boxes in a unit ball: the union of half of them minus the other half."""
    shapes: list[Any] = []
    size = operands ** (-1.0 / 3.0)
    for k in range(int(operands)):
        x, y, z = (unit_vectors(draw.rng, 1)[0] * draw.rng.uniform(0.2, 0.9)).tolist()
        a, b, c = unit_vectors(draw.rng, 1)[0].tolist()
        turn = transform.Turn(axis=(a, b, c), degrees=draw.rng.uniform(0.0, 360.0))
        steps = (
            transform.Scale(scale=size),
            transform.Rotate(rotate=turn),
            transform.Translate(translate=(x, y, z)),
        )
        shapes.append(
            rt.Sphere(center=(x, y, z), radius=1.2 * size)
            if k % 2 == 0
            else rt.Box(transform=steps)
        )
    half = (len(shapes) + 1) // 2
    solid = rt.Difference(of=(rt.Union(of=tuple(shapes[:half])), *shapes[half:]))
    o = _outside(draw.rng, draw.rays, np.zeros(3))
    return [Trial(CsgParameters(solid), o, draw.rng.uniform(-0.8, 0.8, o.shape) - o)]


def _meshes(draw: Draw, v: FloatArray) -> list[Trial]:
    """Triangles (n, 3, 3) in a mesh file, and rays at points of the cube [-1, 1]³."""
    n, path = len(v), draw.folder / f"{len(v)}.obj"
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in v.reshape(-1, 3).tolist()]
    lines += [f"f {k} {k + 1} {k + 2}" for k in range(1, 3 * n, 3)]
    path.write_text("\n".join(lines))
    o = _outside(draw.rng, draw.rays, np.zeros(3))
    scene = rt.Scene(shapes=(rt.Mesh(file=str(path)),))
    return [Trial(SceneParameters(scene), o, draw.rng.uniform(-1.0, 1.0, o.shape) - o)]


def strewn(draw: Draw, number: float) -> list[Trial]:
    """Triangles scattered in a cube, smaller the more there are; rays from all around into it."""
    centers = draw.rng.uniform(-1.0, 1.0, (int(number), 1, 3))
    corners = unit_vectors(draw.rng, 3 * len(centers)).reshape(-1, 3, 3)
    return _meshes(draw, centers + 0.5 * number ** (-1.0 / 3.0) * corners)


def needles(draw: Draw, number: float) -> list[Trial]:
    """Triangles as long as the cube and a thousandth as wide."""
    ends = draw.rng.uniform(-1.0, 1.0, (2, int(number), 3))
    third = ends[1] + 0.002 * unit_vectors(draw.rng, int(number))
    return _meshes(draw, np.stack([*ends, third], axis=1))


def _picture(draw: Draw, number: float, size: int) -> list[Trial]:
    """`strewn` triangles, as many, in a picture of size x size pixels."""
    (strewn_ones,) = strewn(draw, number)
    scene = strewn_ones.part.scene.changed(
        camera=rt.Perspective(eye=(0.0, 0.0, 4.0), target=(0.0, 0.0, 0.0), fov=40.0),
        film=rt.Film(width=size, height=size),
    )
    rays = scene.camera_rays()
    o, d = (np.ascontiguousarray(a.reshape(-1, 3)) for a in rays)
    return [Trial(SceneParameters(scene), o, d)]


def picture_of_triangles(draw: Draw, number: float) -> list[Trial]:
    """64 x 64 pixels, and ever more and smaller triangles scattered in a cube."""
    return _picture(draw, number, 64)


def picture_of_pixels(draw: Draw, pixels: float) -> list[Trial]:
    """1000 triangles scattered in a cube, and ever more pixels."""
    return _picture(draw, 1000.0, math.isqrt(int(pixels)))


SERIES = (
    Series("sphere", "all around", "", (1.0,), spheres),
    Series("triangle", "all around", "", (1.0,), triangles),
    Series("triangle", "slivers", "length / height", (1.0, 1e2, 1e4, 1e6, 1e8), slivers),
    Series("box", "all around", "", (1.0,), boxes),
    Series("polygon", "gears", "vertices", (4.0, 16.0, 64.0, 256.0, 1024.0), polygons),
    Series("csg", "solids", "operands", (2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 256.0), solids),
    Series("hierarchy", "strewn", "triangles", (1e1, 1e2, 1e3, 1e4, 1e5), strewn),
    Series("hierarchy", "needles", "triangles", (1e1, 1e2, 1e3, 1e4), needles),
    Series("picture", "triangles", "triangles", (1e1, 1e2, 1e3, 1e4, 1e5), picture_of_triangles),
    Series(
        "picture",
        "pixels",
        "pixels",
        (32.0**2, 64.0**2, 128.0**2, 256.0**2, 512.0**2),
        picture_of_pixels,
    ),
)
FAMILIES = tuple(dict.fromkeys(series.family for series in SERIES))

_RENDERS = textbook.METHODS["hierarchy.none"]

_OURS = Method(
    "csg.renderer",
    "T12",
    "crossings in order, near ones at once: the renderer's own",
    "reference_rt.accel.csg",
    CsgParameters,
    lambda parameters: _RENDERS.prepare(SceneParameters(rt.Scene(shapes=(parameters.solid,)))),
    _RENDERS.run,
)


def methods(family: str) -> dict[str, Method]:
    """By name: those that the textbook registers, and the renderer's own solids."""
    found = {name: textbook.METHODS[name] for name in textbook.names(family)}
    return found | ({_OURS.name: _OURS} if family == "csg" else {})


LONGEST = 15e6
"""Nanoseconds of one run: fewer rays are traced where all would take longer."""

PROBE = 64
"""Rays of each trial from whose time that of all is estimated."""


class Prepared:
    """A method with its precomputed data for some trials, to be run repeatedly."""

    def __init__(self, method: Method, trials: list[Trial]) -> None:
        self.run, self.whole, self.trials = method.run, method.whole, trials
        with np.errstate(all="ignore"):
            self.parts = [method.prepare(trial.part) for trial in trials]
        self._t = np.empty(max(len(trial.o) for trial in trials))

    def traced(self, trial: Trial, rays: int) -> int:
        """How many rays of a trial a run over `rays` takes."""
        return len(trial.o) if self.whole else min(rays, len(trial.o))

    def nanoseconds(self, rays: int) -> float:
        """Time one run over `rays` rays of all trials, evenly chosen: nanoseconds per ray."""
        jobs = []
        for trial, part in zip(self.trials, self.parts, strict=True):
            n = self.traced(trial, rays)
            of = np.arange(n) * len(trial.o) // n
            jobs.append((part, trial.o[of], trial.d[of], self._t[:n]))
        with np.errstate(all="ignore"):
            begin = time.perf_counter_ns()
            for job in jobs:
                self.run(*job)
            return (time.perf_counter_ns() - begin) / sum(len(o) for _, o, _, _ in jobs)


@dataclass(frozen=True)
class Time:
    """Nanoseconds per ray: median and quartiles of `runs` runs of `rays` rays."""

    median: float
    low: float
    high: float
    runs: int
    rays: int


def measure(prepared: Mapping[str, Prepared], runs: int) -> dict[str, Time]:
    """Times by method.  The methods take turns, so that other load on the machine slows them all
    alike."""
    rays = {name: _affordable(method) for name, method in prepared.items()}
    found: dict[str, list[float]] = {name: [] for name in prepared}
    for _ in range(runs):
        for name, method in prepared.items():
            found[name].append(method.nanoseconds(rays[name]))
    times = {}
    for name, values in found.items():
        low, median, high = (float(q) for q in np.quantile(values, (0.25, 0.5, 0.75)))
        method = prepared[name]
        traced = sum(method.traced(trial, rays[name]) for trial in method.trials)
        times[name] = Time(median, low, high, runs, traced)
    return times


def _affordable(method: Prepared) -> int:
    """How many rays of each trial take LONGEST; the first runs compile or load the kernel."""
    method.nanoseconds(1)
    expected = method.nanoseconds(PROBE)
    longest = max(len(trial.o) for trial in method.trials)
    return int(min(max(LONGEST / (expected * len(method.trials)), PROBE), longest))


class Effort(NamedTuple):
    """rays: in a setting;  runs: how often each method is timed."""

    rays: int
    runs: int


QUICK = Effort(rays=8192, runs=7)
FULL = Effort(rays=32768, runs=15)


@dataclass(frozen=True)
class Row:
    """One method in one setting;  build: seconds, None without an acceleration structure;  error:
    see `barycentric_error`, None but for slivers."""

    family: str
    series: str
    axis: str
    x: float
    method: str
    time: Time
    build: float | None
    error: float | None = None


def run(family: str, effort: Effort, seed: int, progress: Progress) -> list[Row]:
    """Time all settings of a family."""
    rows: list[Row] = []
    every = [(one, x) for one in SERIES if one.family == family for x in one.values]
    progress(family, 0.0)
    for done, (series, x) in enumerate(every, start=1):
        rows += _setting(series, x, effort, seed)
        progress(family, done / len(every))
    return rows


def _setting(series: Series, x: float, effort: Effort, seed: int) -> Iterator[Row]:
    """A row for each method;  the same trials for the same seed, whatever else is timed."""
    number = zlib.crc32(f"{series.family} {series.name} {x!r}".encode())
    with temporary_folder() as folder:
        rng = np.random.default_rng((seed, number))
        trials = series.make(Draw(rng, effort.rays, folder), x)
        prepared = {name: Prepared(m, trials) for name, m in methods(series.family).items()}
        for name, found in measure(prepared, effort.runs).items():
            kind = _BUILT.get(name)
            built = _build(kind, trials[0]) if kind else None
            error = barycentric_error(name, trials) if series.make is slivers else None
            yield Row(series.family, series.name, series.axis, x, name, found, built, error)


_BUILT: dict[str, bvh.Method] = {
    **{f"hierarchy.{kind}": kind for kind in get_args(bvh.Method)},
    "picture.cast_hierarchy": "sah",
}
"""The hierarchy of a method."""


def _build(kind: bvh.Method, trial: Trial) -> float:
    """Seconds to build a hierarchy, the best of three: other load on the machine only adds to
    it."""
    triangles = trial.part.scene.tables.geometry.shapes.triangles
    v = triangles.vertices.reshape(-1, 3, 3)
    bounds, corners = (v.min(axis=1), v.max(axis=1)), v.reshape(-1, 9)
    times = []
    for _ in range(3):
        begin = time.perf_counter()
        bvh.build(*bounds, kind, corners)
        times.append(time.perf_counter() - begin)
    return min(times)
