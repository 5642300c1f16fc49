"""Light in gaps: the contact shadow under a cube, and the transmittance of slabs of glass."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

import reference_rt as rt
from comparisons.experiments.methods.errors import U
from comparisons.experiments.methods.setting import FloatArray
from comparisons.experiments.stability.contact.stacks import COUNT, THEIRS, rays_down
from comparisons.experiments.stability.harness.core import MITSUBA, OURS, Draw, Outcome, Shot
from comparisons.experiments.stability.harness.leaving import CONTACT, PIXELS, bound, lit, picture
from comparisons.experiments.stability.harness.outcomes import outcome
from comparisons.experiments.stability.harness.steps import matrix
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.rendering.query import radiance_without_noise


def shadow_scene(gap: float) -> rt.Scene:
    """A cube over a floor z = 0, from x = -1 to 1 and from z = gap on."""
    floor = rt.Rectangle(transform=matrix(np.diag([4.0, 4.0, 1.0]), np.zeros(3)))
    cube = rt.Box(transform=matrix(np.eye(3), np.array([0.0, 0.0, 1.0 + gap])))
    return rt.Scene(shapes=(floor, cube))


def shadow(draw: Draw, x: float) -> Mapping[str, Outcome]:
    """Points under the cube, `deep` from its edge x = 1, towards a sun at 45°: in the light where
    that comes in under the edge, deep < gap.  The floor is seen from below."""
    gap, n, rng = 1.0 / x, draw.cases, draw.rng
    deep = gap * 2.0 ** rng.uniform(-4.0, 4.0, n)
    slope = np.sqrt(0.5)
    at = np.column_stack([1.0 - deep, rng.uniform(-0.5, 0.5, n), np.zeros(n)])
    d = np.tile([0.0, 0.0, 1.0], (n, 1))
    o, w = at - d, np.tile([slope, 0.0, slope], (n, 1))
    dark = (1.0 - at[:, 0] > gap).astype(np.int64)
    # Near the edge of the shadow either answer is right.
    sure = (np.abs(deep - gap) > CONTACT * bound(0.0, 1.0)) & (deep < 1.5)
    scene = shadow_scene(gap)
    answers = {OURS: lit(OURS, scene, o, d, w)}
    if draw.mitsuba:
        answers[MITSUBA] = lit(MITSUBA, scene, *(a[: 4 * THEIRS] for a in (o, d, w)))
    outcomes = {}
    for name, answer in answers.items():
        met, few = (1.0 - answer[:, 0]).astype(np.int64), slice(len(answer))
        shown = {"gap": gap.hex(), "point": at, "expected": dark, "found": met}
        outcomes[name] = outcome(dark[few] != met, shown, ~sure[few])
    return outcomes


GLASS = 1.5
"""Index of refraction."""

TRANSMITTED = 64.0 * COUNT * U
"""Of the relative error: each of Fresnel's equations, some thirty operations whose result changes
by less than twice what the cosine does, below 30°."""


def panes(gap: float) -> SceneTables:
    """Slabs of glass, `gap` thick and as much apart, before a lamp of radiance 1."""
    slabs = tuple(
        rt.Box(
            material="glass",
            transform=matrix(np.diag([2.0, 2.0, gap / 2.0]), np.array([0.0, 0.0, -2.0 * k * gap])),
        )
        for k in range(COUNT // 2)
    )
    lamp = rt.Rectangle(
        material="lamp", transform=matrix(np.diag([9.0, 9.0, 1.0]), np.array([0.0, 0.0, -3.0]))
    )
    materials: dict[str, Any] = {
        "glass": rt.Dielectric(interior_ior=GLASS),
        "lamp": rt.Emissive(radiance=(1.0, 1.0, 1.0)),
    }
    return rt.build_tables(rt.Scene(shapes=(*slabs, lamp), materials=materials))


def fresnel(cosine: FloatArray) -> FloatArray:
    """Transmitted by one surface, of unpolarised light (both ways the same)."""
    inner = np.sqrt(1.0 - (1.0 - cosine**2) / GLASS**2)
    across = (cosine - GLASS * inner) / (cosine + GLASS * inner)
    along = (GLASS * cosine - inner) / (GLASS * cosine + inner)
    return np.asarray(1.0 - 0.5 * (across**2 + along**2))


def transmitted(draw: Draw, x: float) -> Mapping[str, Outcome]:
    """As many surfaces as Whitted may follow: what is mirrored to and fro needs more, so that the
    lamp is seen through all of them alone: (1 - F)^COUNT."""
    o, d = rays_down(draw.rng, draw.cases)
    setup = rt.Whitted(max_depth=COUNT, min_contribution=0.0).setup()
    found = radiance_without_noise(panes(1.0 / x), setup, o + np.array([0.0, 0.0, 0.5]), d)[:, 0]
    expected = fresnel(-d[:, 2]) ** COUNT
    error = np.abs(found - expected) / expected
    shown = {"o": o, "d": d, "expected": expected, "found": found}
    return {OURS: outcome(~(error <= TRANSMITTED), shown, worst=float(error.max() / (COUNT * U)))}


def shoot(contestant: str, x: float) -> Shot:
    """The strip of the floor beside and under the edge, twelve gaps wide."""
    gap = 1.0 / x
    ticks = (np.arange(PIXELS) + 0.5) / PIXELS * 12.0 - 6.0
    across, along = np.meshgrid(ticks, np.linspace(-0.5, 0.5, PIXELS))
    at = np.column_stack([1.0 + across.ravel() * gap, along.ravel(), np.zeros(across.size)])
    d = np.tile([0.0, 0.0, 1.0], (len(at), 1))
    w = np.tile([math.sqrt(0.5), 0.0, math.sqrt(0.5)], (len(at), 1))
    found = lit(contestant, shadow_scene(gap), at - d, d, w)
    share = float((found[:, 0] > 0.0).mean())
    caption = (
        f"{contestant}: the floor at a cube's edge (in the middle), {gap:.0e} under it; "
        f"light comes in by one gap in twelve: 58 % are lit, here {100.0 * share:.0f} %"
    )
    return Shot(picture(found), caption)
