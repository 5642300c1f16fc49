"""The ray trees of our Whitted plugin for Mitsuba."""

from typing import Any

import numpy as np

from comparisons.integrators import translate_integrator
from comparisons.integrators.whitted import AMBIENT
from comparisons.lights.constant import ambient_of
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.counterpart import Counterpart
from comparisons.mitsuba.plugins.whitted import MOST_COMPONENTS
from comparisons.mitsuba.scene import for_rays
from comparisons.rungs.rays.rays import Rays
from comparisons.rungs.rays.tree_error import Nodes
from comparisons.shapes import type_of
from reference_rt.core.arrays import FloatArray
from reference_rt.integrators import Whitted
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.materials import most_branches
from reference_rt.rendering.scene import Scene
from reference_rt.shapes import Box, Rectangle


class PluginTrees:
    """Mitsuba's Whitted ray tracing of a scene: `Rays`, and where they end if they do -> radiance
    (n, 3)."""

    def __init__(
        self, scene: Scene, tables: SceneTables, counterpart: Counterpart, integrator: Whitted
    ) -> None:
        self._counterpart = counterpart
        # Without rays of a BSDF's samples, what is not sampled lights nothing.
        unlit = [
            name
            for name, mi_shape in counterpart.mi_shapes.items()
            if mi_shape.instance >= 0
            or not type_of(mi_shape.leaf).is_sampled
            or mi_shape.plugin.stand_in is not None
        ]
        boxes = [
            name for name, p in counterpart.mi_shapes.items() if isinstance(p.leaf, Box | Rectangle)
        ]
        self._described = {
            **(translate_integrator(integrator) or {}),
            **dict(zip(AMBIENT, ambient_of(scene.lights), strict=True)),
            "components": MOST_COMPONENTS * most_branches(tables.materials),
            "unlit": " ".join(unlit),
            "boxes": " ".join(boxes),
        }
        self._shared = self._loaded() if mitsuba().variant().startswith("scalar") else None

    def __call__(self, rays: Rays, ends: FloatArray | None = None) -> FloatArray:
        return self._traced(rays, ends, None)

    def nodes(self, rays: Rays) -> Nodes:
        """The nodes of the trees of rays."""
        met: list[list[Any]] = []
        self._traced(rays, None, met)
        found: list[Any] = []
        for first, calls in enumerate(met):  # of all rays, or of each one
            n = len(rays.o) if len(met) == 1 else 1
            for ray, weight, active, depth in calls:
                columns = [_columns(x, n) for x in (ray.o, ray.d, weight)]
                at = np.flatnonzero(np.broadcast_to(np.array(active), n))
                found.append((at + first, np.full(len(at), depth), *(c[at] for c in columns)))
        row, depth, o, d, weight = (np.concatenate(column) for column in zip(*found, strict=True))
        return Nodes(row, depth, weight, Rays(self._counterpart.frame.out(o), d))

    def _loaded(self) -> Any:
        return mitsuba().load_dict(self._described)

    def _traced(
        self, rays: Rays, ends: FloatArray | None, met: list[list[Any]] | None
    ) -> FloatArray:
        """met: where to put what the plugin's `met` is called with, one list for each call."""
        mi, counterpart = mitsuba(), self._counterpart

        def radiance(o: Any, d: Any, end: Any) -> tuple[Any, ...]:
            # Wide variants load it for each call: Dr.Jit makes the lights' data as wide as the
            # first call's rays.  Scalar variants call this for each ray.
            plugin = self._loaded() if self._shared is None else self._shared
            if met is not None:
                calls: list[Any] = []
                met.append(calls)
                # Copies: Dr.Jit's arrays change in place.
                plugin.met = lambda ray, weight, active, depth: calls.append(
                    (mi.Ray3f(ray), mi.Color3f(weight), mi.Mask(active), depth)
                )
            ray = mi.Ray3f(mi.Point3f(o), d)
            ray.maxt = end
            found = plugin.sample(counterpart.lit, None, ray)[0]
            plugin.met = None
            return (found,)

        t_max = np.full(len(rays.o), np.inf) if ends is None else ends * counterpart.frame.scale
        found: FloatArray = for_rays(radiance, counterpart.frame.into(rays.o), rays.d, t_max)[0]
        return found


def _columns(vector: Any, n: int) -> FloatArray:
    """(n, 3) of a vector of Mitsuba's, of a wide or of a scalar variant."""
    return np.broadcast_to(np.array(vector, np.float64).reshape(3, -1), (3, n)).T
