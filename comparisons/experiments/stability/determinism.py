"""F14: a picture depends on its scene and seed alone.

Law.  The same bits for any number of threads; any size and order of the bands of pixels; samples
split at any place; rendering stopped anywhere and carried on by another process from its file; any
number of rays in a block; plain Python instead of compiled kernels.

Range.  1 to 16 threads, bands of 1 pixel to the whole picture in shuffled order, 1 to 8 interrupts,
blocks of 8 to 256 rays.

Counts.  Each pixel is a case, of 48 x 36, in the path-traced scene and the one by Whitted of
`harness.scenes`; in plain Python of 8 x 6.

Passes.  Every bit is the same.

Mitsuba renders the path-traced scene of 96 x 72 pixels three times with the same seed, its scalar
variant with the box filter, and scalar and llvm with the Gaussian, on 1 to 16 threads against 1.
"""

import importlib
import os
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

import reference_rt as rt
from comparisons.experiments.stability.harness import scenes
from comparisons.experiments.stability.harness.core import (
    MITSUBA,
    OURS,
    Draw,
    Family,
    FloatArray,
    Outcome,
    Series,
    Sweep,
)
from comparisons.experiments.stability.harness.scenes import MAKES, on_threads, over, same_bits
from comparisons.mitsuba.backend import LLVM, SCALAR, backend, variant
from comparisons.mitsuba.scene import picture
from comparisons.mitsuba.translate import load
from reference_rt.rendering.executor import Prepared
from reference_rt.util.processes import tied

# ---- pictures in bands, in parts by several processes, and in plain Python -----------------------


Outcomes = dict[str, Outcome]


def _summed(scene: rt.Scene) -> tuple[Callable[..., None], FloatArray]:
    """What adds samples first to last - 1 of pixels begin to end - 1 to their sums, called with
    these four, by the kernel that renders the scene;  the sums (n, 3)."""
    kernel = Prepared(scene, threads=1, specialised=False).running.run(0)
    sums = np.zeros((scene.film.width * scene.film.height, 3))
    return lambda begin, end, *samples: kernel(
        {"colour": sums[begin:end]}, begin, end, *samples
    ), sums


def in_bands(scene: rt.Scene, size: int, rng: np.random.Generator) -> FloatArray:
    """Bands of `size` pixels in any order; the samples of each in two parts, cut anywhere."""
    add, out = _summed(scene)
    spp = scene.resolved_sampler.spp
    begins = np.arange(0, len(out), size)
    for begin in rng.permutation(begins).tolist():
        end = min(begin + size, len(out))
        cut = int(rng.integers(0, spp + 1))
        for first, last in ((0, cut), (cut, spp)):
            if first < last:
                add(begin, end, first, last)
    return out.reshape(scene.film.height, scene.film.width, 3) / spp


def bands(draw: Draw, x: float) -> Outcomes:
    return {OURS: over(draw, lambda s, _: (on_threads(s), in_bands(s, int(x), draw.rng)))}


CARRY_ON = """
import sys
from pathlib import Path
from comparisons.experiments.stability.determinism import carry_on
carry_on(Path(sys.argv[1]), float.fromhex(sys.argv[2]), float.fromhex(sys.argv[3]))
"""


def carry_on(folder: Path, first: float, last: float) -> None:
    """Render the pixels from share `first` to `last` of each scene, added to those in its file."""
    for make in MAKES:
        file = folder / f"{make.__name__}.npy"
        scene = make(folder)
        add, out = _summed(scene)
        if file.exists():
            out[:] = np.load(file)
        begin, end = (round(share * len(out)) for share in (first, last))
        if begin < end:
            add(begin, end, 0, scene.resolved_sampler.spp)
        np.save(file, out)


def interrupted(draw: Draw, x: float) -> Outcomes:
    """The first part is rendered by this process, each other one by a new process that reads the
    file of the one before."""
    cuts = [0.0, *np.sort(draw.rng.uniform(0.0, 1.0, int(x))).tolist(), 1.0]
    carry_on(draw.folder, *cuts[:2])
    for first, last in pairwise(cuts[1:]):
        command = [sys.executable, "-c", CARRY_ON, str(draw.folder)]
        subprocess.run(
            [*command, first.hex(), last.hex()], check=True, capture_output=True, **tied()
        )

    def pictures(scene: rt.Scene, name: str) -> tuple[FloatArray, FloatArray]:
        found = np.load(draw.folder / f"{name}.npy").reshape(scene.film.height, -1, 3)
        return rt.render(scene).colour, found / scene.resolved_sampler.spp

    return {OURS: over(draw, pictures)}


# ---- other code ---------------------------------------------------------------------------------

PLAIN = """
import sys
from pathlib import Path
from comparisons.experiments.stability.determinism import plainly
plainly(Path(sys.argv[1]), int(sys.argv[2]))
"""

SIZED = {"RAY_FLOATS", "HIT_FLOATS", "HIT_INTEGERS", "STATE_FLOATS", "VECTOR_FLOATS"}
"""Sizes of scratch that are so many times `ray.BLOCK`."""

TINY = rt.Film(width=8, height=6)


def plainly(folder: Path, block: int) -> None:
    """Pictures with so many rays side by side, for a process without compiled kernels: there the
    number is read when it is needed."""
    from reference_rt.core import ray

    usual = ray.BLOCK
    for name, module in list(sys.modules.items()):
        if name.startswith("reference_rt") and getattr(module, "BLOCK", None) == usual:
            module.BLOCK = block  # type: ignore[attr-defined]
    for name, module in list(sys.modules.items()):
        if name.startswith("reference_rt"):
            for sized in SIZED & set(vars(module)):
                setattr(module, sized, getattr(module, sized) * block // usual)
    for make in MAKES:
        scene = make(folder).changed(film=TINY)
        np.save(folder / f"{make.__name__}_{block}.npy", rt.render(scene, threads=1).colour)


def blocks(draw: Draw, x: float) -> Outcomes:
    block = int(x)
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    draw.folder.mkdir(exist_ok=True)
    scenes.write_ball(draw.folder)
    command = [sys.executable, "-c", PLAIN, str(draw.folder), str(block)]
    subprocess.run(command, check=True, capture_output=True, env=environment, **tied())

    def pictures(scene: rt.Scene, name: str) -> tuple[FloatArray, FloatArray]:
        compiled = rt.render(scene.changed(film=TINY)).colour
        return compiled, np.load(draw.folder / f"{name}_{block}.npy")

    return {OURS: over(draw, pictures)}


# ---- pictures by any number of threads, ours and Mitsuba's ---------------------------------------


_module: Any = importlib.import_module("reference_rt.rendering.units")


SMALL_BAND = 64


def threads(draw: Draw, x: float) -> Outcomes:
    """In bands so small that threads have something to share."""
    previous = _module.SAMPLES_PER_TILE
    _module.SAMPLES_PER_TILE = SMALL_BAND
    try:
        found = {OURS: over(draw, lambda s, _: (on_threads(s), on_threads(s, int(x))))}
    finally:
        _module.SAMPLES_PER_TILE = previous
    if draw.mitsuba:
        found[MITSUBA] = _mitsuba_threads(draw, SCALAR, rt.BoxFilter(), int(x))
    return found


def wide_filter(variant_name: str, draw: Draw, x: float) -> Outcomes:
    """Ours has no samples that pixels share: each pixel's filter draws its own."""

    def pictures(scene: rt.Scene, _: str) -> tuple[FloatArray, FloatArray]:
        wide = _filtered(scene, rt.GaussianFilter())
        return on_threads(wide), on_threads(wide, int(x))

    found = {OURS: over(draw, pictures)}
    if draw.mitsuba and (variant_name == SCALAR or backend().variant == LLVM):
        found[MITSUBA] = _mitsuba_threads(draw, variant_name, rt.GaussianFilter(), int(x))
    return found


def _filtered(scene: rt.Scene, film_filter: Any, **size: int) -> rt.Scene:
    return scene.changed(film=scene.film.model_copy(update={"filter": film_filter, **size}))


def _mitsuba_threads(draw: Draw, name: str, film_filter: Any, count: int) -> Outcome:
    """The path-traced scene, one seed: one thread, then others, each count three times."""
    import drjit as dr

    scene = _filtered(scenes.path(draw.folder), film_filter, width=96, height=72)
    with variant(name):
        mi_scene = load(scene).mi_scene
        before = dr.thread_count()
        try:
            dr.set_thread_count(1)
            first = picture(mi_scene, 4, seed=1)
            dr.set_thread_count(count)
            total = Outcome(0, 0)
            for _ in range(3):
                total += same_bits(first, picture(mi_scene, 4, seed=1))
        finally:
            dr.set_thread_count(before)
    return total


# ---- the series ----------------------------------------------------------------------------------


_ONE = 1, 1

_series = partial(Series, unit="largest relative difference")

FAMILY = Family(
    id="F14",
    name="determinism",
    law="a picture has the same bits for any threads, bands, blocks, interrupts, and without "
    "compiled kernels",
    anchors="Lightmetrica's scheduler test asks for similar pictures only",
    series=(
        _series(
            "threads",
            Sweep("threads", (1.0, 2.0, 3.0, 4.0, 8.0, 16.0), (2.0, 8.0), *_ONE),
            "Pictures by so many threads against one thread's, with the box filter.",
            threads,
            explained="the range ends at 16 threads.  Mitsuba's scalar variant has the same bits "
            "with 1 to 8 and not with 16: 11,031 of 20,736 pixels differ, by up to all they are",
        ),
        _series(
            "wide filter, scalar",
            Sweep("threads", (1.0, 2.0, 4.0, 8.0, 16.0), (8.0,), *_ONE),
            "The same with the Gaussian filter, Mitsuba's scalar variant.",
            partial(wide_filter, SCALAR),
            explained="the range ends at 16 threads.  Mitsuba differs from 2 on: in 100 to 171 of "
            "20,736 pixels by up to 2.3e-7, with 16 in 20,195 by up to 0.94",
        ),
        _series(
            "wide filter, llvm",
            Sweep("threads", (1.0, 2.0, 4.0, 8.0, 16.0), (8.0,), *_ONE),
            "The same with the Gaussian filter, Mitsuba's llvm variant.",
            partial(wide_filter, LLVM),
            explained="the range ends at 16 threads.  Mitsuba differs from 2 on: in 1,050 to 6,519 "
            "of 20,736 pixels, by up to 8.8e-7",
        ),
        _series(
            "bands",
            Sweep("pixels in a band", (1.0, 7.0, 64.0, 1000.0, 1728.0), (7.0, 1000.0), *_ONE),
            "Bands in any order, the samples of each cut in two anywhere.",
            bands,
        ),
        _series(
            "interrupted",
            Sweep("interrupts", (1.0, 3.0, 8.0), (1.0,), *_ONE),
            "Parts of a picture by processes one after another, each from the file that the "
            "one before has left.",
            interrupted,
        ),
        _series(
            "blocks in plain Python",
            Sweep("rays side by side", (8.0, 16.0, 64.0, 256.0), (8.0,), *_ONE),
            "Tiny pictures without compiled kernels, so many rays at a time, against "
            "compiled ones with 64.",
            blocks,
        ),
    ),
)
