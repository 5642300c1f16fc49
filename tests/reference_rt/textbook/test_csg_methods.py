"""Solids by three ways that share the operands' crossings alone: the renderer, interval lists and
inside tests."""

import math

import numpy as np
import pytest
from builders import icosphere, placed, write_obj

import reference_rt as rt
from reference_rt import shapes as any_shape
from reference_rt import textbook
from reference_rt.core import transform
from reference_rt.core.ray import Hit, surface_error
from reference_rt.core.vec3 import dot
from reference_rt.jit.kernel import entry_kernel, kernel
from reference_rt.shapes.meshes.watertight import project, shear_of
from reference_rt.textbook import operands
from reference_rt.textbook.method import ray_of

N = 10_000
WAYS = textbook.names("csg")


def rays(seed, n=N, reach=2.5):
    """Through the middle of things, from around and from inside."""
    rng = np.random.default_rng(seed)
    o = rng.uniform(-reach, reach, (n, 3))
    d = rng.uniform(-1.0, 1.0, (n, 3)) - o
    return o, d * 10.0 ** rng.uniform(-2, 2, (n, 1))


@pytest.fixture(scope="module")
def mesh(tmp_path_factory):
    """A closed mesh of 20 triangles."""
    return str(write_obj(tmp_path_factory.mktemp("mesh") / "ball.obj", *icosphere(0)))


def turned(rng, offset):
    """Any rotation and a translation."""
    _, *steps = placed(rng, 1.0, offset)
    return tuple(steps)


def leaf(rng, kind, mesh):
    """A solid somewhere near the origin."""
    if kind == "sphere":
        return rt.Sphere(center=tuple(rng.uniform(-0.7, 0.7, 3)), radius=rng.uniform(0.4, 1.0))
    if kind == "box":
        return rt.Box(transform=placed(rng, 0.6, 0.7))
    if kind == "ellipsoid":
        return rt.Sphere(center=(0.1, -0.2, 0.0), transform=placed(rng, 0.7, 0.7))
    if kind == "mesh":
        return rt.Mesh(file=mesh, transform=placed(rng, 0.8, 0.7))
    if kind == "plane":
        return rt.Plane(transform=turned(rng, 0.7))
    if kind == "torus":
        return rt.Torus(minor_radius=rng.uniform(0.2, 0.6), transform=placed(rng, 0.7, 0.5))
    if kind == "cylinder":
        radius = rng.uniform(0.3, 0.8)
        return rt.Cylinder(radius=radius, z_min=-0.5, transform=placed(rng, 1.0, 0.5))
    if kind == "cone":
        top = rng.choice([0.0, 0.4])
        return rt.Cone(radius=0.8, height=1.3, top_radius=top, transform=placed(rng, 1.0, 0.5))
    # Of two sheets, or inside out: x² + y² - z² below or above 0.1.
    k = rng.choice([-1.0, 1.0])
    return rt.Quadric(
        coefficients=(k, k, -k, 0, 0, 0, 0, 0, 0, -0.1),
        lower=(-1, -0.8, -0.9),
        upper=(0.7, 1, 1),
        capped=True,
        transform=placed(rng, 0.8, 0.5),
    )


KINDS = {
    "sphere": 0.25,
    "box": 0.25,
    "mesh": 0.15,
    "ellipsoid": 0.07,
    "plane": 0.06,
    "torus": 0.07,
    "cylinder": 0.05,
    "cone": 0.05,
    "quadric": 0.05,
}
"""And how often each comes."""


def random_tree(rng, depth, mesh):
    """A tree of exactly this depth, with maps of its own on the way."""
    if depth == 0:
        return leaf(rng, rng.choice(list(KINDS), p=list(KINDS.values())), mesh)
    parts = [random_tree(rng, depth - 1, mesh), random_tree(rng, rng.integers(0, depth), mesh)]
    if rng.random() < 0.2:
        parts.append(leaf(rng, "sphere", mesh))
    order = rng.permutation(len(parts))
    operation = rng.choice([rt.Union, rt.Intersection, rt.Difference])
    steps = turned(rng, 0.2) if rng.random() < 0.3 else ()
    return operation(of=tuple(parts[k] for k in order), transform=steps)


# ---- how near is near ---------------------------------------------------------------------------

MOST = 4
"""Crossings of a line with one of the operands here."""


@kernel
def width(shapes, ray, hit):
    """How far rounding may move a crossing along the ray, in t: the surface's own error and that of
    a point of the ray, over the cosine."""
    point = any_shape.surface(shapes, ray, hit)
    cosine = abs(dot(point.n, ray.d))
    return (point.error + surface_error(ray.o, point.p, 0.0)) / cosine


@entry_kernel
def _of_solid(shapes, kind, o, d, t, w):
    for i in range(len(o)):
        ray = ray_of(o, d, i)
        s = any_shape.spans(shapes, kind, 0, ray)
        t[i, 0], t[i, 1], t[i, 2], t[i, 3] = s.t0, s.t1, s.t2, s.t3
        w[i, 0], w[i, 1], w[i, 2], w[i, 3] = s.u0, s.u1, s.u2, s.u3
        for k in range(MOST):
            if abs(t[i, k]) < math.inf:
                w[i, k] = width(shapes, ray, Hit(t[i, k], kind, 0, w[i, k], 0.0, -1))


@entry_kernel
def _of_mesh(shapes, kind, o, d, t, w):
    for i in range(len(o)):
        ray, n = ray_of(o, d, i), 0
        shear = shear_of(ray)
        for k in range(len(shapes.triangles.owner)):
            seen = project(shapes.triangles.vertices, k, shear)
            if seen.side != 0:
                inverse = 1.0 / (seen.e0 + seen.e1 + seen.e2)
                depth = seen.e0 * seen.a_z + seen.e1 * seen.b_z + seen.e2 * seen.c_z
                t[i, n] = depth * shear.s_z * inverse
                hit = Hit(t[i, n], kind, k, seen.e1 * inverse, seen.e2 * inverse, -1)
                w[i, n] = width(shapes, ray, hit)
                n += 1


def is_clear(tree, o, d):
    """(n,) whether no two crossings on a ray, nor one and its origin, are as near as rounding.

    Twice the sum of their widths: a crossing is known to one, and a point between two must be told
    from either by an inside test, whose rounding is of the same size.
    """
    every = []
    for operand in operands.leaves(tree):
        t, w = np.full((len(o), MOST), math.inf), np.zeros((len(o), MOST))
        crossings = _of_mesh if operand.kind == any_shape.TRIANGLE else _of_solid
        with np.errstate(all="ignore"):
            crossings(operand.shapes, operand.kind, o, d, t, w)
        every.append((t, w))
    # The origin is a crossing without a width.
    every.append((np.zeros((len(o), 1)), np.zeros((len(o), 1))))
    t, w = (np.concatenate(part, axis=1) for part in zip(*every, strict=True))
    order = np.argsort(t, axis=1)
    t, w = (np.take_along_axis(a, order, axis=1) for a in (t, w))
    apart = np.full((len(o), t.shape[1] - 1), math.inf)
    finite = np.isfinite(t[:, 1:]) & np.isfinite(t[:, :-1])
    apart[finite] = (t[:, 1:] - np.where(np.isfinite(t), t, 0.0)[:, :-1])[finite]
    near = apart <= 2.0 * (w[:, 1:] + w[:, :-1])
    # What is behind the ray does not matter.
    return ~np.any(near & (t[:, 1:] >= 0.0), axis=1)


# ---- three ways ---------------------------------------------------------------------------------


def render(solid, o, d, mesh):
    """The renderer's t.  Far away is one shape of each kind: every scene has the same tables."""
    far = transform.Translate(translate=(0.0, 0.0, -1e6))
    steps = (transform.Scale(scale=1e-3), far)
    kinds = (rt.Sphere, rt.Box, rt.Plane, rt.Torus, rt.Cylinder)
    others = [rt.Mesh(file=mesh, transform=steps), *(kind(transform=steps) for kind in kinds)]
    hits = rt.Scene(shapes=(solid, *others)).intersect(o, d)
    return np.where(hits.shape == 0, hits.t, math.inf)


def assert_all_agree(solid, o, d, mesh):
    """Of rays that are clear, bit for bit; returns t, with NaN for the others."""
    parameters = textbook.CsgParameters(solid)
    clear = is_clear(operands.prepare(parameters), o, d)
    t = render(solid, o, d, mesh)
    for way in WAYS:
        assert np.array_equal(textbook.intersect(way, parameters, o, d)[clear], t[clear]), way
    # Widths are some 1e-15: it takes many rays to have two crossings as near.
    assert np.mean(clear) > 0.999
    return np.where(clear, t, math.nan)


def check_random_trees(depth, seeds, mesh):
    hits = 0
    for seed in seeds:
        rng = np.random.default_rng((depth, seed))
        solid = random_tree(rng, depth, mesh)
        o, d = rays((depth, seed))
        hits += np.sum(np.isfinite(assert_all_agree(solid, o, d, mesh)))
    return hits / len(seeds)


@pytest.mark.slow
@pytest.mark.parametrize("depth", range(1, 7))
def test_random_trees(depth, mesh):
    assert check_random_trees(depth, range(4), mesh) > 0.05 * N


@pytest.mark.slow
@pytest.mark.parametrize("depth", range(1, 7))
def test_many_random_trees(depth, mesh):
    assert check_random_trees(depth, range(100, 150), mesh) > 0.05 * N


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_one_operand(kind, mesh):
    """A tree of one, and no tree at all."""
    shape = leaf(np.random.default_rng(1), kind, mesh)
    o, d = rays(1)
    t = assert_all_agree(rt.Union(of=(shape,)), o, d, mesh)
    for way in WAYS:
        found = textbook.intersect(way, textbook.CsgParameters(shape), o, d)
        assert np.array_equal(found[~np.isnan(t)], t[~np.isnan(t)])


def test_from_inside_of_the_solid(mesh):
    """Cameras within the lens of two spheres, within a hole, and beyond."""
    lens = rt.Sphere(center=(-0.5, 0, 0)) & rt.Sphere(center=(0.5, 0, 0))
    bowl = rt.Sphere() - rt.Sphere(radius=0.5)
    o, d = [(0, 0, 0), (0.3, 0, 0), (0.8, 0, 0)], [(1, 0, 0), (-2, 0, 0), (1, 0, 0)]
    for solid, expected in ((lens, (0.5, 0.4, math.inf)), (bowl, (0.5, 0.4, 0.2))):
        t = assert_all_agree(solid, np.array(o, float), np.array(d, float), mesh)
        np.testing.assert_allclose(t, expected, rtol=1e-15)


# ---- laws ---------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS)
def test_nothing_is_left_of_a_solid_without_itself(way, mesh):
    rng = np.random.default_rng(2)
    for seed in range(4):
        a, b = random_tree(rng, 2, mesh), random_tree(rng, 1, mesh)
        o, d = rays(seed)
        for empty in (a - a, (a | b) - (b | a), (a & b) - a, (a - b) & b):
            assert np.isinf(textbook.intersect(way, textbook.CsgParameters(empty), o, d)).all()


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS)
def test_de_morgan(way, mesh):
    rng = np.random.default_rng(3)
    hits = 0
    for seed in range(4):
        a, b, c = (random_tree(rng, 1, mesh) for _ in range(3))
        o, d = rays(seed)
        for one, other in (
            (c - (a | b), (c - a) & (c - b)),
            (c - (a & b), (c - a) | (c - b)),
            (a - (b - c), (a - b) | (a & c)),
        ):
            t, same = (
                textbook.intersect(way, textbook.CsgParameters(solid), o, d)
                for solid in (one, other)
            )
            assert np.array_equal(t, same)
            hits += np.isfinite(t).sum()
    assert hits > N


# ---- where they fail ----------------------------------------------------------------------------


@pytest.mark.slow
def test_coincident_faces_leave_a_film_here_and_none_where_it_renders():
    """A side of a box taken out of it, turned: rays to points in what is gone."""
    turn = transform.Rotate(rotate=transform.Turn(axis=(1.0, 2.0, 3.0), degrees=71.0))
    side = transform.Scale(scale=(0.3, 1.0, 1.0))
    right = transform.Translate(translate=(0.7, 0.0, 0.0))
    cut = rt.Box(transform=(turn,)) - rt.Box(transform=(side, right, turn))
    rng = np.random.default_rng(4)
    o = rng.uniform((1.5, -0.8, -0.8), (3.0, 0.8, 0.8), (N, 3))
    d = rng.uniform((0.45, -0.9, -0.9), (0.9, 0.9, 0.9), (N, 3)) - o
    m = transform.affine((turn,))
    o, d = transform.apply_points(m, o), d @ m[:, :3].T
    # The cut stands at x = 0.4, beyond those points.
    assert np.all(rt.Scene(shapes=(cut,)).intersect(o, d).t > 1.0)
    films = [
        np.mean(textbook.intersect(way, textbook.CsgParameters(cut), o, d) < 1.0) for way in WAYS
    ]
    assert films[0] > 0.2
    assert 0.02 < films[1] < films[0]


def test_open_meshes_and_shapes_without_an_inside_are_refused(mesh, tmp_path):
    vertices, faces = icosphere(0)
    file = str(write_obj(tmp_path / "open.obj", vertices, faces[1:]))
    for solid, expected in (
        (rt.Sphere() - rt.Rectangle(), "a rectangle encloses no space; expected a solid"),
        (rt.Sphere() & rt.Mesh(file=file), "a mesh: it is not closed: 3 edges"),
    ):
        for way in WAYS:
            with pytest.raises(ValueError, match=expected):
                textbook.intersect(way, textbook.CsgParameters(solid), *rays(0, 4))
