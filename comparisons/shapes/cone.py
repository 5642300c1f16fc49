"""Cones and their frusta, for whose sides meshes stand in."""

from comparisons.geometry import affine
from comparisons.mitsuba.hits import Plugin
from comparisons.mitsuba.plugins.exact_coordinates import of_cone
from comparisons.shapes.shape import ShapeType, is_capped
from comparisons.shapes.site import Site
from comparisons.shapes.stand_ins import stand_in
from comparisons.shapes.tubes import (
    Tube,
    cap_plugins,
    tube_for_cycles,
    tube_for_povray,
    tube_for_raysect,
    tube_surface,
    tube_triangles,
    unwrapped,
)
from reference_rt.shapes import Cone


def _tube(shape: Cone) -> Tube:
    return Tube(shape.radius, shape.top_radius, 0.0, shape.height, shape.capped)


def _to_mitsuba(shape: Cone, site: Site) -> list[Plugin]:
    tube, slope = _tube(shape), (shape.top_radius - shape.radius) / shape.height
    of = of_cone(shape.radius, slope, 0.0, shape.height)
    side = stand_in(shape, tube_surface(tube, site.textured), site, of)
    return [side, *cap_plugins(tube, affine.map_in(shape, site.place), site)]


CONE = ShapeType(
    of=Cone,
    table=None,
    surface=lambda shape: tube_surface(_tube(shape)),
    to_mitsuba=_to_mitsuba,
    triangles=lambda shape, m: tube_triangles(_tube(shape), m),
    encloses=is_capped,
    unwrapped=unwrapped,
    to_cycles=lambda shape, folder: tube_for_cycles(_tube(shape)),
    to_raysect=lambda shape: tube_for_raysect(_tube(shape)),
    to_povray=lambda shape, folder: tube_for_povray(_tube(shape)),
)
