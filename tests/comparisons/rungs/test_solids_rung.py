"""The rung `solids`: right solids agree with raysect's, under arbitrary transforms and nesting, and
faults of trees, places, sizes and normals differ."""

import dataclasses
import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builders import SCENES

from comparisons.raysect import translate
from comparisons.renderers import NoCounterpartError
from comparisons.rungs.solids import solids
from comparisons.shapes import SHAPES
from reference_rt.core.model import name_of
from reference_rt.core.transform import Matrix
from reference_rt.rendering.scene import Scene
from reference_rt.shapes import Box, Cone, Cylinder, Plane, Sphere, Torus
from reference_rt.shapes.csg import Difference, Intersection, Union
from reference_rt.shapes.instances import Instance

pytest.importorskip("raysect")

RUNG: Any = importlib.import_module("comparisons.rungs.solids")

FEW = 3_000
"""Rays of a fast test."""

CLOSED: tuple[Callable[[np.random.Generator], Any], ...] = (
    lambda rng: Sphere(center=tuple(rng.normal(size=3)), radius=rng.uniform(0.5, 1.5)),
    lambda rng: Box(),
    lambda rng: Cylinder(radius=rng.uniform(0.3, 1.5), z_min=-0.5, z_max=rng.uniform(0.1, 2.0)),
    lambda rng: Cone(radius=1.3, height=rng.uniform(0.5, 2.0)),
    lambda rng: Cone(radius=1.0, top_radius=rng.uniform(0.1, 0.9), height=1.5),
    lambda rng: Cone(radius=rng.uniform(0.1, 0.9), top_radius=1.2, height=1.2),
    lambda rng: Torus(major_radius=rng.uniform(0.8, 1.2), minor_radius=rng.uniform(0.1, 0.5)),
)
"""Every primitive that raysect has."""

COMBINED = Union, Intersection, Difference


def a_map(rng: np.random.Generator) -> tuple[Matrix, ...]:
    """Sheared, scaled, mirrored half of the time."""
    linear = np.eye(3) * rng.uniform(0.5, 2.0, 3) + rng.uniform(-0.4, 0.4, (3, 3))
    linear[:, 0] *= rng.choice([-1.0, 1.0])
    rows = np.column_stack([linear, rng.uniform(-1.0, 1.0, 3)])
    return (Matrix.model_validate({"matrix": rows.tolist()}),)


def a_tree(rng: np.random.Generator, depth: int) -> Any:
    if depth == 0:
        shape = CLOSED[rng.integers(len(CLOSED))](rng)
    else:
        operands = tuple(a_tree(rng, depth - 1) for _ in range(rng.integers(2, 4)))
        shape = COMBINED[rng.integers(3)](of=operands)
    return shape.model_copy(update={"transform": a_map(rng)})


def scene_of(*shapes: Any, **more: Any) -> Scene:
    return Scene(shapes=shapes, **more)


def test_ellipsoids_a_million_times_as_wide_as_high() -> None:
    """Their normals turn over their width, but their equation is solved to rounding over their
    height."""
    found = solids(Scene.load(SCENES / "needle.yaml"), FEW)
    assert found.status == "agree", found.reason


@pytest.mark.parametrize("make", CLOSED)
def test_each_primitive(make: Callable[[np.random.Generator], Any]) -> None:
    rng = np.random.default_rng(5)
    shapes = [make(rng).model_copy(update={"transform": a_map(rng)}) for _ in range(4)]
    found = solids(scene_of(*shapes), FEW)
    assert found.status == "agree", found.reason
    assert found.numbers["solids"] == 4
    assert found.numbers["hits"] > 0.2 * found.numbers["rays"]


def test_every_type_is_expressed_or_has_a_reason() -> None:
    known = {name_of(one.of) for one in SHAPES if one.to_raysect is not None}
    made = {name_of(type(make(np.random.default_rng(1)))) for make in CLOSED}
    assert known == made | {"plane"}


@pytest.mark.parametrize("seed", range(4))
def test_random_solids(seed: int) -> None:
    rng = np.random.default_rng(seed)
    found = solids(scene_of(*(a_tree(rng, 2) for _ in range(3))), FEW)
    assert found.status == "agree", found.reason
    assert found.numbers["cleared"] <= 3


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100, 160))
def test_more_random_solids(seed: int) -> None:
    rng = np.random.default_rng(seed)
    found = solids(scene_of(*(a_tree(rng, seed % 4) for _ in range(3)), Box()), 20_000, seed)
    assert found.status == "agree", found.reason


def test_half_spaces_and_copies() -> None:
    rng = np.random.default_rng(3)
    bowl = Difference(of=(Sphere(), Plane(transform=a_map(rng)), Sphere(radius=0.8)))
    lid = Intersection(of=(Plane(transform=a_map(rng)), Box()))
    group = (bowl, Torus(major_radius=3.0))
    copies = tuple(Instance(group="g", transform=a_map(rng)) for _ in range(3))
    found = solids(scene_of(*copies, lid, groups={"g": group}), FEW)
    assert found.status == "agree", found.reason
    assert found.numbers["solids"] == 7


def test_what_is_left_out_is_named() -> None:
    found = solids(scene_of(Plane(), Union(of=(Plane(), Sphere())), Cylinder(capped=False), Box()))
    assert found.numbers["solids"] == 1
    assert found.numbers["left_out"] == {
        "plane: raysect has bounded solids alone": 2,
        "a tube without caps: raysect's primitives are closed": 1,
    }
    assert "2 of plane" in found.reason
    alone = solids(scene_of(Plane()))
    assert alone.status == "not-applicable"


def test_faces_in_one_place_are_counted() -> None:
    found = solids(Scene.load(SCENES / "csg_coincident.yaml"), FEW)
    assert found.status == "agree", found.reason
    assert found.numbers["coincident"] > 0
    assert found.numbers["wrong"] == found.numbers["cleared"] == 0


@pytest.mark.slow
@pytest.mark.parametrize("path", sorted(SCENES.glob("*.yaml")), ids=lambda path: path.stem)
@pytest.mark.parametrize("seed", range(3))
def test_every_scene(path: Path, seed: int) -> None:
    found = solids(Scene.load(path), 20_000, seed)
    assert found.status in ("agree", "not-applicable"), found.reason


# ---- faults --------------------------------------------------------------------------------------

BITTEN = Difference(of=(Box(), Sphere(center=(1.0, 1.0, 1.0), radius=0.9), Cylinder(radius=0.3)))


def turned(node: Any, change: Callable[[Any], Any]) -> Any:
    """The node with `change` of each of its nodes that is changed."""
    if "of" in node:
        node = node | {"of": [turned(one, change) for one in node["of"]]}
    return change(node)


def of_type(name: str, **values: Any) -> Callable[[Any], Any]:
    return lambda node: node | values if node["type"] == name else node


def longer(node: Any) -> Any:
    """By as much as a float32 is uncertain."""
    return node if "of" in node else node | {"sizes": [x * (1.0 + 2.0**-24) for x in node["sizes"]]}


def moved(node: Any) -> Any:
    if "of" in node:
        return node
    return node | {"map": (np.array(node["map"]) + np.eye(3, 4, 3) * 1e-7).tolist()}


TREES: dict[str, Callable[[Any], Any]] = {
    "a union for a difference": of_type("difference", type="union"),
    "an intersection for a difference": of_type("difference", type="intersection"),
    "longer by 6e-8": longer,
    "moved by 1e-7": moved,
    "operands in another order": lambda n: (
        n | {"of": n["of"][1:] + n["of"][:1]} if "of" in n else n
    ),
    "one operand less": lambda n: n | {"of": n["of"][:-1]} if "of" in n else n,
}


@pytest.mark.parametrize("name", TREES)
def test_another_solid_differs(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    right = translate.node_of
    wrong = lambda member, outer: turned(right(member, outer), TREES[name])  # noqa: E731
    monkeypatch.setattr(RUNG, "node_of", wrong)
    monkeypatch.setattr(RUNG, "MOST_JUDGED", 200)
    touching = solids(Scene.load(SCENES / "csg_coincident.yaml"), FEW)
    assert touching.status == "differ", "faces in one place excuse it"
    found = solids(
        scene_of(BITTEN.model_copy(update={"transform": a_map(np.random.default_rng(2))}))
    )
    assert found.status == "differ"
    assert "raysect's solids are others" in found.reason


def inside_out(hits: Any) -> Any:
    """The normals of subtracted operands as they are alone."""
    return dataclasses.replace(hits, n=np.where((hits.part > 0)[:, None], -hits.n, hits.n))


def behind(hits: Any) -> Any:
    """One surface of a hundred is missed."""
    lost = (np.arange(len(hits.t)) % 100 == 0) & (hits.shape >= 0)
    return dataclasses.replace(
        hits, shape=np.where(lost, -1, hits.shape), t=np.where(lost, np.inf, hits.t)
    )


def late(hits: Any) -> Any:
    return dataclasses.replace(hits, t=hits.t * (1.0 + 1e-9))


@pytest.mark.parametrize("fault", [inside_out, behind, late])
def test_wrong_hits_of_ours_differ(
    fault: Callable[[Any], Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    right = RUNG.query.intersect
    monkeypatch.setattr(RUNG.query, "intersect", lambda *given: fault(right(*given)))
    found = solids(scene_of(BITTEN), FEW)
    assert found.status == "differ"
    assert "wrong by exact arithmetic" in found.reason


# ---- raysect that is not there, or fails ---------------------------------------------------------


def test_without_raysect_it_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(RUNG.importlib.util, "find_spec", lambda name: None)
    found = solids(scene_of(Sphere()))
    assert found.status == "not-applicable"
    assert "pip install" in found.reason


def test_a_failure_of_raysect_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(RUNG, "node_of", lambda *given: {"type": "pyramid", "sizes": [], "map": []})
    found = solids(scene_of(Sphere()))
    assert found.status == "not-applicable"
    assert "raysect: KeyError: 'pyramid'" in found.reason


def test_raysect_is_not_waited_for_without_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(RUNG, "SECONDS", 0.01)
    found = solids(scene_of(Sphere()))
    assert found.status == "not-applicable"
    assert "no answer" in found.reason


def test_many_copies_are_not_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(RUNG, "MOST_COPIES", 2)
    copies = tuple(Instance(group="g") for _ in range(3))
    found = solids(scene_of(*copies, groups={"g": (Sphere(),)}))
    assert found.status == "not-applicable"
    assert "3 copies" in found.reason


def test_an_open_tube_is_no_solid() -> None:
    (cone,) = (one for one in SHAPES if one.of is Cone)
    assert cone.to_raysect is not None
    with pytest.raises(NoCounterpartError, match="without caps"):
        cone.to_raysect(Cone(capped=False))
