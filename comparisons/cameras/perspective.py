"""Perspective cameras and real pinholes: Mitsuba's `perspective`."""

from comparisons.cameras.camera import CameraType, Data, Edges, placed, read_place, read_planes
from comparisons.cameras.central import (
    angle_of,
    centred,
    edges_of,
    is_square,
    principal_point,
    read_angle,
    spanning,
    view_rectangle,
)
from comparisons.cameras.film import Frame
from comparisons.mitsuba.context import TranslationContext
from comparisons.mitsuba.node import Node, Reading
from reference_rt.cameras import Perspective, Pinhole
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
    lens=None,
    is_parallel=False,
    is_upside_down=False,
    scaled=lambda camera, scale: {},
)


def _half(camera: Pinhole) -> float:
    return camera.film_width / camera.film_distance / 2.0


def _pinhole_to_mitsuba(camera: Pinhole, film: Film, context: TranslationContext) -> Data:
    """A perspective camera, upside down."""
    upside_down = placed(camera, context, right=-1.0, up=-1.0)
    return {"type": "perspective", **spanning(_half(camera)), **upside_down}


def _pinhole_edges(camera: Pinhole, film: Film) -> Edges:
    return centred(_half(camera), film)


PINHOLE = CameraType(
    description=Pinhole,
    to_mitsuba=_pinhole_to_mitsuba,
    from_mitsuba={},
    edges=_pinhole_edges,
    lens=None,
    is_parallel=False,
    is_upside_down=True,
    scaled=lambda camera, scale: {},
)
