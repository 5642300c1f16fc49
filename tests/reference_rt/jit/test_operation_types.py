"""Numba's types of annotations: those of values that the annotations are for."""

import sys
from typing import Annotated, Any, NamedTuple

import numba
import numpy as np
import pytest
from builders import import_everything
from numba import types

import reference_rt.rendering  # noqa: F401 -- imports all operations
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.ray import Hit, Ray
from reference_rt.core.vec3 import Vec3
from reference_rt.jit.links import LINK, Group, Link, declare, type_of
from reference_rt.shapes import Shapes

import_everything()


class Mixed(NamedTuple):
    flag: bool
    rows: Annotated[IntArray, 2]
    pair: tuple[int, Vec3]
    nothing: None


ZERO = Vec3(0.0, 0.0, 0.0)
FITTING = {
    "float": (float, 1.0),
    "int": (int, 1),
    "bool": (bool, True),
    "None": (None, None),
    "its type": (type(None), None),
    "floats": (FloatArray, np.zeros(3)),
    "integers": (IntArray, np.zeros(3, np.int64)),
    "matrix": (Annotated[FloatArray, 2], np.zeros((3, 4))),
    "three dimensions": (Annotated[IntArray, 3], np.zeros((2, 3, 4), np.int64)),
    "tuple": (tuple[float, int], (1.0, 1)),
    "tuple of one type": (tuple[float, float], (1.0, 2.0)),
    "empty tuple": (tuple[()], ()),
    "vector": (Vec3, ZERO),
    "ray": (Ray, Ray(ZERO, ZERO, 1.0)),
    "hit": (Hit, Hit(1.0, 0, 0, 0.0, 0.0, -1)),
    "mixed": (Mixed, Mixed(True, np.zeros((1, 2), np.int64), (1, ZERO), None)),
    "link": (Link, Link(1)),
}


@pytest.mark.parametrize("case", FITTING)
def test_the_type_is_that_of_a_value(case):
    annotation, value = FITTING[case]
    assert type_of(annotation) == numba.typeof(value)


def test_tables_are_passed_as_links():
    assert type_of(Shapes) == LINK


@pytest.mark.parametrize(
    "annotation",
    [
        *(Any, object, str, complex, list[float], tuple, "float", np.ndarray),
        *(float | None, Vec3 | None, tuple[float, ...], tuple[Any, float]),
        *(Annotated[float, 2], Annotated[FloatArray | None, 2]),
    ],
    ids=str,
)
def test_what_is_not_one_type_is_refused(annotation):
    with pytest.raises(TypeError, match="not one type; expected"):
        type_of(annotation)


def test_what_is_declared_is_known():
    class Own:
        pass

    with pytest.raises(TypeError):
        type_of(Own)
    declare(Own, types.float32)
    assert type_of(Own) == types.float32
    assert type_of(tuple[Own, int]) == types.Tuple((types.float32, types.int64))


GROUPS = {
    f"{module}.{name}": value
    for module in [name for name in sys.modules if name.startswith("reference_rt.")]
    for name, value in vars(sys.modules[module]).items()
    if isinstance(value, Group)
}
OPERATIONS = {
    f"{operation.module}.{operation.name}": operation
    for group in GROUPS.values()
    for operation in group.operations.values()
}


def test_all_groups_are_found():
    """One of each kind, at least."""
    found = {name.rpartition(".")[0].removeprefix("reference_rt.") for name in GROUPS}
    assert found >= {
        *("shapes.tables", "accel.geometry", "materials.bsdfs.tables", "lights.selection.choice"),
        *("materials.nested.flattened", "cameras", "cameras.film", "textures.lookup"),
    }
    assert len(OPERATIONS) > 40


@pytest.mark.parametrize("name", OPERATIONS)
def test_every_operation_says_its_types(name):
    operation = OPERATIONS[name]
    assert len(operation.arguments) == len(operation.parameters)
    assert isinstance(operation.returns, types.Type)
