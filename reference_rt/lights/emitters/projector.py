"""Projector: a point that throws an image, evenly bright on planes across its axis; and the images
that lights at a point project: a colour for each direction in front of the light.
"""

import math
from typing import Annotated, ClassVar, Literal, NamedTuple, Self

import numpy as np
from pydantic import Field, model_validator

from reference_rt.core.arrays import FloatArray
from reference_rt.core.model import Description, Direction, Examples, Positive, Vector
from reference_rt.core.vec3 import Vec3, dot, length, row
from reference_rt.jit.kernel import kernel
from reference_rt.lights.light import LightSample, from_position
from reference_rt.lights.selection.bounds import LightBounds, of_points
from reference_rt.textures import (
    NO_TEXTURES,
    NOWHERE,
    At,
    ColourParameter,
    Colours,
    Palette,
    Textures,
    colour_at,
)


class ProjectedImages(NamedTuple):
    """For n lights: unit vectors right (n, 3) and up (n, 3), seen from the light; the tangents of
    half the angles across the image, wide (n,) and tall (n,); and its colour (n), with (u, v) =
    (0, 0) at the lower left corner and (1, 1) at the upper right one."""

    right: FloatArray
    up: FloatArray
    wide: FloatArray
    tall: FloatArray
    colour: Colours


def placed(
    axis: FloatArray, up: tuple[float, float, float], wide: float, tall: float, colour: Colours
) -> ProjectedImages:
    """One row.  axis: unit direction of the light;  up: any direction that is not along it.  Raises
    ValueError."""
    right = np.cross(axis, np.array(up) / max(map(abs, up)))
    length = float(np.linalg.norm(right))
    if not length > 0.0:
        raise ValueError("up is parallel to the light's axis; expected another direction")
    right = right / length
    return ProjectedImages(
        right[None], np.cross(right, axis)[None], np.array([wide]), np.array([tall]), colour
    )


WHITE = NO_TEXTURES.colours((1.0, 1.0, 1.0))
"""No image."""


class ImagePoint(NamedTuple):
    """A direction's place in an image: x and y from -1 to 1 inside of it, and its distance along
    the axis, above 0 if it is in front of the light; if not, x and y are infinite."""

    x: float
    y: float
    z: float


@kernel
def place_in(images: ProjectedImages, i: int, axis: Vec3, w: Vec3) -> ImagePoint:
    """The place of the direction `w`, of any length, from light i with this axis."""
    z = dot(axis, w)
    if not z > 0.0:
        return ImagePoint(math.inf, math.inf, z)
    x = dot(row(images.right, i), w) / (z * images.wide[i])
    y = dot(row(images.up, i), w) / (z * images.tall[i])
    return ImagePoint(x, y, z)


@kernel
def colour_in(
    images: ProjectedImages, i: int, textures: Textures | None, place: ImagePoint
) -> Vec3:
    """The colour at a place of image i; white if the place is not in front of the light."""
    if not place.z > 0.0:
        return Vec3(1.0, 1.0, 1.0)
    none = Vec3(-1.0, -1.0, -1.0)
    at = At(textures, 0.5 + 0.5 * place.x, 0.5 + 0.5 * place.y, none, NOWHERE)
    return colour_at(images.colour, i, at)


_PLACE = {"origin": (0.0, 4.0, 0.5), "target": (0.0, 0.0, 0.0)}


class Projector(Description):
    """A point at `origin` that projects an image towards `target`, as a slide projector: the
    reverse of a perspective camera.  A white image lights a plane across the axis evenly."""

    EXAMPLES: ClassVar[Examples] = (
        {**_PLACE, "irradiance": (3.0, 2.0, 1.0)},
        {**_PLACE, "irradiance": "texture", "scale": 5.0, "fov": 70.0, "aspect": 2.0},
    )
    type: Literal["projector"] = "projector"
    origin: Vector
    """Where it is: [x, y, z] in world coordinates, in scene units."""
    target: Vector
    """A point on the axis: [x, y, z] in world coordinates, not the origin."""
    up: Direction = (0.0, 1.0, 0.0)
    """Up in the image: [x, y, z] in world coordinates, not along the axis."""
    irradiance: ColourParameter
    """Irradiance of a plane across the axis at distance 1: W m^-2, linear sRGB, or a texture.  Its
    (u, v) is (0, 0) at the lower left corner of the image, seen from the light, and (1, 1) at the
    opposite one."""
    scale: Positive = 1.0
    """A factor of the irradiance."""
    fov: Annotated[float, Field(gt=0, lt=180)] = 45.0
    """Angle in degrees across the image's width, above 0 and below 180."""
    aspect: Positive = 1.0
    """The image's width over its height."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if not 0.0 < math.dist(self.origin, self.target) < math.inf:
            raise ValueError("origin and target give no direction; expected two different points")
        placed(self.axis, self.up, 1.0, 1.0, WHITE)
        return self

    @property
    def axis(self) -> FloatArray:
        """(3,): the unit direction in which it shines."""
        found = np.subtract(self.target, self.origin) / math.dist(self.target, self.origin)
        return np.asarray(found)

    def tabulate(self, palette: Palette = NO_TEXTURES) -> "Projectors":
        wide = math.tan(math.radians(self.fov) / 2.0)
        irradiance = palette.colours(self.irradiance, math.inf)
        return Projectors(
            position=np.array([self.origin]),
            axis=self.axis[None],
            scale=np.array([self.scale]),
            brightest=np.array([self.scale * palette.brightest(self.irradiance)]),
            image=placed(self.axis, self.up, wide, wide / self.aspect, irradiance),
        )


class Projectors(NamedTuple):
    """position (n, 3), unit axis (n, 3);  scale (n,): a factor on image (n), the irradiance at
    distance 1;  brightest (n,): its largest luminance."""

    position: FloatArray
    axis: FloatArray
    scale: FloatArray
    brightest: FloatArray
    image: ProjectedImages


@kernel
def sample(projectors: Projectors, i: int, textures: Textures | None, p: Vec3) -> LightSample:
    """The one direction to the light: see `from_position`.  With E the irradiance at distance 1,
    the intensity at the angle a from the axis is E / cos³ a: a plane across the axis at z gets
    E / z² everywhere."""
    position = row(projectors.position, i)
    w = p - position
    place = place_in(projectors.image, i, row(projectors.axis, i), w)
    if not max(abs(place.x), abs(place.y)) <= 1.0:
        return from_position(position, Vec3(0.0, 0.0, 0.0), 0.0, p)
    secant = length(w) / place.z
    colour = colour_in(projectors.image, i, textures, place)
    brightness = projectors.scale[i] * (secant * secant * secant)
    return from_position(position, colour * brightness, 1.0, p)


def power(projectors: Projectors, scene_radius: float) -> FloatArray:
    """Luminance of the power (n,), for the image's largest value everywhere: E times the area of
    the image at distance 1."""
    area = 4.0 * projectors.image.wide * projectors.image.tall
    return np.asarray(area * projectors.brightest)


def intensity(projectors: Projectors) -> FloatArray:
    """(n,): the largest luminance of the radiant intensity, towards the image's corners."""
    wide, tall = projectors.image.wide, projectors.image.tall
    return np.asarray(projectors.brightest * (1.0 + wide * wide + tall * tall) ** 1.5)


def reach(projectors: Projectors) -> FloatArray:
    """(n,): the angle from the axis to the image's corners, in radians."""
    return np.asarray(np.arctan(np.hypot(projectors.image.wide, projectors.image.tall)))


def bounds(projectors: Projectors) -> LightBounds:
    found = projectors
    return of_points(found.position, found.axis, reach(found), intensity(found))
