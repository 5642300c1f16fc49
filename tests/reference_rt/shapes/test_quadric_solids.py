"""All kinds of quadrics: spans, bounds, coordinates, descriptions."""

import math
import re

import numpy as np
import pytest
from quadric_checks import (
    ULP,
    all_spans,
    anywhere,
    guides_at,
    probe,
    probe_one,
    put,
    rays_at,
    rotation,
    table_of,
)
from quadric_exact import exactly, meetings
from quadric_kinds import BY_NAME, CONVEX, KINDS, quadric_of, seeded

import reference_rt as rt
from reference_rt.core.vec3 import Vec3
from reference_rt.shapes.curved import quadrics
from reference_rt.util.errors import SceneError

# ---- spans, bounds, coordinates -----------------------------------------------------------------


@pytest.mark.cases(10)
@BY_NAME
def test_spans(name):
    """All crossings, entering and leaving in turn; the first with t > 0 is the hit."""
    rng = seeded(name, 9)
    for shape in KINDS[name]:
        placed = anywhere(rng, shape, 0.3)
        exact, n = exactly(placed), 100
        if not exact.capped:
            assert not quadrics.is_solid(table_of(placed))
            continue
        assert quadrics.is_solid(table_of(placed))
        o, d = rays_at(rng, exact, n, (-1.0, 1.0))
        t, face = all_spans(placed, o, d)
        found = probe(placed, o, d)
        for i in range(n):
            true = meetings(exact, o[i], d[i])
            assert name not in CONVEX or len(true) in (0, 2)
            assert [m.face for m in true] == [
                f for f, x in zip(face[i], t[i], strict=True) if x < math.inf
            ]
            assert np.allclose(t[i][: len(true)], [float(m.t) for m in true], rtol=1e-9)
            assert np.isinf(t[i][len(true) :]).all()
            assert (np.diff(t[i][: len(true)]) >= 0.0).all()
            ahead = t[i][t[i] > 0.0]
            assert found.t[i] == (ahead[0] if len(ahead) else math.inf)


@BY_NAME
def test_bounds_contain_hits(name):
    rng = seeded(name, 10)
    for shape in KINDS[name]:
        placed = anywhere(rng, shape, 1.0)
        found = probe(placed, *rays_at(rng, exactly(placed), 4000))
        lower, upper = quadrics.bounds(table_of(placed))
        p = found.p[found.hits]
        assert (p >= lower).all()
        assert (p <= upper).all()


def test_bounds_of_an_ellipsoid_are_tight():
    lower, upper = quadrics.bounds(table_of(put(rt.Sphere(radius=0.7), np.diag([1.0, 2.0, 3.0]))))
    assert np.allclose(upper, [[0.7, 1.4, 2.1]], rtol=1e-14)
    assert np.allclose(lower, [[-0.7, -1.4, -2.1]], rtol=1e-14)


def test_an_ellipsoid_is_a_sphere_seen_otherwise():
    """The map takes hits and texture coordinates along, and normals by its inverse transpose."""
    rng = np.random.default_rng(11)
    round_one = rt.Sphere(center=(0.3, -0.2, 0.7), radius=1.7)
    linear = rotation(rng) @ np.diag([0.5, 1.0, 2.0]) @ rotation(rng)
    o, d = rays_at(rng, exactly(round_one), 2000)
    one = rt.Scene(shapes=(round_one,)).intersect(o, d)
    two = rt.Scene(shapes=(put(round_one, linear, (1.0, 2.0, 3.0)),)).intersect(
        o @ linear.T + [1.0, 2.0, 3.0], d @ linear.T
    )
    i = np.isfinite(one.t)
    assert i.sum() > 500
    assert np.array_equal(i, np.isfinite(two.t))
    assert np.allclose(two.t[i], one.t[i], rtol=1e-9)
    assert np.allclose(two.uv[i], one.uv[i], atol=1e-9)
    n = one.n[i] @ np.linalg.inv(linear)
    assert np.allclose(two.n[i], n / np.linalg.norm(n, axis=1, keepdims=True), atol=1e-9)
    assert (two.primitive[i] == 0).all()


def test_coordinates():
    """(phi / 2 pi, z) of the box on the surface, two of its coordinates on a cap."""
    shape = quadric_of(
        0, 0, 1, 0, 0, 0, 0, 0, 0, -4, capped=True, lower=(0, 0, -1), upper=(4, 8, 3)
    )
    found = probe(shape, [[3, 6, 9], [3, 6, -9], [9, 6, 1]], [[0, 0, -1], [0, 0, 1], [-1, 0, 0]])
    assert found.face.tolist() == [0, 3, 4]
    assert np.allclose(found.t, [7, 8, 5])
    assert np.allclose([found.u, found.v], [[0.125, 0.75, 0.75], [0.75, 0.75, 0.5]])


def test_plain_python_is_the_same():
    rng = np.random.default_rng(12)
    for name in KINDS:
        placed = anywhere(rng, KINDS[name][0], 0.3)
        table = table_of(placed)
        o, d = rays_at(rng, exactly(placed), 20)
        guides = guides_at(rng, 20)
        out = np.zeros((20, 20))
        with np.errstate(all="ignore"):
            for i in range(20):
                probe_one(table, Vec3(*o[i]), Vec3(*d[i]), Vec3(*guides[i]), out[i])
        compiled = probe(placed, o, d, guides)
        for column, values in ((0, compiled.t), (4, compiled.error), (17, compiled.next_t)):
            assert np.array_equal(out[:, column], values)
        assert np.array_equal(out[:, 5:11], np.hstack([compiled.p, compiled.n]))


# ---- what there is to describe ------------------------------------------------------------------

NO_SURFACE = {
    "zero": (0, 0, 0, 0, 0, 0, 0, 0, 0, 0),
    "a constant": (0, 0, 0, 0, 0, 0, 0, 0, 0, 1),
    "a negative constant": (0, 0, 0, 0, 0, 0, 0, 0, 0, -1),
    "nowhere": (1, 2, 3, 0, 0, 0, 0, 0, 0, 4),
    "a point": (1, 1, 1, 0, 0, 0, 2, 0, 0, 1),
    "a line": (1, 1, 0, 1, 0, 0, 0, 0, 0, 0),
    "a plane met twice": (1, 4, 0, 4, 0, 0, 0, 0, 0, 0),
    "a plane met twice, from within": (-1, -4, 0, -4, 0, 0, 0, 0, 0, 0),
}


@pytest.mark.parametrize("coefficients", NO_SURFACE.values(), ids=NO_SURFACE)
def test_no_surface(coefficients):
    scene = rt.Scene(shapes=(quadric_of(*coefficients),))
    with pytest.raises(SceneError, match="f does not change its sign, so that there is no surface"):
        rt.build_tables(scene)
    # Capped, it is everything or nothing.
    rng = np.random.default_rng(13)
    shape = quadric_of(*coefficients, capped=True)
    o, d = rays_at(rng, exactly(rt.Sphere()), 200)
    whole = rt.Scene(shapes=(rt.Box(),)).intersect(o, d).t
    expected = whole if min(coefficients) < 0 or max(coefficients) == 0 else np.full(200, np.inf)
    assert np.allclose(probe(shape, o, d).t, expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"coefficients": [1, 2, 3]}, "expected ten numbers [A, B, C, D, E, F, G, H, I, J]"),
        ({"coefficients": [*range(9), math.nan]}, "finite"),
        ({"coefficients": [*range(9), "1"]}, "expected ten numbers"),
        ({"coefficients": [*range(9), 10**400]}, "expected finite numbers"),
        ({"upper": [1, -1, 1]}, "expected each coordinate of 'lower' to be below that of 'upper'"),
        ({"upper": [1, math.inf, 1]}, "finite"),
        ({"upper": None}, "[x, y, z]"),
    ],
)
def test_refused(fields, message):
    good = {"coefficients": [1, 1, 0, 0, 0, 0, 0, 0, -1, 0], "lower": [-1, -1, -1]}
    with pytest.raises(SceneError, match=re.escape(message)):
        rt.Quadric(**{**good, "upper": [1, 1, 1], **fields})


@pytest.mark.parametrize("scale", [1e-150, 1e150])
def test_sizes_that_overflow(scale):
    with pytest.raises(ValueError, match="its size overflows; expected a scale"):
        table_of(put(KINDS["saddle"][0], np.eye(3) * scale))


def test_a_box_far_away_that_a_map_brings_back():
    """The cap of a large sphere, in coordinates that begin at its middle: only the box counts."""
    r = 2.0**20
    here = rt.Quadric(
        coefficients=(1, 1, 1, 0, 0, 0, 0, 0, 0, -r * r),
        lower=(-1, -1, r - 1),
        upper=(1, 1, r + 1),
        transform=({"translate": [0, 0, -r]},),
    )
    x = np.linspace(-0.9, 0.9, 50)
    o = np.column_stack([x, 0.3 * x, np.full(50, 2.0)])
    found = probe(here, o, np.tile([0.0, 0.0, -1.0], (50, 1)))
    sag = (x**2 + 0.09 * x**2) / (r + np.sqrt(r * r - x**2 - 0.09 * x**2))
    assert np.allclose(found.t, 2.0 + sag, rtol=4 * ULP)


def test_solids():
    with pytest.raises(SceneError, match="encloses no space"):
        rt.build_tables(rt.Scene(shapes=(KINDS["saddle"][0] & rt.Box(),)))
    # A half-space in a box, by subtraction.
    rng = np.random.default_rng(14)
    o, d = rays_at(rng, exactly(rt.Sphere()), 500)
    plane = (0, 0, 0, 0, 0, 0, 1, 2, 3, 0.25)
    below, above = (quadric_of(*(s * x for x in plane), capped=True) for s in (1.0, -1.0))
    one = rt.Scene(shapes=(rt.Box() - above,)).intersect(o, d)
    two = rt.Scene(shapes=(below,)).intersect(o, d)
    assert np.allclose(one.t, two.t, rtol=1e-12)
    assert np.allclose(one.n, two.n, atol=1e-12)
