"""What all cameras share: position and orientation."""

import math
from typing import Annotated, Any, NamedTuple, Self

from pydantic import Field, model_validator

from reference_rt.core import transform
from reference_rt.core.arrays import FloatArray
from reference_rt.core.model import Description, Direction, Positive, Vector
from reference_rt.core.ray import Ray
from reference_rt.core.vec3 import Vec3, cross, dot, length
from reference_rt.jit.kernel import kernel

LENS_CENTRE = (0.5, 0.5)
"""The lens sample of the centre of any lens."""


class Camera(Description):
    """A camera at `eye` that looks at `target`; `up` is up in the picture."""

    eye: Vector = (0.0, 0.0, 1.0)
    """Where the camera stands: [x, y, z] in world coordinates, in scene units."""
    target: Vector = (0.0, 0.0, 0.0)
    """The point that the camera looks at: [x, y, z] in world coordinates, not the eye."""
    up: Direction = (0.0, 1.0, 0.0)
    """The direction that points up in the picture: world coordinates, of any length, not parallel
    to the line of view."""
    near: Annotated[float, Field(ge=0)] = 0.0
    """The near clipping plane: its distance from the eye along the direction of view, in scene
    units.  Nothing in front of it is seen, and distances in the picture count from it."""
    far: Positive | None = None
    """The far clipping plane: nothing behind it is seen but the environment.  Default: none."""
    medium: str | None = None
    """Name of the medium in which the camera's rays begin.  Default: none."""

    @model_validator(mode="after")
    def _check_orientation(self) -> Self:
        transform.look_at(self.eye, self.target, self.up)
        return self

    @model_validator(mode="after")
    def _check_planes(self) -> Self:
        if self.far is not None and not self.near < self.far:
            raise ValueError(
                f"'far' is {self.far:g} and 'near' {self.near:g}; expected 'near' before 'far'"
            )
        return self

    @property
    def basis(self) -> FloatArray:
        """(3, 3), orthonormal: the textbook's u, v, w as rows: right, up and backward."""
        return transform.look_at(self.eye, self.target, self.up)[:, :3].T

    @property
    def clip(self) -> "Clip":
        """The clipping planes."""
        return Clip(self.near, (math.inf if self.far is None else self.far) - self.near)

    def setup(self, width: int, height: int) -> Any:
        """The NamedTuple that `camera_ray` takes, for a picture of width x height pixels."""
        raise NotImplementedError


class Clip(NamedTuple):
    """near: the distance of the near clipping plane from the eye along the direction of view;
    depth: that from the near to the far one, infinite without one."""

    near: float
    depth: float


@kernel
def clipped_ray(clip: Clip, o: Vec3, s: Vec3) -> Ray:
    """The ray from the near to the far clipping plane, along the line from `o`, at the eye's depth,
    to o + s, at distance 1 along the direction of view."""
    size = length(s)
    return Ray(o + s * clip.near, s * (1.0 / size), clip.depth * size)


class Seen(NamedTuple):
    """A point as a camera sees it.

    x, y: its film point, as in `camera_ray`, also outside of the picture;  weight: the film's area
    there, the picture's being 1, over that across the ray at the point: a small surface whose
    normal has the cosine c to the ray covers weight c times its area; times what a film with an
    exposure shows of radiance; 0 for what no ray reaches;
    o: the origin of its camera ray;  d: the ray's unit direction.
    """

    x: float
    y: float
    weight: float
    o: Vec3
    d: Vec3


@kernel
def seen_through(
    clip: Clip, o: Vec3, corner: Vec3, right: Vec3, down: Vec3, shift: Vec3, p: Vec3
) -> Seen:
    """The point `p` seen from `o`, the eye or a point of the lens: the inverse of `clipped_ray`.

    corner, right, down: the picture at distance 1 from the eye;  shift: what a lens adds to the
    film point's vector.  With A the picture's area at distance 1, r the point's distance and z that
    along the axis, the film's area per solid angle is 1 / (A cos^3), and r^2 is the area across the
    ray per solid angle: their quotient is r / (A z^3).
    """
    w = p - o
    across = cross(right, down)
    area = length(across)
    z = dot(w, across) / area
    if not clip.near < z < clip.near + clip.depth:
        return Seen(0.0, 0.0, 0.0, o, w)
    s = w * (1.0 / z)
    on_film, r = s + shift - corner, length(w)
    x, y = dot(on_film, right) / dot(right, right), dot(on_film, down) / dot(down, down)
    return Seen(x, y, r / (area * z) / (z * z), o + s * clip.near, w * (1.0 / r))
