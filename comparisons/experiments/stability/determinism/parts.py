"""Pictures in bands, in parts by several processes, and in plain Python."""

import os
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

import reference_rt as rt
from comparisons.experiments.stability.harness import scenes
from comparisons.experiments.stability.harness.bits import MAKES, on_threads, over
from comparisons.experiments.stability.harness.core import OURS, Draw, FloatArray, Outcome
from reference_rt.rendering.tiles import render_tile
from reference_rt.util.child_processes import tied

Outcomes = dict[str, Outcome]

_band: Any = render_tile


def _job(scene: rt.Scene) -> tuple[Any, FloatArray]:
    """The arguments of `render_tile` before its sums, and these, (n, 3)."""
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
    )
    return arguments, out


def _add(arguments: Any, out: FloatArray, begin: int, end: int, first: int, last: int) -> None:
    """Add samples first to last - 1 of these pixels to their sums."""
    _band(*arguments, out[begin:end], None, begin, end, first, last)


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
                _add(arguments, out, begin, end, first, last)
    return out.reshape(scene.film.height, scene.film.width, 3) / spp


def bands(draw: Draw, x: float) -> Outcomes:
    return {OURS: over(draw, lambda s, _: (on_threads(s), in_bands(s, int(x), draw.rng)))}


CARRY_ON = """
import sys
from pathlib import Path
from comparisons.experiments.stability.determinism.parts import carry_on
carry_on(Path(sys.argv[1]), float.fromhex(sys.argv[2]), float.fromhex(sys.argv[3]))
"""


def carry_on(folder: Path, first: float, last: float) -> None:
    """Render the pixels from share `first` to `last` of each scene, added to those in its file."""
    for make in MAKES:
        file = folder / f"{make.__name__}.npy"
        scene = make(folder)
        arguments, out = _job(scene)
        if file.exists():
            out[:] = np.load(file)
        begin, end = (round(share * len(out)) for share in (first, last))
        if begin < end:
            _add(arguments, out, begin, end, 0, scene.resolved_sampler.spp)
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
from comparisons.experiments.stability.determinism.parts import plainly
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
