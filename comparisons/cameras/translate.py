"""Cameras, film, filters and samplers -> Mitsuba, whose cameras look along local +z, with local +x
to the *left*."""

import math
from functools import singledispatch
from typing import Any

from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.context import UntranslatableError
from reference_rt.cameras import Orthographic, Perspective, Pinhole, ThinLens
from reference_rt.cameras.camera import Camera
from reference_rt.cameras.film import (
    BoxFilter,
    CatmullRomFilter,
    Film,
    GaussianFilter,
    LanczosFilter,
    MitchellFilter,
    TentFilter,
)
from reference_rt.cameras.view_rectangle import CentralCamera
from reference_rt.sampling import Grid, Independent, Sobol

# ---- film, filters, samplers ---------------------------------------------------------------------


def translate_film(film: Film) -> dict[str, Any]:
    """A film's dict: float32 pixels, no half floats anywhere."""
    return {
        "type": "hdrfilm",
        "width": film.width,
        "height": film.height,
        "pixel_format": "rgb",
        "component_format": "float32",
        "rfilter": translate_filter(film.filter),
        # Our pixels sample the whole filter, also beyond the picture's edge; without a border
        # Mitsuba's edge pixels would lack the samples outside.
        "sample_border": not isinstance(film.filter, BoxFilter),
    }


def translate_filter(film_filter: Any) -> dict[str, Any]:
    """A reconstruction filter's dict.  Raises UntranslatableError."""
    match film_filter:
        case BoxFilter():
            return {"type": "box"}
        case TentFilter(radius=radius):
            return {"type": "tent", "radius": radius}
        case GaussianFilter(stddev=stddev):
            return {"type": "gaussian", "stddev": stddev}
        case MitchellFilter(b=b, c=c):
            return {"type": "mitchell", "B": b, "C": c}
        case CatmullRomFilter():
            return {"type": "catmullrom"}
        case LanczosFilter(lobes=lobes):
            return {"type": "lanczos", "lobes": lobes}
    raise UntranslatableError(film_filter, "filter")


def translate_sampler(sampler: Any) -> dict[str, Any]:
    """A sampler's dict.  Raises UntranslatableError."""
    match sampler:
        case Sobol(spp=spp) | Independent(spp=spp):
            return {"type": "independent", "sample_count": spp}
        case Grid(spp=spp):
            return {"type": "stratified", "jitter": False, "sample_count": spp}
    raise UntranslatableError(sampler, "sampler")


# ---- cameras -------------------------------------------------------------------------------------


NEAR, FAR = 1e-10, 1e10
"""Clipping planes where ours has none.  These equal 0 and infinity for scenes from 1e-3
to 1e8 across, and directions are as exact as with Mitsuba's defaults 1e-2 and 1e4 (measured: 1.5e-7
at 45 degrees for both)."""

UNIT_ROUNDOFF = 2.0**-24
"""u of float32: the tolerance for square pixels and for a centred axis."""


def clipping(camera: Camera) -> dict[str, float]:
    """The clipping planes of a camera."""
    return {"near_clip": camera.near or NEAR, "far_clip": camera.far or FAR}


@singledispatch
def translate_camera(camera: Any, film: Film) -> dict[str, Any]:
    """A sensor's dict, without film and sampler.  Raises UntranslatableError."""
    raise UntranslatableError(camera, "camera")


@translate_camera.register
def _(camera: Perspective, film: Film) -> dict[str, Any]:
    if camera.view is not None and not _is_square(camera, film):
        return _rectangle(camera, film)
    offset_x, offset_y = _principal_point(camera)
    return {
        "type": "perspective",
        **_angle(camera, film),
        "principal_point_offset_x": offset_x,
        "principal_point_offset_y": offset_y,
        **_place(camera),
    }


@translate_camera.register
def _(camera: ThinLens, film: Film) -> dict[str, Any]:
    off_axis = max(map(abs, _principal_point(camera))) > UNIT_ROUNDOFF
    if camera.view is not None and (off_axis or not _is_square(camera, film)):
        lens = {"aperture_radius": camera.aperture_radius, "focus_distance": focus_of(camera)}
        return {**_rectangle(camera, film), **lens}
    return {
        "type": "thinlens",
        **_angle(camera, film),
        "aperture_radius": camera.aperture_radius,
        "focus_distance": focus_of(camera),
        **_place(camera),
    }


@translate_camera.register
def _(camera: Pinhole, film: Film) -> dict[str, Any]:
    """A perspective camera, upside down."""
    half = camera.film_width / camera.film_distance / 2.0
    return {"type": "perspective", **_spanning(half), **_place(camera, right=-1.0, up=-1.0)}


@translate_camera.register
def _(camera: Orthographic, film: Film) -> dict[str, Any]:
    l, r, b, t = _edges(camera, film)
    # Mitsuba's picture is 2 wide and 2 height / width high in the sensor's coordinates.
    right, up = (r - l) / 2.0, (t - b) / 2.0 * (film.width / film.height)
    middle = (l + r) / 2.0, (b + t) / 2.0
    return {"type": "orthographic", **_place(camera, right=right, up=up, middle=middle)}


def _edges(camera: CentralCamera | Orthographic, film: Film) -> tuple[float, ...]:
    """Left, right, bottom and top edge of the rectangle that the camera sees: at distance 1 from
    the eye of a central one."""
    if camera.view is not None:
        distance = getattr(camera, "distance", None) or 1.0
        return tuple(edge / distance for edge in camera.view)
    assert isinstance(camera, Orthographic)
    x = 1.0 if camera.width is None else camera.width / 2.0
    y = x * film.height / film.width
    return -x, x, -y, y


def _angle(camera: CentralCamera, film: Film) -> dict[str, Any]:
    """The field of view, of square pixels."""
    if camera.view is None:
        fov = 45.0 if camera.fov is None else camera.fov
        return {"fov": fov, "fov_axis": camera.fov_axis or "x"}
    l, r, _, _ = _edges(camera, film)
    return _spanning((r - l) / 2.0)


def _is_square(camera: CentralCamera, film: Film) -> bool:
    """Whether pixels are square, as Mitsuba's are."""
    l, r, b, t = _edges(camera, film)
    oblong = (r - l) / (t - b) * (film.height / film.width)
    return abs(oblong - 1.0) <= UNIT_ROUNDOFF


def _rectangle(camera: CentralCamera, film: Film) -> dict[str, Any]:
    """Our plugin `comparisons.mitsuba.plugins.view_rectangle`."""
    named = zip(("left", "right", "bottom", "top"), _edges(camera, film), strict=True)
    return {"type": "view_rectangle", **dict(named), **_place(camera)}


def _spanning(half: float) -> dict[str, Any]:
    """The field of view along the picture's width; `half` is the tangent of half of it."""
    return {"fov": math.degrees(2.0 * math.atan(half)), "fov_axis": "x"}


def _principal_point(camera: CentralCamera) -> tuple[float, float]:
    """Mitsuba's principal point offset, in picture widths and heights: the camera's axis passes
    through the film point p with p + offset - 1/2 = 0."""
    if camera.view is None:
        return 0.0, 0.0
    l, r, b, t = camera.view
    return (l + r) / 2.0 / (r - l), -(b + t) / 2.0 / (t - b)


def focus_of(camera: ThinLens) -> float:
    """The distance of the plane in focus: that of the target by default."""
    if camera.focus_distance is not None:
        return camera.focus_distance
    return math.dist(camera.eye, camera.target)


def _place(
    camera: Camera,
    right: float = 1.0,
    up: float = 1.0,
    middle: tuple[float, float] = (0.0, 0.0),
) -> dict[str, Any]:
    """to_world, by Mitsuba's look_at, whose x points left: with left and up scaled, and the eye
    moved by `middle` to the right and up; and the clipping planes."""
    known = mitsuba().ScalarTransform4d
    look = known().look_at(list(camera.eye), list(camera.target), list(camera.up))
    moved = look @ known().translate([-middle[0], middle[1], 0.0])
    return {"to_world": moved @ known().scale([right, up, 1.0]), **clipping(camera)}
