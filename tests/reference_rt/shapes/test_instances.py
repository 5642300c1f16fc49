"""Instances: stored once, drawn many times, as if each copy stood there by itself."""

import numpy as np
import pytest
from builders import icosphere, placed
from placed_shapes import random_map

import reference_rt as rt
from reference_rt.core import transform


def moved(*offset):
    return (transform.Translate(translate=offset),)


def test_as_if_each_stood_there():
    """Copies under maps that shear, stretch and mirror, against the same shapes with composed
    maps; normals of vertices and texture coordinates too."""
    rng = np.random.default_rng(4)
    vertices, faces = (np.array(a) for a in icosphere(1))
    # All alike: else their lengths, under a map that stretches, weigh in one of the two.
    normals = np.tile([0.0, 0.6, 0.8], (len(vertices), 1))
    arrays = {"vertices": vertices, "faces": faces, "normals": normals, "uv": vertices[:, :2]}
    shapes = (
        rt.Mesh(**arrays, transform=moved(0.0, 0.0, 1.5)),
        rt.Box(transform=placed(rng, 0.5, 1.0)),
        rt.Rectangle(transform=moved(0.0, 1.5, 0.0)),
    )
    maps = [(random_map(rng, 0.3, 4.0),) for _ in range(6)]
    drawn = rt.Scene(
        groups={"g": shapes}, shapes=tuple(rt.Instance(group="g", transform=m) for m in maps)
    )
    baked = [s.model_copy(update={"transform": (*s.transform, *m)}) for m in maps for s in shapes]
    o = rng.uniform(-8.0, 8.0, (8000, 3))
    d = rng.uniform(-4.0, 4.0, (8000, 3)) - o
    one, two = drawn.intersect(o, d), rt.Scene(shapes=tuple(baked)).intersect(o, d)
    hit = one.hit & two.hit
    assert (one.hit != two.hit).sum() <= 1  # an edge
    assert hit.sum() > 800
    assert np.array_equal(one.shape[hit] * len(shapes) + one.part[hit], two.shape[hit])
    assert np.array_equal(one.primitive[hit], two.primitive[hit])
    assert (one.instance[hit] == 0).all()
    # Maps of condition below 16: some hundred roundings of numbers up to 20.
    for name in ("p", "n", "ns", "uv"):
        a, b = getattr(one, name)[hit], getattr(two, name)[hit]
        np.testing.assert_allclose(a, b, rtol=0, atol=16 * 100 * 20 * 2.0**-53, err_msg=name)


def test_groups_of_groups():
    """Three levels of ten: a thousand copies, numbered, where they belong."""
    ten = {
        "ball": (rt.Sphere(radius=0.3),),
        "row": tuple(rt.Instance(group="ball", transform=moved(float(i), 0, 0)) for i in range(10)),
        "sheet": tuple(
            rt.Instance(group="row", transform=moved(0, float(i), 0)) for i in range(10)
        ),
        "cube": tuple(
            rt.Instance(group="sheet", transform=moved(0, 0, float(i))) for i in range(10)
        ),
    }
    scene = rt.Scene(groups=ten, shapes=(rt.Instance(group="cube"),))
    assert len(scene.tables.geometry.instances.root) == 1000
    at = np.array([(x, y, z) for z in range(10) for y in range(10) for x in range(10)], float)
    o = at + np.array([0.5, 0.0, 0.0])
    hits = scene.intersect(o, np.tile([-1.0, 0.0, 0.0], (1000, 1)))
    np.testing.assert_allclose(hits.t, 0.2, rtol=1e-14)
    assert hits.instance.tolist() == list(range(1000))
    assert (hits.shape == 0).all()
    assert len(scene.tables.geometry.shapes.spheres.radius) == 1


def matrices(count, seed=5):
    rng = np.random.default_rng(seed)
    return np.array([transform.affine(placed(rng, 0.5, 3.0)) for _ in range(count)])


@pytest.mark.parametrize("rows", [3, 4])
def test_copies_of_a_file_are_instances(tmp_path, rows):
    """Under another transform and inside of a group too."""
    maps, outer = matrices(7), placed(np.random.default_rng(6), 0.5, 2.0)
    full = np.concatenate([maps, np.tile([0.0, 0.0, 0.0, 1.0], (7, 1, 1))], axis=1)
    np.save(tmp_path / "copies.npy", full[:, :rows])

    def scene(many):
        ball, group = (rt.Sphere(radius=0.3), rt.Box(transform=moved(1.0, 0.0, 0.0))), "ball"
        one = [
            rt.Instance(group=group, transform=(transform.Matrix(matrix=m.tolist()), *outer))
            for m in maps
        ]
        every = [rt.Instance(group=group, file="copies.npy", transform=outer)]
        found = rt.Scene(
            groups={"ball": ball, "all": tuple(every if many else one)},
            shapes=(*(every if many else one), rt.Instance(group="all", transform=outer)),
        )
        found._folder = tmp_path
        return found.tables.geometry

    geometry, expected = scene(True), scene(False)
    assert len(expected.instances.root) == 14
    # Three maps of condition below 16, some ten roundings each.
    limit = 16**3 * 30 * 2.0**-53
    for name in ("center", "to_local", "edges"):
        one, other = getattr(geometry.instances, name), getattr(expected.instances, name)
        np.testing.assert_allclose(one, other, rtol=0, atol=limit * np.abs(other).max())
    assert geometry.instances.root.tolist() == expected.instances.root.tolist()
    assert geometry.instances.owner.tolist() == [0] * 7 + [1] * 7
    assert geometry.instances.copy.tolist() == [*range(7)] * 2


def damaged(content):
    return lambda path: path.write_bytes(content)


def saved(array):
    return lambda path: np.save(path, array)


@pytest.mark.parametrize(
    ("write", "said"),
    [
        (lambda path: None, "cannot be read: No such file"),
        (damaged(b""), "cannot be read"),
        (damaged(b"\x93NUMPY\x01\x00v\x00{'descr'"), "cannot be read"),
        (saved(np.array([{}])), "cannot be read"),
        (saved(np.zeros((3, 4))), r"has float64 \(3, 4\); expected a .npy file of matrices"),
        (saved(np.zeros((2, 3, 3))), r"has float64 \(2, 3, 3\)"),
        (saved(np.zeros((2, 3, 4), complex)), "has complex128"),
        (saved(np.zeros((0, 3, 4))), "has no matrices"),
        (saved(np.ones((2, 4, 4))), "whose last rows are 0 0 0 1"),
        (saved(np.stack([np.eye(3, 4), np.ones((3, 4))])), "matrix 1: the transform is singular"),
        (saved(np.full((1, 3, 4), np.inf)), "matrix 0: the transform is singular"),
    ],
)
def test_files_that_are_refused(tmp_path, write, said):
    write(tmp_path / "copies.npy")
    copies = "{type: instance, group: g, file: copies.npy}"
    text = f"groups:\n  g: [{{type: sphere}}]\nshapes:\n  - {copies}\n"
    scene = rt.Scene.parse(text, "s.yaml", tmp_path)
    with pytest.raises(rt.SceneError, match=f"s.yaml:4: shapes\\[0\\]: .*{said}"):
        _ = scene.tables


def test_more_copies_than_fit_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("reference_rt.scene.build_geometry.MOST_INSTANCES", 20)
    np.save(tmp_path / "copies.npy", matrices(5))
    copies = rt.Instance(group="b", file="copies.npy")
    groups = {"b": (rt.Sphere(),), "c": (copies,), "d": (copies.model_copy(update={"group": "c"}),)}
    scene = rt.Scene(groups=groups, shapes=(rt.Instance(group="d"),))
    scene._folder = tmp_path
    with pytest.raises(rt.SceneError, match="over 20 copies"):
        _ = scene.tables


def test_refusals():
    def message(**parts):
        with pytest.raises(rt.SceneError) as caught:
            rt.build_tables(rt.Scene(**parts))
        return str(caught.value)

    ball = (rt.Sphere(),)
    assert message(shapes=(rt.Instance(group="x"),), groups={"g": ball}) == (
        "shapes[0].group: there is no group 'x'; expected one of: 'g'"
    )
    loop = {"a": (rt.Instance(group="b"),), "b": (rt.Instance(group="a"),)}
    assert "contains itself: a -> b -> a" in message(shapes=(rt.Instance(group="a"),), groups=loop)
    flat = (transform.Scale(scale=(1.0, 0.0, 1.0)),)
    assert "flattens space" in message(
        shapes=(rt.Instance(group="g", transform=flat),), groups={"g": ball}
    )
    lamp = {"lamp": rt.Emissive(radiance=(1, 1, 1))}
    assert "materials of its group" in message(
        shapes=(rt.Instance(group="g", material="lamp"),), groups={"g": ball}, materials=lamp
    )
