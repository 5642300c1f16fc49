"""Solids by three ways that share the operands' crossings alone: the renderer, interval lists and
inside tests."""

import math

import numpy as np
import pytest
from builders import icosphere, placed, write_obj

import reference_rt as rt
from reference_rt import textbook
from reference_rt.core import transform

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


def render(solid, o, d, mesh):
    """The renderer's t.  Far away is one shape of each kind: every scene has the same tables."""
    far = transform.Translate(translate=(0.0, 0.0, -1e6))
    steps = (transform.Scale(scale=1e-3), far)
    kinds = (rt.Sphere, rt.Box, rt.Plane, rt.Torus, rt.Cylinder)
    others = [rt.Mesh(file=mesh, transform=steps), *(kind(transform=steps) for kind in kinds)]
    hits = rt.Scene(shapes=(solid, *others)).intersect(o, d)
    return np.where(hits.shape == 0, hits.t, math.inf)


def assert_all_agree(solid, o, d, mesh):
    """Bit for bit, but for rays with two crossings as near as rounding: widths are some 1e-15, so
    that there are fewer than one in a thousand.  Returns t."""
    parameters = textbook.CsgParameters(solid)
    t = render(solid, o, d, mesh)
    for way in WAYS:
        assert np.mean(textbook.intersect(way, parameters, o, d) == t) > 0.999, way
    return t


@pytest.mark.parametrize(
    "depth", [1, 2, 3, 4, *(pytest.param(depth, marks=pytest.mark.slow) for depth in (5, 6))]
)
def test_random_trees(depth, mesh):
    """Laws of sets and coincident faces: F7 of the stability suites."""
    hits = 0
    for seed in range(4):
        solid = random_tree(np.random.default_rng((depth, seed)), depth, mesh)
        hits += np.isfinite(assert_all_agree(solid, *rays((depth, seed)), mesh)).sum()
    assert hits > 0.2 * N


def test_from_inside_of_the_solid(mesh):
    """Cameras within the lens of two spheres, within a hole, and beyond."""
    lens = rt.Sphere(center=(-0.5, 0, 0)) & rt.Sphere(center=(0.5, 0, 0))
    bowl = rt.Sphere() - rt.Sphere(radius=0.5)
    o, d = [(0, 0, 0), (0.3, 0, 0), (0.8, 0, 0)], [(1, 0, 0), (-2, 0, 0), (1, 0, 0)]
    for solid, expected in ((lens, (0.5, 0.4, math.inf)), (bowl, (0.5, 0.4, 0.2))):
        t = assert_all_agree(solid, np.array(o, float), np.array(d, float), mesh)
        np.testing.assert_allclose(t, expected, rtol=1e-15)


# ---- where they fail ----------------------------------------------------------------------------


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
