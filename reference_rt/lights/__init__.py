"""All lights: one file each; here, their names.  What is asked of them is in `dispatch.py`.

To add a light: its file with description, table and kernels; a code in `light.py`; in `dispatch.py`
a field of `Lights` and one `if` in `_sample_one`; below, `AnyLight` and a line in `TABLES`; a
translator function in `comparisons.mitsuba.translate`; a scene; a row in the tests' tuple.
"""

from typing import Annotated, Any

from pydantic import Field

from reference_rt.lights.dispatch import (
    Lights,
    ambient,
    area_pdf,
    asks_normal,
    asks_place,
    background,
    count,
    environment_pdf,
    is_area,
    middle,
    pick,
    pick_probability,
    sample_one,
)
from reference_rt.lights.emitters import directional, point, spot
from reference_rt.lights.emitters.ambient import Ambient
from reference_rt.lights.emitters.area import Areas
from reference_rt.lights.emitters.constant import Constant, Environment
from reference_rt.lights.emitters.directional import Directional
from reference_rt.lights.emitters.environment_map import EnvironmentMap
from reference_rt.lights.emitters.point import Point
from reference_rt.lights.emitters.spot import Spot
from reference_rt.lights.light import (
    AREA,
    DIRECTIONAL,
    ENVIRONMENT,
    POINT,
    SPOT,
    LightSample,
    shadow_ray,
)
from reference_rt.lights.selection.choice import Choice
from reference_rt.lights.selection.tree import Pick

AnyLight = Annotated[
    Point | Spot | Directional | Constant | EnvironmentMap | Ambient, Field(discriminator="type")
]

TABLES: tuple[tuple[int, str, type, Any], ...] = (
    (POINT, "points", Point, point),
    (SPOT, "spots", Spot, spot),
    (DIRECTIONAL, "directionals", Directional, directional),
)
"""(code, field of Lights, description, module) of those that are neither surfaces nor surround the
scene, in the order in which `Lights.choice` lists them."""

__all__ = [
    "AREA",
    "DIRECTIONAL",
    "ENVIRONMENT",
    "POINT",
    "SPOT",
    "TABLES",
    "Ambient",
    "AnyLight",
    "Areas",
    "Choice",
    "Constant",
    "Directional",
    "Environment",
    "EnvironmentMap",
    "LightSample",
    "Lights",
    "Pick",
    "Point",
    "Points",
    "Spot",
    "ambient",
    "area_pdf",
    "asks_normal",
    "asks_place",
    "background",
    "count",
    "environment_pdf",
    "is_area",
    "middle",
    "pick",
    "pick_probability",
    "sample_one",
    "shadow_ray",
]
