"""Which renderer is wrong: faults planted in ours and in Mitsuba's scene are attributed rightly."""

import dataclasses
from typing import Any

import numpy as np
import pytest

from comparisons.mitsuba.backend import scalar
from comparisons.mitsuba.counterpart import trace
from comparisons.referee.referee import Referee
from comparisons.referee.sizes import ShapeSizes
from comparisons.rungs import geometry
from comparisons.rungs.rays.aimed import aimed_rays
from comparisons.rungs.rays.judgement import MOST_JUDGED, judged
from comparisons.rungs.rays.rays import Rays, mixed_rays
from comparisons.translator import load
from reference_rt.rendering import query
from reference_rt.rendering.query import Intersections
from reference_rt.rendering.scene import Scene
from reference_rt.scene.build import build_tables

TEXT = """
camera: {type: perspective, eye: [1, 2, 7], target: [0, 0, 0], fov: 40}
film: {width: 40, height: 30}
integrator: {type: ray_cast}
groups:
  pair: [{type: sphere, radius: 0.4}, {type: box, transform: [{scale: 0.3}, {translate: [0, 1, 0]}]}]
shapes:
  - {type: rectangle, transform: [{scale: 3}, {translate: [0, 0, -1]}]}
  - {type: instance, group: pair, transform: [{scale: [1, -1.4, 1]}, {translate: [1.5, 0, 0]}]}
  - {type: difference, of: [{type: box}, {type: sphere, radius: 1.2}], transform: [{translate: [-1, 0, 0]}]}
  - {type: triangle, v0: [-2, 1.5, 0], v1: [2, 1.5, 0], v2: [0, 2.5, 0.5]}
"""  # noqa: E501


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene.parse(TEXT)


def test_ours_and_exact_arithmetic_agree(scene: Scene) -> None:
    """Every random ray, and every ray that is aimed at an edge."""
    sizes = ShapeSizes(scene)
    tables = build_tables(scene)
    for rays in (mixed_rays(scene, tables, sizes, 200, 1), aimed_rays(tables, sizes, 300, 1)):
        ours = query.intersect(tables, rays.o, rays.d)
        truths = Referee(sizes).decide(rays.o, rays.d)
        right = [truth.agrees(ours, k, 1e-9) for k, truth in enumerate(truths)]
        assert all(right)
        assert np.count_nonzero(ours.shape >= 0) > 100


@pytest.mark.slow
@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ("radius: 1.2", "radius: 1.201"),
        ("radius: 0.4", "radius: 0.401"),
        ("-1.4", "-1.401"),
        ("v1: [2, 1.5, 0]", "v1: [2, 1.501, 0]"),
    ],
)
def test_a_fault_of_ours_is_ours(scene: Scene, right: str, wrong: str) -> None:
    assert TEXT.count(right) == 1
    faulty = Scene.parse(TEXT.replace(right, wrong))
    # Our tables are of another scene than is asked for.
    rung = geometry(scene, build_tables(faulty), load(scene), pixels=300)
    assert rung.status == "differ"
    assert rung.numbers["decided_ours"] > 0
    # But for rays at edges that Mitsuba does get wrong.
    assert rung.numbers["decided_mitsuba"] < 0.2 * rung.numbers["decided_ours"]
    assert "by our fault" in rung.reason
    # And the other way round it is Mitsuba's: too many rays for its rounding.
    rung = geometry(scene, build_tables(scene), load(faulty), pixels=300)
    assert rung.status == "differ"
    assert rung.numbers["decided_ours"] == 0
    assert rung.numbers["decided_mitsuba"] > 0
    assert rung.numbers["mitsuba_wrong"]


@pytest.mark.slow
def test_answers_that_are_made_up_are_seen_through(scene: Scene) -> None:
    sizes = ShapeSizes(scene)
    tables = build_tables(scene)
    referee = Referee(sizes)
    rays = mixed_rays(scene, tables, sizes, 40, 2)
    theirs = trace(load(scene), rays.o, rays.d)
    hit = np.flatnonzero(theirs.shape >= 0)[:30]

    def verdict(ours: Intersections, numbers: Any = hit) -> Any:
        return judged(referee, rays, ours, theirs, numbers)

    ours = query.intersect(tables, rays.o, rays.d)
    assert len(verdict(ours).undecided) == len(hit)  # both are right
    for name, value in (("shape", 0), ("part", 7), ("instance", 3), ("primitive", 9)):
        column = getattr(ours, name).copy()
        column[hit] = np.where(column[hit] == value, value + 1, value)
        assert len(verdict(dataclasses.replace(ours, **{name: column})).ours) == len(hit)
    assert len(verdict(dataclasses.replace(ours, t=ours.t * (1.0 + 1e-5))).ours) == len(hit)
    missed = dataclasses.replace(ours, shape=np.full_like(ours.shape, -1))
    assert len(verdict(missed).ours) == len(hit)
    many = np.repeat(hit, MOST_JUDGED)
    assert len(verdict(ours, many).undecided) == len(many)


def test_aimed_rays_are_at_edges(scene: Scene) -> None:
    """Moved by the largest offset that they are given, most find something else."""
    sizes = ShapeSizes(scene)
    tables = build_tables(scene)
    rays = aimed_rays(tables, sizes, 2000, 3)
    assert len(rays.o) == 2000
    np.testing.assert_array_equal(rays.o, rays.o.astype(np.float32))
    changes = np.zeros(2000, bool)
    before = query.intersect(tables, rays.o, rays.d)
    rng = np.random.default_rng(5)
    for _ in range(12):
        d = rays.d + 0.02 * rng.normal(size=(2000, 3))
        after = query.intersect(tables, rays.o, d)
        for name in ("shape", "instance", "part", "primitive"):
            changes |= getattr(after, name) != getattr(before, name)
    # The corners that are aimed at may be hidden behind something else.
    assert changes.mean() > 0.7
    plain = mixed_rays(scene, tables, sizes, 700, 3)
    unaimed = Rays(plain.o[:2000], plain.d[:2000])
    before = query.intersect(tables, unaimed.o, unaimed.d)
    d = unaimed.d + 0.02 * rng.normal(size=(2000, 3))
    after = query.intersect(tables, unaimed.o, d)
    assert (before.shape != after.shape).mean() < 0.2


SOLIDS_IN_A_GROUP = """
camera: {type: perspective, eye: [1, 2, 9], target: [0, 0, 0], fov: 50}
film: {width: 40, height: 30}
integrator: {type: ray_cast}
groups:
  g:
    - {type: box, transform: [{scale: 0.6}, {translate: [3, 0, 0]}]}
    - {type: intersection, of: [{type: sphere}, {type: box, transform: [{scale: 0.8}]}, {type: torus}]}
    - {type: sphere, transform: [{translate: [-3, 0, 0]}]}
    - {type: difference, of: [{type: box}, {type: sphere, radius: 1.2}], transform: [{translate: [0, 3, 0]}]}
shapes:
  - {type: instance, group: g, transform: [{rotate: {axis: [1, 2, 3], degrees: 30}}]}
"""  # noqa: E501


@pytest.mark.slow
def test_parts_of_a_group_with_solids_have_one_number_each() -> None:
    """Shapes and operands count one by one; both renderers and exact arithmetic agree on them."""
    scene = Scene.parse(SOLIDS_IN_A_GROUP)
    sizes, tables = ShapeSizes(scene), build_tables(scene)
    assert sorted(sizes.by_part(sizes.copies[0])) == [*range(7)]
    rays = mixed_rays(scene, tables, sizes, 300, 1)
    ours = query.intersect(tables, rays.o, rays.d)
    assert {0, 4, 5} <= {*ours.part[ours.shape >= 0].tolist()}
    truths = Referee(sizes).decide(rays.o, rays.d)
    assert all(truth.agrees(ours, k, 1e-9) for k, truth in enumerate(truths))
    found = geometry(scene, tables, load(scene), 300)
    assert found.status == "agree", found.reason


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_infinite_planes(seed: int) -> None:
    """Alone and in solids, however they lie: float32 turns the triangles of the mesh that stands in
    for one, and rays that are nearly parallel to it hit beyond that."""
    rng = np.random.default_rng(seed)
    turn = f"rotate: {{axis: {rng.normal(size=3).round(2).tolist()}, degrees: {40 * seed + 7}}}"
    move = f"translate: {rng.normal(size=3).round(2).tolist()}"
    scene = Scene.parse(f"""
camera: {{type: perspective, eye: [4, 3, 6], target: [0, 0, 0]}}
film: {{width: 24, height: 18}}
shapes:
  - {{type: plane, transform: [{{{turn}}}, {{{move}}}]}}
  - {{type: sphere}}
  - type: union
    of: [{{type: plane}}, {{type: plane, transform: [{{scale: [0.6, 1, 1.1]}}]}},
         {{type: cone, transform: [{{translate: [0, 0, -0.3]}}]}}]
    transform: [{{{move}}}, {{{turn}}}]
""")
    found = geometry(scene, scene.tables, load(scene), 300, seed)
    assert found.status in ("agree", "reference-limited"), found.reason


FACES = """
camera: {type: perspective, eye: [1, 2, 6], target: [0, 0, 0], fov: 40}
film: {width: 24, height: 18}
groups:
  small: [{type: rectangle, transform: [{scale: 0.6}]}]
  two:
    - {type: rectangle, transform: [{scale: -0.6}]}
    - {type: rectangle, transform: [{rotate: {axis: [1, 0, 0], degrees: 180}}, {translate: [0.2, 0.1, 0]}]}
  nested:
    - {type: instance, group: small, transform: [{translate: [0.3, 0, 0]}]}
    - {type: instance, group: small, transform: [{scale: [1.5, 1, 1]}]}
shapes:
"""  # noqa: E501
ALIKE = {
    "two shapes": "{type: rectangle, TURN}\n"
    "  - {type: box, transform: [{translate: [0, 0, 1]}, STEPS]}",
    "two shapes of a group": "{type: instance, group: two, TURN}",
    "two instances in a group": "{type: instance, group: nested, TURN}",
    "two instances": "{type: instance, group: small, TURN}\n"
    "  - {type: instance, group: small, transform: [{scale: [2, 0.5, 1]}, STEPS]}",
    "two triangles": "{type: mesh, vertices: [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]],"
    " faces: [[0, 1, 2], [0, 1, 3]], TURN}",
    "two operands": "{type: union, of: [{type: box}, {type: box, transform:"
    " [{scale: [0.5, 0.7, 1]}]}], TURN}",
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("name", ALIKE)
def test_faces_in_one_place(name: str, seed: int) -> None:
    """Each renderer reports either."""
    rng = np.random.default_rng(seed)
    steps = f"{{rotate: {{axis: {rng.normal(size=3).round(2).tolist()}, degrees: {30 + seed}}}}}"
    steps += f", {{translate: {rng.uniform(-0.5, 0.5, 3).round(2).tolist()}}}"
    shapes = ALIKE[name].replace("TURN", "transform: [STEPS]").replace("STEPS", steps)
    scene = Scene.parse(f"{FACES}  - {shapes}\n")
    with scalar():
        found = geometry(scene, scene.tables, load(scene), 300, seed)
    assert found.status == "agree", found.reason
