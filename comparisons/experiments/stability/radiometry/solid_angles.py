"""Solid angles of spheres, implied by the densities of light samples."""

import math
from typing import Any

import numpy as np
from flint import arb, ctx

from comparisons.experiments.methods.setting import unit_vectors
from comparisons.experiments.stability.harness.core import MITSUBA, OURS, Draw, FloatArray, Outcome
from comparisons.experiments.stability.harness.family import Series, Sweep, decades
from comparisons.experiments.stability.harness.outcomes import (
    Columns,
    of_errors,
    plain,
    relative,
    unit_of,
)
from comparisons.geometry.float32 import round32
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.scene import for_rays
from reference_rt.core.vec3 import row
from reference_rt.jit.kernel import entry_kernel
from reference_rt.shapes.curved import sphere
from reference_rt.shapes.curved.sphere import Sphere
from reference_rt.shapes.shape import TabulationContext

TEXTBOOK = "sphere.cosine"


@entry_kernel
def _of_sphere(table: Any, p: Any, u: Any, out: Any) -> None:
    for i in range(len(p)):
        for k in range(u.shape[1]):
            out[i, k] = sphere.sample(table, 0, 0.0, row(p, i), u[i, k, 0], u[i, k, 1]).pdf


def theirs(shape: dict[str, Any] | Any, p: FloatArray, u: FloatArray) -> FloatArray:
    """Densities (n, k) of Mitsuba's samples of a shape."""
    import drjit as dr

    mi = mitsuba()
    loaded = mi.load_dict(shape) if isinstance(shape, dict) else shape

    def density(at: Any, v: Any) -> tuple[Any, ...]:
        it = dr.zeros(mi.SurfaceInteraction3f)
        it.p = mi.Point3f(at)
        it.t = 1.0
        return (loaded.sample_direction(it, mi.Point2f(v.x, v.y)).pdf,)

    points = np.repeat(p, u.shape[1], axis=0)
    numbers = np.minimum(np.pad(u.reshape(-1, 2), ((0, 0), (0, 1))), 1.0 - 2.0**-24)
    return np.asarray(for_rays(density, points, numbers)[0].reshape(u.shape[:2]))


def _sphere(draw: Draw, gap: FloatArray, shared: bool) -> dict[str, Outcome]:
    """The unit sphere from 1 + gap."""
    p = np.ascontiguousarray(unit_vectors(draw.rng, len(gap)) * (1.0 + gap)[:, None])
    p = round32(p) if shared else p
    exact, cosines = [], []
    with ctx.workprec(300):
        for at in p.tolist():
            d2 = sum((arb(c) * arb(c) for c in at), arb(0))
            cosine = (1 - 1 / d2).sqrt() if d2 > 1 else arb(0)
            exact.append(float(2 * arb.pi() * (1 / d2) / (1 + cosine)))
            cosines.append(float(cosine))
    truth, cosine = np.array(exact), np.array(cosines)
    out = np.empty((len(p), 1))
    u = draw.rng.uniform(0.0, 1.0, (len(p), 1, 2))
    _of_sphere(Sphere().tabulate(TabulationContext()), p, u, out)
    d2 = (p * p).sum(axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        naive = 2.0 * math.pi * (1.0 - np.sqrt(1.0 - 1.0 / d2))
        found = {OURS: 1.0 / out[:, 0], TEXTBOOK: naive}
        if draw.mitsuba and shared:
            found[MITSUBA] = 1.0 / theirs({"type": "sphere"}, p, u)[:, 0]
    outcomes = {}
    for who, value in found.items():
        shown: Columns = {"sphere": "of radius 1 at the origin", "point": p}
        shown |= {"solid angle": plain(truth), "found": plain(value)}
        allowed = 16.0 * unit_of(who) * (1.0 + 1.0 / np.maximum(cosine, 1e-300))
        outcomes[who] = of_errors(relative(value, truth), allowed, shown)
    return outcomes


def _small(draw: Draw, x: float) -> dict[str, Outcome]:
    """Solid angles of 1 / x to 2 / x: pi / d²."""
    omega = draw.rng.uniform(1.0, 2.0, draw.cases) / x
    return _sphere(draw, np.sqrt(math.pi / omega) - 1.0, True)


def _close(draw: Draw, x: float) -> dict[str, Outcome]:
    return _sphere(draw, draw.rng.uniform(1.0, 2.0, draw.cases) / x, x < 2.0**20)


SMALL_SPHERE = Series(
    "small spheres",
    Sweep("1 / solid angle", decades(0, 12), (1.0, 1e6, 1e12), 1_000, 20_000),
    "The solid angle that light samples of a sphere stand for, seen from afar.",
    _small,
    unit="of the value",
)
CLOSE_SPHERE = Series(
    "close spheres",
    Sweep(
        "radius / distance from the surface", decades(0, 12), (1.0, 1e3, 1e6, 1e12), 1_000, 20_000
    ),
    "The solid angle that light samples of a sphere stand for, seen from just off it.",
    _close,
    unit="of the value",
    explained="the law allows for the condition, 1 / cos, so that both may lose digits alike: "
    "Mitsuba is off by 6.9e-5 at 1e6, ours by 6.3e-14; it is asked as far as float32 has points "
    "that close, 2^20",
)
