"""F12: radiometry at extremes: sizes, distances, brightness, angles, depth.

Law, u = 2^-53 (Mitsuba: its own u = 2^-24, and numbers that float32 holds).
- a point light's I / d² arrives to 8 u, from a direction right to 8 u, at distances 1e-9 to 1e9;
- a spot's falloff, of cones from 20 degrees to 1e-6, is the exact one of the very floats to
  16 u / (cutoff - beam) + 16 u, what rounding a direction turns it by; and to 1e-3 for anyone;
- the solid angle of a sphere, seen from 1 + 1e-12 to 1e6 radii, is the exact one to
  16 u (1 + 1 / cos), cos that of half the cone: at a distance d, 1 - r²/d² rounds by u;
- that of rectangles and triangles, from 1e-20 to 2 pi: the mean of 1 / pdf over the random numbers
  of a sample, by Gauss's rule with 20² nodes, to 64 u times the condition of van Oosterom and
  Strackee's denominator, and what the rule leaves in doubt, up to 1 %;
- lamps of areas 1e-12 to 1e12 light a floor, seen under one angle, as the closed form says, and so
  do lamps of radiance 1e-30 to 1e30: within their noise (`harness.worlds`) and to a tenth, finite;
- paths with roulette at every bounce gather (1 - a^n) / (1 - a) in n edges of a closed furnace, n
  to 1e3, within their noise and to a tenth.

Range.  As the law says, law by law.

Counts.  Of a point in the full run: 20,000 receivers for point lights, spots and spheres, 2,000 for
rectangles and for triangles, 400 numbers at each; pictures of 1024 pixels of 16 samples, 64 for
roulette.

Passes.  No failure.

`solid_angles`: densities; here: points and spots, and rendered pictures of lamps."""

import math
from typing import Any

import numpy as np
from flint import arb, ctx

import reference_rt as rt
from comparisons.experiments.stability.harness.core import (
    MITSUBA,
    OURS,
    Draw,
    Family,
    FloatArray,
    Outcome,
    Series,
    Sweep,
    decades,
    hexed,
    of_errors,
    plain,
    together,
    unit_of,
)
from comparisons.experiments.stability.harness.steps import at, scaled, turned
from comparisons.experiments.stability.harness.worlds import World, closed, grey, measure
from comparisons.experiments.stability.radiometry.solid_angles import (
    CLOSE_SPHERE,
    FLAT,
    SKY,
    SMALL_SPHERE,
)
from comparisons.geometry.affine import unit_vectors
from comparisons.geometry.frame import round32
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.scene import for_rays
from reference_rt.core.vec3 import Vec3
from reference_rt.lights.emitters import point, spot
from reference_rt.lights.emitters.point import Point
from reference_rt.lights.emitters.spot import Spot

# ---- lamps of any size and brightness over a floor, and paths of any length, as rendered ---------


RHO = 0.5
KINDS = ("disk", "sphere", "rectangle", "triangle")


def _rounding(who: str) -> float:
    """Of a mean of numbers of one sign."""
    return 256.0 * unit_of(who)


def _lamp(kind: str, size: float, height: float) -> tuple[Any, float]:
    """A lamp right above the origin that shines down, and its irradiance there per radiance."""
    scale = scaled(size, size, 1.0)
    place = (scale, turned(90), at(0, height, 0))
    ratio = (size / height) ** 2
    if kind == "disk":
        return rt.Disk(transform=place, material="lamp"), math.pi * ratio / (1.0 + ratio)
    if kind == "sphere":
        ball = rt.Sphere(center=(0, height, 0), radius=size, material="lamp")
        return ball, math.pi * ratio
    if kind == "rectangle":
        # Four rectangles with a corner above the origin (Howell & Mengüç, B-4 with a = b).
        x = size / height
        y = x / math.sqrt(1.0 + x * x)
        return rt.Rectangle(transform=place, material="lamp"), 4.0 * y * math.atan(y)
    # A triangle of three corners around the middle: three edges of Lambert's formula.
    phi = np.arange(3) * 2.0 * math.pi / 3.0
    corners = np.stack([np.cos(phi) * size, np.full(3, height), np.sin(phi) * size], axis=1)
    a, b = corners[0] / size, corners[1] / size
    cross = np.cross(a, b)
    angle = math.atan2(float(np.linalg.norm(cross)), float(a @ b))
    irradiance = 1.5 * angle * abs(float(cross[1])) / float(np.linalg.norm(cross))
    v = [tuple(c) for c in corners.tolist()]
    return rt.Triangle(v0=v[0], v1=v[1], v2=v[2], material="lamp"), irradiance


def lit_floor(kind: str, size: float, radiance: float) -> World:
    """The floor right under a lamp that is as far above as two of its sizes."""
    lamp, irradiance = _lamp(kind, size, 2.0 * size)
    wide = scaled(30.0 * size)
    floor = rt.Rectangle(material="floor", transform=(wide, turned(-90)))
    camera = rt.Orthographic(
        eye=(0, 0.5 * size, 0), target=(0, 0, 0), up=(0, 0, -1), width=1e-9 * size
    )
    return World(
        (floor, lamp),
        {"floor": rt.Diffuse(reflectance=grey(RHO)), "lamp": rt.Emissive(radiance=grey(radiance))},
        camera,
        RHO / math.pi * radiance * irradiance,
        {"max_depth": 2},
    )


def _area(draw: Draw, x: float) -> dict[str, Outcome]:
    """Areas of about x and of about 1 / x."""
    found = []
    for size in {math.sqrt(x), 1.0 / math.sqrt(x)}:
        for kind in KINDS:
            shown = {"lamp": kind, "size": size}
            found.append(measure(lit_floor(kind, size, 1.0), draw, 16, _rounding, shown))
    return together(found)


def _radiance(draw: Draw, x: float) -> dict[str, Outcome]:
    found = []
    for radiance in {x, 1.0 / x}:
        for kind in ("sphere", "rectangle"):
            shown = {"lamp": kind, "radiance": radiance}
            found.append(measure(lit_floor(kind, 1.0, radiance), draw, 16, _rounding, shown))
    return together(found)


def _roulette(draw: Draw, x: float) -> dict[str, Outcome]:
    found = []
    for albedo in (0.5, 0.9, 0.99):
        world = closed(albedo, int(x), rr_depth=1)
        spp = 16 if draw.effort == "quick" else 64
        shown = {"albedo": albedo, "edges": int(x)}
        found.append(measure(world, draw, spp, _rounding, shown, in_scalar=False, their_pixels=32))
    return together(found)


AREA = Series(
    "light area",
    Sweep("area, or 1 / area", decades(0, 12, 2), (1.0, 1e8, 1e12), 8, 8),
    "Disks, spheres, rectangles and triangles of areas x and 1 / x light a floor two of their "
    "sizes below; all is scaled with them.  A case is a picture whose pixels see one point.",
    _area,
    unit="of the value",
)
RADIANCE = Series(
    "radiance",
    Sweep("radiance, or 1 / radiance", (1.0, 1e5, 1e10, 1e15, 1e20, 1e25, 1e30), (1.0, 1e30), 4, 4),
    "A sphere and a rectangle of radiance x and 1 / x light a floor.  A case is a picture.",
    _radiance,
    unit="of the value",
    explained="1e-30 to 1e30 lie within float32's range, and radiance is a factor of all light: "
    "Mitsuba's pictures are as near as their noise, 4.5e-3, throughout",
)
ROULETTE = Series(
    "roulette",
    Sweep("edges of a path", (1.0, 2.0, 5.0, 10.0, 30.0, 1e2, 3e2, 1e3), (2.0, 30.0, 1e3), 3, 3),
    "A closed furnace of albedo 0.5, 0.9 and 0.99, paths of up to x edges, Russian roulette at "
    "each of them.  A case is a picture.",
    _roulette,
    unit="of the value",
    explained="no number grows with depth.  What Mitsuba's cap of 0.95 on survival costs at an "
    "albedo of 0.99 is noise without a variance: its means are some tenth of the value off at "
    "1,000 edges, about what the law allows; ours 0.7 %",
)


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


def _distance(draw: Draw, x: float) -> dict[str, Outcome]:
    """At the distances x and 1 / x, in all directions."""
    n = draw.cases
    far = np.where(np.arange(n) % 2 == 0, x, 1.0 / x) * draw.rng.uniform(1.0, 2.0, n)
    p = round32(unit_vectors(draw.rng, n) * far[:, None])
    light = Point(position=(0.0, 0.0, 0.0), intensity=(1.0, 1.0, 1.0))
    table = light.tabulate()
    sampled = [point.sample(table, 0, Vec3(*at)) for at in p.tolist()]
    found = {OURS: (np.array([s.radiance.x for s in sampled]), np.array([s.wi for s in sampled]))}
    if draw.mitsuba:
        found[MITSUBA] = _theirs({"type": "point", "position": [0, 0, 0], "intensity": 1.0}, p)
    with ctx.workprec(200):
        squares = [sum((arb(c) * arb(c) for c in at), arb(0)) for at in p.tolist()]
        exact = np.array([float(1 / s) for s in squares])
        towards = np.array(
            [
                [float(-arb(c) / s.sqrt()) for c in at]
                for at, s in zip(p.tolist(), squares, strict=True)
            ]
        )
    outcomes = {}
    for who, (arriving, wi) in found.items():
        with np.errstate(invalid="ignore"):
            errors = np.maximum(
                np.abs(arriving - exact) / exact, np.linalg.norm(wi - towards, axis=1)
            )
        shown = {"light": "at the origin", "point": p, "irradiance": plain(exact)}
        outcomes[who] = of_errors(errors, 8.0 * unit_of(who), shown | {"found": plain(arriving)})
    return outcomes


def _spot(draw: Draw, x: float) -> dict[str, Outcome]:
    """One cone per sweep point, receivers from its axis to a little beyond its rim."""
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


def _falloffs(target: FloatArray, cutoff: float, p: FloatArray) -> FloatArray:
    found = []
    with ctx.workprec(200):
        a = [arb(c) for c in target.tolist()]
        end = arb(cutoff) * arb.pi() / 180
        for at in p.tolist():
            w = [arb(c) for c in at]
            c = [a[k - 2] * w[k - 1] - a[k - 1] * w[k - 2] for k in range(3)]
            sine = sum((v * v for v in c), arb(0)).sqrt()
            angle = arb.atan2(sine, sum((v * u for v, u in zip(a, w, strict=True)), arb(0)))
            found.append(min(1.0, max(0.0, float((end - angle) / (end / 4)))))
    return np.array(found)


DISTANCE = Series(
    "point light",
    Sweep("distance, or 1 / distance", decades(0, 9), (1.0, 1e3, 1e9), 2_000, 20_000),
    "A point light of intensity 1 at the origin, receivers at x and at 1 / x: irradiance and "
    "direction.",
    _distance,
    unit="of the value",
    explained="1 / d² of 1e-9 to 1e9 is a float of 32 bits as well, and a root, squares and a "
    "quotient round by a few u wherever they are: Mitsuba is off by 3.1e-7 at most, at all of them",
)
SPOT = Series(
    "spot",
    Sweep(
        "1 / cutoff in degrees", (0.05, 0.1, *decades(0, 6)), (0.05, 1.0, 1e3, 1e6), 2_000, 20_000
    ),
    "Points from a spot's axis to beyond its rim, at distances from 1e-3 to 1e3; the beam is three "
    "quarters of the cone.",
    _spot,
    unit="of the intensity",
)


# ---- the series ----------------------------------------------------------------------------------


FAMILY = Family(
    id="F12",
    name="radiometry at extremes",
    law="light of any size, distance, brightness, cone and depth arrives as closed forms say",
    anchors="no other project is known to test these",
    series=(AREA, RADIANCE, DISTANCE, SPOT, SMALL_SPHERE, CLOSE_SPHERE, FLAT, SKY, ROULETTE),
)
