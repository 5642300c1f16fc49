"""Scenes whose every pixel has one known radiance, rendered by ours and by Mitsuba.

All have the same kinds of shapes, materials and lights, some of them black and too small to be met,
so that ours compiles its kernels once.  Mitsuba's have only what counts.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

import reference_rt as rt
from comparisons.experiments.stability.harness.chance import AGAIN, Mean, fails
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
    every pixel;  path: fields of the integrator;  rounding: its relative error, per u;  media: of
    the shapes."""

    shapes: tuple[Any, ...]
    materials: Mapping[str, Any]
    camera: Any
    expected: float
    path: Mapping[str, Any]
    sky: float = 0.0
    rounding: float = 64.0
    media: Mapping[str, Any] = {}


def scene_of(world: World, pixels: int, spp: int, seed: int, hidden: bool) -> rt.Scene:
    """pixels: along either side of the picture."""
    lights = (rt.Constant(radiance=grey(world.sky)),) if hidden or world.sky > 0.0 else ()
    return rt.Scene(
        camera=world.camera,
        film=rt.Film(width=pixels, height=pixels, filter=rt.BoxFilter()),
        sampler=rt.Sobol(spp=spp, seed=seed) if hidden else rt.Independent(spp=spp, seed=seed),
        integrator=rt.Path(**world.path),
        hierarchy="sah",
        media=dict(world.media),
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
