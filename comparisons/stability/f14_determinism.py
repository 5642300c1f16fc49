"""F14: a picture depends on its scene and seed alone.

Law: the same bits for any number of threads; any size and order of the bands of pixels; samples
split at any place; rendering stopped anywhere and carried on by another process from what was
kept; any number of rays traced side by side; plain Python instead of compiled kernels.

Ranges: 1 to 16 threads, bands of 1 pixel to the whole picture in shuffled order, 1 to 8 interrupts,
blocks of 8 to 256 rays.  Counts: each pixel is a case, of 48 x 36, in the path-traced scene and the
one by Whitted of F9; in plain Python of 8 x 6.  Passes: every bit is the same.  Mitsuba: its scalar
and llvm variants with the same seed on 1 to 16 threads, with the box filter, whose pixels share no
samples, and with the Gaussian, which sums samples of several pixels as threads end.
"""

import importlib
import os
import subprocess
import sys
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import reference_rt as rt
from comparisons.mitsuba_backend import LLVM, SCALAR, backend, variant
from comparisons.mitsuba_scene import picture
from comparisons.stability import f09_scenes as scenes
from comparisons.stability.family import (
    EXAMPLES,
    MITSUBA,
    OURS,
    Draw,
    Family,
    FloatArray,
    Outcome,
    Series,
)
from comparisons.translate import load
from reference_rt.bands import render_band

Outcomes = dict[str, Outcome]

# The package has a function of this name.
_module: Any = importlib.import_module("reference_rt.render")

_band: Any = render_band


def same_bits(expected: FloatArray, found: FloatArray) -> Outcome:
    """A case a pixel; worst: the largest relative difference."""
    other = (expected != found).any(axis=-1)
    size = np.maximum(np.abs(expected), np.abs(found))
    off = np.abs(expected - found) / np.where(size > 0.0, size, 1.0)
    examples = tuple(
        {
            "pixel": [int(x), int(y)],
            "expected": [c.hex() for c in expected[y, x].tolist()],
            "found": [c.hex() for c in found[y, x].tolist()],
        }
        for y, x in np.argwhere(other)[:EXAMPLES]
    )
    return Outcome(other.size, int(np.count_nonzero(other)), float(off.max()), 0, examples)


MAKES = (scenes.path, scenes.whitted)


def _over(draw: Draw, again: Callable[[rt.Scene], FloatArray]) -> Outcome:
    """Both scenes on one thread, against what `again` renders of them."""
    total = Outcome(0, 0)
    for make in MAKES:
        scene = make(draw.folder)
        total += same_bits(rt.render(scene, threads=1).colour, again(scene))
    return total


# ---- threads ------------------------------------------------------------------------------------

SMALL_BAND = 64


def _threads(draw: Draw, x: float) -> Outcomes:
    """In bands so small that threads have something to share."""
    previous = _module.SAMPLES_PER_BAND
    _module.SAMPLES_PER_BAND = SMALL_BAND
    try:
        found = {OURS: _over(draw, lambda scene: rt.render(scene, threads=int(x)).colour)}
    finally:
        _module.SAMPLES_PER_BAND = previous
    if draw.mitsuba:
        found[MITSUBA] = _mitsuba_threads(draw, SCALAR, rt.BoxFilter(), int(x))
    return found


def _wide_filter(variant_name: str, draw: Draw, x: float) -> Outcomes:
    """Ours has no samples that pixels share: each pixel's filter draws its own."""

    def wide(scene: rt.Scene) -> rt.Scene:
        return scene.changed(film=scene.film.model_copy(update={"filter": rt.GaussianFilter()}))

    total = Outcome(0, 0)
    for make in MAKES:
        scene = wide(make(draw.folder))
        first, again = (rt.render(scene, threads=n).colour for n in (1, int(x)))
        total += same_bits(first, again)
    found = {OURS: total}
    if draw.mitsuba and (variant_name == SCALAR or backend().variant == LLVM):
        found[MITSUBA] = _mitsuba_threads(draw, variant_name, rt.GaussianFilter(), int(x))
    return found


def _mitsuba_threads(draw: Draw, name: str, film_filter: Any, threads: int) -> Outcome:
    """The path-traced scene, one seed: one thread, then others, each count three times."""
    import drjit as dr

    scene = scenes.path(draw.folder)
    film = scene.film.model_copy(update={"filter": film_filter, "width": 96, "height": 72})
    with variant(name):
        mi_scene = load(scene.changed(film=film)).mi_scene
        before = dr.thread_count()
        try:
            dr.set_thread_count(1)
            first = picture(mi_scene, 4, seed=1)
            dr.set_thread_count(threads)
            total = Outcome(0, 0)
            for _ in range(3):
                total += same_bits(first, picture(mi_scene, 4, seed=1))
        finally:
            dr.set_thread_count(before)
    return total


# ---- bands and interrupts -----------------------------------------------------------------------


def _job(scene: rt.Scene) -> tuple[Any, FloatArray]:
    """All of `render_band`'s arguments but the last four, and the sums (n, 3) that it writes."""
    film, sampler, integrator = scene.film, scene.resolved_sampler, scene.integrator
    assert not isinstance(integrator, rt.RayCast)
    shape = (film.width, film.height)
    out = np.zeros((film.width * film.height, 3))
    arguments = (
        integrator.setup(),
        rt.build_tables(scene),
        scene.camera.setup(*shape),
        film.filter.setup(),
        sampler.setup(),
        shape,
        sampler.spp,
        out,
        None,
    )
    return arguments, out


def in_bands(scene: rt.Scene, size: int, rng: np.random.Generator) -> FloatArray:
    """Bands of `size` pixels in any order; the samples of each in two parts, cut anywhere."""
    arguments, out = _job(scene)
    spp = scene.resolved_sampler.spp
    begins = np.arange(0, len(out), size)
    for begin in rng.permutation(begins).tolist():
        end = min(begin + size, len(out))
        cut = int(rng.integers(0, spp + 1))
        for first, last in ((0, cut), (cut, spp)):
            if first < last:
                _band(*arguments, begin, end, first, last)
    return out.reshape(scene.film.height, scene.film.width, 3)


def _bands(draw: Draw, x: float) -> Outcomes:
    return {OURS: _over(draw, lambda scene: in_bands(scene, int(x), draw.rng))}


CARRY_ON = """
import sys
from pathlib import Path
from comparisons.stability.f14_determinism import carry_on
carry_on(Path(sys.argv[1]), sys.argv[2], int(sys.argv[3]), int(sys.argv[4]))
"""


def carry_on(folder: Path, name: str, first: int, last: int) -> None:
    """Pixels first..last of a scene, added to those that are kept in a file."""
    scene = getattr(scenes, name)(folder)
    file = folder / f"{name}.npy"
    arguments, out = _job(scene)
    if file.exists():
        out[:] = np.load(file)
    _band(*arguments, first, last, 0, scene.resolved_sampler.spp)
    np.save(file, out)


def _interrupted(draw: Draw, x: float) -> Outcomes:
    """Each part by a process of its own, from what the one before has left."""
    total = Outcome(0, 0)
    for make in MAKES[: 1 if draw.effort == "quick" else 2]:
        scene = make(draw.folder)
        pixels = scene.film.width * scene.film.height
        cuts = np.sort(draw.rng.choice(np.arange(1, pixels), int(x), replace=False)).tolist()
        name = make.__name__
        for first, last in zip([0, *cuts], [*cuts, pixels], strict=True):
            command = [sys.executable, "-c", CARRY_ON, str(draw.folder), name]
            subprocess.run([*command, str(first), str(last)], check=True, capture_output=True)
        found = np.load(draw.folder / f"{name}.npy").reshape(scene.film.height, -1, 3)
        total += same_bits(rt.render(scene).colour, found)
    return {OURS: total}


# ---- other code ---------------------------------------------------------------------------------

PLAIN = """
import sys
from pathlib import Path
from comparisons.stability.f14_determinism import plainly
plainly(Path(sys.argv[1]), int(sys.argv[2]))
"""

SIZED = {"RAY_FLOATS", "HIT_FLOATS", "HIT_INTEGERS", "STATE_FLOATS", "VECTOR_FLOATS"}
"""Sizes of scratch that are so many times `ray.BLOCK`."""

TINY = rt.Film(width=8, height=6)


def plainly(folder: Path, block: int) -> None:
    """Pictures with so many rays side by side, for a process without compiled kernels: there the
    number is looked up when it is needed."""
    from reference_rt import ray

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


def _blocks(draw: Draw, x: float) -> Outcomes:
    block = int(x)
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    draw.folder.mkdir(exist_ok=True)
    scenes.write_ball(draw.folder)
    command = [sys.executable, "-c", PLAIN, str(draw.folder), str(block)]
    subprocess.run(command, check=True, capture_output=True, env=environment)
    total = Outcome(0, 0)
    for make in MAKES:
        compiled = rt.render(make(draw.folder).changed(film=TINY)).colour
        total += same_bits(compiled, np.load(draw.folder / f"{make.__name__}_{block}.npy"))
    return {OURS: total}


# ---- the family ---------------------------------------------------------------------------------

_ONE: Mapping[Any, int] = {"quick": 1, "full": 1}
_UNIT = "largest relative difference"

FAMILY = Family(
    id="F14",
    name="determinism",
    law="a picture has the same bits for any threads, bands, blocks, interrupts, and without "
    "compiled kernels",
    anchors="Lightmetrica's scheduler test asks for similar pictures only",
    series=(
        Series(
            name="threads",
            axis="threads",
            about="Pictures by so many threads against one thread's, with the box filter.",
            values=(1.0, 2.0, 3.0, 4.0, 8.0, 16.0),
            quick=(2.0, 8.0),
            cases=_ONE,
            measure=_threads,
            unit=_UNIT,
            explained="with the box filter no pixel of Mitsuba's depends on another",
        ),
        Series(
            name="wide filter, scalar",
            axis="threads",
            about="The same with the Gaussian filter, Mitsuba's scalar variant.",
            values=(1.0, 2.0, 4.0, 8.0, 16.0),
            quick=(8.0,),
            cases=_ONE,
            measure=partial(_wide_filter, SCALAR),
            unit=_UNIT,
            explained="threads are few",
        ),
        Series(
            name="wide filter, llvm",
            axis="threads",
            about="The same with the Gaussian filter, Mitsuba's llvm variant.",
            values=(1.0, 2.0, 4.0, 8.0, 16.0),
            quick=(8.0,),
            cases=_ONE,
            measure=partial(_wide_filter, LLVM),
            unit=_UNIT,
            explained="threads are few",
        ),
        Series(
            name="bands",
            axis="pixels in a band",
            about="Bands in any order, the samples of each cut in two anywhere.",
            values=(1.0, 7.0, 64.0, 1000.0, 1728.0),
            quick=(7.0, 1000.0),
            cases=_ONE,
            measure=_bands,
            unit=_UNIT,
        ),
        Series(
            name="interrupted",
            axis="interrupts",
            about="Parts of a picture by processes one after another, each from the file that the "
            "one before has left.",
            values=(1.0, 3.0, 8.0),
            quick=(1.0,),
            cases=_ONE,
            measure=_interrupted,
            unit=_UNIT,
        ),
        Series(
            name="blocks in plain Python",
            axis="rays side by side",
            about="Tiny pictures without compiled kernels, so many rays at a time, against "
            "compiled ones with 64.",
            values=(8.0, 16.0, 64.0, 256.0),
            quick=(8.0,),
            cases=_ONE,
            measure=_blocks,
            unit=_UNIT,
        ),
    ),
)
