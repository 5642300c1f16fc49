"""Solids: coincident faces, normals, parts and materials on cut faces, in groups.

F7 of the stability suites has the laws of sets, volumes and films."""

import subprocess
import sys

import numpy as np
import pytest
from builders import cube, write_obj

import reference_rt as rt
from reference_rt.core import transform

TINY = (transform.Scale(scale=(1e-3, 1e-3, 1e-3)), transform.Translate(translate=(0.0, 0.0, -1e6)))
ELSEWHERE = (
    rt.Sphere(transform=TINY),
    rt.Box(transform=TINY),
    rt.Triangle(v0=(0, 0, 0), v1=(1, 0, 0), v2=(0, 1, 0), transform=TINY),
    rt.Box(transform=TINY) - rt.Sphere(transform=TINY),
)
"""Out of the way: scenes have the same kinds of shapes, and share kernels."""


def solid_of(shape, **more):
    return rt.Scene(shapes=(shape, *ELSEWHERE), **more)


def moved(*offset):
    return (transform.Translate(translate=offset),)


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


def test_operators_work_before_a_scene_is_made():
    """In a new process, which has imported nothing else."""
    line = "import reference_rt as rt; print((rt.Box() - rt.Sphere()).type)"
    found = subprocess.run([sys.executable, "-c", line], capture_output=True, text=True, check=True)
    assert found.stdout == "difference\n"


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


def test_a_solid_has_at_most_ten_thousand_operands():
    """Beyond, a ray's walk would not fit into the stack of a thread."""
    balls = [rt.Sphere()] * 10_001
    message = refusal(shapes=(rt.Box(), rt.Union(of=balls)))
    assert message == "shapes[1]: over 10,000 operands; expected fewer in one solid"
    centers = np.random.default_rng(3).uniform(-1.0, 1.0, (3_000, 3)).tolist()
    many = rt.Union(of=[rt.Sphere(center=c, radius=0.02) for c in centers])
    hits = solid_of(many).intersect(np.full((20, 3), -3.0), 3.0 + np.array(centers[:20]))
    assert hits.hit.all()
