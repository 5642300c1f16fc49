"""F3, F4, F5: ours passes, and what is planted is seen."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
import stability_runs

import reference_rt as rt
from comparisons.experiments.stability import watertight
from comparisons.experiments.stability.harness import meshes
from comparisons.experiments.stability.harness.outcomes import OURS, U
from comparisons.experiments.stability.harness.series import Draw, family
from comparisons.experiments.stability.hierarchy import compared
from comparisons.experiments.stability.slivers.judge import DISTANCES, RING, Judge, Question
from comparisons.experiments.stability.watertight import seamed
from comparisons.experiments.stability.watertight.tracers import crossings
from comparisons.referee import columns_of

# Cases have triangles without area on purpose: what a mesh leaves out is no news here.
pytestmark = pytest.mark.filterwarnings("ignore::reference_rt.util.errors.SceneWarning")


def measured(folder, family, series, x, cases, mitsuba=False):
    return stability_runs.measured(family, series, x, folder, cases, mitsuba=mitsuba)


def test_float64_ends_where_the_law_says(tmp_path):
    series = family("F3").by_name["size"]
    assert measured(tmp_path, "F3", "size", series.values[-1], 200)[OURS].failures > 0
    assert "2^1024" in series.law


@pytest.mark.parametrize("mesh", [meshes.ball(1), meshes.cube(3), meshes.knot(), None])
def test_meshes_are_closed(mesh):
    """Every edge belongs to two triangles, once in each direction; volumes are positive."""
    mesh = meshes.noisy(np.random.default_rng(0)) if mesh is None else mesh
    pairs = np.concatenate([mesh.faces[:, [k, (k + 1) % 3]] for k in range(3)])
    assert len(np.unique(pairs, axis=0)) == len(pairs)
    assert {tuple(p) for p in pairs.tolist()} == {tuple(p[::-1]) for p in pairs.tolist()}
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    assert np.einsum("ij,ij", a, np.cross(b, c)) > 0
    assert len(meshes.edges(mesh)) * 2 == len(pairs)
    assert len(np.unique(mesh.vertices, axis=0)) == len(mesh.vertices)


def _faces_in_place_of(folder, faces):
    """What is found of a ball with other faces."""
    whole = meshes.ball(2)
    mesh = meshes.Closed("ball", whole.vertices, faces(whole.faces), whole.insides)
    made = Draw(np.random.default_rng(1), 0, False, folder)
    return watertight._measure(made, mesh, 4000, 1.0, others=False)[OURS]


def test_a_hole_is_seen(tmp_path):
    """Of a mesh that lacks a triangle: rays leak, and their crossings do not add up."""
    found = _faces_in_place_of(tmp_path, lambda faces: faces[1:])
    assert found.failures > 10
    assert {e["expected"] for e in found.examples} <= {
        "a hit",
        "crossings, one more out than in",
        "crossings, as many in as out",
    }


def test_an_inside_out_triangle_is_seen(tmp_path):
    def turned(faces):
        return np.concatenate([faces[:7], faces[7:8, ::-1], faces[8:]])

    assert _faces_in_place_of(tmp_path, turned).failures > 0


def test_crossings_of_a_cube(tmp_path):
    """Closed form: a line along x through the cube goes in once and out once."""
    file = meshes.write(*_parts(meshes.cube(4)), tmp_path / "cube.ply")
    tables = rt.build_tables(rt.Scene(shapes=(rt.Mesh(file=str(file)),), hierarchy="sah"))
    o = np.array([[-3.0, 0.1, 0.3], [0.0, 0.1, 0.3], [3.0, 0.1, 0.3], [-3.0, 0.5, -0.5]])
    number, balance = crossings(tables, o, np.tile([1.0, 0.0, 0.0], (4, 1)))
    assert number.tolist() == [2, 1, 0, 2]
    assert balance.tolist() == [0, -1, 0, 0]


def _parts(mesh):
    return mesh.vertices, mesh.faces


def test_seams_of_something_else_are_seen():
    """Rays that hit nothing, or another shape than they start in."""
    case = seamed.drawn(np.random.default_rng(0), ("box", "sphere"), 1.0, 50)
    shape = case.whose.copy()
    shape[3], shape[70] = -1, 0
    found = seamed.judged(case, SimpleNamespace(shape=shape, t=np.full(100, math.inf)))
    assert (found.cases, found.failures) == (100, 2)
    assert found.examples[1]["found"] == "shape 0 at t = inf"


# ---- slivers ------------------------------------------------------------------------------------

SQUARE = {"vertices": np.array([[-1.0, -1.0, 0.0, 1.0, -1.0, 0.0, 0.0, 1.0, 0.0]])}


def _question(o, d):
    return Question("triangles", SQUARE, np.array(o, float), np.array(d, float), 2.0)


def test_what_is_wrong_is():
    """A hit as a miss, a miss as a hit, another t; float32's rounding of t is not."""
    o = [[0.0, 0.0, 3.0]] * 5 + [[4.0, 0.0, 3.0]] * 2
    judge = Judge(_question(o, [[0.0, 0.0, -1.0]] * 7))
    t = np.array([3.0, float(np.float32(3.0000001)), math.inf, 2.9, 12291.2, math.inf, 3.0])
    assert judge.wrong(t).tolist() == [False, False, True, True, True, False, True]
    found = judge.outcome(t)
    assert (found.cases, found.failures) == (7, 4)
    assert found.examples[0]["found"] == "inf"


def test_rounding_of_the_border_is_granted():
    """Beside an edge by less than the band, either answer is right; by more, one is."""
    beside = np.array([-1e-16, 1e-16, -1e-12, 1e-12])
    o = np.stack([np.zeros(4), -1.0 + beside, np.full(4, 3.0)], axis=1)
    judge = Judge(_question(o, [[0.0, 0.0, -1.0]] * 4))
    assert 1e-16 < judge.question.band < 1e-12
    assert judge.wrong(np.full(4, 3.0)).tolist() == [False, False, True, False]
    assert judge.wrong(np.full(4, math.inf)).tolist() == [False, False, False, True]


def test_moved_rays_are_the_band_away():
    question = _question([[0.0, 0.3, 3.0]], [[0.2, -0.1, -1.0]])
    o, d = question.moved(np.array([0]))
    assert len(o) == RING
    away = np.cross(o - question.o[0], d / np.linalg.norm(d, axis=1, keepdims=True))
    # Coordinates of 3 round by 2 u each, the band is 144 u times 4.
    np.testing.assert_allclose(np.linalg.norm(away, axis=1), question.band, atol=8 * U)


@pytest.mark.parametrize("kind", ["rectangles", "disks", "boxes"])
def test_distances_of_other_shapes(kind):
    """From a unit shape: a point 0.25 beside it, one 0.25 off it, one on it."""
    shape = {"rectangles": rt.Rectangle(), "disks": rt.Disk(), "boxes": rt.Box()}[kind]
    row = columns_of(getattr(rt.build_tables(rt.Scene(shapes=(shape,))).geometry.shapes, kind))
    top = 1.0 if kind == "boxes" else 0.0
    p = np.array([[1.25, 0.0, 0.0], [0.5, 0.0, top + 0.25], [1.0, 0.0, top]], np.longdouble)
    assert DISTANCES[kind](row, p).tolist() == [0.25, 0.25, 0.0]


# ---- hierarchies --------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_box_that_is_too_small_is_seen(tmp_path, monkeypatch):
    """Planes of boxes moved inwards by a millionth: rays in them miss what they hold."""
    honest = compared.rt.build_tables

    def damaged(scene):
        tables = honest(scene)
        upper = tables.geometry.bvh.boxes[:, 24:48]
        upper[upper < 10.0] -= np.float32(1e-6)
        return tables

    monkeypatch.setattr(compared.rt, "build_tables", damaged)
    assert measured(tmp_path, "F5", "primitives", 100.0, 2000)[OURS].failures > 0


def test_of_several_at_one_place_the_first_counts():
    """Closed form: three triangles in one place, in front of others."""
    near = (rt.Triangle(v0=(-1, -1, 0), v1=(3, -1, 0), v2=(-1, 3, 0)),) * 3
    far = (rt.Triangle(v0=(-9, -9, -1), v1=(9, -9, -1), v2=(0, 9, -1)),) * 2
    tables = rt.build_tables(rt.Scene(shapes=far + near, hierarchy="sah"))
    o = np.array([[0.0, 0.0, 2.0], [-2.0, 0.0, 2.0], [0.0, 0.0, 2.0]])
    d = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, -1.0], [0.0, 0.0, 1.0]])
    found = compared.named(tables, compared.every(tables, o, d))
    assert found[:, :4].tolist() == [
        [2.0, 3.0, 2.0, 0.0],
        [3.0, 3.0, 0.0, 0.0],
        [np.inf, -1, -1, -1],
    ]
