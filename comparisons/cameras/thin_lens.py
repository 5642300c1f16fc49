"""Cameras with a lens: Mitsuba's `thinlens`, or our `view_rectangle` for views that it lacks."""

import math

from comparisons.cameras.camera import CameraType, Data, Lens, placed, read_place, read_planes
from comparisons.cameras.central import (
    UNIT_ROUNDOFF,
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
from reference_rt.cameras import Perspective, Pinhole, ThinLens
from reference_rt.cameras.film import Film


def _lens(camera: ThinLens) -> Lens:
    """In focus is the plane of the target by default."""
    focus = camera.focus_distance
    return Lens(
        camera.aperture_radius, math.dist(camera.eye, camera.target) if focus is None else focus
    )


def _to_mitsuba(camera: ThinLens, film: Film, context: TranslationContext) -> Data:
    off_axis = max(map(abs, principal_point(camera))) > UNIT_ROUNDOFF
    if camera.view is not None and (off_axis or not is_square(camera, film)):
        found = view_rectangle(camera, film, context)
    else:
        found = {"type": "thinlens", **angle_of(camera, film), **placed(camera, context)}
    lens = _lens(camera)
    return {**found, "aperture_radius": lens.radius, "focus_distance": lens.focus}


def _from_mitsuba(reading: Reading, node: Node, frame: Frame) -> Perspective | ThinLens:
    place, _ = read_place(reading, node)
    planes, far = read_planes(node)
    place |= planes
    values, half = read_angle(node, frame)
    if frame.is_cropped:
        values = {"view": frame.window(half)}
    if not node.has("aperture_radius"):
        raise node.error("has no 'aperture_radius'; expected one")
    return _with_lens(place | values, *_read_lens(node, far))


def _read_view_rectangle(
    reading: Reading, node: Node, frame: Frame
) -> Perspective | ThinLens | Pinhole:
    """Of our plugin, in files that we have written."""
    place, _ = read_place(reading, node)
    place |= read_planes(node)[0]
    view = tuple(node.number(name, 0.0) for name in ("left", "right", "bottom", "top"))
    radius, focus = _read_lens(node, 1.0)
    exposure = node.number("exposure", 0.0)
    if focus > 0.0:
        return _with_lens(place | {"view": view}, radius, focus)
    return Pinhole(
        **place | {"up": [-x for x in place["up"]]},
        film_width=(view[1] - view[0]) * -focus,
        film_distance=-focus,
        hole_radius=radius,
        exposure=exposure or None,
    )


def _read_lens(node: Node, focus: float) -> tuple[float, float]:
    """Radius and focus distance;  focus: the default of the plugin."""
    return node.number("aperture_radius", 0.0), node.number("focus_distance", focus)


def _with_lens(values: Data, radius: float, focus: float) -> Perspective | ThinLens:
    if radius == 0.0:  # Mitsuba takes a tiny one
        return Perspective(**values)
    return ThinLens(**values, aperture_radius=radius, focus_distance=focus)


def _scaled(camera: ThinLens, scale: float) -> Data:
    lens = _lens(camera)
    return {"aperture_radius": scale * lens.radius, "focus_distance": scale * lens.focus}


THIN_LENS = CameraType(
    description=ThinLens,
    to_mitsuba=_to_mitsuba,
    from_mitsuba={"thinlens": _from_mitsuba, "view_rectangle": _read_view_rectangle},
    edges=edges_of,
    lens=_lens,
    is_parallel=False,
    is_upside_down=False,
    scaled=_scaled,
)
