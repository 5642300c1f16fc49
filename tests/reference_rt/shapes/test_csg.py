"""Solids: the laws of sets, volumes, coincident faces, normals and materials on cut faces."""

import numpy as np
import pytest
from builders import cube, icosphere, placed, unit_vectors, write_obj
from drivers import leave_scene

import reference_rt as rt
from reference_rt.core import transform
from reference_rt.rendering import query

N = 8_000
TINY = (
    transform.Scale(scale=(1e-3, 1e-3, 1e-3)),
    transform.Translate(translate=(0.0, 0.0, -1e6)),
)
ELSEWHERE = (
    rt.Sphere(transform=TINY),
    rt.Box(transform=TINY),
    rt.Triangle(v0=(0, 0, 0), v1=(1, 0, 0), v2=(0, 1, 0), transform=TINY),
    rt.Box(transform=TINY) - rt.Sphere(transform=TINY),
)
"""Out of the way: scenes have the same kinds of shapes, and share kernels."""


def solid_of(shape, **more):
    return rt.Scene(shapes=(shape, *ELSEWHERE), **more)


def rays(seed, n=N, reach=2.5):
    """Through the middle of things, from around and from inside."""
    rng = np.random.default_rng(seed)
    o = rng.uniform(-reach, reach, (n, 3))
    d = rng.uniform(-1.0, 1.0, (n, 3)) - o
    return o, d * 10.0 ** rng.uniform(-2, 2, (n, 1))


def moved(*offset):
    return (transform.Translate(translate=offset),)


def leaf(rng):
    """A sphere or a box somewhere near the origin, turned."""
    if rng.random() < 0.5:
        return rt.Sphere(center=tuple(rng.uniform(-0.7, 0.7, 3)), radius=rng.uniform(0.4, 1.0))
    return rt.Box(transform=placed(rng, 0.6, 0.7))


def assert_same_solid(a, b, seed, allowed=0.0):
    """The same points: t, side and place of every ray but the fraction `allowed`."""
    o, d = rays(seed)
    one, two = (solid_of(s).intersect(o, d) for s in (a, b))
    same = np.isfinite(one.t) == np.isfinite(two.t)
    both = np.isfinite(one.t) & np.isfinite(two.t)
    # The same operands' crossings, computed by the same arithmetic.
    same[both] &= one.t[both] == two.t[both]
    same[both] &= np.all(one.n[both] == two.n[both], axis=1)
    assert np.mean(~same) <= allowed
    return one


def test_a_solid_without_itself_is_empty():
    rng = np.random.default_rng(1)
    for seed in range(3):
        a, b = leaf(rng), leaf(rng)
        o, d = rays(seed)
        for empty in (a - a, (a | b) - (a | b), (a & b) - a, a - (a | b), (a - b) & b):
            assert np.isinf(solid_of(empty).intersect(o, d).t).all()


@pytest.mark.slow
def test_laws_of_sets():
    rng = np.random.default_rng(2)
    for seed in range(4):
        a, b, c = leaf(rng), leaf(rng), leaf(rng)
        hits = [
            assert_same_solid(a | a, a, seed),
            assert_same_solid(a & a, a, seed),
            assert_same_solid(a | b, b | a, seed),
            assert_same_solid(a & b, b & a, seed),
            assert_same_solid((a | b) | c, a | (b | c), seed),
            assert_same_solid((a & b) & c, a & (b & c), seed),
            # De Morgan, inside of c.
            assert_same_solid(c - (a | b), (c - a) & (c - b), seed),
            assert_same_solid(c - (a & b), (c - a) | (c - b), seed),
            assert_same_solid(a & (b | c), (a & b) | (a & c), seed),
            assert_same_solid(a - (b - c), (a - b) | (a & c), seed),
        ]
        assert sum(np.isfinite(h.t).sum() for h in hits) > N / 2


@pytest.mark.cases(2)
@pytest.mark.parametrize("depth", [4, 16, 64])
def test_deep_trees(depth):
    """A box out of which spheres in a row are taken, one difference in the other: as many as
    there are, against the one difference from their union."""
    box = rt.Box(transform=(transform.Scale(scale=(2.0, 0.3, 0.3)),))
    balls = [
        rt.Sphere(center=(x, 0.3, 0.0), radius=0.9 * 2.0 / depth)
        for x in np.linspace(-2.0, 2.0, depth)
    ]
    chain = box
    for ball in balls:
        chain = chain - ball
    both = rt.Difference(of=(box, *balls))
    hits = assert_same_solid(chain, both, 3)
    assert np.isfinite(hits.t).sum() > 200
    nested = balls[0]
    for k, ball in enumerate(balls[1:]):
        nested = rt.Union(of=(ball, nested)) if k % 2 else rt.Difference(of=(ball, nested))
    o, d = rays(4, 10 * N)
    assert np.isfinite(solid_of(nested).intersect(o, d).t).any()


def chords(scene, o, d, most=40):
    """(n,) lengths of the rays inside: leavings minus enterings, the sides by the normals."""
    tables = rt.build_tables(scene)
    total, at, start = np.zeros(len(o)), np.zeros(len(o)), o.copy()
    alive = np.ones(len(o), bool)
    for _ in range(most):
        hits = query.intersect(tables, start, d)
        alive &= np.isfinite(hits.t)
        if not alive.any():
            return total
        step = np.where(alive, hits.t, 0.0)
        at += step
        total += np.where(alive, np.sign(np.sum(hits.n * d, axis=1)) * at, 0.0)
        # 1e-9 of the size: far above rounding, and what is thinner is not missed by the volume.
        at += np.where(alive, 1e-9, 0.0)
        start = o + at[:, None] * d
    raise AssertionError("more crossings than there can be")


def parallel_rays(seed, n, half):
    """Along z over a square of side 2 half."""
    rng = np.random.default_rng(seed)
    o = np.column_stack([rng.uniform(-half, half, (n, 2)), np.full(n, -10.0)])
    return o, np.tile([0.0, 0.0, 1.0], (n, 1))


def test_volumes_of_spheres():
    """Two unit spheres at distance 1: their lens is 5 pi / 12."""
    a, b = rt.Sphere(), rt.Sphere(center=(0.0, 1.0, 0.0))
    lens, ball = 5.0 * np.pi / 12.0, 4.0 * np.pi / 3.0
    o, d = parallel_rays(5, 40_000, 2.5)
    for shape, volume in ((a & b, lens), (a | b, 2 * ball - lens), (a - b, ball - lens)):
        found = chords(solid_of(shape), o, d) * 25.0
        assert abs(found.mean() - volume) < 4.0 * found.std() / np.sqrt(len(found))


@pytest.mark.parametrize("seed", range(3))
def test_volumes_against_another_kernel(seed, tmp_path):
    """Trees of boxes and closed meshes; manifold3d has their exact volume."""
    manifold3d = pytest.importorskip("manifold3d")
    rng = np.random.default_rng(seed)
    vertices, faces = icosphere(1)
    file = str(write_obj(tmp_path / "ball.obj", vertices, faces))

    def operand():
        steps = placed(rng, 0.7, 0.5)
        m = transform.affine(steps)
        v, f = cube(1) if rng.random() < 0.5 else (vertices, faces)
        shape = rt.Box(transform=steps) if len(f) == 12 else rt.Mesh(file=file, transform=steps)
        mesh = manifold3d.Mesh64(transform.apply_points(m, v), f.astype(np.uint64))
        return shape, manifold3d.Manifold(mesh)

    (a, A), (b, B), (c, C), (e, E) = (operand() for _ in range(4))
    shape, solid = ((a | b) - c) & (e | a), ((A + B) - C) ^ (E + A)
    o, d = parallel_rays(6 + seed, 40_000, 3.0)
    found = chords(solid_of(shape), o, d) * 36.0
    assert abs(found.mean() - solid.volume()) < 4.0 * found.std() / np.sqrt(len(found))
    assert solid.volume() > 0.01


@pytest.mark.parametrize("shift", [0.0, 1e-16, -1e-16, 1e-15, -1e-15])
def test_coincident_faces_leave_no_film(shift):
    """Half a box out of a box, turned, their faces the same to within rounding: the other half."""
    turn = transform.Rotate(rotate=transform.Turn(axis=(1.0, 2.0, 3.0), degrees=33.0))
    half = transform.Scale(scale=(0.5, 1.0, 1.0))
    right = transform.Translate(translate=(0.5 + shift, 0.0, 0.0))
    left = transform.Translate(translate=(-0.5 + shift, 0.0, 0.0))
    cut = rt.Box(transform=(turn,)) - rt.Box(transform=(half, right, turn))
    rest = rt.Box(transform=(half, left, turn))
    o, d = rays(7, 4 * N)
    one, two = solid_of(cut).intersect(o, d), solid_of(rest).intersect(o, d)
    assert np.array_equal(np.isfinite(one.t), np.isfinite(two.t))
    hit = np.isfinite(one.t)
    assert hit.sum() > N / 2
    np.testing.assert_allclose(one.n[hit], two.n[hit], atol=1e-14)
    # Along the normal: the shift, and some forty roundings of numbers up to 4.
    apart = (one.t[hit] - two.t[hit]) * np.sum(one.n[hit] * d[hit], axis=1)
    assert np.abs(apart).max() < abs(shift) + 160 * 2.0**-53


def test_touching_boxes_are_one():
    """No wall between two boxes that share a face, seen from inside."""
    pair = rt.Box() | rt.Box(transform=moved(2.0, 0.0, 0.0))
    hits = solid_of(pair).intersect([[0.0, 0.1, 0.2]], [[1.0, 0.0, 0.0]])
    assert hits.t[0] == 3.0
    assert hits.part[0] == 1


def test_first_operand_shows_where_faces_coincide():
    for order in (("red", "blue"), ("blue", "red")):
        boxes = [
            rt.Box(material=name, transform=(transform.Scale(scale=(w, 1.0, 1.0)),))
            for name, w in zip(order, (1.0, 2.0), strict=True)
        ]
        materials = {"red": rt.Diffuse(reflectance=(1, 0, 0)), "blue": rt.Diffuse()}
        scene = solid_of(boxes[0] | boxes[1], materials=materials)
        rng = np.random.default_rng(8)
        o = np.column_stack([rng.uniform(-0.9, 0.9, (1000, 2)), np.full(1000, 5.0)])
        hits = scene.intersect(o, np.tile([0.0, 0.0, -1.0], (1000, 1)))
        assert (hits.part == 0).all()


def test_sides_normals_and_parts():
    """A bowl: outside of the sphere, inside of the hole, the rim; from within the material too."""
    bowl = rt.Sphere() - rt.Sphere(radius=0.5) - rt.Box(transform=moved(0.0, 0.0, 1.0))
    scene = solid_of(bowl)
    o = [[0, 0, -3.0], [0, 0, 3.0], [0.8, 0, 3.0], [0, 0, -0.75], [0, 0, 0]]
    d = [[0, 0, 1.0], [0, 0, -1.0], [0, 0, -1.0], [0, 0, 1.0], [0, 0, -1.0]]
    hits = scene.intersect(o, d)
    np.testing.assert_allclose(hits.t, [2.0, 3.5, 3.0, 0.25, 0.5], rtol=1e-15)
    assert hits.part.tolist() == [0, 1, 2, 1, 1]
    n = [[0, 0, -1], [0, 0, 1], [0, 0, 1], [0, 0, 1], [0, 0, 1]]
    np.testing.assert_allclose(hits.n, n, atol=1e-15)
    assert (hits.shape == 0).all()
    assert scene.occluded(o, d).all()
    assert scene.occluded(o, d, [1.0, 3.0, 4.0, 0.2, 1.0]).tolist() == [
        False, False, True, False, True,
    ]  # fmt: skip


def test_materials_of_operands_or_of_the_whole():
    red, blue = rt.Diffuse(reflectance=(1, 0, 0)), rt.Diffuse(reflectance=(0, 0, 1))
    hole = rt.Sphere(center=(0.0, 0.0, 1.0), radius=0.9, material="blue")
    shape = rt.Difference(of=(rt.Box(), hole), material="red")
    scene = rt.Scene(
        camera=rt.Orthographic(eye=(0, 0, 5), width=1.0),
        film=rt.Film(width=2, height=2),
        integrator=rt.RayCast(),
        materials={"red": red, "blue": blue},
        shapes=(shape,),
    )
    assert (rt.render(scene).colour == (0, 0, 1)).all()
    wide = scene.changed(camera=rt.Orthographic(eye=(0, 0, 5), width=3.9))
    assert (rt.render(wide).colour == (1, 0, 0)).all()


@pytest.mark.slow
def test_leaving_where_faces_coincide():
    """Rays that leave outwards from faces that operands share, or nearly: convex seen from there,
    so that nothing is met; under maps that round the operands' faces apart."""
    rng = np.random.default_rng(9)
    for k in range(4):
        turn = placed(rng, 1.0, 10.0**k)
        small = rt.Box(transform=(transform.Scale(scale=(0.5, 1.0, 1.0)),))
        halves = rt.Box() | small | rt.Box(transform=(transform.Scale(scale=(1.0, 1.0, 0.3)),))
        halves = halves & rt.Box(transform=(transform.Scale(scale=(1.0, 1.0, 1.0)),))
        scene = solid_of(halves.model_copy(update={"transform": turn}))
        m = transform.affine(turn)
        target = transform.apply_points(m, rng.uniform(-1.0, 1.0, (N, 3)))
        o = target + 10.0 * unit_vectors(rng, N)
        again, hit = leave_scene(scene, o, target - o, unit_vectors(rng, N))
        assert hit.all()
        assert np.isinf(again).all()


def test_in_groups_and_under_maps():
    """A solid in a group, drawn twice; its own map and its operands' compose."""
    ring = rt.Box() - rt.Sphere(radius=1.2)
    scene = rt.Scene(
        groups={"ring": (ring,)},
        shapes=tuple(
            rt.Instance(
                group="ring", transform=(transform.Scale(scale=(1.0, 2.0, 1.0)), *moved(x, 0, 0))
            )
            for x in (0.0, 5.0)
        ),
    )
    # Through the hole, whose sphere cuts through all faces, and onto a corner that is left.
    o, d = [[5.0, 0.0, 9.0], [5.9, 1.9, 9.0]], [[0.0, 0.0, -1.0]] * 2
    hits = scene.intersect(o, d)
    assert hits.t.tolist() == [np.inf, 8.0]
    assert hits.shape.tolist() == [-1, 1]


# ---- what is refused ----------------------------------------------------------------------------


def refusal(**parts):
    with pytest.raises(rt.SceneError) as caught:
        rt.build_tables(rt.Scene(**parts))
    return str(caught.value)


def test_operands_must_be_solids(tmp_path):
    message = refusal(shapes=(rt.Sphere() - rt.Rectangle(),))
    assert message == ("shapes[0]: operand 1, a rectangle: it encloses no space; expected a solid")
    vertices, faces = cube(1)
    file = write_obj(tmp_path / "open.obj", vertices, faces[1:])
    message = refusal(shapes=(rt.Sphere() & rt.Mesh(file=str(file)),))
    assert message.startswith("shapes[0]: operand 1, a mesh: ")
    assert "3" in message
    assert "edge" in message
    with pytest.raises(rt.SceneError, match="shapes"):
        rt.Scene.parse("shapes: [{type: union, of: []}]")


def test_yaml_and_python_say_the_same():
    text = """\
shapes:
  - type: intersection
    of:
      - {type: sphere}
      - {type: difference, of: [{type: box}, {type: sphere, radius: 0.5}]}
"""
    scene = rt.Scene.parse(text)
    assert scene.shapes[0] == rt.Sphere() & rt.Box() - rt.Sphere(radius=0.5)
    assert rt.Scene.parse(scene.to_yaml()) == scene
