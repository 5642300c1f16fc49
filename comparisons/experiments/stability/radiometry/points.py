"""Light from a point, evenly and in a cone."""

import math
from typing import Any

import numpy as np
from flint import arb

from comparisons.experiments.stability.harness.exactly import cross, dot, exactly
from comparisons.experiments.stability.harness.outcomes import (
    MITSUBA,
    OURS,
    FloatArray,
    Outcomes,
    hexed,
    of_errors,
    plain,
    unit_of,
)
from comparisons.experiments.stability.harness.series import Draw, Sweep, decades, series
from comparisons.geometry.affine import unit_vectors
from comparisons.geometry.frame import round32
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.scene import for_rays
from reference_rt.core.vec3 import Vec3
from reference_rt.lights.emitters import point, spot
from reference_rt.lights.emitters.point import Point
from reference_rt.lights.emitters.spot import Spot

VISIBLE = 1e-3
"""Of the full intensity: what may be off by rounding where the cone is as thin as float32."""


def _theirs(light: dict[str, Any], p: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(n,) what arrives at the points p, (n, 3) from where."""
    import drjit as dr

    mi = mitsuba()
    emitter = mi.load_dict(light)

    def arriving(at: Any) -> tuple[Any, ...]:
        it = dr.zeros(mi.SurfaceInteraction3f)
        it.p = mi.Point3f(at)
        it.t = 1.0
        sample, weight = emitter.sample_direction(it, mi.Point2f(0.5, 0.5), True)
        return weight.x, sample.d

    return for_rays(arriving, p)  # type: ignore[return-value]


@series(
    Sweep("distance, or 1 / distance", decades(0, 9), (1.0, 1e3, 1e9), 2_000, 20_000),
    unit="of the value",
    explained="1 / d² of 1e-9 to 1e9 is a float of 32 bits as well, and a root, squares and a "
    "quotient round by a few u wherever they are: Mitsuba is off by 3.1e-7 at most, at all of them",
)
def point_light(draw: Draw, x: float) -> Outcomes:
    """A point light of intensity 1 at the origin, receivers at x and at 1 / x: irradiance and
    direction."""
    n = draw.cases
    far = np.where(np.arange(n) % 2 == 0, x, 1.0 / x) * draw.rng.uniform(1.0, 2.0, n)
    p = round32(unit_vectors(draw.rng, n) * far[:, None])
    light = Point(position=(0.0, 0.0, 0.0), intensity=(1.0, 1.0, 1.0))
    table = light.tabulate()
    sampled = [point.sample(table, 0, Vec3(*at)) for at in p.tolist()]
    found = {OURS: (np.array([s.radiance.x for s in sampled]), np.array([s.wi for s in sampled]))}
    if draw.mitsuba:
        found[MITSUBA] = _theirs({"type": "point", "position": [0, 0, 0], "intensity": 1.0}, p)
    exact, *towards = exactly(_arriving, p).T
    outcomes = {}
    for who, (arriving, wi) in found.items():
        with np.errstate(invalid="ignore"):
            errors = np.maximum(
                np.abs(arriving - exact) / exact, np.linalg.norm(wi - np.transpose(towards), axis=1)
            )
        shown = {"light": "at the origin", "point": p, "irradiance": plain(exact)}
        outcomes[who] = of_errors(errors, 8.0 * unit_of(who), shown | {"found": plain(arriving)})
    return outcomes


@series(
    Sweep(
        "1 / cutoff in degrees", (0.05, 0.1, *decades(0, 6)), (0.05, 1.0, 1e3, 1e6), 2_000, 20_000
    ),
    "spot",
    unit="of the intensity",
)
def spot_light(draw: Draw, x: float) -> Outcomes:
    """Points from a spot's axis to beyond its rim, at distances from 1e-3 to 1e3; the beam is
    three quarters of the cone."""
    n, cutoff = draw.cases, 1.0 / x
    target = round32(unit_vectors(draw.rng, 1))[0]
    light = Spot(
        origin=(0.0, 0.0, 0.0),
        target=tuple(target.tolist()),
        intensity=(1.0, 1.0, 1.0),
        cutoff_angle=cutoff,
    )
    table = light.tabulate()
    axis = target / np.linalg.norm(target)
    across = np.cross(axis, unit_vectors(draw.rng, n))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    angle = math.radians(cutoff) * draw.rng.uniform(0.0, 1.2, (n, 1))
    far = 10.0 ** draw.rng.uniform(-3.0, 3.0, (n, 1))
    # Float32 holds these points where a rounding is small to the cone; beyond, ours alone.
    shared = math.radians(cutoff) > 2.0**-16
    p = far * (axis * np.cos(angle) + across * np.sin(angle))
    p = round32(p) if shared else p
    found = {OURS: np.array([spot.falloff(table, 0, Vec3(*at)) for at in p.tolist()])}
    if draw.mitsuba:
        mi = mitsuba()
        to_world = mi.ScalarTransform4f().look_at([0, 0, 0], target.tolist(), [0.3, 0.5, 0.8])
        arriving, _ = _theirs(
            {
                "type": "spot",
                "to_world": to_world,
                "intensity": 1.0,
                "cutoff_angle": cutoff,
                "beam_width": 0.75 * cutoff,
            },
            p,
        )
        found[MITSUBA] = arriving * (p * p).sum(axis=1)
    exact = _falloffs(target, cutoff, p)
    outcomes = {}
    for who, value in found.items():
        unit = unit_of(who)
        allowed = min(VISIBLE, 16.0 * unit * (1.0 + 1.0 / math.radians(0.25 * cutoff)))
        shown = {"target": hexed(target), "cutoff in degrees": cutoff, "point": p}
        shown |= {"falloff": plain(exact), "found": plain(value)}
        outcomes[who] = of_errors(np.abs(value - exact), allowed, shown)
    return outcomes


def _arriving(at: list[arb]) -> tuple[arb, ...]:
    """1 / d², and the direction to the origin."""
    square = dot(at, at)
    return 1 / square, *(-c / square.sqrt() for c in at)


def _falloffs(target: FloatArray, cutoff: float, p: FloatArray) -> FloatArray:
    def formula(w: list[arb]) -> float:
        a, end = [arb(c) for c in target.tolist()], arb(cutoff) * arb.pi() / 180
        normal = cross(a, w)
        angle = arb.atan2(dot(normal, normal).sqrt(), dot(a, w))
        return min(1.0, max(0.0, float((end - angle) / (end / 4))))

    return exactly(formula, p)
