"""Every shape, turned and mirrored: its counterpart is met where ours is, and no other one."""

import itertools
from typing import Any

import numpy as np
import pytest

from comparisons.mitsuba.backend import scalar
from comparisons.results.case import RungResult
from comparisons.rungs import geometry
from comparisons.shapes import SHAPES, type_of
from comparisons.shapes.stand_ins import coarser
from comparisons.translator import load
from reference_rt import Disk, Plane, Polygon, RayCast, Rectangle, Scene
from reference_rt.core.transform import Matrix, Rotate, Scale, Translate, Turn
from reference_rt.scene.build import build_tables
from reference_rt.scene.examples import examples
from reference_rt.shapes import Primitive

TURN = Rotate(rotate=Turn(axis=(1, 2, 3), degrees=40))
MAPS = {
    "stretched": (Scale(scale=(1, 0.7, 1.2)), TURN),
    "mirrored": (Matrix(matrix=((-1, 0.3, 0, 0), (0, 1, 0.2, 0), (0.1, 0, 0.9, 0))), TURN),
}


def compared(ours: Any, theirs: Any, pixels: int) -> RungResult:
    first, second = (Scene(shapes=(shape,), integrator=RayCast()) for shape in (ours, theirs))
    return geometry(first, build_tables(first), load(second), pixels=pixels)


def placed(shape: Any, steps: str) -> Any:
    return shape.model_copy(update={"transform": MAPS[steps]})


@pytest.mark.cases(6)
@pytest.mark.parametrize("steps", MAPS)
@pytest.mark.parametrize("shape", examples(Primitive), ids=lambda shape: shape.type)
def test_a_counterpart_is_met_in_the_same_places(shape: Any, steps: str) -> None:
    shape = placed(shape, steps)
    rung = compared(shape, shape, 700)
    assert rung.status in ("agree", "reference-limited"), rung.reason
    assert (rung.numbers["decided_ours"], rung.numbers["undecided"]) == (0, 0), rung.reason
    assert rung.numbers["hits"] > 300
    for stand_ins in rung.numbers["stand_ins"].values():
        for stand_in in stand_ins:
            # Half the fineness, four times the distance: the surface is smooth, or straight.
            assert 3.0 < stand_in["ratio"] < 5.0
            assert stand_in["sag"] < 1e-4


TIES = [n for n in itertools.product((-1, 0, 1), repeat=3) if np.abs(n).sum() > 1]


@pytest.mark.parametrize("normal", TIES)
def test_roofs_have_the_same_uv(normal: tuple[int, int, int]) -> None:
    """Polygons whose normal has two or three equal components, but for the rounding of decimals:
    uv are along the same two axes on both sides."""
    n, first = np.array(normal), int(np.flatnonzero(normal)[0])
    rng = np.random.default_rng(5)
    square = np.array([[0, 0, 0], [0.7, 0.1, 0], [0.9, 0.8, 0], [0.1, 0.6, 0]])[:, ::-1]
    square = np.roll(square, first, axis=1)  # across the first axis, which the plane then gives
    for factor in rng.uniform(0.1, 3.0, 3):
        corners = factor * square
        corners[:, first] = -np.delete(corners, first, 1) @ np.delete(n, first) / n[first]
        shape = Polygon(rings=(tuple(map(tuple, corners.tolist())),))
        rung = compared(shape, shape, 60)
        assert rung.status == "agree", rung.reason


@pytest.mark.cases(4)
@pytest.mark.parametrize("shape", examples(Primitive), ids=lambda shape: shape.type)
def test_a_counterpart_that_is_elsewhere_is_seen(shape: Any) -> None:
    """Mitsuba meets nothing where ours is, before an empty background: no coincident surface."""
    ours = placed(shape, "stretched")
    away = (*ours.transform, Translate(translate=(900.0, 900.0, 900.0)))
    rung = compared(ours, ours.model_copy(update={"transform": away}), 700)
    assert rung.status == "differ", rung.reason


def changes(shape: Any) -> list[Any]:
    """The shape with each of its numbers off by a hundredth, and with each flag turned."""
    found = []
    for name, value in shape:
        if name in ("material", "transform", "type"):
            continue
        if isinstance(value, bool):
            found.append(shape.model_copy(update={name: not value}))
        elif isinstance(value, float):
            found.append(shape.model_copy(update={name: value + 0.01 * max(1.0, abs(value))}))
    return found


@pytest.mark.cases(4)
@pytest.mark.parametrize(
    ("shape", "other"),
    [
        (shape, other)
        for one in SHAPES
        for shape in examples(one.of)[:1]
        for other in changes(shape)
        if type_of(shape).surface is not None
    ],
    ids=lambda shape: shape.type,
)
def test_another_number_is_seen(shape: Any, other: Any) -> None:
    with scalar(), coarser(0.2):
        rung = compared(placed(shape, "stretched"), placed(other, "stretched"), 200)
    assert rung.status == "differ"


ACROSS_THE_CAMERA = Matrix(matrix=((0.37, 0, 0.37, 0), (-0.37, 0, 0.37, 0), (0, 0.83, 0, 0)))
"""To the plane x = -y, in which the usual camera is: its rays run along it."""


@pytest.mark.parametrize("shape", [Plane(), Rectangle(), Disk()], ids=lambda shape: shape.type)
def test_a_plane_through_the_camera(shape: Any) -> None:
    """Float32 does not resolve where rays along a plane meet it; one that is turned is seen."""
    through, turned = (
        shape.model_copy(update={"transform": (ACROSS_THE_CAMERA, *steps)})
        for steps in ((), (Rotate(rotate=Turn(axis=(0, 0, 1), degrees=0.1)),))
    )
    rung = compared(through, through, 300)
    assert rung.status in ("agree", "reference-limited"), rung.reason
    assert rung.numbers["decided_ours"] == 0
    assert compared(through, turned, 300).status == "differ"
