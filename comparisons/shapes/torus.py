"""Tori, for which meshes stand in."""

from pathlib import Path

import flint
import numpy as np

from comparisons.geometry.exact.crossings import Crossings, Row, column, in_local, ordered
from comparisons.geometry.exact.dyadic import (
    CERTAIN,
    FRACTION,
    NEVER,
    Dyadic,
    Integers,
    dot,
    roots,
)
from comparisons.mitsuba.hits import Plugin
from comparisons.mitsuba.plugins.exact_coordinates import Round
from comparisons.shapes.fine import FINE, fine, widened
from comparisons.shapes.shape import RaysectPart, ShapeType, TableType, always, per_face
from comparisons.shapes.site import Site
from comparisons.shapes.soup import Soup
from comparisons.shapes.stand_ins import stand_in, tessellated
from comparisons.shapes.surface import Patch, Surface
from reference_rt.core.arrays import FloatArray
from reference_rt.shapes import Torus

TORUS_CELLS = (768, 384)
"""Around the axis and around the tube."""


def surface_of(shape: Torus) -> Surface:
    major, minor = shape.major_radius, shape.minor_radius
    around = major + minor

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

    return Surface(
        value=lambda p: from_tube(p)[1] - minor,
        gradient=lambda p: from_tube(p)[0] / from_tube(p)[1][..., None],
        middle=(0.0, 0.0, 0.0),
        half=(around, around, minor),
        patches=lambda: [Patch(point, TORUS_CELLS, has_uv=True)],
    )


def torus_quartic(row: Row, o: Dyadic, d: Dyadic) -> Integers:
    """The coefficients (n, 5), up to a factor and with the constant term first, of
    (|p|² + R² - r²)² - 4 R² (x² + y²) along the rays."""
    q, e = in_local(row, o, d)
    major, minor = column(row, "major"), column(row, "minor")
    alpha, beta = dot(e, e), Dyadic.of(2.0) * dot(q, e)
    gamma = dot(q, q) + major * major - minor * minor
    four = Dyadic.of(4.0) * major * major
    flat_q, flat_e = q[..., :2], e[..., :2]
    ring = [
        dot(flat_q, flat_q) * four,
        Dyadic.of(2.0) * dot(flat_q, flat_e) * four,
        dot(flat_e, flat_e) * four,
    ]
    coefficients = [
        gamma * gamma - ring[0],
        Dyadic.of(2.0) * beta * gamma - ring[1],
        beta * beta + Dyadic.of(2.0) * alpha * gamma - ring[2],
        Dyadic.of(2.0) * alpha * beta,
        alpha * alpha,
    ]
    exponent = min(c.e for c in coefficients)
    return np.stack([np.broadcast_to(c.to(exponent).n, len(q.n)) for c in coefficients], axis=1)


def _crossings(row: Row, o: Dyadic, d: Dyadic) -> Crossings:
    """Roots of the quartic, isolated and certified by FLINT (fmpz_poly_complex_roots)."""
    q, e = in_local(row, o, d)
    integers = torus_quartic(row, o, d)
    # Rays that miss the bounding sphere miss the torus.
    size = column(row, "major") + column(row, "minor")
    ball, _, _ = roots(dot(e, e), dot(q, e), dot(q, q) - size * size)
    t = np.full((len(q.n), 4), NEVER, dtype=object)
    touching = np.zeros(len(q.n), bool)
    for i in np.flatnonzero(ball > 0).tolist():
        found = _real_roots(integers[i].tolist())
        simple = [t for t, times in found if times % 2 == 1]
        touching[i] = any(times > 1 for _, times in found)
        t[i, : len(simple)] = sorted(simple)
    ways = [np.array(k % 2 == 0) for k in range(4)]
    return ordered([t[:, k] for k in range(4)], ways, [0] * 4, touching)


def _real_roots(coefficients: list[int]) -> list[tuple[int, int]]:
    """(t as fixed-point number, multiplicity) of the real roots;  coefficients: the constant term
    first."""
    precision = flint.ctx.prec
    flint.ctx.prec = CERTAIN + 32
    try:
        found = flint.fmpz_poly(coefficients).complex_roots()
        real = [(z.real, times) for z, times in found if z.imag == 0]
        one = flint.arb(2) ** FRACTION
        return [(int((x * one).mid().floor().unique_fmpz()), times) for x, times in real]
    finally:
        flint.ctx.prec = precision


def _to_mitsuba(shape: Torus, site: Site) -> list[Plugin]:
    of = Round((0.0, 0.0, 0.0), shape.major_radius)
    return [stand_in(shape, surface_of(shape), site, of)]


def _to_cycles(shape: Torus, folder: Path) -> Soup:
    radii = {
        "major_radius": shape.major_radius * widened(4 * FINE),
        "minor_radius": shape.minor_radius * widened(FINE),
    }
    return fine(surface_of(shape.model_copy(update=radii)), (4 * FINE, FINE))


AROUND_Z = "matrix <1,0,0, 0,0,1, 0,-1,0, 0,0,0>"
"""POV-Ray's tori are around y."""


def _to_povray(shape: Torus, folder: Path) -> str:
    """By Sturm's method: its other one leaves holes in thin tori."""
    return f"torus {{ {shape.major_radius!r}, {shape.minor_radius!r} sturm {AROUND_Z}"


TORUS = ShapeType(
    of=Torus,
    table=TableType(
        field="tori",
        crossings=_crossings,
        features=lambda table: per_face(
            np.asarray(table.minor / np.linalg.norm(table.to_local.reshape(3, 3), 2))
        ),
    ),
    surface=surface_of,
    to_mitsuba=_to_mitsuba,
    triangles=lambda shape, m: tessellated(surface_of(shape), m),
    encloses=always,
    to_cycles=_to_cycles,
    to_raysect=lambda shape: [RaysectPart("torus", (shape.major_radius, shape.minor_radius))],
    to_povray=_to_povray,
)
