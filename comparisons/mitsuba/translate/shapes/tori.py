"""Tori, for which meshes stand in."""

import numpy as np

from comparisons.mitsuba.coordinates import Round
from comparisons.mitsuba.stand_ins import Plugin
from comparisons.mitsuba.translate.shapes.choice import translate_shape
from comparisons.mitsuba.translate.shapes.patches import Implicit, Patch
from comparisons.mitsuba.translate.shapes.plugins import Site
from comparisons.mitsuba.translate.shapes.stand_ins import stand_in
from reference_rt.core.arrays import FloatArray
from reference_rt.shapes import Torus

CELLS = (768, 384)
"""Around the axis and around the tube."""


@translate_shape.register
def _(shape: Torus, site: Site) -> list[Plugin]:
    patches, surface = torus_surface(shape)
    of = Round((0.0, 0.0, 0.0), shape.major_radius)
    return [stand_in(shape, patches, surface, None, site, of)]


def torus_surface(shape: Torus) -> tuple[list[Patch], Implicit]:
    """The surface in its own coordinates."""
    major, minor = shape.major_radius, shape.minor_radius

    def point(u: FloatArray, v: FloatArray) -> FloatArray:
        phi, theta = 2.0 * np.pi * u, 2.0 * np.pi * v
        rho = major + minor * np.cos(theta)
        return np.stack([rho * np.cos(phi), rho * np.sin(phi), minor * np.sin(theta)], axis=-1)

    def from_tube(p: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The vector from the nearest point of the circle, and its length."""
        rho = np.hypot(p[..., 0], p[..., 1])
        factor = 1.0 - major / rho
        across = np.stack([p[..., 0] * factor, p[..., 1] * factor, p[..., 2]], axis=-1)
        return across, np.linalg.norm(across, axis=-1)

    surface = Implicit(
        value=lambda p: from_tube(p)[1] - minor,
        gradient=lambda p: from_tube(p)[0] / from_tube(p)[1][..., None],
    )
    return [Patch(point, CELLS, has_uv=True)], surface
