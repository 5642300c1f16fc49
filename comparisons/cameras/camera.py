"""What the comparison knows of a type of cameras: `CameraType`, one per type, in the type's file;
and where cameras stand, in both directions.

Mitsuba's cameras look along local +z, with +y up and +x to the left."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from comparisons.cameras.film import Frame
from comparisons.geometry.affine import Affine
from comparisons.mitsuba.context import TranslationContext
from comparisons.mitsuba.node import Node, Reading
from comparisons.mitsuba.parse import LookAt, Step
from reference_rt.cameras import AnyCamera
from reference_rt.cameras.camera import Camera
from reference_rt.cameras.film import Film

C = TypeVar("C", bound=Camera)

Data = dict[str, Any]

Edges = tuple[float, float, float, float]
"""Left, right, bottom and top."""


class Lens(NamedTuple):
    """radius: of its aperture;  focus: the distance of the plane in focus, below 0 for a hole,
    whose rays part from the film behind it;  exposure: None where pixels are the mean radiance
    through it, else they are so many times the irradiance of the film."""

    radius: float
    focus: float
    exposure: float | None = None


@dataclass(frozen=True, kw_only=True)
class CameraType(Generic[C]):
    """A type of cameras.  A test holds that `CAMERAS` has a row for each member of `AnyCamera`."""

    description: type[C]
    to_mitsuba: Callable[[C, Film, TranslationContext], Data]
    """The dictionary of a sensor, without film and sampler."""
    from_mitsuba: Mapping[str, Callable[[Reading, Node, Frame], AnyCamera]]
    """By Mitsuba's plugin: the camera of an element.  Raises SceneError."""
    edges: Callable[[C, Film], Edges]
    """Of what it sees: at distance 1 before the eye, or through the eye if its rays are parallel.
    From the description's fields, not by our cameras' code."""
    lens: Callable[[C], Lens | None]
    """Of its fields; None without."""
    is_parallel: bool
    is_upside_down: bool
    scaled: Callable[[C, float], Data]
    """Its lengths in a scene that is so many times as large, except those of which only the ratio
    matters: fields."""


def no_lens(camera: Camera) -> None:
    """`CameraType.lens` of a type that has none."""


NEAR, FAR = 1e-10, 1e10
"""Clipping planes where ours has none.  These equal 0 and infinity for scenes from 1e-3
to 1e8 across, and directions are as exact as with Mitsuba's defaults 1e-2 and 1e4 (measured: 1.5e-7
at 45 degrees for both)."""


def placed(
    camera: Camera,
    context: TranslationContext,
    right: float = 1.0,
    up: float = 1.0,
    middle: tuple[float, float] = (0.0, 0.0),
) -> Data:
    """to_world, with left and up scaled, and the eye moved by `middle` to the right and up; and the
    clipping planes."""
    steps: tuple[Step | LookAt, ...] = (LookAt(camera.eye, camera.target, camera.up),)
    if any(middle):
        steps = Step("translate", (-middle[0], middle[1], 0.0)), *steps
    if (right, up) != (1.0, 1.0):
        steps = Step("scale", (right, up, 1.0)), *steps
    return {
        "to_world": context.to_world(*steps, double=True),
        "near_clip": camera.near or NEAR,
        "far_clip": camera.far or FAR,
    }


# ---- reading -------------------------------------------------------------------------------------


TOLERANCE = 1e-5
"""Of a rotation."""

NO_NEAR, NO_FAR = 1e-9, 1e9
"""Clipping planes that cut nothing."""

CLIP = {"near_clip": 1e-2, "far_clip": 1e4}
"""Mitsuba's defaults."""

MIRROR = np.diag([-1.0, 1.0, 1.0])
"""x becomes -x: the map of the whole scene for a sensor that mirrors the picture.

Our cameras do not.  The picture of a scene by a camera M (a map from its own coordinates to the
world's) is that of the mirrored scene by the camera W M, for any mirroring map W; and W M mirrors
no more.  Our shapes stay what they are under a map that mirrors: their front stays the front, and
their uv stay."""


def read_place(reading: Reading, node: Node, rigid: bool = True) -> tuple[Data, Affine]:
    """eye, target and up, and to_world.  rigid: refuse scales, as Mitsuba does."""
    m = node.transform()
    linear = m[:, :3]
    lengths = np.linalg.norm(linear, axis=0)
    if not lengths.min() > 0.0:
        raise node.error("'to_world' flattens space; expected one that can be undone")
    if rigid and np.abs(lengths - 1.0).max() > 1e-3:
        raise node.error("'to_world' scales, which Mitsuba refuses, too; expected none")
    unit = linear / lengths
    if np.abs(unit.T @ unit - np.eye(3)).max() > TOLERANCE:
        raise node.error("'to_world' shears; expected a rotation and a translation")
    look, scale = node.looks()
    if np.linalg.det(unit) < 0.0:
        reading.mirrored_for = node
        m, unit = MIRROR @ m, MIRROR @ unit
    elif look is not None and min(scale) > 0.0:
        return {"eye": look.origin, "target": look.target, "up": look.up}, m
    eye = m[:, 3]
    # A target far away in units of the eye's coordinates: the direction must not be lost.
    distance = max(1.0, float(np.abs(eye).max()))
    return {"eye": eye, "target": eye + distance * unit[:, 2], "up": unit[:, 1]}, m


def read_planes(node: Node) -> tuple[dict[str, float], float]:
    """near and far, without those that cut nothing; and Mitsuba's far plane."""
    near, far = (node.number(key, default) for key, default in CLIP.items())
    if not 0.0 < near < far:
        raise node.error(
            f"near_clip is {near:g} and far_clip {far:g}; expected near_clip above 0 and below "
            "far_clip"
        )
    found = {"near": near} if near > NO_NEAR else {}
    return found | ({"far": far} if far < NO_FAR else {}), far
