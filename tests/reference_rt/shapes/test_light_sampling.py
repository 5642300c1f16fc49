"""Shapes as lights: their densities against the solid angles that they subtend.

Samples against densities, of every shape: `test_every_light`."""

import math

import numpy as np
import pytest
from builders import U, random_shape

import reference_rt as rt
from reference_rt import shapes as any_shape
from reference_rt.core.vec3 import row
from reference_rt.jit.kernel import entry_kernel
from reference_rt.shapes import BOX, RECTANGLE, SPHERE, TRIANGLE


@entry_kernel
def _sample_all(shapes, kind, area, p, u, out):
    for i in range(len(u)):
        q = any_shape.sample(shapes, kind, 0, area, row(p, 0), u[i, 0], u[i, 1])
        out[i, 0], out[i, 1], out[i, 2] = q.p
        out[i, 3], out[i, 4], out[i, 5] = q.n
        out[i, 6] = q.pdf


@pytest.fixture(scope="module")
def lights():
    """One of each shape: (tables, kind -> (area, corners or measures))."""
    rng = np.random.default_rng(81)
    kinds = ("sphere", "rectangle", "box", "triangle")
    scene = rt.Scene(
        materials={"lamp": rt.Emissive(radiance=(1, 1, 1))},
        shapes=tuple(
            random_shape(kind, rng, 1.0, 1.0).model_copy(update={"material": "lamp"})
            for kind in kinds
        ),
    )
    return rt.build_tables(scene)


def sample(lights, kind, p, u):
    """(points, normals, densities per solid angle at p)."""
    areas = lights.lights.areas
    (area,) = areas.area[areas.kind == kind]
    out = np.empty((len(u), 7))
    with np.errstate(all="ignore"):
        _sample_all(lights.geometry.shapes, kind, area, np.array([p], float), u, out)
    return out[:, :3], out[:, 3:6], out[:, 6]


def midpoints(n):
    ticks = (np.arange(n) + 0.5) / n
    return np.stack(np.meshgrid(ticks, ticks, indexing="ij"), axis=-1).reshape(-1, 2)


def triangle_solid_angle(p, corners):
    """Van Oosterom & Strackee 1983; positive seen from the side of the normal."""
    a, b, c = (v - p for v in corners)
    la, lb, lc = (np.linalg.norm(v) for v in (a, b, c))
    volume = a @ np.cross(b, c)
    denominator = la * lb * lc + (a @ b) * lc + (b @ c) * la + (c @ a) * lb
    return -2 * math.atan2(volume, denominator)


def quadrangle_solid_angle(p, center, x, y):
    a, b, c, d = (center + i * x + j * y for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1)))
    return triangle_solid_angle(p, (a, b, c)) + triangle_solid_angle(p, (a, c, d))


def solid_angle(lights, kind, p):
    shapes = lights.geometry.shapes
    if kind == RECTANGLE:
        r = shapes.rectangles
        return quadrangle_solid_angle(p, r.center[0], r.x_edge[0], r.y_edge[0])
    if kind == TRIANGLE:
        return triangle_solid_angle(p, shapes.triangles.vertices[0].reshape(3, 3))
    center, edges = shapes.boxes.center[0], shapes.boxes.edges[0].reshape(3, 3)
    faces = [
        quadrangle_solid_angle(p, center + s * edges[k], s * edges[(k + 1) % 3], edges[(k + 2) % 3])
        for k in range(3)
        for s in (-1, 1)
    ]
    return sum(max(0.0, face) for face in faces)


@pytest.mark.parametrize("kind", [RECTANGLE, TRIANGLE, BOX])
def test_flat_lights_integrate_to_their_solid_angle(lights, kind):
    """E[1 / pdf] over points with pdf > 0, by the midpoint rule on 1000 x 1000 points."""
    rng = np.random.default_rng(82)
    seen = 0
    for p in rng.normal(size=(8, 3)) * 6:
        _, _, pdf = sample(lights, kind, p, midpoints(1000))
        expected = max(0.0, solid_angle(lights, kind, p))
        found = np.mean(np.divide(1.0, pdf, where=pdf > 0, out=np.zeros_like(pdf)))
        # Second order in cells of 1/1000, with lights no nearer than about their size; for a box
        # first order: six faces share the first number, whose limits cut through cells.
        assert found == pytest.approx(expected, rel=1e-4 if kind != BOX else 6e-3, abs=1e-15)
        seen += expected > 0
    assert seen >= 2


def test_sphere_light_is_a_cone(lights):
    """The density is one over the cone's solid angle, even for tiny and for huge cones; points lie
    on the near side."""
    spheres = lights.geometry.shapes.spheres
    c, r = spheres.center[0], spheres.radius[0]
    u = np.random.default_rng(83).uniform(0, 1, (2000, 2))
    for distance in (1.0001, 2.0, 1e5):
        axis = np.array([1.0, 2.0, -2.0]) / 3
        p = c + axis * r * distance
        q, n, pdf = sample(lights, SPHERE, p, u)
        sine2 = (r / np.linalg.norm(p - c)) ** 2
        one_minus_cos = sine2 / (1 + math.sqrt(1 - sine2))
        # 1 - sin² loses at most the bits that distance 1.0001 has to lose.
        assert pdf == pytest.approx(1 / (2 * math.pi * one_minus_cos), rel=1e-11)
        # p is as exact as q's own rounding and c's.
        assert np.abs(np.linalg.norm(q - c, axis=1) - r).max() < 16 * U * (np.abs(c).max() + r)
        w = q - p
        # Points at the rim are seen edge-on, to within rounding of the distance.
        assert (np.sum(w * n, axis=1) <= 1e-7 * np.linalg.norm(w, axis=1)).all()


def test_a_sphere_gives_nothing_to_points_inside(lights):
    c = lights.geometry.shapes.spheres.center[0]
    _, _, pdf = sample(lights, SPHERE, c, midpoints(4))
    assert not pdf.any()


def test_rectangle_points_fill_it(lights):
    """Affine: the middle of the unit square is the centre, its corners are the corners."""
    r = lights.geometry.shapes.rectangles
    q, n, _ = sample(lights, RECTANGLE, [9, 9, 9], np.array([[0.5, 0.5], [0, 0], [1, 0], [1, 1.0]]))
    c, x, y = r.center[0], r.x_edge[0], r.y_edge[0]
    # Two products and two sums of numbers about 1.
    assert np.allclose(q, [c, c - x - y, c + x - y, c + x + y], rtol=0, atol=8 * U)
    assert np.allclose(n, np.cross(x, y) / np.linalg.norm(np.cross(x, y)), rtol=0, atol=8 * U)
