"""What is known of a scene while its lights are compared one by one."""

from typing import Any, NamedTuple

from comparisons.mitsuba.counterpart import Twin
from comparisons.rungs.rays.bounds import ShapeSizes
from comparisons.rungs.rays.rays import Rays
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.lights import DIRECTIONAL, POINT, SPOT, Directional, Point, Spot
from reference_rt.rendering.query import Intersections
from reference_rt.rendering.scene import Scene

POINT_LIKE: dict[int, type] = {POINT: Point, SPOT: Spot, DIRECTIONAL: Directional}
"""What Mitsuba's emitters tell of themselves, by kind: these have one direction."""


class Setting(NamedTuple):
    """What all lights of a scene share: the rays, what they hit, the sizes behind the bounds."""

    scene: Scene
    tables: SceneTables
    twin: Twin
    rays: Rays
    hits: Intersections
    sizes: ShapeSizes


def kind_of(setting: Setting, light: int) -> int:
    choice = setting.tables.lights.choice
    return -1 if choice is None else int(choice.kind[light])


def described(setting: Setting, light: int) -> Any:
    """The description of a light that is a point or a direction."""
    return setting.scene.lights[number_of(setting, light)]


def number_of(setting: Setting, light: int) -> int:
    """Its place in the scene's lights: rows of our tables count those of its kind."""
    choice = setting.tables.lights.choice
    row = 0 if choice is None else int(choice.row[light])
    described = POINT_LIKE[kind_of(setting, light)]
    return [i for i, x in enumerate(setting.scene.lights) if isinstance(x, described)][row]
