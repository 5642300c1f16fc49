"""Lights: where light comes from, and which light a shadow ray is sent to.

- `emitters/`: the types of lights, one file each;
- `selection/`: the light sampler, by power or by a light tree;
- `tables.py`: the tables of all types;
- `dispatch.py`: the kernels that integrators call, for any light of a scene.

Contract: all positions and directions are in the world; units are W sr^-1 m^-2 for radiance, scene
units for distances; colours are linear sRGB.  Lights that can be sampled are numbered 0, 1, ...

- `pick(lights, p, n, u)` returns a light's number and the probability of picking it;
- `sample_one(lights, k, shapes, textures, p, u0, u1) -> LightSample` returns a direction from `p`
  to light k and the radiance from there, without testing visibility; its pdf does not include the
  probability of picking k; pdf = 0 means that nothing arrives;
- `area_pdf` and `environment_pdf` return the density with which these two find a point that was
  hit, or a direction in which nothing is hit: per solid angle, picking included;
- `background` returns the radiance of a ray that hits nothing.

Shapes whose material is `emissive` are lights too (`emitters/area.py`).

To add a light: a file in `emitters/`; a code in `light.py`; in `tables.py` a field of `Lights`
and a line in `TABLES`; below, a member of `AnyLight` and a line in `TABLES`; a translator in
`comparisons.translator`; a scene; a row in the tests' tuple.  Step by step:
docs/extending.md.
"""

from typing import Annotated, Any

from pydantic import Field

from reference_rt.lights.dispatch import (
    ambient,
    area_pdf,
    background,
    background_of,
    count,
    emitted,
    environment_pdf,
    is_area,
    pick,
    pick_probability,
    sample_fixed,
    sample_one,
    sample_picked,
)
from reference_rt.lights.emitters import directional, point, projector, spot
from reference_rt.lights.emitters.area import Areas
from reference_rt.lights.emitters.constant import Ambient, Constant, Environment
from reference_rt.lights.emitters.directional import Directional
from reference_rt.lights.emitters.environment_map import Ahead, EnvironmentMap, EnvironmentMaps
from reference_rt.lights.emitters.point import Point
from reference_rt.lights.emitters.projector import Projector
from reference_rt.lights.emitters.spot import Spot
from reference_rt.lights.light import (
    AREA,
    DIRECTIONAL,
    ENVIRONMENT,
    POINT,
    PROJECTOR,
    SPOT,
    LightSample,
    shadow_ray,
)
from reference_rt.lights.selection.choice import LightSampler, Pick
from reference_rt.lights.tables import (
    Lights,
    LinkedLights,
    depends_on_normal,
    depends_on_point,
    map_of,
    sky_floats,
)

AnyLight = Annotated[
    Point | Spot | Projector | Directional | Constant | EnvironmentMap | Ambient,
    Field(discriminator="type"),
]

TABLES: tuple[tuple[int, str, type, Any], ...] = (
    (POINT, "points", Point, point),
    (SPOT, "spots", Spot, spot),
    (PROJECTOR, "projectors", Projector, projector),
    (DIRECTIONAL, "directionals", Directional, directional),
)
"""(code, field of Lights, description, module) of those that are neither surfaces nor surround the
scene, in the order in which `Lights.choice` lists them."""

__all__ = [
    "AREA",
    "DIRECTIONAL",
    "ENVIRONMENT",
    "POINT",
    "PROJECTOR",
    "SPOT",
    "TABLES",
    "Ahead",
    "Ambient",
    "AnyLight",
    "Areas",
    "Constant",
    "Directional",
    "Environment",
    "EnvironmentMap",
    "EnvironmentMaps",
    "LightSample",
    "LightSampler",
    "Lights",
    "LinkedLights",
    "Pick",
    "Point",
    "Projector",
    "Spot",
    "ambient",
    "area_pdf",
    "background",
    "background_of",
    "count",
    "depends_on_normal",
    "depends_on_point",
    "emitted",
    "environment_pdf",
    "is_area",
    "map_of",
    "pick",
    "pick_probability",
    "sample_fixed",
    "sample_one",
    "sample_picked",
    "shadow_ray",
    "sky_floats",
]
