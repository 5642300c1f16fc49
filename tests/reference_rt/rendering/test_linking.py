"""Linking asks for every operation that compiled code calls: found by following the names in the
code of kernels.  An operation that is forgotten would end the process where it is called.
"""

import dis
import sys
import types
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from builders import SCENES, every_law, every_shape, import_everything

import reference_rt as rt
from reference_rt.accel.geometry import geometries
from reference_rt.integrators import INTEGRATORS
from reference_rt.integrators.scene_tables import LinkedScene
from reference_rt.jit.kernel import ByClass
from reference_rt.jit.links import Group, Link, Linkable, Linker, Operation
from reference_rt.lights import LinkedLights
from reference_rt.rendering import query, tiles
from reference_rt.rendering.linking import linked_scene
from reference_rt.rendering.query.tracing import geometry_of

import_everything()

GROUP = {
    operation: group
    for name, module in list(sys.modules.items())
    if name.startswith("reference_rt.")
    for group in vars(module).values()
    if isinstance(group, Group)
    for operation in group.operations.values()
}
OPERATION = {getattr(sys.modules[one.module], one.name): one for one in GROUP}
"""By the function that kernels call."""

KERNELS = dict.fromkeys(INTEGRATORS.values(), tiles.render_tile) | {
    "ray_cast": tiles.aov_tile,
    "first_hits": tiles.first_hits_tile,
    "cost": tiles.cost_tile,
}

NEVER = {
    # Blocks of rays without a hierarchy are traced together: `nearest_of_block`.
    **{name: {"nearest_of_type"} for name in ("path", "direct", "closest_hits", "any_hits")},
}
"""Operations that are in the code of an integrator or a query, and that no scene makes it call."""


def named(function: types.FunctionType) -> Iterator[Any]:
    """What the code of a function names: globals, what it takes of modules, what it closes over."""
    of_module = None
    for step in dis.get_instructions(function):
        found = None
        if step.opname == "LOAD_GLOBAL":
            found = function.__globals__.get(step.argval)
        elif step.opname in ("LOAD_ATTR", "LOAD_METHOD") and of_module is not None:
            found = getattr(of_module, step.argval, None)
        of_module = found if isinstance(found, types.ModuleType) else None
        yield found
    for cell in function.__closure__ or ():
        yield cell.cell_contents


def choices(choice: ByClass, integrator: str) -> list[Any]:
    """The kernels that a linked scene comes to."""
    kernels = choice._kernels
    for cls in (LinkedScene, tiles.LinkedView, LinkedLights):
        if cls in kernels:
            return [kernels[cls]]
    own = [cls for cls in kernels if INTEGRATORS.get(cls, integrator) == integrator]
    return [kernels[cls] for cls in own]


def called(root: Any, integrator: str = "", within: Group | None = None) -> set[Operation]:
    """The operations that a kernel calls through links, and those that these call.  Within an
    operation on one table the others of its group are called on the table itself."""
    found, seen, left = set(), set(), [(root, within)]
    while left:
        function, inside = left.pop()
        function = getattr(function, "py_func", function)  # of an entry kernel
        if isinstance(function, ByClass):
            left += [(one, inside) for one in choices(function, integrator)]
        if not isinstance(function, types.FunctionType) or (function, inside) in seen:
            continue
        if not function.__module__.startswith("reference_rt."):
            continue
        seen.add((function, inside))
        operation = OPERATION.get(function)
        if operation is None:
            left += [(one, inside) for one in named(function)]
            continue
        group = GROUP[operation]
        if group is not inside:
            found.add(operation)
        left += [(row, group) for row in operation.rows.values()]
        if not isinstance(group, Linkable):  # the body is for all codes without a kernel
            left.append((operation._function, inside))
    return found


class Asked:
    """In place of a `Linker`: notes what is asked for."""

    def __init__(self) -> None:
        self.operations: set[Operation] = set()

    def link(self, operations: Any, wanted: Any, tables: Any, only: Any = None) -> Link:
        self.operations |= {operations[name] for name in wanted}
        return Link(1)


@cache
def scenes(folder: Path) -> list[Any]:
    """With everything, and with few shapes, for which there is no hierarchy."""
    lamp = rt.Rectangle(material="lamp")
    few = rt.Scene(materials={"lamp": rt.Emissive(radiance=1.0)}, shapes=(rt.Sphere(), lamp))
    files = every_shape(folder), every_law(folder), SCENES / "many_lights.yaml"
    found = [few, *map(rt.Scene.load, files)]
    assert [scene.tables.geometry.bvh is None for scene in found][:2] == [True, False]
    return [scene.tables for scene in found]


@pytest.fixture(scope="module")
def tables(tmp_path_factory: pytest.TempPathFactory) -> list[Any]:
    return scenes(tmp_path_factory.mktemp("scenes"))


def names(operations: set[Operation]) -> set[str]:
    return {operation.name for operation in operations}


@pytest.mark.parametrize("integrator", KERNELS)
def test_a_scene_is_linked_to_all_that_its_integrator_calls(integrator, tables):
    asked = Asked()
    for one in tables:
        linked_scene(asked, one, integrator)
    groups = {GROUP[operation] for operation in asked.operations}
    needed = {one for one in called(KERNELS[integrator], integrator) if GROUP[one] in groups}
    assert len(needed) > 5
    assert names(needed - asked.operations) == NEVER.get(integrator, set())
    assert names(asked.operations - needed) == set()  # each would be compiled


def test_only_shapes_that_are_lights_are_sampled(tables):
    """A sphere in the light of a rectangle."""
    linker = Linker()
    linked_scene(linker, tables[0], "path")
    sampled = {kernel.__name__ for kernel, _ in linker.calls if kernel.__name__.startswith("pdf")}
    assert sampled == {f"pdf_{tables[0].lights.areas.kind[0]}"}


QUERIES = "".join(path.read_text("utf-8") for path in Path(query.__file__).parent.glob("*.py"))


@pytest.mark.parametrize("name", [n for n in geometries.operations if f'"{n}"' in QUERIES])
def test_a_query_is_linked_to_all_that_its_operation_calls(name, tables):
    asked, (row,) = Asked(), geometries.operations[name].rows.values()
    for one in tables:
        geometry_of(asked, one.geometry, [name])
    groups = {GROUP[operation] for operation in asked.operations} - {geometries}
    needed = {one for one in called(row, "", geometries) if GROUP[one] in groups}
    assert names(needed - asked.operations) == NEVER.get(name, set())
