"""`derivative`: the picture of the derivative of radiance by a parameter of the scene.

Differences with common random numbers.  A random number is a pure function of seed, pixel, sample
and dimension, so that the scenes at +h and -h take the same paths: where radiance depends smoothly
on the parameter their difference has the noise of the derivative itself.  Where an edge moves by
d = h |v| pixels, a sample's difference is 0 or the whole step across the edge over 2 h, with a
chance of 2 d: its variance grows with 1 / h, its truncation with h².

Truncation.  D(h) = D + c h² + O(h⁴), so that (D(2h) - D(h)) / 3 estimates c h² (Richardson 1911).
One of the replicates makes D(2h), with its own random numbers.  Edges give this estimate noise: of
the samples within h of an edge 1 / 2h becomes 1 / 4h, and as many beyond h count 1 / 4h, so that
its variance is 1 / 18 of that of one replicate's D(h): with REPLICATES of them its standard error
is .94 of that of the mean.

Russian roulette is a choice that depends on the parameter: a path that survives in one scene only
is an edge, of much light.  So it begins late here, which changes no mean.  In the Cornell box, by
reflectances of walls, the noise is a third to a seventh, .89 to .97 of that of Mitsuba's automatic
differentiation at equal samples.

At a bound, such as a reflectance of 1, the difference is one-sided and of second order as well:
(-3 f(p) + 4 f(p + h) - f(p + 2h)) / 2h, of three scenes.
"""

import math
import os
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Generic, Literal, NamedTuple, TypeVar

import numpy as np

from reference_rt.core.arrays import FloatArray
from reference_rt.core.exr import write_exr
from reference_rt.rendering.image import check_suffix
from reference_rt.rendering.picture import provenance
from reference_rt.rendering.render import Progress, render, with_settings
from reference_rt.rendering.signed_picture import write_signed
from reference_rt.scene.build import BuiltScene
from reference_rt.scene.model import SceneModel
from reference_rt.scene.parameters import Parameter, moved, parameter
from reference_rt.util.errors import Brief, SceneError, UsageError
from reference_rt.util.memory import check_memory

REPLICATES = 16
"""Independent estimates: a sixteenth of the samples makes the second step, so that a derivative
costs 1.06 of two pictures, and standard errors have 15 degrees of freedom."""

STEP = 2.0**-8
"""The default step in parts of the parameter's scale, and a power of two, so that p + h is exact.
It moves an edge across a picture of 100 pixels by half a pixel.  The truncation of x^n is
(n - 1)(n - 2) / 6 of 1.5e-5; rounding, some hundred units of 2^-53 over h, is below 1e-11."""

ROULETTE = 16
"""The number of a path's edges from which roulette may end it, if the scene lets it be so long.  In
a closed room of albedo .8, .5, .2 paths take 2.5 times as long as from 5, with .43 and .14 of the
noise in red and green; from 32 on, twice as long again, with .3 of the noise in red alone."""

HALVINGS = 4
"""How often the default step is halved to stay between bounds before it becomes one-sided."""

Side = Literal["central", "forward", "backward"]

_RULES: dict[Side, tuple[tuple[int, float], ...]] = {
    "central": ((1, 0.5), (-1, -0.5)),
    "forward": ((0, -1.5), (1, 2.0), (2, -0.5)),
    "backward": ((0, 1.5), (-1, -2.0), (-2, 0.5)),
}
"""Steps from the parameter, and the weights of the pictures there, times 1 / h."""

S = TypeVar("S", bound=SceneModel)


class Difference(NamedTuple, Generic[S]):
    """A derivative as a sum over scenes: sum of weights[i] f(scenes[i]), for any f of a scene.

    coarse: the scenes at twice the step, whose weights are half as large.
    """

    parameter: Parameter
    step: float
    side: Side
    scenes: tuple[S, ...]
    weights: tuple[float, ...]
    coarse: tuple[S, ...]


def difference(scene: S, path: str, step: float | None = None) -> Difference[S]:
    """The scenes whose pictures make the derivative by a parameter.

    step: in the parameter's unit; None: STEP of its scale, halved up to HALVINGS times to stay
    between the parameter's bounds.  At a bound the difference is one-sided.  Raises UsageError for
    a path that is none, and for a step across a bound.
    """
    of = parameter(scene, path)
    if step is not None and not 0.0 < step < math.inf:
        raise UsageError(f"step: expected a number above 0, got {step:g}")
    first = step or 2.0 ** round(math.log2(STEP * of.scale))
    tries: list[tuple[Side, float]] = [("central", first)]
    if step is None:
        tries += [("central", first / 2.0**k) for k in range(1, HALVINGS + 1)]
    tries += [("forward", first), ("backward", first)]
    if step is not None and _fits(scene, of, "central", first / 1024.0):
        del tries[1:]  # not at a bound
    reasons = []
    for side, h in tries:
        try:
            rule = _RULES[side]
            scenes, coarse = (
                tuple(moved(scene, of, k * times * h) for k, _ in rule) for times in (1, 2)
            )
            for one in (*scenes, *coarse):
                if isinstance(one, BuiltScene):
                    _ = one.tables  # some faults show only there
        except SceneError as error:
            reasons.append(error.message)
            continue
        return Difference(of, h, side, scenes, tuple(w / h for _, w in rule), coarse)
    raise UsageError(
        f"{of.path}: a step of {first:g} and of twice that from {_shown(of.value)} crosses a "
        f"bound: {reasons[0]}; expected a smaller step"
    )


def _fits(scene: SceneModel, of: Parameter, side: Side, h: float) -> bool:
    try:
        for k, _ in _RULES[side]:
            moved(scene, of, k * h)
    except SceneError:
        return False
    return True


def _shown(value: float | tuple[float, ...]) -> str:
    return f"{value:g}" if isinstance(value, float) else str([*value])


@dataclass(frozen=True)
class Derivative(metaclass=Brief):
    """The derivative of a picture by a parameter, in W/sr/m² per unit of the parameter.

    parameter: its path;  value: the parameter's, or those of a colour that moves as a whole;  step:
    h;  side: "central", or one-sided at a bound.  replicates (R, height, width, 3): independent
    estimates, of samples of their own.  truncation (height, width, 3): an estimate, with sign, of
    what the step adds to the picture; its own noise is at most that of the picture.  spp: samples
    per pixel of each scene, of all replicates.  scene: what was differenced.  warnings: why no
    statement, or a poor one, is possible.  seconds: wall-clock time.
    """

    parameter: str
    value: float | tuple[float, ...]
    step: float
    side: Side
    replicates: FloatArray
    truncation: FloatArray
    spp: int
    scene: SceneModel
    warnings: tuple[str, ...] = ()
    seconds: float = field(default=0.0, compare=False)

    @cached_property
    def picture(self) -> FloatArray:
        """(height, width, 3), row 0 on top."""
        return np.asarray(self.replicates.mean(axis=0))

    @cached_property
    def standard_error(self) -> FloatArray:
        """(height, width, 3): of the picture; inf where there is one replicate."""
        count = len(self.replicates)
        if count < 2:
            return np.full(self.picture.shape, math.inf)
        return np.asarray(self.replicates.std(axis=0, ddof=1) / math.sqrt(count))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write picture, standard error and truncation to an .exr (float32; R, G, B,
        standard_error.R, ..., truncation.B), or the picture to a .png: red above 0, blue below,
        with a scale.  The file appears whole or not at all.  Raises UsageError for other suffixes,
        ImageError."""
        target = Path(path)
        check_suffix(target)
        header = provenance(self.scene) | {
            "derivative": self.parameter,
            "step": repr(self.step),
            "side": self.side,
        }
        if target.suffix.lower() == ".png":
            write_signed(target, self.picture, f"W/sr/m2 per unit of {self.parameter}", header)
            return
        layers = ("", self.picture), ("standard_error.", self.standard_error)
        planes = {
            prefix + channel: layer[..., k]
            for prefix, layer in (*layers, ("truncation.", self.truncation))
            for k, channel in enumerate("RGB")
        }
        write_exr(target, planes, header)


def derivative(
    scene: BuiltScene | str | os.PathLike[str],
    parameter: str,
    *,
    spp: int | None = None,
    size: tuple[int, int] | None = None,
    seed: int | None = None,
    threads: int | None = None,
    step: float | None = None,
    replicates: int = REPLICATES,
    progress: Progress | None = None,
) -> Derivative:
    """The derivative of a scene's picture by a parameter, named by its path (see
    `reference_rt.scene.parameters`), by differences with common random numbers.

    spp: samples per pixel of each scene, of all replicates together, rounded up to a multiple of
    them;  size, seed, threads, progress: as of `render`;  step: in the parameter's unit; None: see
    `difference`;  replicates: independent estimates, with the seeds that follow the first.  It
    costs as much as two pictures, and one part in `replicates` more; at a bound, three.

    Raises UsageError, SceneError.
    """
    began = time.perf_counter()
    if not isinstance(scene, BuiltScene):
        scene = BuiltScene.load(os.fspath(scene))
    scene = _with_late_roulette(with_settings(scene, spp=spp, size=size, seed=seed))
    sampler = scene.resolved_sampler
    first = getattr(sampler, "seed", None)
    if replicates < 1:
        raise UsageError(f"replicates: expected 1 or more, got {replicates}")
    count = 1 if first is None else min(replicates, sampler.spp)
    each = -(-sampler.spp // count)
    film = scene.film
    try:
        check_memory((count + 4) * film.width * film.height * 24, f"{count} replicates")
    except ValueError as error:
        raise scene.error(str(error), "film") from None
    say = progress or (lambda what, fraction: None)
    _ = scene.tables  # of a camera that moves they are shared
    found = difference(scene, parameter, step)

    def pictures(scenes: Sequence[BuiltScene], k: int) -> list[FloatArray]:
        made = []
        for one in scenes:
            chosen = one if first is None else with_settings(one, spp=each, seed=first + k)
            picture = render(
                chosen,
                tables=one.tables,
                threads=threads,
                compiling=lambda done, total: say("compile", done / total),
            )
            made.append(picture.colour)
        return made

    def summed(made: Sequence[FloatArray], factor: float = 1.0) -> FloatArray:
        return np.asarray(sum(w * factor * f for w, f in zip(found.weights, made, strict=True)))

    estimates = np.empty((count, film.height, film.width, 3))
    brightest = 0.0
    for k in range(count):
        say("render", k / (count + 1))
        made = pictures(found.scenes, k)
        brightest = max(brightest, *(float(np.abs(f).mean()) for f in made))
        estimates[k] = summed(made)
    coarse = summed(pictures(found.coarse, 0), 0.5)
    truncation = (coarse - estimates[0]) / 3.0
    say("render", 1.0)
    result = Derivative(
        found.parameter.path,
        found.parameter.value,
        found.step,
        found.side,
        estimates,
        truncation,
        each * count,
        scene,
        seconds=time.perf_counter() - began,
    )
    object.__setattr__(result, "warnings", tuple(_warnings(result, brightest)))
    return result


def _with_late_roulette(scene: BuiltScene) -> BuiltScene:
    first = getattr(scene.integrator, "rr_depth", None)
    if first is None or first >= ROULETTE:
        return scene
    integrator = scene.integrator.model_copy(update={"rr_depth": ROULETTE})
    return scene.changed(integrator=integrator)


# ---- what is said of a derivative ---------------------------------------------------------------

_TILES = 4
"""Tiles along each side, of whose means the warnings are: a picture's mean may be 0 by symmetry."""

_NOISY = 0.1
"""The relative standard error from which a derivative is called noisy."""

_BENT = 0.01
"""The relative truncation from which a step is called too large."""

_ROUNDED = 1e-3
"""The relative rounding from which a step is called too small."""

_ROUNDINGS = 256.0 * 2.0**-53
"""Of a pixel, relatively: a path has some tens of operations for each of a few vertices."""


def _warnings(of: Derivative, brightest: float) -> Iterator[str]:
    """brightest: the largest mean of a picture that was differenced."""
    if not np.isfinite(of.replicates).all():
        yield "some values are not finite: the scene's picture has pixels that are not"
        return
    if len(of.replicates) == 1:
        yield (
            "one replicate has no standard error, and the points of a grid miss edges that move "
            "between them; expected a sampler 'sobol' or 'independent', of 2 samples or more"
        )
    tiles = _tiles(of.replicates)
    size = float(np.square(tiles.mean(axis=0)).sum())
    rounding, mean = _ROUNDINGS * brightest / of.step, math.sqrt(size / tiles[0].size)
    if mean <= rounding:
        yield (
            f"nothing changes, beyond rounding, with {of.parameter} within {of.step:g}: it is not "
            "seen, or too rarely; expected a larger step or more samples"
        )
        return
    if len(tiles) > 1:
        noise = float(tiles.var(axis=0, ddof=1).sum()) / len(tiles)
        share = math.sqrt(noise / size)
        bent = math.sqrt(max(float(np.square(_tiles(of.truncation)).sum()) - 4.0 * noise, 0.0))
        if bent > _BENT * math.sqrt(size):
            yield (
                f"the step, {of.step:g}, is too large: it adds about "
                f"{bent / math.sqrt(size):.1%}; expected a smaller one"
            )
        if share > _NOISY:
            times = (share / _NOISY) ** 2
            yield (
                f"the standard error of its tiles is {share:.0%} of it: too much for a statement; "
                f"{_NOISY:.0%} takes about {times:.2g} times the samples"
            )
    if rounding > _ROUNDED * mean:
        yield f"the step, {of.step:g}, is so small that rounding shows; expected a larger one"


def _tiles(pictures: FloatArray) -> FloatArray:
    """Means of tiles (..., tiles, tiles, 3) of (..., height, width, 3); fewer of small pictures."""
    for axis in (-3, -2):
        length = pictures.shape[axis]
        starts = np.unique(np.arange(_TILES) * length // _TILES)
        counts = np.diff([*starts, length])
        shape = [1] * pictures.ndim
        shape[axis] = -1
        pictures = np.add.reduceat(pictures, starts, axis=axis) / counts.reshape(shape)
    return pictures
