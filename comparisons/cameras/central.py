"""What the cameras of one eye share: the angle of view and the view rectangle, in both
directions."""

import math

from comparisons.cameras.camera import Data, Edges, placed
from comparisons.cameras.film import Frame
from comparisons.mitsuba.context import TranslationContext
from comparisons.mitsuba.node import Node
from reference_rt.cameras.film import Film
from reference_rt.cameras.view_rectangle import CentralCamera

UNIT_ROUNDOFF = 2.0**-24
"""u of float32: the tolerance for square pixels and for a centred axis."""


def edges_of(camera: CentralCamera, film: Film) -> Edges:
    """The rectangle that it sees at distance 1 from the eye."""
    if camera.view is not None:
        l, r, b, t = (edge / (camera.distance or 1.0) for edge in camera.view)
        return l, r, b, t
    fov, axis = given_angle(camera)
    x = math.tan(math.radians(fov) / 2.0) * film.width / spanned(axis, film.width, film.height)
    return centred(x, film)


def centred(x: float, film: Film) -> Edges:
    """A rectangle 2 x wide in the shape of the picture."""
    y = x * film.height / film.width
    return -x, x, -y, y


def given_angle(camera: CentralCamera) -> tuple[float, str]:
    """The angle of view in degrees, and the side of the picture that it spans."""
    return 45.0 if camera.fov is None else camera.fov, camera.fov_axis or "x"


def spanned(axis: str, width: int, height: int) -> float:
    """The length in pixels of what an angle of view spans."""
    return {
        "x": width,
        "y": height,
        "diagonal": math.hypot(width, height),
        "smaller": min(width, height),
        "larger": max(width, height),
    }[axis]


# ---- writing -------------------------------------------------------------------------------------


def angle_of(camera: CentralCamera, film: Film) -> Data:
    """The field of view, of square pixels."""
    if camera.view is None:
        fov, axis = given_angle(camera)
        return {"fov": float(fov), "fov_axis": axis}
    l, r, _, _ = edges_of(camera, film)
    return spanning((r - l) / 2.0)


def spanning(half: float) -> Data:
    """The field of view along the picture's width; `half` is the tangent of half of it."""
    return {"fov": math.degrees(2.0 * math.atan(half)), "fov_axis": "x"}


def is_square(camera: CentralCamera, film: Film) -> bool:
    """Whether pixels are square, as Mitsuba's are."""
    l, r, b, t = edges_of(camera, film)
    oblong = (r - l) / (t - b) * (film.height / film.width)
    return abs(oblong - 1.0) <= UNIT_ROUNDOFF


def principal_point(camera: CentralCamera) -> tuple[float, float]:
    """Mitsuba's principal point offset, in picture widths and heights: the camera's axis passes
    through the film point p with p + offset - 1/2 = 0."""
    if camera.view is None:
        return 0.0, 0.0
    l, r, b, t = camera.view
    return (l + r) / 2.0 / (r - l), -(b + t) / 2.0 / (t - b)


def view_rectangle(camera: CentralCamera, film: Film, context: TranslationContext) -> Data:
    """Our plugin `comparisons.mitsuba.plugins.view_rectangle`."""
    named = zip(("left", "right", "bottom", "top"), edges_of(camera, film), strict=True)
    return {"type": "view_rectangle", **dict(named), **placed(camera, context)}


# ---- reading -------------------------------------------------------------------------------------


def read_angle(node: Node, frame: Frame) -> tuple[Data, float]:
    """fov and fov_axis, and the tangent of half of the angle across the film's width."""
    if node.has("fov"):
        if node.has("focal_length"):
            raise node.error("has both 'fov' and 'focal_length'; expected one of them")
        axes = ("x", "y", "diagonal", "smaller", "larger")
        fov, axis = node.number("fov", 45.0), node.choice("fov_axis", "x", axes)
        if not 0.0 < fov < 180.0:
            raise node.error(f"'fov' is {fov:g}; expected degrees above 0 and below 180")
        values: Data = {"fov": fov, "fov_axis": axis}
    else:
        text = node.take("focal_length")
        try:
            length = float(str("50mm" if text is None else text).removesuffix("mm"))
        except ValueError:
            raise node.error(f"'focal_length' is '{text}'; expected such as 50mm") from None
        if not length > 0.0:
            raise node.error(f"'focal_length' is '{text}'; expected more than 0")
        values = focal(length)
    across = spanned(values["fov_axis"], frame.width, frame.height)
    return values, math.tan(math.radians(values["fov"]) / 2.0) * frame.width / across


def focal(length: float) -> Data:
    """The angle of a focal length in millimetres, of film of 36 x 24 mm."""
    diagonal = math.hypot(36.0, 24.0)
    return {
        "fov": math.degrees(2.0 * math.atan(diagonal / (2.0 * length))),
        "fov_axis": "diagonal",
    }
