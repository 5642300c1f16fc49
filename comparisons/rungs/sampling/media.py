"""Media: flights that end as Beer's law says, and directions that are scattered as their phase
functions say.

Of a flight only its end is seen: in a ball of a medium, below a white sky, a path of one edge from
the middle brings light if it does not scatter before the border.  Each path brings the same light,
and so many do that light times chance is exp(-sigma radius) in each colour: what is drawn and what
it is weighted by are seen one by one, at several radii, without any table or formula of ours.

Directions are drawn by our kernel and turned into numbers by the distribution function of the
description's phase function, which is a closed form: these numbers, and the angles around the way
of the light, must be uniform.  The densities are computed again by other forms of their formulas.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy import special, stats

from comparisons.results.case import RungResult
from comparisons.rungs.sampling.roulette import LEVEL, SAME
from reference_rt.cameras import Perspective
from reference_rt.core.arrays import FloatArray
from reference_rt.core.vec3 import Vec3
from reference_rt.integrators import Path
from reference_rt.lights import Constant
from reference_rt.materials import NoSurface
from reference_rt.media import (
    AnyMedium,
    AnyPhase,
    BlendPhase,
    HenyeyGreenstein,
    Homogeneous,
    Isotropic,
    Media,
    Rayleigh,
)
from reference_rt.media.phase import Lobes, phase, turned
from reference_rt.rendering.scene import Scene
from reference_rt.scene.build_media import media_of
from reference_rt.shapes import Sphere

MOST_MEDIA = 16
"""Of a scene with more, these many are checked, evenly chosen."""

THICKNESSES = (0.02, 0.1, 0.3, 0.7, 1.2, 2.0, 3.5)
"""Of the ball's radius, in the colour that is densest; of endless media all flights scatter."""

PATHS = 1 << 13
"""Of each radius: their share is known to 0.6 %, and an exponent to some percent."""

DRAWN = 1 << 13
"""Directions of a medium."""

CELLS = (32, 8)
"""Of the numbers along the cosine, and around."""

WAY = Vec3(2.0 / 7.0, -3.0 / 7.0, 6.0 / 7.0)
"""The direction of the light that is scattered."""

Values = Callable[[Scene, int], FloatArray]
"""The radiance of n paths of a scene, one sample each: (n, 3)."""


def check(scene: Scene) -> RungResult:
    """Check all media of a scene."""
    names, table = [*scene.media], media_of(scene)
    chosen = np.unique(np.linspace(0, len(names) - 1, min(len(names), MOST_MEDIA)).astype(int))
    for k in chosen.tolist():
        name = names[k]
        fault = fault_of(scene.media[name], table, k)
        if fault:
            return RungResult("sampling", "differ", f"medium '{name}': {fault}")
    if not names:
        return RungResult("sampling", "not-applicable", "there are no media")
    numbers: dict[str, Any] = {"media": len(chosen)}
    reason = f"{len(chosen)} media scatter as Beer's law and their phase functions say"
    return RungResult("sampling", "agree", reason, numbers)


def fault_of(medium: AnyMedium, table: Media, k: int) -> str:
    """What is wrong with a medium, which is number k of a table; empty: nothing."""
    fault = fault_of_flights(medium, traced)
    if fault or not np.any(medium.albedo):
        return fault
    lobes = table.lobes
    return fault_of_densities(medium.phase, lobes, k) or fault_of_directions(medium.phase, lobes, k)


# ---- flights -------------------------------------------------------------------------------------


def ball(medium: Homogeneous, radius: float) -> Scene:
    """A ball of a medium under a white sky, seen from its middle."""
    return Scene(
        media={"medium": medium},
        materials={"none": NoSurface()},
        shapes=(Sphere(radius=radius, material="none", interior="medium"),),
        lights=(Constant(radiance=(1.0, 1.0, 1.0)),),
        camera=Perspective(eye=(0.0, 0.0, 0.0), target=(0.0, 0.0, 1.0), medium="medium"),
        integrator=Path(max_depth=1),
    )


def traced(scene: Scene, count: int, seed: int = 23) -> FloatArray:
    direction = np.broadcast_to([0.31, -0.47, 1.0], (count, 3))
    return scene.radiance(np.zeros(3), direction, spp=1, seed=seed).mean


def fault_of_flights(medium: AnyMedium, values: Values) -> str:
    """What is wrong with how far light flies in a medium."""
    sigma = np.array(medium.sigma_t) * medium.scale
    if not sigma.any():
        return ""
    for thick in THICKNESSES:
        radius = thick / sigma.max()
        expected = np.exp(-sigma * radius)
        seen = values(ball(medium, radius), PATHS)
        arrives = seen.any(axis=1)
        light = seen[arrives]
        if not len(light):
            return f"no flight of the optical thickness {thick} ends at a surface"
        if (np.abs(light - light[0]) > SAME * light[0].max()).any():
            return f"flights of the optical thickness {thick} have more than one weight"
        chances = expected / light[0]
        if (np.abs(chances / chances[0] - 1.0) > SAME).any():
            return (
                f"flights of the optical thickness {thick} bring {light[0].tolist()}, which are no "
                f"multiples of exp(-thickness) in each colour, {expected.tolist()}"
            )
        if not _likely(len(light), PATHS, float(chances[0])):
            return (
                f"{len(light) / PATHS:.4f} of flights of the optical thickness {thick} arrive; "
                f"with their weight, exp(-thickness) needs {chances[0]:.4f}"
            )
    return ""


def _likely(count: int, of: int, chance: float) -> bool:
    """Whether so many of `of` flights may have arrived, each with this chance."""
    if chance > 1.0 - SAME:
        return chance < 1.0 + SAME and count == of
    tails = special.bdtr(count, of, chance), special.bdtrc(count - 1, of, chance)
    return bool(min(tails) >= LEVEL)


# ---- phase functions, by closed forms ------------------------------------------------------------


def density_of(described: AnyPhase, cosine: FloatArray) -> FloatArray:
    """Per solid angle, in 80 bits where the machine has them: 1 + g² - 2 g cosine cancels."""
    c = np.asarray(cosine, np.longdouble)
    match described:
        case Isotropic():
            return np.full(len(c), 0.25 / math.pi)
        case HenyeyGreenstein(g=given):
            g = np.longdouble(given)
            return np.asarray((1 - g * g) / (4 * math.pi * (1 + g * g - 2 * g * c) ** 1.5), float)
        case Rayleigh():
            return np.asarray(3 * (1 + c * c) / (16 * math.pi), float)
        case BlendPhase():
            parts = density_of(described.first, cosine), density_of(described.second, cosine)
            return np.asarray((1.0 - described.weight) * parts[0] + described.weight * parts[1])


def share_below(described: AnyPhase, cosine: FloatArray) -> FloatArray:
    """The distribution function of the cosine."""
    c = np.asarray(cosine, np.longdouble)
    match described:
        case HenyeyGreenstein(g=given) if abs(given) > SMALL:
            g = np.longdouble(given)
            root = np.sqrt(1 + g * g - 2 * g * c)
            return np.asarray((1 - g * g) / (2 * g) * (1 / root - 1 / (1 + g)), float)
        case Isotropic() | HenyeyGreenstein():
            return np.asarray((1 + c) / 2, float)
        case Rayleigh():
            return np.asarray((c**3 + 3 * c + 4) / 8, float)
        case BlendPhase():
            parts = share_below(described.first, cosine), share_below(described.second, cosine)
            return np.asarray((1.0 - described.weight) * parts[0] + described.weight * parts[1])
    raise TypeError(type(described).__name__)


SMALL = 1e-9
"""g below which the distribution is that of g = 0 to far less than a count can tell."""


def fault_of_densities(described: AnyPhase, lobes: Lobes, k: int) -> str:
    """What is wrong with the values of a medium's phase function."""
    near = np.geomspace(1e-9, 0.1, 16)
    cosines = np.concatenate([np.linspace(-1.0, 1.0, 33), 1.0 - near, near - 1.0])
    ours = np.array([phase(lobes, k, c) for c in cosines.tolist()])
    expected = density_of(described, cosines)
    off = np.abs(ours - expected) > SAME * expected
    if off.any():
        at = int(np.flatnonzero(off)[0])
        return (
            f"its phase function is {ours[at]:.9g} at the cosine {cosines[at]:.9g}; its formula "
            f"says {expected[at]:.9g}"
        )
    return ""


def fault_of_directions(described: AnyPhase, lobes: Lobes, k: int, seed: int = 29) -> str:
    """What is wrong with the directions that are drawn of a medium's phase function."""
    u = np.random.default_rng(seed).random((DRAWN, 2)).tolist()
    drawn = np.array([turned(lobes, k, WAY, *pair) for pair in u])
    lengths = np.linalg.norm(drawn, axis=1)
    if (np.abs(lengths - 1.0) > SAME).any():
        return f"a direction of the length {lengths[np.argmax(np.abs(lengths - 1.0))]:.9g} is drawn"
    way = np.array(WAY)
    cosine = np.clip(drawn @ way, -1.0, 1.0)
    x = np.cross(way, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    around = np.arctan2(drawn @ np.cross(way, x), drawn @ x) / (2.0 * math.pi) + 0.5
    numbers = np.column_stack([share_below(described, cosine), around])
    counts, _ = np.histogramdd(numbers, CELLS, [(0.0, 1.0), (0.0, 1.0)])
    expected = DRAWN / counts.size
    value = float(((counts - expected) ** 2).sum() / expected)
    p = float(stats.chi2.sf(value, counts.size - 1))
    if p < LEVEL:
        return (
            f"directions are not scattered as its phase function says (chi-square of {DRAWN} "
            f"directions in {counts.size} cells: p = {p:.1g})"
        )
    return ""
