"""Images that lights at a point project: a colour for each direction in front of the light."""

import math
from typing import NamedTuple

import numpy as np

from reference_rt.core.arrays import FloatArray
from reference_rt.core.vec3 import Vec3, dot, row
from reference_rt.jit.kernel import kernel
from reference_rt.textures import NO_TEXTURES, At, Colours, Textures, colour_at


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
    at = At(textures, 0.5 + 0.5 * place.x, 0.5 + 0.5 * place.y, none)
    return colour_at(images.colour, i, at)
