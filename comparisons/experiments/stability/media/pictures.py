"""Media under a white sky, as rendered: half spaces, layers and balls."""

import functools
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

import reference_rt as rt
from comparisons.experiments.stability.harness import chance
from comparisons.experiments.stability.harness.outcomes import (
    MITSUBA,
    OURS,
    FloatArray,
    Outcomes,
    of_errors,
    plain,
    together,
    unit_of,
)
from comparisons.experiments.stability.harness.series import Draw, Sweep, decades, series
from comparisons.experiments.stability.harness.steps import at, scaled
from comparisons.experiments.stability.harness.worlds import (
    LATEST,
    UNLIMITED,
    Render,
    World,
    grey,
    judge,
    measure,
    ours,
    theirs,
)
from comparisons.truth.optics import fresnel
from comparisons.truth.scattering import half_space_in_sky
from reference_rt.core.ray import SURFACE_ROUNDING
from reference_rt.media import AnyPhase

COSINE = 0.6
"""Of the view to the normal of layers."""

ENDLESS: Mapping[str, Any] = {"rr_depth": LATEST}
"""Paths that roulette does not shorten before they are very long."""


SAMPLES = 32 * 32
"""Pixels of a picture, all of one point."""

SPP = 16

RARE = chance.bernstein(0.0, 1.0, SAMPLES * SPP)
"""What so seldom happens that no sample shows it is in no standard error: a second scattering in a
thin layer.  It adds up to 1."""


def _rounding(who: str) -> float:
    """Of a mean of numbers of one sign, whose exponentials have errors of some u."""
    return 256.0 * unit_of(who)


def _seldom(who: str) -> float:
    return _rounding(who) + RARE


def _camera() -> rt.Orthographic:
    """It sees one point of the plane z = 0, from above."""
    sine = math.sqrt(1.0 - COSINE**2)
    return rt.Orthographic(eye=(0, -sine, COSINE), target=(0, 0, 0), up=(0, 0, 1), width=1e-9)


def _layer(
    medium: rt.Homogeneous,
    thickness: float,
    path: Mapping[str, Any],
    expected: float,
    material: Any = None,
    size: float = 1e6,
) -> World:
    """A layer between z = 0 and a plane that looks down; without a bottom if its thickness is
    infinite.  material: of both, None for no surface;  size: half of their edges."""
    places: list[tuple[Any, ...]] = [(scaled(size),)]
    if thickness < math.inf:
        places.append((scaled(size, -size, -size), at(0.0, 0.0, -thickness)))
    planes = [rt.Rectangle(material="edge", interior="medium", transform=place) for place in places]
    media = {"medium": medium}
    edge = {"edge": rt.NoSurface() if material is None else material}
    return World(tuple(planes), edge, _camera(), expected, path, 1.0, media=media)


def _white(sigma: Any, phase: AnyPhase) -> rt.Homogeneous:
    return rt.Homogeneous(sigma_t=sigma, albedo=grey(1.0), phase=phase)


# ---- half spaces --------------------------------------------------------------------------------


@series(
    Sweep("1 / (1 - albedo)", (1.5, 2.0, *decades(1, 4)), (2.0, 1e2, 1e4), 1, 1),
    unit="of the value",
    explained="no number is small: Mitsuba draws the same paths, and is right within its noise",
)
def half_spaces(draw: Draw, x: float) -> Outcomes:
    """A half space of the albedo 1 - 1 / x under a sky: 1 - sqrt(1 - albedo) H(cosine). A case is a
    picture whose pixels see one point."""
    albedo = 1.0 - 1.0 / x
    sigma = float(10.0 ** draw.rng.uniform(-2.0, 2.0))
    expected = float(half_space_in_sky(np.array(COSINE), albedo)[0])
    medium = rt.Homogeneous(sigma_t=grey(sigma), albedo=grey(albedo))
    world = _layer(medium, math.inf, ENDLESS, expected)
    shown = {"albedo": albedo, "sigma_t": sigma}
    return measure(world, draw, SPP, _seldom, shown, in_scalar=False, their_pixels=32)


# ---- media that absorb nothing ------------------------------------------------------------------


@series(
    Sweep("optical depth", decades(-8, 2), (1e-8, 1.0, 1e2), 3, 3),
    unit="of the value",
    explained="float32 keeps no digit of the phase function of g = -0.9999, whatever the depth: "
    "Mitsuba fails as soon as a layer scatters enough light to be seen",
)
def white_layers(draw: Draw, x: float) -> Outcomes:
    """A layer of albedo 1 of the optical depth x in a sky, with phase functions of g = 0, 0.9 and
    -0.9999: as bright as the sky. A case is a picture."""
    found = []
    for g in (0.0, 0.9, -0.9999):
        phase = rt.HenyeyGreenstein(g=g)
        world = _layer(_white(grey(x), phase), 1.0, ENDLESS, 1.0)
        shown = {"optical depth": x, "g": g}
        found.append(measure(world, draw, SPP, _seldom, shown, in_scalar=False, their_pixels=32))
    return together(found)


@series(
    Sweep("largest / smallest density of a colour", decades(0, 4), (1.0, 1e2, 1e4), 3, 3),
    unit="of the value",
    explained="weights of colours are at most 3, whatever their densities, with Mitsuba's "
    "volpathmis as well.  Its volpath, which weighs each flight by itself, is 40 % off from a "
    "ratio of 100 on",
)
def unlike_colours(draw: Draw, x: float) -> Outcomes:
    """A white layer whose optical depths are sqrt(x), 1 and 1 / sqrt(x) in the three colours: as
    bright as the sky in each. A case is a colour."""
    root = math.sqrt(x)
    medium = _white((root, 1.0, 1.0 / root), rt.HenyeyGreenstein(g=0.3))
    # With an end, which no path comes to, Mitsuba's side is volpathmis, for media in colours.
    world = _layer(medium, 1.0, {**ENDLESS, "max_depth": UNLIMITED}, 1.0)
    seeds = draw.rng.integers(1, 2**31, 2).tolist()

    @functools.cache
    def picture(who: str, seed: int, spp: int) -> FloatArray:
        if who == OURS:
            return ours(world, 32, spp, seed)
        return theirs(world, 32, spp, seed, in_scalar=False)

    names = [OURS, MITSUBA] if draw.mitsuba else [OURS]

    def one_colour(who: str, k: int) -> Render:
        return lambda seed, spp: picture(who, seed, spp)[:, k : k + 1]

    found = []
    for k in range(3):
        renderers = {who: one_colour(who, k) for who in names}
        shown = {"ratio": x, "colour": k}
        found.append(judge(renderers, (seeds[0], seeds[1]), SPP, 1.0, _seldom, shown))
    return together(found)


# ---- behind boundaries of matched index ---------------------------------------------------------

MATCHED = Sweep("1 / (index - 1)", (1.0, 2.0, *decades(1, 12)), (1.0, 1e3, 1e12), 1, 1)


@series(
    MATCHED,
    unit="of the value",
    explained="Fresnel's reflectance of such boundaries is nothing beside the light that passes, "
    "and Mitsuba refracts by the same formula: it is right within the noise of its flights",
)
def absorption_behind_glass(draw: Draw, x: float) -> Outcomes:
    """A layer of the optical depth 1 behind boundaries of the index 1 + 1 / x, in a sky: what
    Fresnel's equations and Beer's law say. A case is a picture."""
    index = 1.0 + 1.0 / x
    f = float(fresnel(np.array(COSINE), index))
    way = 1.0 / math.sqrt(1.0 - (1.0 - COSINE**2) / index**2)
    t = math.exp(-way)
    common = (1.0 - f) ** 2 * t / (1.0 - f * f * t * t)
    expected = f + common * f * t + common
    medium, size = rt.Homogeneous(sigma_t=grey(1.0), albedo=grey(0.0)), 8.0
    world = _layer(medium, 1.0, {}, expected, rt.Dielectric(interior_ior=index), size)
    # From an index so near 1 on that not one path of all is reflected, by that chance.
    rare = 0.0 if chance.AGAIN * SAMPLES * SPP * f < chance.LEVEL else RARE

    def rounding(who: str) -> float:
        # A ray leaves a plane by its error bound; Mitsuba's leaves by 1e-4 of its size.
        leaving = SURFACE_ROUNDING * 3.0 * size if who == OURS else 1e-4 * size
        return _rounding(who) + 4.0 * leaving / COSINE + rare / expected

    shown = {"index": index}
    return measure(world, draw, SPP, rounding, shown, in_scalar=False, their_pixels=32)


DEPTH = 2.0
"""Of the ball, across."""


@series(
    MATCHED,
    unit="of the value",
    explained="a path's weight is a product of ones, for Mitsuba as well",
)
def white_balls_behind_glass(draw: Draw, x: float) -> Outcomes:
    """A ball of a medium of albedo 1 and of the optical depth 2 across behind a boundary of the
    index 1 + 1 / x, in a sky: every pixel is 1. A case is a pixel."""
    world = World(
        (rt.Sphere(material="edge", interior="medium"),),
        {"edge": rt.Dielectric(interior_ior=1.0 + 1.0 / x)},
        rt.Orthographic(eye=(0, 0, 3), target=(0, 0, 0), width=2.1),
        1.0,
        ENDLESS,
        sky=1.0,
        media={"medium": _white(grey(DEPTH / 2.0), rt.HenyeyGreenstein(g=0.5))},
    )
    side, spp = (16, 4) if draw.effort == "quick" else (64, 16)
    seed = int(draw.rng.integers(1, 2**31))
    pictures = {OURS: ours(world, side, spp, seed)}
    if draw.mitsuba:
        pictures[MITSUBA] = theirs(world, side, spp, seed, in_scalar=False)
    found = {}
    for who, pixels in pictures.items():
        shown = {"index": 1.0 + 1.0 / x, "seed": seed, "pixel": lambda i: i, "found": plain(pixels)}
        off = np.abs(pixels - 1.0).max(axis=1)
        found[who] = of_errors(off, 64.0 * EDGES * unit_of(who), shown)
    return found


EDGES = 16.0
"""Of the longest paths but few: what is scattered in a ball of this depth, and mirrored within."""
