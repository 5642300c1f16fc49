"""Perspective cameras: Mitsuba's `perspective`."""

from comparisons.cameras.camera import CameraType, Data, no_lens, placed, read_place, read_planes
from comparisons.cameras.central import (
    angle_of,
    edges_of,
    is_square,
    principal_point,
    read_angle,
    view_rectangle,
)
from comparisons.cameras.film import Frame
from comparisons.mitsuba.context import TranslationContext
from comparisons.mitsuba.node import Node, Reading
from reference_rt.cameras import Perspective
from reference_rt.cameras.film import Film


def _to_mitsuba(camera: Perspective, film: Film, context: TranslationContext) -> Data:
    if camera.view is not None and not is_square(camera, film):
        return view_rectangle(camera, film, context)
    found: Data = {"type": "perspective", **angle_of(camera, film)}
    if camera.view is not None or context.files is None:
        x, y = principal_point(camera)
        found |= {"principal_point_offset_x": x, "principal_point_offset_y": y}
    return {**found, **placed(camera, context)}


def _from_mitsuba(reading: Reading, node: Node, frame: Frame) -> Perspective:
    place, _ = read_place(reading, node)
    place |= read_planes(node)[0]
    node.ignore("focus_distance")  # Mitsuba reads it for every projective camera
    values, half = read_angle(node, frame)
    x, y = (node.number(f"principal_point_offset_{axis}", 0.0) for axis in "xy")
    if frame.is_cropped or x or y:
        values = {"view": frame.window(half, (x, y))}
    return Perspective(**place, **values)


PERSPECTIVE = CameraType(
    description=Perspective,
    to_mitsuba=_to_mitsuba,
    from_mitsuba={"perspective": _from_mitsuba},
    edges=edges_of,
    lens=no_lens,
    is_parallel=False,
    is_upside_down=False,
    scaled=lambda camera, scale: {},
)
