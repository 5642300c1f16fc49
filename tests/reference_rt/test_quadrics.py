"""Quadrics and ellipsoids against rational arithmetic: hits, faces, normals, leaving, spans."""

import itertools
import math
import re

import numpy as np
import pytest
from quadric_checks import (
    ULP,
    all_spans,
    anywhere,
    check_against_exact,
    check_leaving,
    exactly,
    extent,
    first,
    guides_at,
    meetings,
    probe,
    probe_one,
    put,
    rays_at,
    rotation,
    side,
    table_of,
    value,
)

import reference_rt as rt
from reference_rt.errors import SceneError
from reference_rt.shapes import quadric
from reference_rt.vec3 import Vec3

BOX = {"lower": (-1.0, -1.0, -1.0), "upper": (1.0, 1.0, 1.0)}


def quadric_of(*coefficients, capped=False, **box):
    return rt.Quadric(coefficients=coefficients, capped=capped, **(box or BOX))


def open_and_capped(*coefficients, **box):
    return [quadric_of(*coefficients, capped=capped, **box) for capped in (False, True)]


ELLIPSOIDS = [rt.Sphere(), rt.Sphere(center=(0.3, -0.2, 0.7), radius=1.7)]
KINDS = {
    "ellipsoid": ELLIPSOIDS,
    "ellipsoid by coefficients": open_and_capped(2, 3, 4, 0.5, -0.3, 0.2, 0.1, 0.2, -0.3, -1),
    "elliptic cylinder": open_and_capped(1, 2, 0, 0, 0, 0, 0, 0, 0, -0.5),
    "double cone": [
        *open_and_capped(1, 1, -1, 0, 0, 0, 0, 0, 0, 0),
        quadric_of(-1, -1, 1, 0, 0, 0, 0, 0, 0, 0, capped=True),
    ],
    "paraboloid": open_and_capped(1, 1.3, 0, 0, 0, 0, 0.1, 0, -1, -0.3),
    "saddle": open_and_capped(1, -1, 0, 0, 0, 0, 0, 0, -1, 0),
    "hyperboloid of one sheet": open_and_capped(1, 1, -1, 0, 0, 0, 0, 0, 0, -0.2),
    "hyperboloid of two sheets": open_and_capped(1, 1, -1, 0, 0, 0, 0, 0, 0, 0.2),
    "turned, off the middle": open_and_capped(
        *(1, 0.5, 0.7, -0.3, 0.2, 0.9, 0.3, -0.4, 0.2, -0.3),
        lower=(-1.3, -0.8, -0.2),
        upper=(0.8, 2.1, 1.0),
    ),
    "plane": open_and_capped(0, 0, 0, 0, 0, 0, 1, 2, 3, 0.25),
    "pair of planes": [
        *open_and_capped(1, -1, 0, 0, 0, 0, 0, 0, 0, 0),
        *open_and_capped(1, 0, 0, 0, 0, 0, 0, 0, 0, -0.25),
    ],
    "box": [quadric_of(0, 0, 0, 0, 0, 0, 0, 0, 0, -1, capped=True)],
}
BY_NAME = pytest.mark.parametrize("name", KINDS)


def seeded(name, *more):
    return np.random.default_rng([list(KINDS).index(name), *more])


# ---- hits ---------------------------------------------------------------------------------------


def hits_of(name, distance, n):
    rng = seeded(name, 1)
    hits = 0
    # Where two planes meet, f is flat: the cosine alone does not say how well t is known.
    ulps = 512.0 if name == "pair of planes" else 16.0
    for shape in KINDS[name]:
        placed = anywhere(rng, shape, 0.3)
        hits += check_against_exact(placed, *rays_at(rng, exactly(placed), n, distance), ulps)
    assert hits > n * len(KINDS[name]) / 5


@BY_NAME
@pytest.mark.parametrize("distance", [(-2.0, 1.0), (3.0, 7.0)])
def test_hits(name, distance):
    hits_of(name, distance, 100)


@pytest.mark.slow
@BY_NAME
@pytest.mark.parametrize("distance", [(-2.0, 1.0), (1.0, 4.0), (3.0, 7.0)])
def test_hits_of_many(name, distance):
    hits_of(name, distance, 2000)


@pytest.mark.parametrize(
    "sizes", [(1e3, 1.0, 1e-3), (1e3, 1e3, 1e-3), (1e3, 1e-3, 1e-3), (1e-3, 1e-3, 1e3)]
)
@pytest.mark.parametrize("name", ["ellipsoid", "elliptic cylinder", "saddle", "double cone"])
def test_hits_of_the_stretched(name, sizes):
    """Points stay where the ray meets them, though the surface is 1e6 times as long as thin."""
    rng = seeded(name, 17)
    for shape in KINDS[name]:
        placed = put(shape, rotation(rng) @ np.diag(sizes), rng.uniform(-3.0, 3.0, 3))
        check_against_exact(placed, *rays_at(rng, exactly(placed), 60), bend=1e9)


@pytest.mark.parametrize("scale", [1e-130, 1e-40, 1e40, 1e130])
def test_scales(scale):
    """Of the world and of directions; nothing overflows."""
    rng = np.random.default_rng(2)
    for shape in (put(ELLIPSOIDS[0], np.diag([1.0, 2.0, 3.0])), KINDS["saddle"][1]):
        whole = put(shape, exactly(shape).m[:, :3] * scale)
        o, d = rays_at(rng, exactly(shape), 200)
        d /= np.linalg.norm(d, axis=1, keepdims=True)
        one, many = probe(shape, o, d), probe(whole, o * scale, d * 1e-150)
        assert np.array_equal(np.isfinite(one.t), np.isfinite(many.t))
        i = one.hits
        assert np.allclose(many.t[i] * (1e-150 / scale), one.t[i], rtol=1e-12)
        assert np.allclose(many.n[i], one.n[i], atol=1e-9)
        assert np.isinf(many.next_t[i]).mean() > 0.5


def test_a_point_from_afar_is_on_the_surface():
    """The error of the point does not grow with the distance."""
    shape = put(rt.Sphere(), np.diag([1.0, 2.0, 3.0]))
    for power in range(0, 15, 2):
        o = np.array([[10.0**power, 0.3, -0.7]])
        found = probe(shape, o, [[-1.0, 0.0, 0.0]])
        f = float(
            value(exactly(shape).form, [x / s for x, s in zip(found.p[0], (1, 2, 3), strict=True)])
        )
        assert abs(f) < 8 * ULP
        assert found.error[0] < 1e-13


def test_what_is_not_a_number_meets_nothing():
    strange = [math.nan, math.inf, -math.inf, 1e308]
    values = list(itertools.product([*strange, 0.0, 0.5], repeat=3))
    o = np.array(values)
    for name in KINDS:
        for shape in KINDS[name]:
            placed = put(shape, np.diag([1.0, 2.0, 0.5]))
            for d in ([0.3, 0.2, -0.4], [0.0, 0.0, 0.0]):
                found = probe(placed, o, np.tile(d, (len(o), 1)))
                assert not np.isnan(found.t).any()
                assert np.isfinite(o[found.hits]).all()
            found = probe(placed, np.tile([0.1, 0.2, 0.3], (len(o), 1)), o)
            assert np.isfinite(o[found.hits]).all()


def test_lattices():
    """Where all is exact, so is the answer: rims, tangents, apexes, signed zeros, rays in faces."""
    rng = np.random.default_rng(3)
    shapes = [
        put(rt.Sphere(), np.diag([1.0, 2.0, 0.5])),
        rt.Cylinder(),
        rt.Cylinder(capped=False, z_min=-0.5),
        rt.Cone(),
        rt.Cone(capped=False),
        rt.Cone(top_radius=0.5),
        *KINDS["saddle"],
        *KINDS["pair of planes"],
        *KINDS["box"],
        *KINDS["double cone"],
    ]
    n = 300
    for shape in shapes:
        exact = exactly(shape)
        o = rng.integers(-8, 9, (n, 3)) * 0.25
        d = rng.integers(-4, 5, (n, 3)) * 0.5
        d = np.where(d == 0.0, rng.choice([0.0, -0.0], d.shape), d)
        d[(d == 0.0).all(axis=1)] = [0.0, -0.0, 1.0]
        found = probe(shape, o, d)
        for i in range(n):
            every = [m for m in meetings(exact, o[i], d[i]) if m.t > 0]
            if every and every[0].cos == 0.0 and side(exact, o[i] + d[i] * 0.99 * every[0].t) < 0:
                # Through an apex, where f touches 0 from within: a solid goes on.
                assert found.face[i] != 0 or not exact.capped
                if exact.capped:
                    continue
            assert np.isfinite(found.t[i]) == bool(every), (shape, o[i], d[i], every)
            if every:
                assert abs(found.t[i] - float(every[0].t)) <= 4 * ULP * float(every[0].t)
                assert found.face[i] in {m.face for m in every if m.t == every[0].t}


RIMS = [
    *((shape, (1, 0, 1)) for shape in (rt.Cylinder(), rt.Cylinder(capped=False))),
    *((shape, (0, -1, 0)) for shape in (rt.Cone(), rt.Cone(capped=False))),
    *((shape, (0.5, -0.25, -1)) for shape in open_and_capped(4, 0, 0, 0, 0, 0, 0, 8, 1, 2)),
    *((shape, (1, -0.25, -0.25)) for shape in KINDS["plane"]),
    *((shape, (1, -0.5, 0.75)) for shape in KINDS["saddle"][:1]),
]


@pytest.mark.parametrize(("shape", "rim"), RIMS)
def test_rims(shape, rim):
    """A rim belongs to the surface, also where t, the third of an integer, is rounded."""
    rng = np.random.default_rng(15)
    rim = np.array(rim)
    assert value(exactly(shape).form, rim) == 0.0
    away = rng.integers(-12, 13, (2000, 3)) * 0.25
    times = rng.choice([1.0, 3.0, 5.0, 6.0, 7.0], (2000, 1))
    o, d = rim - away, away * times
    met = probe(shape, o, d)
    for i in range(2000):
        true = first(exactly(shape), o[i], d[i])
        assert np.isfinite(met.t[i]) == (true.t is not None), (o[i], d[i], true)
        if true.t is not None:
            assert abs(met.t[i] - float(true.t)) <= 4 * ULP * float(true.t)


@pytest.mark.parametrize("kind", ["ellipsoid", "cylinder", "cone", "paraboloid"])
def test_tangents(kind):
    """A ray that passes a convex surface at more than 32 ulp of its size is told on which side."""
    rng = np.random.default_rng(4)
    shape = {
        "ellipsoid": put(rt.Sphere(), np.diag([1.0, 2.0, 3.0])),
        "cylinder": rt.Cylinder(),
        "cone": rt.Cone(),
        "paraboloid": quadric_of(1, 1, 0, 0, 0, 0, 0, 0, -1, 0),
    }[kind]
    placed = put(shape, exactly(shape).m[:, :3] @ rotation(rng), (1.0, 2.0, -1.0))
    exact, n = exactly(placed), 400
    o, d = rays_at(rng, exact, n)
    point = probe(placed, o, d)
    i = point.hits[point.face[point.hits] == 0]
    w = np.cross(point.n[i], rng.normal(size=(len(i), 3)))
    w /= np.linalg.norm(w, axis=1, keepdims=True)
    gap = extent(exact) * rng.choice([-1, 1], len(i)) * 10.0 ** -rng.uniform(3, 17, len(i))
    o = point.p[i] + point.n[i] * gap[:, None] - w * rng.uniform(0.5, 3.0, (len(i), 1))
    found = probe(placed, o, w)
    told = 0
    for k in range(len(i)):
        true = first(exact, o[k], w[k])
        if np.isfinite(found.t[k]) == (true.t is not None):
            told += 1
        else:
            assert abs(gap[k]) <= 32 * ULP * (extent(exact) + 3.0)
    assert told > 0.9 * len(i)


# ---- leaving ------------------------------------------------------------------------------------

WELL_CONDITIONED = [name for name in KINDS if name != "pair of planes"]
"""Along one plane of a pair f vanishes all the way: where a ray meets the other one is rounded."""


def leave_of(name, spread, n):
    rng = seeded(name, 5)
    hits = 0
    for shape in KINDS[name]:
        placed = anywhere(rng, shape, spread)
        o, d = rays_at(rng, exactly(placed), n)
        hits += check_leaving(placed, o, d, guides_at(rng, n))
    assert hits > n * len(KINDS[name]) / 5


@pytest.mark.parametrize("name", WELL_CONDITIONED)
@pytest.mark.parametrize("spread", [0.3, 3.0])
def test_leaving(name, spread):
    """Rays that leave towards all sides, most of them grazing, from shapes that are up to 1e6 times
    as long as they are thin."""
    leave_of(name, spread, 250)


@pytest.mark.slow
@pytest.mark.parametrize("name", WELL_CONDITIONED)
@pytest.mark.parametrize("spread", [0.3, 3.0])
def test_leaving_of_many(name, spread):
    leave_of(name, spread, 5000)


def test_leaving_both_of_a_pair_of_planes():
    rng = np.random.default_rng(6)
    for shape in KINDS["pair of planes"]:
        placed = anywhere(rng, shape, 0.3)
        o, d = rays_at(rng, exactly(placed), 2000)
        guides = guides_at(rng, 2000)
        guides[:, 2] = np.copysign(np.maximum(np.abs(guides[:, 2]), 1e-3), guides[:, 2])
        check_leaving(placed, o, d, guides, every=50, ulps=1e5)


def test_leaving_where_two_planes_meet():
    """Next to where f is flat, a surface's error has to grow: |f| does not tell otherwise."""
    rng = np.random.default_rng(16)
    n = 1000
    for capped in (False, True):
        # (x - 1/2)² - (y - 1/4)², off the middle.
        shape = quadric_of(1, -1, 0, 0, 0, 0, -1, 0.5, 0, 0.1875, capped=capped)
        exact = exactly(shape)
        line = np.column_stack([np.full((n, 2), [0.5, 0.25]), rng.uniform(-0.9, 0.9, n)])
        target = line + [[1.0, -1.0, 0.0]] * 10.0 ** -rng.uniform(1, 6, (n, 1))
        o = target + [[0.1, 0.3, 0.06]] * rng.choice([-1.0, 1.0], (n, 1))
        found = probe(shape, o, target - o, guides_at(rng, n))
        curved = found.hits[found.face[found.hits] == 0]
        assert len(curved) > n / 2
        for i in curved:
            f = side(exact, found.o[i])
            assert (f > 0) - (f < 0) == found.side[i]
        d = np.array([[0.25, 0.75, 0.125]])
        found = probe(shape, [[0.5, 0.25, 0.25]] - d * [[0.5], [1.0]], np.tile(d, (2, 1)))
        i = found.face == 0
        assert i.sum() == (0 if capped else 2)
        assert np.array_equal(found.p[i], np.tile([0.5, 0.25, 0.25], (i.sum(), 1)))
        assert (found.error[i] < 1e-6).all()


def test_what_is_convex_is_not_met_again():
    rng = np.random.default_rng(7)
    n = 20_000
    for shape in (*ELLIPSOIDS, KINDS["paraboloid"][1], *KINDS["box"]):
        for spread in (0.3, 3.0):
            placed = anywhere(rng, shape, spread)
            guides = guides_at(rng, n)
            guides[:, 2] = np.abs(guides[:, 2])
            found = probe(placed, *rays_at(rng, exactly(placed), n), guides)
            assert len(found.hits) > n / 4
            # Along the surface, w's rounding decides which side it leaves on.
            outwards = found.hits[found.side[found.hits] > 0]
            assert len(outwards) > 0.8 * len(found.hits)
            assert np.isinf(found.next_t[outwards]).all()


def test_rims_of_thin_ellipsoids():
    """Where a pancake's rim bends within a thousandth of its thickness, or a needle's tip."""
    rng = np.random.default_rng(8)
    n = 300
    for sizes in ((30.0, 30.0, 0.03), (30.0, 0.03, 0.03), (30.0, 1.0, 0.03)):
        turn = rotation(rng)
        placed = put(rt.Sphere(), turn @ np.diag(sizes), rng.uniform(-3.0, 3.0, 3))
        flat = 10.0 ** -rng.uniform(0.0, 6.0, (2, n))
        c, v = rng.normal(size=(2, n, 3))
        c[:, 2], v[:, 2] = c[:, 2] * flat[0], v[:, 2] * flat[1]
        c /= np.linalg.norm(c, axis=1, keepdims=True)
        target = exactly(placed).m[:, 3] + 0.999 * c * sizes @ turn.T
        o = target + 100.0 * v @ turn.T
        assert check_leaving(placed, o, target - o, guides_at(rng, n)) == n


# ---- spans, bounds, coordinates -----------------------------------------------------------------


@BY_NAME
def test_spans(name):
    """All crossings, entering and leaving in turn; the first with t > 0 is the hit."""
    rng = seeded(name, 9)
    for shape in KINDS[name]:
        placed = anywhere(rng, shape, 0.3)
        exact, n = exactly(placed), 60
        if not exact.capped:
            assert not quadric.is_solid(table_of(placed))
            continue
        assert quadric.is_solid(table_of(placed))
        o, d = rays_at(rng, exact, n, (-1.0, 1.0))
        t, face = all_spans(placed, o, d)
        found = probe(placed, o, d)
        for i in range(n):
            true = meetings(exact, o[i], d[i])
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
        lower, upper = quadric.bounds(table_of(placed))
        p = found.p[found.hits]
        assert (p >= lower).all()
        assert (p <= upper).all()


def test_bounds_of_an_ellipsoid_are_tight():
    lower, upper = quadric.bounds(table_of(put(rt.Sphere(radius=0.7), np.diag([1.0, 2.0, 3.0]))))
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
    with pytest.raises(ValueError, match=re.escape(message)):
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


def test_lights_and_solids():
    lamp = {"lamp": rt.Emissive(radiance=1)}
    sphere = put(rt.Sphere(material="lamp"), np.diag([1.0, 2.0, 3.0]))
    with pytest.raises(SceneError, match="cannot be a light"):
        rt.build_tables(rt.Scene(materials=lamp, shapes=(sphere,)))
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
