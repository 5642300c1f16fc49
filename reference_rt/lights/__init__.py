"""All lights: one file each; here, the choice among them.

To add a light: its file with description, table and kernels; a code in `light.py`; below, a field
of `Lights`, `AnyLight`, and one `if` in `sample_one`; a translator function in
`comparisons.translate`; a scene; a row in the tests' tuple.
"""

from typing import Annotated, NamedTuple

import numpy as np
from pydantic import Field

from reference_rt.kernel import kernel
from reference_rt.lights import area, constant, point
from reference_rt.lights.area import Areas
from reference_rt.lights.constant import Constant, Environment
from reference_rt.lights.light import (
    AREA,
    CONSTANT,
    POINT,
    LightSample,
    no_light,
    shadow_ray,
)
from reference_rt.lights.point import Point, Points
from reference_rt.ray import SurfacePoint
from reference_rt.shapes import Shapes
from reference_rt.shapes.shape import FloatArray, IntArray
from reference_rt.vec3 import Vec3

AnyLight = Annotated[Point | Constant, Field(discriminator="type")]


class Choice(NamedTuple):
    """Every light that can be sampled, as one list: kind (n,) and row (n,) of its table, the
    probability (n,) of picking it and the running sum (n,) of these."""

    kind: IntArray
    row: IntArray
    probability: FloatArray
    cumulative: FloatArray


class Lights(NamedTuple):
    """The tables of each kind, None for absent ones; `choice` is None without any light.

    The choice lists all areas, then all points, then the environment: area light i is entry i.
    """

    points: Points | None
    areas: Areas | None
    environment: Environment | None
    choice: Choice | None


@kernel
def pick(choice: Choice, u: float) -> int:
    """The light whose stretch of the running sum holds `u`."""
    return min(int(np.searchsorted(choice.cumulative, u, "right")), len(choice.kind) - 1)


@kernel
def sample_one(
    lights: Lights, k: int, shapes: Shapes, p: Vec3, u0: float, u1: float
) -> LightSample:
    """Light from entry k of the choice at `p`; the pdf does not count the choice."""
    return _sample_one(
        lights.points, lights.areas, lights.environment, lights.choice, k, shapes, p, u0, u1
    )


@kernel
def _sample_one(
    points: Points | None,
    areas: Areas | None,
    environment: Environment | None,
    choice: Choice | None,
    k: int,
    shapes: Shapes,
    p: Vec3,
    u0: float,
    u1: float,
) -> LightSample:
    if choice is None:
        return no_light()
    kind, i = choice.kind[k], choice.row[k]
    if areas is not None:
        if kind == AREA:
            return area.sample(areas, i, shapes, p, u0, u1)
    if points is not None:
        if kind == POINT:
            return point.sample(points, i, p)
    if environment is not None:
        if kind == CONSTANT:
            return constant.sample(environment, u0, u1)
    return no_light()


@kernel
def area_pdf(
    areas: Areas | None, choice: Choice | None, shapes: Shapes, p: Vec3, q: SurfacePoint
) -> float:
    """The density per solid angle, choice included, with which a light sample at `p` finds `q`."""
    if areas is None:
        return 0.0
    if choice is None:
        return 0.0
    if q.light < 0:
        return 0.0
    probability: float = choice.probability[q.light]
    return area.pdf(areas, q.light, shapes, p, q) * probability


@kernel
def environment_pdf(environment: Environment | None, choice: Choice | None) -> float:
    """The same for directions that hit nothing."""
    if environment is None:
        return 0.0
    if choice is None:
        return 0.0
    probability: float = choice.probability[len(choice.kind) - 1]
    return constant.PDF * probability


__all__ = [
    "AREA",
    "CONSTANT",
    "POINT",
    "AnyLight",
    "Areas",
    "Choice",
    "Constant",
    "Environment",
    "LightSample",
    "Lights",
    "Point",
    "Points",
    "area_pdf",
    "environment_pdf",
    "pick",
    "sample_one",
    "shadow_ray",
]
