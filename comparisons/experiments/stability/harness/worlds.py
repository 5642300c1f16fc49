"""Scenes whose every pixel has one known radiance, rendered by ours and by Mitsuba.

All have the same kinds of shapes, materials and lights, some of them black and too small to be met,
so that ours compiles its kernels once.  Mitsuba's have only what counts.

Two-stage tests of means of random numbers: how seldom a right renderer fails by chance.

All that is statistical is in F10, F11 and F12.  A full run asks, of either contestant,

| series | cases | tests of a case |
|---|---|---|
| F10 closed furnace | 8 | 1 |
| F10 open furnace | 432 | 2: no more than all, as much as the integral |
| F11 densities | 135 | 1 |
| F12 light area, radiance, roulette | 52, 26, 24 | 1 |

1,109 tests, each with a false alarm of at most `LEVEL`: by the union bound, a full run of both
contestants has one with a chance of at most 2.3e-5, a quick run with less than 4e-6.

- A picture's mean is suspect where it is `ERRORS` standard errors off, which by chance it is with
  1e-4, the root of `LEVEL`; it fails where `AGAIN` times as many fresh samples are as far off to
  the same side.  Means over 256 pixels and more are near normal; one suspect case in a thousand, as
  heavy tails would have it, is still but 5e-7 of failures.  A fault is seen with 97 % where it is
  6 standard errors of the first samples: 1 % of the value where they know it to 0.17 %.
- Where a weight's variance is infinite its samples do not know how wrong they are: 49 % off was
  less than 3.9 of their standard errors.  A tenth of the value is too much whatever they say; ours
  are known to 1 % and better, a tenth of that.
- Weights between 0 and a known bound are judged by their own variance and that bound, whatever
  their distribution: the empirical Bernstein inequality.
- Histograms are judged by chi-square.

Rectangles' and triangles' solid angles (F12) are integrated by Gauss's rule, without chance.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from scipy import stats

import reference_rt as rt
from comparisons.experiments.stability.harness.in_mitsuba import rendered
from comparisons.experiments.stability.harness.outcomes import (
    MITSUBA,
    OURS,
    FloatArray,
    Outcomes,
    one_case,
)
from comparisons.experiments.stability.harness.series import Draw
from comparisons.experiments.stability.harness.steps import at, scaled, turned
from comparisons.mitsuba.backend import scalar

LEVEL = 1e-8
"""The chance that a test without fault fails."""

ERRORS = float(stats.norm.isf(0.5 * math.sqrt(LEVEL)))
"""Standard errors, 3.9, that each of two stages allows, to either side."""

AGAIN = 4
"""Times as many samples the second stage has."""


class Mean(NamedTuple):
    """Of samples, and its standard error."""

    mean: float
    error: float


def off(found: Mean, expected: float, rounding: float) -> float:
    """By how many standard errors, beyond `rounding`, with its sign; NaN for what is not finite."""
    if not math.isfinite(found.mean):
        return math.nan
    beyond = max(0.0, abs(found.mean - expected) - rounding)
    if beyond == 0.0:
        return 0.0
    errors = beyond / found.error if found.error > 0.0 else math.inf
    return math.copysign(errors, found.mean - expected)


def fails(
    sample: Callable[[int], Mean], expected: float, rounding: float, most: float = math.inf
) -> tuple[bool, Mean]:
    """Whether both stages do, and the last one's mean.

    sample: of the stages 0 and 1, independent, the second with `AGAIN` times as many samples;
    rounding: of the mean, absolute;  most: what it may be off by whatever the noise.
    """
    first = sample(0)
    one = _beyond(first, expected, rounding, most)
    if one == 0.0 or math.isnan(one):
        return math.isnan(one), first
    second = sample(1)
    other = _beyond(second, expected, rounding, most)
    return math.isnan(other) or other * one > 0.0, second


def _beyond(found: Mean, expected: float, rounding: float, most: float) -> float:
    """`off` where it is suspect, 0 where not."""
    errors = off(found, expected, rounding)
    near = abs(errors) <= ERRORS and abs(found.mean - expected) <= most
    return 0.0 if near else errors


def bernstein(error: float, most: float, n: int) -> float:
    """How far the mean of n numbers between 0 and `most`, of the standard error `error`, may be
    off, to either side (Maurer and Pontil 2009, "Empirical Bernstein Bounds and Sample Variance
    Penalization", theorem 4)."""
    tail = math.log(4.0 / LEVEL)
    return math.sqrt(2.0 * tail) * error + 7.0 * tail * most / (3.0 * (n - 1))


_TINY = scaled(1e-30)


def grey(x: float) -> tuple[float, float, float]:
    return x, x, x


_HIDDEN = (
    rt.Rectangle(material="nothing", transform=(_TINY, at(0.01, -900.0, 0.01))),
    rt.Sphere(material="glass", center=(0.02, -900.0, 0.01), radius=1e-30),
    rt.Disk(material="black", transform=(_TINY, at(0.03, -900.0, 0.01))),
    rt.Triangle(
        material="black",
        v0=(0.04, -900.0, 0.01),
        v1=(0.04, -900.0, 0.01 + 1e-9),
        v2=(0.04 + 1e-9, -900.0, 0.01),
    ),
)
_MATERIALS: Mapping[str, Any] = {
    "black": rt.Diffuse(reflectance=grey(0.0)),
    "glass": rt.Dielectric(),
    "nothing": rt.Emissive(radiance=grey(0.0)),
}


class World(NamedTuple):
    """shapes, materials: the visible ones;  sky: radiance from all sides;  expected: radiance of
    every pixel;  path: fields of the integrator;  rounding: its relative error, per u."""

    shapes: tuple[Any, ...]
    materials: Mapping[str, Any]
    camera: Any
    expected: float
    path: Mapping[str, Any]
    sky: float = 0.0
    rounding: float = 64.0


def scene_of(world: World, pixels: int, spp: int, seed: int, hidden: bool) -> rt.Scene:
    """pixels: along either side of the picture."""
    lights = (rt.Constant(radiance=grey(world.sky)),) if hidden or world.sky > 0.0 else ()
    return rt.Scene(
        camera=world.camera,
        film=rt.Film(width=pixels, height=pixels, filter=rt.BoxFilter()),
        sampler=rt.Sobol(spp=spp, seed=seed) if hidden else rt.Independent(spp=spp, seed=seed),
        integrator=rt.Path(**world.path),
        hierarchy="sah",
        materials={**(_MATERIALS if hidden else {}), **world.materials},
        shapes=(*(_HIDDEN if hidden else ()), *world.shapes),
        lights=lights,
    )


def ours(world: World, pixels: int, spp: int, seed: int) -> FloatArray:
    """(pixels², 3)."""
    scene = scene_of(world, pixels, spp, seed, hidden=True)
    return rt.render(scene).colour.reshape(-1, 3)


def theirs(world: World, pixels: int, spp: int, seed: int, in_scalar: bool) -> FloatArray:
    def render() -> FloatArray:
        scene = scene_of(world, pixels, spp, seed, hidden=False)
        return rendered(scene, spp, seed).reshape(-1, 3)

    if not in_scalar:
        return render()
    with scalar():
        return render()


MOST = 0.1
"""Largest relative error of a picture's mean, whatever its noise."""

Render = Callable[[int, int], FloatArray]
"""Pixels (n, 3) of a picture by its seed and its samples per pixel."""


def judge(
    renderers: Mapping[str, Render],
    seeds: tuple[int, int],
    spp: int,
    expected: float,
    rounding: Callable[[str], float],
    shown: Mapping[str, Any],
) -> Outcomes:
    """One case: the mean is finite and, in two stages of `fails`, the expected one, to noise, of
    `MOST` at most, and rounding.  The worst is relative."""
    found = {}
    for who, render in renderers.items():

        def sample(stage: int, render: Render = render) -> Mean:
            one = render(seeds[stage], spp * (1, AGAIN)[stage]).mean(axis=1)
            return Mean(float(one.mean()), float(one.std(ddof=1)) / math.sqrt(len(one)))

        limits = rounding(who) * expected, MOST * expected
        failed, (mean, error) = fails(sample, expected, *limits)
        off = abs(mean - expected) / expected
        seen = {"expected": expected, "found": mean, "standard error": error, "seeds": seeds}
        found[who] = one_case(failed, off, {**shown, **seen})
    return found


def measure(
    world: World,
    draw: Draw,
    spp: int,
    rounding: Callable[[str], float],
    shown: Mapping[str, Any],
    pixels: int = 32,
    in_scalar: bool = True,
    their_pixels: int = 16,
) -> Outcomes:
    first, again = draw.rng.integers(1, 2**31, 2).tolist()

    def mitsubas(seed: int, spp: int) -> FloatArray:
        with np.errstate(all="ignore"):
            return theirs(world, their_pixels, spp, seed, in_scalar)

    renderers: dict[str, Render] = {OURS: lambda seed, spp: ours(world, pixels, spp, seed)}
    if draw.mitsuba:
        renderers[MITSUBA] = mitsubas
    return judge(renderers, (first, again), spp, world.expected, rounding, shown)


# ---- rooms and bodies in light that is the same everywhere, for furnaces -------------------------


WALLS = tuple(
    rt.Rectangle(material="wall", transform=(at(0, 0, -1), turned(degrees, axis)))
    for axis, degrees in (
        ((1, 0, 0), 0), ((1, 0, 0), 90), ((1, 0, 0), 180),
        ((1, 0, 0), 270), ((0, 1, 0), 90), ((0, 1, 0), 270),
    )
)  # fmt: skip
"""Their fronts point at the middle of the cube [-1, 1]³."""

UNLIMITED = 10**6

LATEST = 4096
"""Edges after which roulette begins at the latest: no path in glass is that long (measured)."""


def closed(albedo: float, edges: int | None = None, rr_depth: int = 5) -> World:
    """Walls that emit 1 and reflect `albedo`, seen from within: 1 / (1 - a), or as much as comes in
    a number of edges, 1 + a + ... + a^(n - 1)."""
    lost = 0.0 if edges is None else albedo**edges
    return World(
        WALLS,
        {
            "scattering": rt.Diffuse(reflectance=grey(albedo)),
            "wall": rt.Emissive(radiance=grey(1.0), base="scattering"),
        },
        rt.Orthographic(eye=(0.1, 0.2, 0.3), target=(-1, -0.9, -0.8), width=1e-9),
        (1.0 - lost) / (1.0 - albedo),
        {"max_depth": edges, "rr_depth": rr_depth},
    )


def shells(n: int) -> World:
    """n spheres of glass within each other, every other gap filled with air, in a white sky: no
    matter what they bend and mirror, 1 comes out."""
    materials: dict[str, Any] = {
        "solid": rt.Dielectric(interior_ior=1.5),
        "hollow": rt.Dielectric(interior_ior=1.0, exterior_ior=1.5),
    }
    spheres = tuple(
        rt.Sphere(radius=1.0 - 0.9 * k / n, material=("solid", "hollow")[k % 2]) for k in range(n)
    )
    camera = rt.Orthographic(eye=(0, 0, 3), target=(0, 0, 0), width=2.1)
    # Without roulette; light is lost only where a path is cut.
    path = {"max_depth": UNLIMITED, "rr_depth": LATEST}
    return World(spheres, materials, camera, 1.0, path, sky=1.0)
