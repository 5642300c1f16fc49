"""The counterpart of CSG solids, Mitsuba's crossings combined in NumPy; many instances."""

from collections.abc import Iterator

import numpy as np
import pytest
from counterparts import coarse_meshes

from comparisons.mitsuba import backend
from comparisons.mitsuba.counterpart import trace
from comparisons.rungs import geometry
from comparisons.translator import load
from reference_rt.rendering.scene import Scene
from reference_rt.scene.build import build_tables

BALL = "{type: sphere, radius: 0.8, center: [0.3, 0.2, 0.1]}"
BOX = "{type: box, transform: [{scale: 0.7}, {rotate: {axis: [1, 2, 3], degrees: 30}}]}"
ROD = "{type: cylinder, radius: 0.3, z_min: -2, z_max: 2}"
HALF = "{type: plane, transform: [{rotate: {axis: [1, 1, 0], degrees: 20}}]}"
RING = "{type: torus, major_radius: 0.7, minor_radius: 0.3}"


def solid(operation: str, *of: str) -> str:
    return f"{{type: {operation}, of: [{', '.join(of)}]}}"


def scene_of(*shapes: str) -> Scene:
    listed = "".join(f"  - {shape}\n" for shape in shapes)
    return Scene.parse(f"integrator: {{type: ray_cast}}\nshapes:\n{listed}")


def rays(n: int, reach: float = 1.5) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(1)
    o = rng.uniform(-reach, reach, (n, 3))
    d = rng.uniform(-1.0, 1.0, (n, 3)) - o
    d /= np.linalg.norm(d, axis=1)[:, None]
    return o.astype(np.float32).astype(float), d.astype(np.float32).astype(float)


@pytest.fixture
def coarse() -> Iterator[None]:
    with coarse_meshes(256, 128):
        yield


@pytest.fixture
def scalar() -> Iterator[None]:
    with backend.scalar():
        yield


LAWS = (
    (solid("union", BALL, BALL), solid("union", BALL)),
    (solid("intersection", BOX, solid("union", BOX, BALL)), solid("union", BOX)),
    (
        solid("difference", BOX, solid("union", BALL, ROD)),
        solid("difference", solid("difference", BOX, BALL), ROD),
    ),
    (
        solid("difference", HALF, solid("intersection", BOX, BALL)),
        solid("union", solid("difference", HALF, BOX), solid("difference", HALF, BALL)),
    ),
)


@pytest.mark.cases(2)
@pytest.mark.parametrize(("one", "other"), LAWS)
def test_laws_hold_of_the_counterpart(one: str, other: str) -> None:
    o, d = rays(3000)
    first, second = (trace(load(scene_of(text)), o, d) for text in (one, other))
    met = first.shape >= 0
    # But for rays that pass an edge where two operands cross within float32.
    same = (met == (second.shape >= 0)) & (np.abs(first.p - second.p).max(axis=1) < 1e-4)
    assert same.mean() > 0.999
    assert met.mean() > 0.2
    np.testing.assert_allclose(first.n[met & same], second.n[met & same], atol=1e-3)


@pytest.mark.parametrize("text", [solid("difference", BALL, BALL), solid("difference", BOX, BOX)])
def test_nothing_less_itself_is_nothing(text: str) -> None:
    o, d = rays(3000)
    assert (trace(load(scene_of(text)), o, d).shape < 0).all()


def test_normals_point_out_of_the_solid() -> None:
    """From inside a box with a hole, everything faces away from the ray but what it enters by."""
    o, d = rays(3000)
    hits = trace(load(scene_of(solid("difference", BOX, BALL))), o, d)
    met = hits.shape >= 0
    inside_box = np.abs(hits.p[met]).max() < 2.0
    assert inside_box
    part = hits.part[met]
    towards = np.sum(hits.n[met] * (hits.p[met] - [0.3, 0.2, 0.1]), axis=1)
    assert (towards[part == 1] < 0.0).all()  # into the hole
    assert set(part.tolist()) == {0, 1}


MIXED = (
    solid("difference", BOX, BALL, ROD),
    solid("intersection", BALL, HALF, solid("union", BOX, RING)),
    "{type: rectangle, transform: [{scale: 2}, {translate: [0, 0, -1]}]}",
)


@pytest.mark.slow
@pytest.mark.usefixtures("coarse")
def test_solids_beside_shapes() -> None:
    scene = scene_of(*MIXED)
    tables = build_tables(scene)
    rung = geometry(scene, tables, load(scene), pixels=500)
    assert rung.status == "agree", rung.reason
    assert rung.numbers["decided_ours"] == 0
    moved = scene_of(*MIXED[:2], MIXED[2].replace("-1]", "-1.001]"))
    turned = scene_of(MIXED[0].replace("degrees: 30", "degrees: 30.1"), *MIXED[1:])
    swapped = scene_of(solid("difference", BOX, ROD, BALL), *MIXED[1:])
    for other in (moved, turned, swapped):
        assert geometry(scene, tables, load(other), pixels=200).status == "differ"


GROUPS = """
integrator: {type: ray_cast}
groups:
  egg: [{type: sphere, transform: [{scale: [0.3, 0.4, 0.2]}]}]
  row: [ROW]
  sheet: [SHEET]
shapes:
  - {type: instance, group: sheet}
  - {type: box, transform: [{scale: [9, 9, 0.1]}, {translate: [3, 3, -1]}]}
"""


def instanced_group(step: float = 1.0) -> Scene:
    def line(group: str, axis: int) -> str:
        at = [[0.0, 0.0, 0.0] for _ in range(7)]
        for k in range(7):
            at[k][axis] = step * k
        made = (f"{{type: instance, group: {group}, transform: [{{translate: {p}}}]}}" for p in at)
        return ", ".join(made)

    return Scene.parse(GROUPS.replace("ROW", line("egg", 0)).replace("SHEET", line("row", 1)))


@pytest.mark.slow
def test_a_crowd_of_instances() -> None:
    scene = instanced_group()
    counterpart = load(scene)
    assert counterpart.instanced_group is not None
    assert len(counterpart.instanced_group.mi_shapes) == 49
    rung = geometry(scene, build_tables(scene), counterpart, pixels=300)
    assert rung.status in ("agree", "reference-limited"), rung.reason
    assert rung.numbers["decided_ours"] == 0
    # Numbered row by row, where they stand.
    o = np.array([[x, y, 2.0] for y in range(7) for x in range(7)], float)
    hits = trace(counterpart, o, np.tile([0.0, 0.0, -1.0], (49, 1)))
    assert hits.instance.tolist() == list(range(49))
    np.testing.assert_allclose(hits.t, 1.8, rtol=1e-5)
    assert (
        geometry(scene, build_tables(scene), load(instanced_group(1.001)), pixels=100).status
        == "differ"
    )


MESH = (
    "{type: mesh, vertices: [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], "
    "faces: [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]}"
)
CUBE, GROUND = "{type: box}", "{type: plane}"


def mapped(shape: str, mirrored: bool) -> str:
    steps = "{rotate: {axis: [1, 2, 3], degrees: 30}}"
    if mirrored:
        steps += ", {scale: [-1, 0.8, 0.9]}"
    return f"{shape[:-1]}, transform: [{steps}]}}"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("operand", "mirrored"),
    [(MESH, k) for k in range(16)]
    + [(shape, 1 << k) for shape in (CUBE, ROD, GROUND, RING) for k in range(4)],
)
def test_maps_that_mirror_leave_operands_their_inside(
    coarse: None, scalar: None, operand: str, mirrored: int
) -> None:
    """Its own map, that of the solid, of a solid around that one, and of an instance."""
    own, inner, outer, instance = (bool(mirrored >> k & 1) for k in range(4))
    part = solid("intersection", "{type: sphere, radius: 0.9}", mapped(operand, own))
    whole = mapped(solid("difference", mapped(part, inner), BALL), outer)
    scene = Scene.parse(
        "integrator: {type: ray_cast}\n"
        f"groups: {{g: [{whole}]}}\n"
        f"shapes: [{mapped('{type: instance, group: g}', instance)}]\n"
    )
    found = geometry(scene, build_tables(scene), load(scene), 300)
    assert found.status == "agree", found.reason
