"""Cameras: Mitsuba's look along local +z, with local +x to the *left* of the picture."""

from functools import singledispatch
from typing import Any

import numpy as np

from comparisons.mitsuba_backend import mitsuba
from comparisons.translate.errors import UntranslatableError
from reference_rt import transform
from reference_rt.cameras import Orthographic, Perspective
from reference_rt.cameras.camera import Camera

NEAR, FAR = 1e-10, 1e10
"""Mitsuba's rays begin at the near plane and end at the far one, ours do neither.  These are as
good as 0 and infinity for scenes from 1e-3 to 1e8 across, and the directions that come out are as
exact as with Mitsuba's own 1e-2 and 1e4 (measured: 1.5e-7 at 45 degrees for both)."""


@singledispatch
def translate_camera(camera: Any) -> dict[str, Any]:
    """A sensor's dict, without film and sampler.  Raises UntranslatableError."""
    raise UntranslatableError(camera, "camera")


@translate_camera.register
def _(camera: Perspective) -> dict[str, Any]:
    return {
        "type": "perspective",
        "fov": camera.fov,
        "fov_axis": camera.fov_axis,
        "to_world": _to_world(camera, 1.0),
        "near_clip": NEAR,
        "far_clip": FAR,
    }


@translate_camera.register
def _(camera: Orthographic) -> dict[str, Any]:
    return {
        "type": "orthographic",
        # Mitsuba's picture is 2 wide in the sensor's coordinates.
        "to_world": _to_world(camera, camera.width / 2.0),
        "near_clip": NEAR,
        "far_clip": FAR,
    }


def _to_world(camera: Camera, half_width: float) -> Any:
    """Columns: left, up, forward, eye; left and up as long as half the picture is wide."""
    u, v, w, eye = transform.look_at(camera.eye, camera.target, camera.up).T
    matrix = np.eye(4)
    matrix[:3] = np.column_stack([-half_width * u, half_width * v, -w, eye])
    return mitsuba().ScalarTransform4f(matrix)
