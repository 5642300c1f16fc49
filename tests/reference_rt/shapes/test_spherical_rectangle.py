"""Rectangles sampled by solid angle: points against the angle, which F12 of stability measures."""

import math

import numpy as np
import pytest
from builders import U

from comparisons.statistics.chi_square import UNIT_SQUARE, chi_square, sidak
from reference_rt.core import transform
from reference_rt.core.ray import SurfacePoint
from reference_rt.core.vec3 import row
from reference_rt.jit.kernel import entry_kernel
from reference_rt.shapes.flat import rectangle
from reference_rt.shapes.flat.rectangle import Rectangle
from reference_rt.shapes.shape import TabulationContext


@entry_kernel
def _points(h, sides, u, out):
    seen = rectangle.project(h, sides[0], sides[1], sides[2], sides[3])
    for k in range(len(u)):
        out[k, 0], out[k, 1] = rectangle.sample_seen(seen, u[k, 0], u[k, 1])


@entry_kernel
def _light_points(table, area, p, u, out):
    for k in range(len(u)):
        q = rectangle.sample(table, 0, area, row(p, k), u[k, 0], u[k, 1])
        out[k, 0], out[k, 1], out[k, 2] = q.p
        out[k, 3], out[k, 4], out[k, 5] = q.pdf, q.u, q.v
        found = SurfacePoint(q.p, q.n, q.n, q.error, 0, 0)
        out[k, 6] = rectangle.pdf(table, 0, area, row(p, k), found)


def light_points(table, p, u):
    """(points, densities, local coordinates, densities by `pdf`)."""
    out = np.empty((len(u), 7))
    with np.errstate(all="ignore"):
        _light_points(
            table, float(rectangle.areas(table)[0]), np.broadcast_to(p, (len(u), 3)).copy(), u, out
        )
    return out[:, :3], out[:, 3], out[:, 4:6], out[:, 6]


def placed(*steps):
    return Rectangle(transform=steps).tabulate(TabulationContext())


def triangle_solid_angle(a, b, c):
    """From the origin (Van Oosterom & Strackee 1983, "The Solid Angle of a Plane Triangle")."""
    la, lb, lc = (np.linalg.norm(v) for v in (a, b, c))
    below = la * lb * lc + (a @ b) * lc + (b @ c) * la + (c @ a) * lb
    return 2.0 * math.atan2(abs(a @ np.cross(b, c)), below)


CASES = {
    "above": (1.0, -1.0, 1.0, -1.0, 1.0),
    "near": (0.1, -1.0, 1.0, -0.5, 0.7),
    "beside": (0.01, 1.0, 3.0, 1.0, 2.0),
    "at a corner": (1e-3, 0.01, 1.0, 0.01, 1.0),
    "thin across x": (0.5, -1e-4, 1e-4, -1.0, 2.0),
    "far beyond y": (0.5, -1.0, 2.0, 5.0, 6.0),
    "before y": (0.5, -1.0, 2.0, -6.0, -5.0),
    "left": (0.5, -9.0, -8.0, -1.0, 1.0),
}


def strip(h, x, y0, y1):
    """G(x, y1) - G(x, y0) by the definition, an integral over x, with 200 Gauss points: independent
    of the closed form."""
    nodes, weights = np.polynomial.legendre.leggauss(200)
    t = 0.5 * x * (nodes + 1.0)
    height = t * t + h * h
    inner = (y1 / np.sqrt(height + y1 * y1) - y0 / np.sqrt(height + y0 * y0)) / height
    return 0.5 * x * h * np.sum(weights * inner)


@pytest.mark.parametrize("name", ["above", "beside", "thin across x", "far beyond y", "left"])
def test_points_are_where_their_share_of_the_solid_angle_ends(name):
    """u0 is the share of the rectangle's solid angle up to x, by quadrature."""
    h, x0, x1, y0, y1 = CASES[name]
    seen = rectangle.project(*CASES[name])
    for u0 in (0.0, 0.1, 0.5, 0.9, 1.0):
        x, y = rectangle.sample_seen(seen, u0, 0.5)
        assert x0 <= x <= x1
        assert y0 <= y <= y1
        below = strip(h, x, y0, y1) - strip(h, x0, y0, y1)
        assert below == pytest.approx(u0 * seen.solid_angle, abs=1e-11 + 64 * U)


PLAIN = ("above", "near", "beside", "at a corner", "thin across x", "far beyond y", "before y")


def test_points_are_uniform_in_solid_angle():
    """Against the solid angle of an area, cos / distance², of the unit square stretched to it."""
    u = np.random.default_rng(401).random((60_000, 2))
    p_values = []
    for h, x0, x1, y0, y1 in (CASES[name] for name in PLAIN):
        corner, size = np.array([x0, y0]), np.array([x1 - x0, y1 - y0])
        whole = rectangle.project(h, x0, x1, y0, y1).solid_angle
        q = np.empty((len(u), 2))
        _points(h, np.array([x0, x1, y0, y1]), u, q)

        def density(s, h=h, corner=corner, size=size, whole=whole):
            distance2 = np.sum((corner + s * size) ** 2, axis=1) + h * h
            return size.prod() * h / distance2**1.5 / whole

        fit = chi_square(density, (q - corner) / size, UNIT_SQUARE)
        assert fit.integral == pytest.approx(1.0, abs=1e-4)
        p_values.append(fit.p_value)
    assert min(p_values) > sidak(len(p_values))


def turned(rng):
    axis = tuple(rng.normal(size=3))
    return transform.Rotate(rotate=transform.Turn(axis=axis, degrees=float(rng.uniform(0, 360))))


def test_sample_and_pdf_agree_and_integrate_to_the_solid_angle():
    """E[1 / pdf] is the solid angle by both ways of sampling: where the way changes nothing else
    does; densities agree to the last bit; points lie at their local coordinates."""
    rng = np.random.default_rng(402)
    stretch = transform.Scale(scale=(2.0, 0.5, 1.0))
    shear = transform.Matrix(
        matrix=((1.0, 0.4, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0))
    )
    n = 200
    ticks = (np.arange(n) + 0.5) / n
    u = np.stack(np.meshgrid(ticks, ticks, indexing="ij"), axis=-1).reshape(-1, 2)
    ways = set()
    for steps in ((stretch,), (stretch, shear), (turned(rng), shear), (stretch, turned(rng))):
        table = placed(*steps)
        c, x, y, normal = (a[0] for a in (table.center, table.x_edge, table.y_edge, table.normal))
        assert (table.lengths[0] > 0).all() == (abs(x @ y) < 1e-9)
        for distance in (0.7, 2.0, 6.17, 6.2, 30.0):
            w = rng.normal(size=3)
            w *= distance * np.sign(w @ normal) / np.linalg.norm(w)
            p = c + w
            q, pdf, local, again = light_points(table, p, u)
            assert (pdf == again).all()
            assert np.abs(local).max() <= 1.0
            assert np.allclose(q, c + local[:, :1] * x + local[:, 1:] * y, rtol=0, atol=16 * U * 9)
            a, b, d, e = (c + i * x + j * y - p for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1)))
            expected = triangle_solid_angle(a, b, d) + triangle_solid_angle(a, d, e)
            by_angle = np.ptp(pdf) == 0.0
            ways.add(by_angle)
            # The midpoint rule on 200 x 200 points, of a density that changes over `distance`.
            rel = 1e-12 if by_angle else 1e-3
            assert np.mean(1.0 / pdf) == pytest.approx(expected, rel=rel)
            _, behind, _, _ = light_points(table, c - w, u)
            assert not behind.any()
    assert ways == {True, False}


def test_from_the_plane_and_close_to_it():
    """No NaN, no density without a point; from the plane itself nothing."""
    table = placed()
    u = np.random.default_rng(403).random((2000, 2))
    for h in (1e-300, 1e-20, 1e-9, 1e-6, 1e-3):
        for x, y in ((0.0, 0.0), (1.0, 1.0), (1.5, 0.2), (-2.0, 1.0), (1.0, 0.0)):
            q, pdf, local, again = light_points(table, [x, y, h], u)
            assert np.isfinite(q).all()
            assert not np.isnan(pdf).any()
            assert (pdf == again).all()
            assert np.abs(local).max() <= 1.0
    _, pdf, _, _ = light_points(table, [0.3, 0.3, 0.0], u)
    assert not pdf.any()


def test_scales_with_the_scene():
    """Powers of two change no bit of a density."""
    u = np.random.default_rng(404).random((100, 2))
    p = np.array([0.3, -0.8, 0.4])
    _, expected, at, _ = light_points(placed(), p, u)
    for power in (-200, -30, 40, 200):
        table = placed(transform.Scale(scale=2.0**power))
        _, pdf, local, _ = light_points(table, p * 2.0**power, u)
        assert (pdf == expected).all()
        assert (local == at).all()


def test_bad_rectangles_are_refused():
    for factors in ((0.0, 1.0, 1.0), (1e200, 1e200, 1.0), (1e-200, 1e-200, 1.0)):
        with np.errstate(over="ignore"), pytest.raises(ValueError, match=r"expected|flattens"):
            placed(transform.Scale(scale=factors))
