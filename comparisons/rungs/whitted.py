"""The rung of Whitted ray tracing: the radiance of pixel centres, without noise."""

from typing import Any, NamedTuple

import numpy as np

from comparisons.geometry.frame import UNIT_ROUNDOFF, round32
from comparisons.mitsuba.counterpart import Counterpart, trace
from comparisons.referee.sizes import ShapeSizes
from comparisons.results.case import RungResult
from comparisons.rungs.rays import arbiter
from comparisons.rungs.rays.coincidence import is_doubled, on_two_surfaces
from comparisons.rungs.rays.lamp_images import changes_of_lamps
from comparisons.rungs.rays.light_context import LightContext
from comparisons.rungs.rays.light_error import MIDDLE, cut_off
from comparisons.rungs.rays.neighbours import explained_by_neighbours
from comparisons.rungs.rays.plugin_trees import PluginTrees
from comparisons.rungs.rays.rays import Rays, described, pixel_rays
from comparisons.rungs.rays.resolution import NOT_BEYOND, elsewhere, too_many_elsewhere
from comparisons.rungs.rays.tree_error import FACTORS, TreeContext, magnified, roundings
from comparisons.translator.accuracy import accuracy
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.integrators import Whitted
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.lights import AREA, ENVIRONMENT
from reference_rt.rendering import query
from reference_rt.rendering.scene import Scene

PIXELS = 128 * 128
"""Most pixels that are compared, evenly strided."""

MOST_LIGHTS = 256
"""Most lights: each needs a shadow ray at every surface, and more would take minutes."""

MOST_MAGNIFIED = 2048
"""Most pixels of which it is measured how mirrors magnify float32's errors; if more differ, this is
not why."""


def whitted(
    scene: Scene, tables: SceneTables, counterpart: Counterpart, pixels: int = PIXELS
) -> RungResult:
    """Compare the radiance through pixel centres with that of our Whitted plugin in Mitsuba.

    The depth is the scene's if its integrator is Whitted, else the default.  Each pixel may be off
    by its `tree_error`.  Outliers go to the arbiter: rays moved by float32's bound in both
    renderers; but not where they have the values of another tree.
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
    other, in_words = trees.others(rays, compared)
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
        "of_another_tree": other,
        "lit": int(np.count_nonzero(lit)),
        "lit_right": int(np.count_nonzero(told)),
    }
    numbers["tells"] = arbiter.is_enough(numbers["lit_right"], numbers["lit"])
    asked = outliers[settled & ~of_lamps]
    numbers["explained_elsewhere"] = too_many_elsewhere(
        scene,
        tables,
        counterpart,
        rays.rows(asked[~trees.see_doubled_lamps(rays.rows(asked))]),
        len(rays.o),
        trees.following,
    )
    if len(unexplained):
        numbers["elsewhere"] = elsewhere(scene, tables, counterpart, rays.rows(unexplained))
        k = int(unexplained[np.argmax(np.nan_to_num(error[unexplained], nan=np.inf))])
        reason = (
            f"{len(unexplained)} of {len(rays.o)} pixels differ by more than float32 explains; the "
            f"largest error, of {described(scene.film, pixels, rays, k)}: "
            f"ours {ours[k]}, Mitsuba's {theirs[k]} W/sr/m²"
        )
        reason += f"; {in_words}" if other else ""
        return RungResult("whitted", "differ", reason, numbers)
    if other:
        return RungResult("whitted", "differ", in_words, numbers)
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
        self._context = TreeContext(scene, tables, counterpart, self._sizes, integrator)
        self._theirs_at = PluginTrees(scene, tables, counterpart, integrator)

    def of_ours(self, rays: Rays) -> FloatArray:
        """Our radiance (n, 3)."""
        return self._ours_along(rays.o, rays.d)

    def see_doubled_lamps(self, rays: Rays) -> arbiter.BoolArray:
        """(n,): whether another surface lies in the place of the middle of a lamp, within float32's
        error, as seen from the rays' first hits.  No light is asked."""
        choice, doubled = self._tables.lights.choice, np.zeros(len(rays.o), bool)
        if choice is None:
            return doubled
        for light in np.flatnonzero((choice.kind == AREA) & (choice.probability > 0.0)).tolist():
            ours = query.direct_light(self._tables, *rays, light, MIDDLE)
            seen = np.flatnonzero(ours.pdf > 0.0)
            p = query.intersect(self._tables, *rays.rows(seen)).p
            doubled[seen] |= is_doubled(self._sizes, self._tables, p, ours.target[seen])
        return doubled

    def following(self, rays: Rays) -> tuple[IntArray, Rays]:
        """All rays of Mitsuba's trees of some rays, and the row of each: see `resolution`."""
        nodes = self._theirs_at.nodes(rays)
        return nodes.row, nodes.rays

    def compare(self, rays: Rays) -> Compared:
        """Trace the trees of rays that are exact in float32."""
        ours, theirs = self.of_ours(rays), self._theirs_at(rays)
        size = np.maximum(np.abs(ours), np.abs(theirs)).max(axis=1)
        error = np.abs(theirs - ours).max(axis=1)
        hits = query.intersect(self._tables, *rays), trace(self._counterpart, *rays)
        doubled = on_two_surfaces(self._sizes, self._tables, rays, *hits)
        error[np.isfinite(error) & doubled] = 0.0
        # The least that any tree may be off; most pixels need no more.
        tables_off = max(
            (accuracy(self._scene, name) for name in self._scene.materials), default=0.0
        )
        least = (FACTORS * UNIT_ROUNDOFF + tables_off) * size + cut_off(self._scene)
        bound = least.copy()
        over = np.flatnonzero(~(error <= bound))
        if len(over):
            some = rays.rows(over)
            nodes = self._theirs_at.nodes(some)
            bound[over] += roundings(self._context, nodes, len(over))
            rest = np.flatnonzero(~(error[over] <= bound[over]))
            rest = rest[:: -(-len(rest) // MOST_MAGNIFIED) or 1]
            bound[over[rest]] += magnified(self._context, nodes.of(rest), len(rest))
        # A bound that leaves nothing to say excuses nothing: those rays are the arbiter's.
        bound = np.where(arbiter.tells(bound, ours, theirs), bound, least)
        return Compared(ours, theirs, error, bound, np.flatnonzero(~(error <= bound)))

    def others(self, rays: Rays, compared: Compared) -> tuple[int, str]:
        """In how many pixels Mitsuba's values are those of another tree of ours, and that in words;
        0 if they are ours.

        The pixels that tell are those that the other tree changes by more than twice what float32
        may: they have its value, or ours.  A vote, since one that passes an edge may have any.
        """
        ours, theirs, _, bound, outliers = compared
        known, right = self._setup, np.ones(len(ours), bool)
        right[outliers] = False
        for name, changed in (
            ("one reflection fewer", {"max_depth": max(known.max_depth - 1, 0)}),
            ("one reflection more", {"max_depth": known.max_depth + 1}),
            ("rays of any contribution", {"min_contribution": 0.0}),
        ):
            there = query.radiance_without_noise(self._tables, known._replace(**changed), *rays)
            tells = np.abs(there - ours).max(axis=1) > 2.0 * bound
            like = tells & ~right & (np.abs(there - theirs).max(axis=1) <= bound)
            count, rest = int(np.count_nonzero(like)), int(np.count_nonzero(tells & right))
            if count > max(rest, 1):
                return count, (
                    f"Mitsuba's values are those of {name} in {count} pixels, and ours in {rest}, "
                    f"of {int(np.count_nonzero(tells))} pixels which that changes"
                )
        return 0, ""

    def explained(
        self, rays: Rays, compared: Compared
    ) -> tuple[arbiter.BoolArray, arbiter.BoolArray]:
        """(m,): which outliers of the rays the arbiter explains, and which the textures of lamps
        do: their light may be so much more or less where the middle of a lamp lies at the edge of a
        texel, wherever the ray goes."""
        ours, theirs, _, bound, outliers = compared
        if len(outliers) == 0:
            return np.zeros(0, bool), np.zeros(0, bool)
        tables, integrator = self._tables, self._integrator
        some = rays.rows(outliers)
        settled = explained_by_neighbours(
            self._context,
            some,
            ((ours[outliers], self._ours_along), (theirs[outliers], self._theirs_along)),
            bound[outliers],
        )
        off = FACTORS * UNIT_ROUNDOFF * (integrator.max_depth + 1)
        for factor in (1.0 - off, 1.0 + off):  # a ray with just the least contribution
            least = factor * integrator.min_contribution
            other = integrator.model_copy(update={"min_contribution": least}).setup()
            again = query.radiance_without_noise(tables, other, some.o, some.d)
            settled |= np.abs(again - theirs[outliers]).max(axis=1) <= bound[outliers]
        nodes = self._theirs_at.nodes(some)
        hits = query.intersect(tables, *nodes.rays), trace(self._counterpart, *nodes.rays)
        lit = LightContext(self._scene, tables, self._counterpart, nodes.rays, *hits, self._sizes)
        low, high = changes_of_lamps(lit, nodes, len(outliers), self._setup)
        apart, allowed = theirs[outliers] - ours[outliers], bound[outliers][:, None]
        within = ((apart >= low - allowed) & (apart <= high + allowed)).all(axis=1)
        return settled | within, np.asarray(within & (np.abs(apart) > allowed).any(axis=1))

    def _ours_along(
        self, o: FloatArray, d: FloatArray, tables: SceneTables | None = None
    ) -> FloatArray:
        return query.radiance_without_noise(
            self._tables if tables is None else tables, self._setup, o, d
        )

    def _theirs_along(self, o: FloatArray, d: FloatArray) -> FloatArray:
        return np.asarray(self._theirs_at(Rays(self._counterpart.frame.rounded(o), round32(d))))
