"""Every kind of shape against the exact referee of `comparisons`: hits, crossings, rims."""

import itertools
import math

import numpy as np
import pytest
from builders import U, random_turn, unit_vectors
from drivers import probe_one, spans_of
from placed_shapes import Placed, anywhere, lattice_rays, put, random_map
from quadric_kinds import KINDS as QUADRICS

import reference_rt as rt
from comparisons.geometry.exact.dyadic import NEVER, nearest
from comparisons.referee import all_hits
from reference_rt.core import transform
from reference_rt.core.ray import Ray
from reference_rt.core.vec3 import Vec3

STAR = ((0.0, 1.0), (0.6, -0.8), (-1.0, 0.3), (1.0, 0.3), (-0.6, -0.8))
HOLE = ((0.1, 0.1), (0.2, -0.1), (-0.2, -0.2))
FILLS = ("even_odd", "nonzero")
SHAPES = {
    "sphere": [rt.Sphere(center=(0.3, -0.2, 0.7), radius=1.7)],
    "rectangle": [rt.Rectangle()],
    "disk": [rt.Disk()],
    "plane": [rt.Plane()],
    "triangle": [rt.Triangle(v0=(-1, -1, 0), v1=(1, -0.8, 0.3), v2=(0.1, 1, -0.2))],
    "polygon": [rt.Polygon(rings=(STAR, HOLE), fill=fill) for fill in FILLS],
    "box": [rt.Box()],
    "torus": [rt.Torus(minor_radius=minor) for minor in (0.01, 0.25, 0.9)],
    **QUADRICS,
}
FLAT = ("rectangle", "disk", "plane", "triangle", "polygon", "box")
BY_NAME = pytest.mark.parametrize("name", SHAPES)


def seeded(name, *more):
    return np.random.default_rng([list(SHAPES).index(name), *more])


# ---- hits, crossings, rims ----------------------------------------------------------------------


def check_hits(name, placed, o, d, bend=256.0):
    """Hit or miss and the face are the exact ones; t, point and normal to roundings, as seen head
    on; the normal is on the side that the ray enters from; the point is in the bounds, and on the
    surface to within the error that it names.  A shift along the surface turns the normal by shift
    / radius of curvature, size / `bend` at least."""
    # Where two planes meet, f is flat: the cosine alone does not say how well t is known.
    ulps = 512.0 if name == "pair of planes" else 16.0
    found, true = placed.probe(o, d), placed.first(o, d)
    assert np.array_equal(np.isfinite(found.t), np.isfinite(true.t))
    i = np.flatnonzero(np.isfinite(true.t))
    assert np.array_equal(found.face[i], true.code[i])
    o, d, t, p, error = o[i], d[i], true.t[i], found.p[i], found.error[i]
    speed, n = np.linalg.norm(d, axis=1), placed.normals(o, d, true.code[i])
    cosine = np.abs(np.sum(n * d, axis=1)) / speed
    shift = ulps * 2.0 * U * (t * speed + placed.reach) / cosine
    assert (np.abs(found.t[i] - t) * speed <= shift).all()
    off = p - (o + t[:, None] * d)
    assert (np.linalg.norm(off, axis=1) <= 4.0 * shift).all()
    # o + t d itself is rounded.
    rounding = 4.0 * U * (np.abs(o).max(axis=1) + placed.reach)
    assert (np.abs(np.sum(off * n, axis=1)) <= error + rounding).all()
    largest = placed.reach + np.abs(p).max(axis=1)
    assert (error <= 512.0 * U * largest / np.minimum(1.0, cosine * 1e6)).all()
    crossings = all_hits(placed.field, placed.row, o, d)
    first = np.where(crossings.t > 0, crossings.t, NEVER).argmin(axis=1)
    enters = crossings.enters[np.arange(len(o)), first]
    n *= np.where(enters, -1.0, 1.0)[:, None] * np.sign(np.sum(n * d, axis=1, keepdims=True))
    turned = found.n[i] - n
    limit = bend / 16.0 * shift / placed.size * (name not in FLAT) + 16.0 * U / cosine
    assert (np.linalg.norm(turned, axis=1) <= limit).all()
    assert (placed.lower <= p).all()
    assert (p <= placed.upper).all()
    return len(i)


@BY_NAME
@pytest.mark.parametrize("distance", [(-2.0, 1.0), (3.0, 7.0)])
def test_hits(name, distance):
    rng, hits = seeded(name, 1), 0
    for shape in SHAPES[name]:
        placed = Placed(anywhere(rng, shape))
        hits += check_hits(name, placed, *placed.rays(rng, 150, distance))
    assert hits > 150 * len(SHAPES[name]) / 20


@pytest.mark.parametrize(
    "sizes", [(1e3, 1.0, 1e-3), (1e3, 1e3, 1e-3), (1e3, 1e-3, 1e-3), (1e-3, 1e-3, 1e3)]
)
@pytest.mark.parametrize("name", ["ellipsoid", "elliptic cylinder", "saddle", "double cone"])
def test_hits_of_the_stretched(name, sizes):
    """Points stay where the ray meets them, though the surface is 1e6 times as long as thin."""
    rng = seeded(name, 17)
    for shape in SHAPES[name]:
        turn = random_turn(rng)
        placed = Placed(put(shape, turn @ np.diag(sizes), rng.uniform(-3.0, 3.0, 3)))
        check_hits(name, placed, *placed.rays(rng, 60, (0.0, 1.0)), bend=1e9)


def test_normals_of_slivers_are_perpendicular_to_their_edges():
    """To a few roundings, however thin; by plain products they are off by 1e-4 at 1e-12."""
    rng = np.random.default_rng(23)
    for height in (1e-2, 1e-6, 1e-12):
        a, b, up = rng.uniform(-1, 1, (3, 3))
        v = np.array([a, b, a + (b - a) * 0.3 + up * height])
        placed = Placed(rt.Triangle(v0=tuple(v[0]), v1=tuple(v[1]), v2=tuple(v[2])))
        middle = v.mean(axis=0)
        toward = np.cross(b - a, up)
        found = placed.probe([middle + toward], [-toward])
        if np.isfinite(found.t[0]):
            edge = (b - a) / np.linalg.norm(b - a)
            assert abs(found.n[0] @ edge) <= 8 * U


@BY_NAME
def test_rims(name):
    """Rays at rims and silhouettes, off by 1e-3 to 1e-17: what they hit is what an exact ray does
    that is moved across by no more than 16 ulp of the largest coordinate."""
    rng = seeded(name, 2)
    for shape in SHAPES[name] if name != "plane" else ():
        placed = Placed(anywhere(rng, shape))
        o, d = placed.rays(rng, 600, (0.0, 2.0))
        found = placed.probe(o, d)
        inside, missed = np.flatnonzero(np.isfinite(found.t)), np.flatnonzero(np.isinf(found.t))
        # From origins of misses towards points of hits: between the two there is a rim.
        k = rng.choice(missed, 200)
        o, low, high = o[k], found.p[rng.choice(inside, 200)], (o + d)[k]
        seen = np.isfinite(placed.probe(o, low - o).t)
        assert seen.sum() > 50
        o, low, high = o[seen], low[seen], high[seen]
        way = (high - low) / np.linalg.norm(high - low, axis=1, keepdims=True)
        for _ in range(60):
            middle = (low + high) / 2
            hit = np.isfinite(placed.probe(o, middle - o).t)[:, None]
            low, high = np.where(hit, middle, low), np.where(hit, high, middle)
        gap = 10.0 ** -rng.uniform(3.0, 17.0, (len(o), 1)) * rng.choice([-1.0, 1.0], (len(o), 1))
        d = low + way * gap * placed.reach - o
        found = placed.probe(o, d).t
        right = np.zeros(len(o), bool)
        band = 32.0 * U * (np.abs(o).max(axis=1, keepdims=True) + placed.reach)
        side = np.cross(d, way)
        side /= np.linalg.norm(side, axis=1, keepdims=True)
        up = np.cross(d, side) / np.linalg.norm(d, axis=1, keepdims=True)
        for across in (0.0 * up, up, -up, side, -side):
            right |= np.isfinite(placed.first(o + band * across, d).t) == np.isfinite(found)
        assert right.all()


@BY_NAME
def test_crossings(name):
    """All crossings of a solid, entering and leaving in turn; the first with t > 0 is the hit."""
    rng = seeded(name, 3)
    for shape in SHAPES[name]:
        placed = Placed(anywhere(rng, shape))
        if not placed.is_solid:
            with pytest.raises(rt.SceneError, match=r"shapes\[0\]: operand 1"):
                rt.build_tables(rt.Scene(shapes=(rt.Box() - shape,)))
            continue
        o, d = placed.rays(rng, 100, (-1.0, 1.0))
        t = spans_of(rt.Scene(shapes=(placed.shape,)), o, d)
        true = nearest(all_hits(placed.field, placed.row, o, d).t)
        expected = np.full((100, 4), math.inf)
        expected[:, : true.shape[1]] = true[:, :4]
        if placed.field == "planes":  # what is below goes on for ever
            t = np.where(np.isfinite(t), t, math.inf)
            t.sort(axis=1)
        assert np.allclose(t, expected, rtol=1e-9)
        ahead = np.where(t > 0.0, t, math.inf).min(axis=1)
        assert np.array_equal(placed.probe(o, d).t, ahead)


# ---- lattices, on which float64 is exact --------------------------------------------------------

NOTCHED = (((0, 0), (4, 0), (4, 4), (2, 1), (0, 4)), ((1, 1), (3, 1), (2, 3)))
LATTICES = {
    "rectangle": [rt.Rectangle()],
    "disk": [rt.Disk()],
    "plane": [rt.Plane()],
    "polygon": [rt.Polygon(rings=NOTCHED, fill=fill) for fill in FILLS],
    "box": [rt.Box()],
    "sphere": [rt.Sphere(radius=2.0)],
    "ellipsoid": [rt.Sphere(transform=({"scale": [1.0, 2.0, 0.5]},))],
    "cylinder": [rt.Cylinder(), rt.Cylinder(capped=False, z_min=-0.5)],
    "cone": [rt.Cone(), rt.Cone(capped=False), rt.Cone(top_radius=0.5)],
    **{name: QUADRICS[name] for name in ("saddle", "pair of planes", "double cone")},
}


@pytest.mark.parametrize("name", LATTICES)
def test_on_a_lattice(name):
    """Along faces, in their planes, through rims, edges and corners, with either zero: rims belong
    to the shape.  Where a ray touches a quadric, or runs along a face of its box, the referee
    leaves it open; what is hit there lies on the surface."""
    for shape in LATTICES[name]:
        placed = Placed(shape)
        o, d = lattice_rays(3)
        if placed.field == "quadrics":
            o = 0.5 * o
        found, true = placed.probe(o, d), placed.first(o, d)
        open_here = true.touching & (placed.field == "quadrics")
        hit = np.isfinite(found.t)
        assert hit[np.isfinite(true.t)].all()
        assert np.isinf(found.t[np.isinf(true.t) & ~open_here]).all()
        decided = hit & ~open_here
        assert np.allclose(found.t[decided], true.t[decided], rtol=8 * U, atol=0.0)
        if placed.field == "quadrics":
            check_on_surface(placed.row, found, np.flatnonzero(hit))


def check_on_surface(row, found, hits):
    """f is 0 on face 0, elsewhere not positive on a plane of the box; all is within the box."""
    q = (found.p[hits] - row["center"]) @ row["to_local"].reshape(3, 3).T
    x, y, z = q.T
    f = row["coefficients"][0] @ [x * x, y * y, z * z, x * y, y * z, z * x, x, y, z, x**0]
    lower, upper = row["lower"][0], row["upper"][0]
    slack = 64.0 * U
    face = found.face[hits].astype(int)
    assert (np.where(face == 0, np.abs(f), f) <= slack).all()
    ends = np.concatenate([lower, upper])
    cap = face > 0
    axis = (face[cap] - 1) % 3
    assert (np.abs(q[cap, axis] - ends[face[cap] - 1]) <= slack).all()
    outside = np.maximum(lower - q, q - upper) * row["clipped"][0]
    assert (outside <= slack).all()


def test_triangles_on_a_lattice():
    """A ray on an edge or a corner is where it would be moved by (h, h²), across the axes other
    than the largest of d, in cyclic order; swapped where that is negative.  Whatever the winding;
    rays in the triangle's plane miss."""
    h = 1e-5
    o, d = lattice_rays(3)
    for corners in itertools.permutations([(-1, -1, 0), (2, -1, 0), (-1, 2, 0)]):
        found = Placed(rt.Triangle(**dict(zip(("v0", "v1", "v2"), corners, strict=True)))).probe(
            o, d
        )
        largest = np.argmax(np.abs(d) == 1.0, axis=1)
        rows = np.arange(len(o))
        backwards = d[rows, largest] < 0
        moved = o.copy()
        moved[rows, (largest + 1 + backwards) % 3] += h
        moved[rows, (largest + 2 - backwards) % 3] += h * h
        with np.errstate(all="ignore"):
            x, y, _ = (moved - d * (moved[:, 2:] / d[:, 2:])).T
            t = -o[:, 2] / d[:, 2]
            inside = (d[:, 2] != 0) & (t > 0) & (x > -1) & (y > -1) & (x + y < 1)
        # The area is 9: dividing by it rounds, once for 1/9 and once for its product.
        assert np.allclose(found.t, np.where(inside, t, np.inf), rtol=2 * U, atol=0)


# ---- maps, scales, what is no ray ---------------------------------------------------------------


@BY_NAME
def test_a_map_takes_hits_along(name):
    """And faces and texture coordinates; normals by its inverse transpose, mirrored or not."""
    rng = seeded(name, 4)
    for shape in SHAPES[name]:
        one, two = Placed(shape), Placed(shape.model_copy(update={"transform": (random_map(rng),)}))
        m = transform.affine(two.shape.transform)
        o, d = one.rays(rng, 300, (-1.0, 1.0))
        before, after = one.probe(o, d), two.probe(transform.apply_points(m, o), d @ m[:, :3].T)
        i = np.isfinite(before.t)
        assert i.sum() > 20
        assert np.array_equal(i, np.isfinite(after.t))
        assert np.array_equal(before.face[i], after.face[i])
        for field, limit in (("t", 0.0), ("u", 1e-9), ("v", 1e-9)):
            a, b = getattr(before, field)[i], getattr(after, field)[i]
            assert np.allclose(a, b, rtol=1e-8, atol=limit), field
        n = before.n[i] @ np.linalg.inv(m[:, :3])
        assert np.allclose(after.n[i], n / np.linalg.norm(n, axis=1, keepdims=True), atol=1e-7)


@BY_NAME
@pytest.mark.parametrize("sign", [-1, 1])
def test_scales(name, sign):
    """Nothing overflows: the area of flat shapes, and the volume of boxes, have to be float64s."""
    rng = seeded(name, 5)
    for shape in SHAPES[name]:
        one = Placed(shape)
        scale = 10.0 ** (sign * (60 if name in FLAT else 130))
        larger = transform.Scale(scale=(scale,) * 3)
        two = Placed(shape.model_copy(update={"transform": (larger,)}))
        o, d = one.rays(rng, 100, (-1.0, 1.0))
        d /= np.linalg.norm(d, axis=1, keepdims=True)
        before, after = one.probe(o, d), two.probe(o * scale, d)
        i = np.isfinite(before.t)
        assert np.array_equal(i, np.isfinite(after.t))
        assert np.allclose(after.t[i] / scale, before.t[i], rtol=1e-10)
        assert np.allclose(after.n[i], before.n[i], atol=1e-8)


@BY_NAME
def test_what_is_not_a_number_meets_nothing(name):
    strange = [math.nan, math.inf, -math.inf, 1e308]
    v = np.array(list(itertools.product([*strange, 0.0, 0.5], repeat=3)))
    for shape in SHAPES[name]:
        placed = Placed(anywhere(seeded(name, 6), shape))
        for d in ([0.3, 0.2, -0.4], [0.0, 0.0, 0.0]):
            found = placed.probe(v, np.tile(d, (len(v), 1)))
            assert not np.isnan(found.t).any()
            assert np.isfinite(v[np.isfinite(found.t)]).all()
        found = placed.probe(np.tile([0.1, 0.2, 0.3], (len(v), 1)), v)
        assert np.isfinite(v[np.isfinite(found.t)]).all()


@pytest.mark.parametrize("name", [name for name in SHAPES if name != "torus"])
def test_plain_python_is_the_same(name):
    """Of a torus see `test_plain_python`: its roots lie in memory that compiled code reserves."""
    rng = seeded(name, 7)
    for shape in SHAPES[name][:1]:
        placed = Placed(anywhere(rng, shape))
        o, d = placed.rays(rng, 20, (-1.0, 1.0))
        w, out = unit_vectors(rng, 20), np.zeros((20, 15))
        with np.errstate(all="ignore"):
            for i in range(20):
                ray = Ray(Vec3(*o[i]), Vec3(*d[i]), math.inf)
                probe_one(placed.tables, placed.kind, 0, ray, Vec3(*w[i]), out[i])
        assert np.array_equal(out, placed.probe(o, d, w).out)
