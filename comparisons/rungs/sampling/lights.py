"""Light samples: how often our sampler picks each light, and where on it, is what its
densities say.

There is no chance in it and no second renderer: the interval of numbers that pick a light is found
by bisection, and the map from [0, 1]² to directions is differentiated.  A light that is picked with
another probability than the one that estimates divide by may leave the image mean as it is.
"""

import numpy as np

from comparisons.referee.sizes import ShapeSizes
from comparisons.results.case import RungResult
from comparisons.rungs.rays.rays import described, mixed_rays
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.rendering import query
from reference_rt.rendering.query.hits import BoolArray
from reference_rt.rendering.scene import Scene

POINTS, PICKS = 32, 16
"""Points of surfaces, some of them met by camera rays, and light samples at each."""

STEP = 1e-5
"""Of central differences in [0, 1]²: their truncation is in proportion to its square, and their
rounding to 1e-16 / STEP."""

SMOOTH = 1e-4
"""Differences with STEP and half of it that differ by more pass a border: of texels, or of a map of
the square to the disk.  Elsewhere they are exact to 4e-5 (measured far from the origin, where
directions to lamps have lost five digits)."""

SLACK = 1e-3
"""A relative difference of probabilities that is one: ten times SMOOTH."""

FINEST = 1e-12
"""The error of an interval's length: bisection goes to the last bit, and each level of a light tree
rescales the number, with an error of a rounding of 1."""

ENDS = (0.0, 1.0 - 1e-14)
"""The last numbers below 1 pick any light: their rescaling rounds up to 1."""

SAME = 1e-9
"""Of a density that is computed twice, from the sample and from its direction (measured: 1e-12, by
directions that graze a lamp)."""

AHEAD = 1e-6
"""Where rays to a sample begin, beyond the surface that they leave, and how near to it they must
end; as a fraction of its distance."""


def check(scene: Scene, tables: SceneTables) -> RungResult:
    """Compare the picks, positions and densities of light samples at points of surfaces."""
    most = 4 * POINTS
    rays = mixed_rays(scene, tables, ShapeSizes(scene), most, seed=3)
    hits = query.intersect(tables, rays.o, rays.d)
    met = np.flatnonzero(hits.shape >= 0)
    if tables.lights.choice is None or not len(met):
        return RungResult("sampling", "not-applicable", "no light is sampled from a surface")
    met = np.repeat(met[np.linspace(0, len(met) - 1, min(POINTS, len(met))).astype(int)], PICKS)
    p, n = hits.p[met], hits.n[met]
    n = n * np.where(np.sum(n * rays.d[met], axis=1) > 0.0, -1.0, 1.0)[:, None]
    u = np.random.default_rng(4).uniform(2.0 * STEP, 1.0 - 2.0 * STEP, (len(met), 3))
    samples = query.sample_lights(tables, p, u, n)
    low, high = (_end(tables, p, n, u, samples.light, u0) for u0 in ENDS)
    length = high - low
    angles = [_solid_angle(tables, p, n, u, step) for step in (STEP, 0.5 * STEP)]
    usable = samples.is_delta | (np.abs(angles[0] - angles[1]) <= SMOOTH * angles[1])
    picked = np.where(samples.is_delta, samples.pdf, samples.pdf * angles[1])
    drawn = samples.light >= 0
    off = drawn & usable & (np.abs(picked - length) > SLACK * length + FINEST)
    evaluated, seen = _evaluated(tables, p, n, samples)
    other = drawn & seen & (np.abs(evaluated - samples.pdf) > SAME * samples.pdf)
    numbers = {"samples": int(np.count_nonzero(drawn)), "evaluated": int(np.count_nonzero(seen))}
    for k in np.flatnonzero(off | other)[:1]:
        where = f"light {samples.light[k]}, where {described(scene.film, most, rays, int(met[k]))}"
        reason = (
            f"{where} ends, is picked with a probability of {length[k]:.6g} and sampled as if with "
            f"{picked[k]:.6g}"
            if off[k]
            else f"{where} ends, is sampled along {samples.wi[k].tolist()} with the density "
            f"{samples.pdf[k]:.9g} and evaluated with {evaluated[k]:.9g}"
        )
        return RungResult("sampling", "differ", reason, numbers)
    reason = f"{numbers['samples']} light samples have their densities"
    return RungResult("sampling", "agree", reason, numbers)


def _end(
    tables: SceneTables, p: FloatArray, n: FloatArray, u: FloatArray, light: IntArray,
    beyond: float,
) -> FloatArray:  # fmt: skip
    """The end, towards `beyond`, of the interval of numbers that pick a light."""
    outside = np.full(len(u), beyond)

    def same(first: FloatArray) -> BoolArray:
        at = np.column_stack([first, u[:, 1:]])
        return np.asarray(query.sample_lights(tables, p, at, n).light == light)

    inside = np.where(same(outside), outside, u[:, 0])
    for _ in range(52):
        middle = 0.5 * (inside + outside)
        is_in = same(middle)
        inside, outside = np.where(is_in, middle, inside), np.where(is_in, outside, middle)
    return inside


def _solid_angle(
    tables: SceneTables, p: FloatArray, n: FloatArray, u: FloatArray, step: float
) -> FloatArray:
    """The solid angle that samples cover for each unit of [0, 1]²."""

    def slope(way: tuple[float, float, float]) -> FloatArray:
        ahead, behind = (query.sample_lights(tables, p, u + s * np.array(way), n) for s in (1, -1))
        return np.asarray((ahead.wi - behind.wi) / (2.0 * step))

    return np.asarray(
        np.linalg.norm(np.cross(slope((0.0, step, 0.0)), slope((0.0, 0.0, step))), axis=1)
    )


def _evaluated(
    tables: SceneTables, p: FloatArray, n: FloatArray, samples: query.LightSamples
) -> tuple[FloatArray, BoolArray]:
    """The densities of the directions of samples, and which of these are not occluded."""
    begin = AHEAD * samples.distance.clip(max=1.0)
    t = query.intersect(tables, p, samples.wi, begin).t
    far = np.isinf(samples.distance)
    with np.errstate(invalid="ignore"):
        seen = np.where(far, np.isinf(t), np.abs(t - samples.distance) <= AHEAD * samples.distance)
    density = query.light_pdf(tables, p, samples.wi, n, begin)
    return density, np.asarray(seen & (samples.pdf > 0.0) & ~samples.is_delta)
