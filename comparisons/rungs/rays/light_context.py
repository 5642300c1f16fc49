"""The data that the comparisons of a scene's lights share."""

from typing import Any, NamedTuple

from comparisons.lights import BY_TYPE
from comparisons.lights.light import LightType
from comparisons.mitsuba.counterpart import Counterpart
from comparisons.mitsuba.hits import MitsubaHits, rows_of
from comparisons.referee.sizes import ShapeSizes
from comparisons.rungs.rays.rays import Rays
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.lights import ENVIRONMENT, TABLES
from reference_rt.rendering.query import Intersections
from reference_rt.rendering.scene import Scene

POINT_LIKE: dict[int, LightType[Any]] = {code: BY_TYPE[of] for code, _, of, _ in TABLES}
"""The lights without extent, by kind: from a point each has one direction, which Mitsuba's emitter
itself gives."""

DISTANT = {ENVIRONMENT, *(kind for kind, of in POINT_LIKE.items() if of.along is not None)}
"""Kinds of lights whose `target` is a direction, not a point."""


class LightContext(NamedTuple):
    """The scene in both renderers, n rays, their hits in both, and the lengths behind the
    bounds."""

    scene: Scene
    tables: SceneTables
    counterpart: Counterpart
    rays: Rays
    hits: Intersections
    theirs: MitsubaHits
    sizes: ShapeSizes

    def of(self, rows: IntArray) -> "LightContext":
        """Of some of the rays."""
        return self._replace(
            rays=self.rays.rows(rows),
            hits=rows_of(self.hits, rows),
            theirs=rows_of(self.theirs, rows),
        )

    def off_by(self, error: str) -> FloatArray:
        """(n,): an error of the meshes that stand in for the shapes that are hit; 0 for others."""
        return self.counterpart.off_by(self.hits.shape, error)


def kind_of(context: LightContext, light: int) -> int:
    choice = context.tables.lights.choice
    return -1 if choice is None else int(choice.kind[light])


def described(context: LightContext, light: int) -> Any:
    """The description of a light without extent (POINT_LIKE)."""
    return context.scene.lights[number_of(context, light)]


def number_of(context: LightContext, light: int) -> int:
    """Its index in the scene's lights: rows of our tables count those of its kind."""
    choice = context.tables.lights.choice
    row = 0 if choice is None else int(choice.row[light])
    of = POINT_LIKE[kind_of(context, light)].description
    return [i for i, x in enumerate(context.scene.lights) if isinstance(x, of)][row]
