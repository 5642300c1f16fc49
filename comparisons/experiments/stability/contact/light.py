"""Light in gaps: the contact shadow under a cube, and what slabs of glass let through."""

import math
from typing import Any

import numpy as np

import reference_rt as rt
from comparisons.experiments.stability.contact.stacks import COUNT
from comparisons.experiments.stability.harness.outcomes import U
from comparisons.experiments.stability.harness.shadows import PIXELS, light_picture, lit
from comparisons.experiments.stability.harness.shots import Shot
from comparisons.experiments.stability.harness.steps import matrix
from reference_rt.core.arrays import FloatArray
from reference_rt.integrators.scene_tables import SceneTables


def shadow_scene(gap: float) -> rt.Scene:
    """A cube over a floor z = 0, from x = -1 to 1 and from z = gap on."""
    floor = rt.Rectangle(transform=matrix(np.diag([4.0, 4.0, 1.0]), np.zeros(3)))
    cube = rt.Box(transform=matrix(np.eye(3), np.array([0.0, 0.0, 1.0 + gap])))
    return rt.Scene(shapes=(floor, cube))


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
    return Shot(light_picture(found), caption)
