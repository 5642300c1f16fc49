"""Lamps of any size and brightness over a floor, and paths of any length, as rendered."""

import math
from typing import Any

import numpy as np

import reference_rt as rt
from comparisons.experiments.stability.harness.outcomes import Outcomes, together, unit_of
from comparisons.experiments.stability.harness.series import Draw, Sweep, decades, series
from comparisons.experiments.stability.harness.steps import at, scaled, turned
from comparisons.experiments.stability.harness.worlds import World, closed, grey, measure

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


@series(Sweep("area, or 1 / area", decades(0, 12, 2), (1.0, 1e8, 1e12), 8, 8), unit="of the value")
def light_area(draw: Draw, x: float) -> Outcomes:
    """Disks, spheres, rectangles and triangles of areas x and 1 / x light a floor two of their
    sizes below; all is scaled with them. A case is a picture whose pixels see one point."""
    found = []
    for size in {math.sqrt(x), 1.0 / math.sqrt(x)}:
        for kind in KINDS:
            shown = {"lamp": kind, "size": size}
            found.append(measure(lit_floor(kind, size, 1.0), draw, 16, _rounding, shown))
    return together(found)


@series(
    Sweep("radiance, or 1 / radiance", decades(0, 30, 5), (1.0, 1e30), 4, 4),
    unit="of the value",
    explained="1e-30 to 1e30 lie within float32's range, and radiance is a factor of all light: "
    "Mitsuba's pictures are as near as their noise, 4.5e-3, throughout",
)
def radiance(draw: Draw, x: float) -> Outcomes:
    """A sphere and a rectangle of radiance x and 1 / x light a floor. A case is a picture."""
    found = []
    for light in {x, 1.0 / x}:
        for kind in ("sphere", "rectangle"):
            shown = {"lamp": kind, "radiance": light}
            found.append(measure(lit_floor(kind, 1.0, light), draw, 16, _rounding, shown))
    return together(found)


@series(
    Sweep(
        "edges of a path",
        (1.0, 2.0, 5.0, 10.0, 30.0, 1e2, 3e2, 1e3),
        (2.0, 30.0, 1e3),
        *(3, 3),
    ),
    unit="of the value",
    explained="no number grows with depth.  What Mitsuba's cap of 0.95 on survival costs at an "
    "albedo of 0.99 is noise without a variance: its means are some tenth of the value off at "
    "1,000 edges, about what the law allows; ours 0.7 %",
)
def roulette(draw: Draw, x: float) -> Outcomes:
    """A closed furnace of albedo 0.5, 0.9 and 0.99, paths of up to x edges, Russian roulette at
    each of them. A case is a picture."""
    found = []
    for albedo in (0.5, 0.9, 0.99):
        world = closed(albedo, int(x), rr_depth=1)
        spp = 16 if draw.effort == "quick" else 64
        shown = {"albedo": albedo, "edges": int(x)}
        found.append(measure(world, draw, spp, _rounding, shown, in_scalar=False, their_pixels=32))
    return together(found)
