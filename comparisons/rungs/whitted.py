"""The rung of Whitted ray tracing: the radiance of pixel centres, without noise."""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from comparisons.geometry.frame import UNIT_ROUNDOFF, round32
from comparisons.integrators import translate_integrator
from comparisons.integrators.whitted import AMBIENT
from comparisons.lights.constant import ambient_of
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.counterpart import Counterpart, trace
from comparisons.mitsuba.plugins.whitted import MOST_COMPONENTS
from comparisons.mitsuba.scene import for_rays
from comparisons.referee.sizes import ShapeSizes
from comparisons.results.case import RungResult
from comparisons.rungs.rays import arbiter
from comparisons.rungs.rays.coincidence import on_two_surfaces
from comparisons.rungs.rays.lamp_images import changes_of_lamps
from comparisons.rungs.rays.light_context import LightContext
from comparisons.rungs.rays.light_error import cut_off, of_direct_light
from comparisons.rungs.rays.neighbours import NeighbourContext, explained_by_neighbours, rounding_of
from comparisons.rungs.rays.rays import Rays, described, pixel_rays
from comparisons.rungs.rays.resolution import NOT_BEYOND, elsewhere, too_many_elsewhere
from comparisons.rungs.rays.slopes import is_steep, moved, slopes
from comparisons.shapes import type_of
from comparisons.translator.accuracy import accuracy, coat_error
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.integrators import Whitted
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.lights import ENVIRONMENT
from reference_rt.materials import most_branches
from reference_rt.rendering import query
from reference_rt.rendering.scene import Scene
from reference_rt.shapes import Box, Rectangle

PIXELS = 128 * 128
"""Most pixels that are compared, evenly strided."""

MOST_LIGHTS = 256
"""Most lights: each needs a shadow ray at every surface, and more would take minutes."""

AT_LEAST = 64.0 * UNIT_ROUNDOFF
"""Relative error of a ray's throughput: the product of some eight factors of each of eight levels.
Rays with less than a least contribution are not followed."""

TOLERANCE = 1e-5
"""Relative to a pixel, or to the picture's white (the 99th percentile of lit pixels) if that is
brighter.  What a light sends to a point is off by 4 e / r at most (see `comparisons.rungs.direct`),
with e = 8 * 2^-24 (|o| + |p| + reach): 1e-5 where these three are 1.7 times the light's distance
each. Points closer to a light, and rays that curved mirrors spread, are left to the arbiter.
Measured on the project's scenes: 0.6e-5."""


def whitted(
    scene: Scene, tables: SceneTables, counterpart: Counterpart, pixels: int = PIXELS
) -> RungResult:
    """Compare the radiance through pixel centres with that of our Whitted plugin in Mitsuba.

    The depth is the scene's if its integrator is Whitted, else the default.  Outliers go to the
    arbiter: rays moved by float32's bound, then by Mitsuba's ray epsilon, in both renderers.
    """
    choice = tables.lights.choice
    if choice is None:
        return RungResult("whitted", "not-applicable", "the scene has no light")
    lights = int(np.count_nonzero(choice.kind != ENVIRONMENT))
    if lights > MOST_LIGHTS:
        reason = f"{lights} lights: with more than {MOST_LIGHTS} shadow rays take too long"
        return RungResult("whitted", "not-applicable", reason)
    if counterpart.no_light_reason:
        return RungResult("whitted", "not-comparable", counterpart.no_light_reason)
    integrator = scene.integrator if isinstance(scene.integrator, Whitted) else Whitted()
    rays = pixel_rays(scene, counterpart.frame, pixels)
    trees = Trees(scene, tables, counterpart, integrator)
    compared = trees.compare(rays)
    ours, theirs, error, bound, outliers = compared
    settled, of_lamps = trees.explained(rays, compared)
    unexplained = outliers[~settled]
    right, lit = error <= bound, ours.any(axis=1) | theirs.any(axis=1)
    told = lit & right & arbiter.tells(bound, ours, theirs)
    ratio = np.divide(error, bound, out=np.zeros_like(error), where=bound > 0.0)[right]
    numbers: dict[str, Any] = {
        "pixels": len(rays.o),
        "max_depth": integrator.max_depth,
        "max_error": float(error[right].max(initial=0.0)),
        "max_error_over_bound": float(ratio.max(initial=0.0)),
        "explained": int(np.count_nonzero(settled)),
        "unexplained": len(unexplained),
        "lit": int(np.count_nonzero(lit)),
        "lit_right": int(np.count_nonzero(told)),
    }
    numbers["tells"] = arbiter.is_enough(numbers["lit_right"], numbers["lit"])
    numbers["explained_elsewhere"] = too_many_elsewhere(
        scene, tables, counterpart, rays.rows(outliers[settled & ~of_lamps]), len(rays.o)
    )
    if len(unexplained):
        numbers["elsewhere"] = elsewhere(scene, tables, counterpart, rays.rows(unexplained))
        k = int(unexplained[np.argmax(np.nan_to_num(error[unexplained], nan=np.inf))])
        reason = (
            f"{len(unexplained)} of {len(rays.o)} pixels differ by more than float32 explains; the "
            f"largest error, of {described(scene.film, pixels, rays, k)}: "
            f"ours {ours[k]}, Mitsuba's {theirs[k]} W/sr/m²"
        )
        return RungResult("whitted", "differ", reason, numbers)
    edges = (
        f"{numbers['explained']} of {len(rays.o)} pixels lie at edges that Mitsuba does not "
        "resolve (float32, its ray epsilon)"
    )
    if not numbers["tells"]:
        edges += f"; only {numbers['lit_right']} of {numbers['lit']} lit pixels say anything"
    if numbers["explained_elsewhere"]:
        return RungResult("whitted", "differ", f"{edges}, but {NOT_BEYOND}", numbers)
    if arbiter.too_many(numbers["explained"], len(rays.o)):
        return RungResult("whitted", "reference-limited", edges, numbers)
    reason = f"pixels agree within {numbers['max_error']:.2g} W/sr/m²; {edges}"
    return RungResult("whitted", "agree", reason, numbers)


class Compared(NamedTuple):
    """The radiance of n rays, (n, 3) on either side, how far they are apart and may be, (n,), and
    the indices (m,) of those that are further apart."""

    ours: FloatArray
    theirs: FloatArray
    error: FloatArray
    bound: FloatArray
    outliers: IntArray


class Trees:
    """Ray trees of a scene in both renderers."""

    def __init__(
        self, scene: Scene, tables: SceneTables, counterpart: Counterpart, integrator: Whitted
    ) -> None:
        self._scene, self._tables, self._counterpart = scene, tables, counterpart
        self._integrator, self._setup = integrator, integrator.setup()
        self._sizes = ShapeSizes(scene, counterpart.frame)
        self._theirs_at = plugin_radiance(scene, tables, counterpart, integrator)

    def of_ours(self, rays: Rays) -> FloatArray:
        """Our radiance (n, 3)."""
        return self._ours_along(rays.o, rays.d)

    def compare(self, rays: Rays) -> Compared:
        """Trace the trees of rays that are exact in float32."""
        scene, tables, sizes = self._scene, self._tables, self._sizes
        ours, theirs = self.of_ours(rays), self._theirs_at(rays)
        size = np.maximum(np.abs(ours), np.abs(theirs)).max(axis=1)
        lit = size[np.isfinite(size) & (size > 0.0)]
        bright = np.percentile(lit, 99.0) if len(lit) else 0.0
        bound = TOLERANCE * np.maximum(size, bright)
        bound += bright * max((coat_error(scene, name) for name in scene.materials), default=0.0)
        tables_off = max((accuracy(scene, name) for name in scene.materials), default=0.0)
        bound += tables_off * size
        bound += cut_off(scene)
        error = np.abs(theirs - ours).max(axis=1)
        hits = query.intersect(tables, *rays), trace(self._counterpart, *rays)
        error[np.isfinite(error) & on_two_surfaces(sizes, tables, rays, *hits)] = 0.0
        if is_steep(scene):
            over = np.flatnonzero(~(error <= bound))
            few = rays.rows(over)
            others = [
                partial(self._ours_along, other.o, other.d)
                for other in moved(few, rounding_of(tables, sizes, few))
            ]
            bound[over] += slopes(ours[over], others, float(lit.max(initial=0.0)))
        return Compared(ours, theirs, error, bound, np.flatnonzero(~(error <= bound)))

    def explained(
        self, rays: Rays, compared: Compared
    ) -> tuple[arbiter.BoolArray, arbiter.BoolArray]:
        """(m,): which outliers of the rays the arbiter explains, and which the textures of lamps
        do: their light may be so much more or less where the middle of a lamp lies at the edge of a
        texel, wherever the ray goes."""
        ours, theirs, _, bound, outliers = compared
        tables, setup = self._tables, self._setup
        some, integrator = rays.rows(outliers), self._integrator
        settled = explained_by_neighbours(
            NeighbourContext(
                self._scene, tables, self._counterpart, self._sizes, integrator.max_depth
            ),
            some,
            ((ours[outliers], self._ours_along), (theirs[outliers], self._theirs_along)),
            bound[outliers],
        )
        for factor in (1.0 - AT_LEAST, 1.0 + AT_LEAST):  # a ray with just the least contribution
            least = factor * integrator.min_contribution
            other = integrator.model_copy(update={"min_contribution": least}).setup()
            again = query.radiance_without_noise(tables, other, some.o, some.d)
            settled |= np.abs(again - theirs[outliers]).max(axis=1) <= bound[outliers]
        hits = query.intersect(tables, *some), trace(self._counterpart, *some)
        context = LightContext(self._scene, tables, self._counterpart, some, *hits, self._sizes)
        low, high = changes_of_lamps(context, setup)
        off = theirs[outliers] - ours[outliers]
        allowed = (bound[outliers] + of_direct_light(context))[:, None]
        within = ((off >= low - allowed) & (off <= high + allowed)).all(axis=1)
        return settled | within, np.asarray(within & (np.abs(off) > allowed).any(axis=1))

    def _ours_along(
        self, o: FloatArray, d: FloatArray, tables: SceneTables | None = None
    ) -> FloatArray:
        return query.radiance_without_noise(
            self._tables if tables is None else tables, self._setup, o, d
        )

    def _theirs_along(self, o: FloatArray, d: FloatArray) -> FloatArray:
        return np.asarray(self._theirs_at(Rays(self._counterpart.frame.rounded(o), round32(d))))


def plugin_radiance(
    scene: Scene, tables: SceneTables, counterpart: Counterpart, integrator: Whitted
) -> Callable[..., FloatArray]:
    """Mitsuba's Whitted ray tracing: `Rays`, and where they end if they do -> radiance (n, 3)."""
    mi = mitsuba()
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
    described = {
        **(translate_integrator(integrator) or {}),
        **dict(zip(AMBIENT, ambient_of(scene.lights), strict=True)),
        "components": MOST_COMPONENTS * most_branches(tables.materials),
        "unlit": " ".join(unlit),
        "boxes": " ".join(boxes),
    }

    shared = mi.load_dict(described) if mi.variant().startswith("scalar") else None

    def radiance(o: Any, d: Any, end: Any) -> tuple[Any, ...]:
        # Wide variants load it for each call: Dr.Jit makes the lights' data as wide as the first
        # call's rays.  Scalar variants call this for each ray.
        plugin = mi.load_dict(described) if shared is None else shared
        ray = mi.Ray3f(mi.Point3f(o), d)
        ray.maxt = end
        return (plugin.sample(counterpart.lit, None, ray)[0],)

    def of(rays: Rays, ends: FloatArray | None = None) -> FloatArray:
        t_max = np.full(len(rays.o), np.inf) if ends is None else ends * counterpart.frame.scale
        found: FloatArray = for_rays(radiance, counterpart.frame.into(rays.o), rays.d, t_max)[0]
        return found

    return of
