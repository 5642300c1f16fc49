"""Spot light: a point that emits into a cone, with a falloff towards its rim."""

import math
from typing import Annotated, ClassVar, Literal, NamedTuple, Self

import numpy as np
from pydantic import Field, model_validator

from reference_rt.core.arrays import FloatArray
from reference_rt.core.model import Colour, Description, Direction, Examples, Vector
from reference_rt.core.vec3 import Vec3, cross, dot, length, luminance, row
from reference_rt.jit.kernel import kernel
from reference_rt.lights.emitters.projector import (
    WHITE,
    ProjectedImages,
    colour_in,
    place_in,
    placed,
)
from reference_rt.lights.light import LightSample, from_position
from reference_rt.lights.selection.bounds import LightBounds, of_points
from reference_rt.textures import NO_TEXTURES, Palette, TextureName, Textures

_PLACE = {"origin": (0.0, 4.0, 0.5), "target": (0.0, 0.0, 0.0)}


class Spot(Description):
    """A point that emits into a cone: full intensity within `beam_width`, none beyond
    `cutoff_angle`, linear in the angle between the two."""

    EXAMPLES: ClassVar[Examples] = (
        {**_PLACE, "intensity": 9.0},
        {**_PLACE, "intensity": (3.0, 2.0, 1.0), "cutoff_angle": 50.0, "beam_width": 10.0},
        {**_PLACE, "intensity": 9.0, "texture": "texture", "up": (0.0, 0.3, 1.0)},
    )
    type: Literal["spot"] = "spot"
    origin: Vector
    """Where it is: [x, y, z] in world coordinates, in scene units."""
    target: Vector
    """A point on the axis of the cone: [x, y, z] in world coordinates, not the origin."""
    intensity: Colour
    """Radiant intensity on the axis: W sr^-1, linear sRGB."""
    cutoff_angle: Annotated[float, Field(gt=0, le=180)] = 20.0
    """Angle in degrees from the axis to the rim of the cone, beyond which it is dark; above 0, at
    most 180."""
    beam_width: Annotated[float, Field(ge=0, le=180)] | None = None
    """Angle in degrees from the axis within which the intensity is full; at most `cutoff_angle`.
    Default: three quarters of it."""
    texture: TextureName | None = None
    """Name of a texture, times which the intensity is: an image over the square around the cone,
    (u, v) from (0, 0) at its lower left corner, seen from the light, to (1, 1)."""
    up: Direction = (0.0, 1.0, 0.0)
    """Up in the image: [x, y, z] in world coordinates, not along the axis."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if not 0.0 < math.dist(self.origin, self.target) < math.inf:
            raise ValueError(
                "origin and target give no direction; expected two different points, "
                f"got {list(self.origin)} and {list(self.target)}"
            )
        if self.beam_width is not None and self.beam_width > self.cutoff_angle:
            raise ValueError(
                f"beam_width {self.beam_width:g} is more than cutoff_angle {self.cutoff_angle:g}; "
                "expected at most that"
            )
        if self.texture is not None:
            if self.cutoff_angle >= 90.0:
                raise ValueError("cutoff_angle is 90 or more; expected less with a texture")
            placed(self.axis, self.up, 1.0, 1.0, WHITE)
        return self

    @property
    def axis(self) -> FloatArray:
        """(3,): the unit direction in which it shines."""
        found = np.subtract(self.target, self.origin) / math.dist(self.target, self.origin)
        return np.asarray(found)

    def _image(self, palette: Palette) -> ProjectedImages:
        """What the intensity is multiplied with: white without a texture."""
        if self.texture is None:
            x, y, z = np.eye(3)[int(np.argmin(np.abs(self.axis)))].tolist()
            return placed(self.axis, (x, y, z), 1.0, 1.0, WHITE)
        slope = math.tan(math.radians(self.cutoff_angle))
        return placed(self.axis, self.up, slope, slope, palette.colours(self.texture, math.inf))

    def tabulate(self, palette: Palette = NO_TEXTURES) -> "Spots":
        beam = 0.75 * self.cutoff_angle if self.beam_width is None else self.beam_width
        most = 1.0 if self.texture is None else palette.brightest(self.texture)
        return Spots(
            position=np.array([self.origin]),
            axis=self.axis[None],
            intensity=np.array([self.intensity]),
            cutoff=np.array([math.radians(self.cutoff_angle)]),
            beam=np.array([math.radians(beam)]),
            brightest=np.array([most]),
            image=self._image(palette),
        )


class Spots(NamedTuple):
    """position (n, 3), unit axis (n, 3), intensity (n, 3) in W sr^-1; the angles from the axis
    where the light ends and where it begins to fall off, cutoff (n,) and beam (n,), radians;
    image (n): a factor on the intensity, at most brightest (n,)."""

    position: FloatArray
    axis: FloatArray
    intensity: FloatArray
    cutoff: FloatArray
    beam: FloatArray
    brightest: FloatArray
    image: ProjectedImages


@kernel
def falloff(spots: Spots, i: int, w: Vec3) -> float:
    """The fraction of the intensity that is emitted along `w`, of any length.

    The angle is computed from its sine and cosine: from the cosine alone it would lose half of its
    digits near the axis.
    """
    axis = row(spots.axis, i)
    angle = math.atan2(length(cross(axis, w)), dot(axis, w))
    if angle <= spots.beam[i]:
        return 1.0
    if angle >= spots.cutoff[i]:
        return 0.0
    return float((spots.cutoff[i] - angle) / (spots.cutoff[i] - spots.beam[i]))


@kernel
def sample(spots: Spots, i: int, textures: Textures | None, p: Vec3) -> LightSample:
    """The one direction to the light: see `from_position`."""
    position = row(spots.position, i)
    w = -(position - p)
    shining = falloff(spots, i, w)
    place = place_in(spots.image, i, row(spots.axis, i), w)
    colour = colour_in(spots.image, i, textures, place)
    return from_position(position, row(spots.intensity, i) * colour, shining, p)


def power(spots: Spots, scene_radius: float) -> FloatArray:
    """Luminance of the power (n,): 2 pi I times the integral of the falloff f sin from 0 to the
    cutoff c, which with the beam's edge b is 1 - (sin c - sin b) / (c - b).

    With the middle m and half the width h of the ring that is 1 - cos m sin h / h, also for h = 0.
    It is computed as 2 sin²(m/2) + cos m (1 - sin h / h), which is above 0 for the thinnest beam.
    """
    middle = 0.5 * (spots.cutoff + spots.beam)
    half_width = 0.5 * (spots.cutoff - spots.beam)
    integral = 2.0 * np.sin(0.5 * middle) ** 2
    integral += np.cos(middle) * (1.0 - np.sinc(half_width / math.pi))
    intensity = luminance(Vec3(*spots.intensity.T)) * spots.brightest
    return np.asarray(2.0 * math.pi * integral * intensity)


def bounds(spots: Spots) -> LightBounds:
    intensity = np.asarray(luminance(Vec3(*spots.intensity.T)) * spots.brightest)
    return of_points(spots.position, spots.axis, spots.cutoff, intensity)
