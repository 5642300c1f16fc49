"""Real pinholes: Mitsuba's `perspective` upside down, and for a hole that has a size our sensor
`view_rectangle`.

Mitsuba's `thinlens` has no counterpart of such a hole.  The rays of a film point s, behind the hole
at distance d, part from s: at the point q of the hole the direction is q + d c, c that through the
middle, with 1 along the axis.  A lens in focus at f sends f c - q from q.  Both are one line for
every q only if f = -d; there `thinlens` looks backwards, at the film.  For f > 0 the blur at
distance z has the radius r |1 - z / f| in place of r (1 + z / d): equal for one z alone.
"""

from comparisons.cameras.camera import CameraType, Data, Edges, Lens, placed
from comparisons.cameras.central import centred, spanning
from comparisons.mitsuba.context import TranslationContext
from reference_rt.cameras import Pinhole
from reference_rt.cameras.film import Film


def _half(camera: Pinhole) -> float:
    return camera.film_width / camera.film_distance / 2.0


def _edges(camera: Pinhole, film: Film) -> Edges:
    return centred(_half(camera), film)


def _lens(camera: Pinhole) -> Lens | None:
    if camera.hole_radius is None:
        return None
    return Lens(camera.hole_radius, -camera.film_distance, camera.exposure)


def _to_mitsuba(camera: Pinhole, film: Film, context: TranslationContext) -> Data:
    """Upside down."""
    upside_down = placed(camera, context, right=-1.0, up=-1.0)
    lens = _lens(camera)
    if lens is None:
        return {"type": "perspective", **spanning(_half(camera)), **upside_down}
    edges = dict(zip(("left", "right", "bottom", "top"), _edges(camera, film), strict=True))
    hole = {"aperture_radius": lens.radius, "focus_distance": lens.focus}
    exposure = {} if lens.exposure is None else {"exposure": lens.exposure}
    return {"type": "view_rectangle", **edges, **hole, **exposure, **upside_down}


def _scaled(camera: Pinhole, scale: float) -> Data:
    if camera.hole_radius is None:
        return {}
    lengths = ("film_width", "film_distance", "hole_radius")
    return {name: scale * getattr(camera, name) for name in lengths}


PINHOLE = CameraType(
    description=Pinhole,
    to_mitsuba=_to_mitsuba,
    from_mitsuba={},
    edges=_edges,
    lens=_lens,
    is_parallel=False,
    is_upside_down=True,
    scaled=_scaled,
)
