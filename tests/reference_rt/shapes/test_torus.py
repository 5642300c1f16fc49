"""The torus against exact roots of its quartic; rays that leave it."""

import flint
import numpy as np
import pytest
from builders import U, unit_vectors
from drivers import leave_scene, spans_of

import reference_rt as rt
from reference_rt.core import transform

N = 400


def q(x):
    return flint.fmpq(*float(x).as_integer_ratio())


def exact_roots(o, d, major, minor):
    """All real t with their multiplicity, of exact rationals: certified intervals' middles."""
    p = [flint.fmpq_poly([q(a), q(b)]) for a, b in zip(o, d, strict=True)]
    big, small = q(major), q(minor)
    s = p[0] * p[0] + p[1] * p[1] + p[2] * p[2] + flint.fmpq_poly([big * big - small * small])
    quartic = s * s - 4 * big * big * (p[0] * p[0] + p[1] * p[1])
    found = [z for z, _ in quartic.numer().complex_roots()]
    real = sorted(float(z.real.mid()) for z in found if z.imag.is_zero())
    # How near to a double root: the smallest gap, or distance from the real line.
    gaps = [*np.diff(real), *(abs(float(z.imag.mid())) for z in found if not z.imag.is_zero())]
    return real, min(gaps, default=np.inf)


@pytest.mark.cases(4)
@pytest.mark.parametrize("minor", [0.01, 0.25, 0.9])
@pytest.mark.parametrize("far", [0.0, 3.0, 1e6])
def test_all_roots(minor, far):
    """Through the tube, from within it, near it and far away, along directions of any length."""
    rng = np.random.default_rng(1)
    phi = rng.uniform(0.0, 2.0 * np.pi, N)
    target = np.column_stack([np.cos(phi), np.sin(phi), 0 * phi]) + 0.6 * minor * rng.normal(
        size=(N, 3)
    )
    o = target + (far + minor) * rng.normal(size=(N, 3))
    d = (target - o) * 10.0 ** rng.uniform(-2, 2, (N, 1))
    scene = rt.Scene(shapes=(rt.Torus(minor_radius=minor),))
    found = spans_of(scene, o, d)
    hits = scene.intersect(o, d)
    compared = 0
    for i in range(N):
        real, gap = exact_roots(o[i], d[i], 1.0, minor)
        mine = found[i][np.isfinite(found[i])]
        speed = np.linalg.norm(d[i])
        reach = np.linalg.norm(o[i]) + 1.0 + minor
        # Where roots are less than this apart, in lengths, the ray touches: the line itself is
        # known to a few u of its origin, and a chord of length c is as deep as c² / (8 r).
        if gap * speed < np.sqrt(64.0 * U * reach * 8.0):
            continue
        compared += 1
        assert len(mine) == len(real), (o[i], d[i])
        for t, expected in zip(mine, real, strict=True):
            p = o[i] + expected * d[i]
            rho = np.hypot(p[0], p[1])
            n = np.array([p[0] * (1 - 1 / rho), p[1] * (1 - 1 / rho), p[2]]) / minor
            cosine = abs(n @ d[i]) / speed
            # 16 units in the last place of |t| + size, as seen head-on.
            size = abs(expected) * speed + 1.0 + minor
            assert abs(t - expected) * speed <= 32.0 * U * size / min(1.0, 10.0 * cosine)
        ahead = [t for t in mine if t > 0.0]
        assert hits.t[i] == (ahead[0] if ahead else np.inf)
    assert compared > 0.9 * N


@pytest.mark.parametrize("scale", [(1.0, 1.0, 1.0), (1e3, 1.0, 1e-3), (-1.0, 2.0, 1.0)])
def test_leaving(scale):
    """Away from the solid half space of the tangent plane and outwards, at once again is never:
    where the surface bends towards the ray, the chord is longer than the step by far."""
    rng = np.random.default_rng(2)
    n = 50_000
    steps = (transform.Scale(scale=scale), transform.Translate(translate=(100.0, 0.0, 0.0)))
    scene = rt.Scene(shapes=(rt.Torus(transform=steps),))
    m = transform.affine(steps)
    phi = rng.uniform(0.0, 2.0 * np.pi, n)
    inner = np.column_stack([np.cos(phi), np.sin(phi), 0 * phi]) + 0.15 * rng.normal(size=(n, 3))
    o = transform.apply_points(m, inner + 3.0 * rng.normal(size=(n, 3)))
    d = transform.apply_points(m, inner) - o
    again, hit = leave_scene(scene, o, d, unit_vectors(rng, n))
    assert hit.sum() > n // 2
    # A surface of curvature k, left by e, is met again by a ray towards it no sooner than at
    # sqrt(2 e / k): with e of some 1e-14 and the smallest radius that these maps make, 1e-9.
    assert (again[hit] > 1e-9).all()


def test_normals_and_uv():
    scene = rt.Scene(shapes=(rt.Torus(),))
    o = [[5, 0, 0], [0, 0, 0], [0, 1.0, 5], [0, 1.0, 0.0], [0, -5.0, 0]]
    d = [[-1, 0, 0], [1, 0, 0], [0, 0, -1], [0, 0, -1], [0, 2, 0]]
    hits = scene.intersect(o, d)
    np.testing.assert_allclose(hits.t, [3.75, 0.75, 4.75, 0.25, 1.875], rtol=4e-16)
    n = [[1, 0, 0], [-1, 0, 0], [0, 0, 1], [0, 0, -1], [0, -1, 0]]
    np.testing.assert_allclose(hits.n, n, atol=1e-15)
    uv = [[0, 0], [0, 0.5], [0.25, 0.25], [0.25, 0.75], [0.75, 0]]
    np.testing.assert_allclose(hits.uv, uv, atol=1e-15)


def test_refuses_a_tube_that_cuts_itself():
    with pytest.raises(rt.SceneError, match=r"shapes\[0\]: minor_radius is 1; expected less than"):
        rt.build_tables(rt.Scene(shapes=(rt.Torus(minor_radius=1.0),)))
