"""All kinds of quadrics against rational arithmetic: hits, faces, normals, leaving."""

import itertools
import math

import numpy as np
import pytest
from quadric_checks import (
    ULP,
    anywhere,
    check_against_exact,
    check_leaving,
    guides_at,
    probe,
    put,
    rays_at,
    rotation,
)
from quadric_exact import exactly, extent, first, meetings, side, value
from quadric_kinds import (
    BY_NAME,
    CONVEX,
    ELLIPSOIDS,
    KINDS,
    TURNED,
    open_and_capped,
    quadric_of,
    seeded,
)

import reference_rt as rt

# ---- hits ---------------------------------------------------------------------------------------


def least_hits(name, n):
    """Of n rays at the boxes of each of these shapes."""
    return n * len(KINDS[name]) / (3 if name in TURNED else 5)


def hits_of(name, distance, n):
    rng = seeded(name, 1)
    hits = 0
    # Where two planes meet, f is flat: the cosine alone does not say how well t is known.
    ulps = 512.0 if name == "pair of planes" else 16.0
    for shape in KINDS[name]:
        placed = anywhere(rng, shape, 0.3)
        hits += check_against_exact(placed, *rays_at(rng, exactly(placed), n, distance), ulps)
    assert hits > least_hits(name, n)


@pytest.mark.cases(4)
@BY_NAME
@pytest.mark.parametrize("distance", [(-2.0, 1.0), (3.0, 7.0)])
def test_hits(name, distance):
    hits_of(name, distance, 150)


@pytest.mark.slow
@BY_NAME
@pytest.mark.parametrize("distance", [(-2.0, 1.0), (1.0, 4.0), (3.0, 7.0)])
def test_hits_of_many(name, distance):
    hits_of(name, distance, 2000)


@pytest.mark.cases(4)
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


@pytest.mark.slow
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
    assert hits > least_hits(name, n)


@pytest.mark.cases(3)
@pytest.mark.parametrize("name", WELL_CONDITIONED)
@pytest.mark.parametrize("spread", [0.3, 3.0])
def test_leaving(name, spread):
    """Rays that leave towards all sides, most of them grazing, from shapes that are up to 1e6 times
    as long as they are thin."""
    leave_of(name, spread, 300)


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


@pytest.mark.parametrize("name", CONVEX)
def test_what_is_convex_is_not_met_again(name):
    rng = seeded(name, 7)
    n = 20_000
    for shape in CONVEX[name]:
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
