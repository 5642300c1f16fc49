"""Linking asks for every operation that compiled code calls: found by following the names in the
code of kernels.  An operation that is forgotten would end the process where it is called.
"""

import dis
import types
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from builders import SCENES, import_everything
from galleries import gallery_of_materials, gallery_of_shapes

import reference_rt as rt
from reference_rt.accel.geometry import geometries
from reference_rt.integrators import SETUPS
from reference_rt.jit import called
from reference_rt.jit.links import Link, Linker, Operation
from reference_rt.rendering import query, tiles
from reference_rt.rendering.linking import calls_of, calls_of_geometry, geometry_of, linked_scene

import_everything()

KERNELS = {setup.__name__: (tiles.render_tile, setup) for setup in SETUPS} | {
    kernel.__name__: (kernel, None)
    for kernel in (tiles.aov_tile, tiles.first_hits_tile, tiles.cost_tile)
}

QUERIES = "".join(path.read_text("utf-8") for path in Path(query.__file__).parent.glob("*.py"))
OF_QUERIES = [name for name in geometries.operations if f'"{name}"' in QUERIES]


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


def test_names_are_those_that_the_code_loads(monkeypatch):
    """To read them off the code, one instruction after another, finds the same operations; of some
    queries, which ask for it anyway, one less."""
    cases = [lambda case=case: calls_of(*case) for case in KERNELS.values()]
    cases += [lambda name=name: calls_of_geometry([name]) for name in OF_QUERIES]
    quickly = [case() for case in cases]
    assert min(map(len, quickly)) > 1
    assert max(map(len, quickly)) > 35
    monkeypatch.setattr(called, "_named", cache(lambda function: (*named(function),)))
    called.called.cache_clear()
    exactly = [case() for case in cases]
    called.called.cache_clear()
    assert exactly[: len(KERNELS)] == quickly[: len(KERNELS)]
    more = [quick - exact for quick, exact in zip(quickly, exactly, strict=True)]
    assert all(exact <= quick for quick, exact in zip(quickly, exactly, strict=True))
    assert set().union(*map(names, more)) <= {"face"}


class Asked:
    """In place of a `Linker`: notes what is asked for."""

    nothing = Link(0)

    def __init__(self) -> None:
        self.operations: set[Operation] = set()

    def link(self, group: Any, wanted: Any, of_all: Any, only: Any = None) -> Link:
        self.operations |= {group.operations[name] for name in wanted}
        return Link(1)


@cache
def scenes(folder: Path) -> list[Any]:
    """With everything, and with few shapes, for which there is no hierarchy."""
    lamp = rt.Rectangle(material="lamp")
    few = rt.Scene(materials={"lamp": rt.Emissive(radiance=1.0)}, shapes=(rt.Sphere(), lamp))
    many = rt.Scene.load(SCENES / "many_lights.yaml")
    found = [few, gallery_of_shapes(folder), gallery_of_materials(folder), many]
    assert [scene.tables.geometry.bvh is None for scene in found][:2] == [True, False]
    return [scene.tables for scene in found]


@pytest.fixture(scope="module")
def tables(tmp_path_factory: pytest.TempPathFactory) -> list[Any]:
    return scenes(tmp_path_factory.mktemp("scenes"))


def names(operations: set[Operation]) -> set[str]:
    return {operation.name for operation in operations}


NEVER = {"nearest_of_type"}
"""Of blocks of rays without a hierarchy, which are traced together: `nearest_of_block`."""


@pytest.mark.parametrize("case", KERNELS)
def test_nothing_is_left_out_that_some_scene_needs(case, tables):
    asked = Asked()
    for one in tables:
        linked_scene(asked, one, calls_of(*KERNELS[case]))
    groups = {operation.group for operation in asked.operations}
    needed = {one for one in calls_of(*KERNELS[case]) if one.group in groups}
    assert len(needed) > 5
    assert names(needed - asked.operations) <= NEVER


@pytest.mark.parametrize("name", OF_QUERIES)
def test_a_query_is_linked_to_all_that_its_operation_calls(name, tables):
    asked = Asked()
    for one in tables:
        geometry_of(asked, one.geometry, [name])
    assert names(calls_of_geometry([name]) - asked.operations) <= NEVER


def test_only_shapes_that_are_lights_are_sampled(tables):
    """A sphere in the light of a rectangle."""
    linker = Linker()
    linked_scene(linker, tables[0], calls_of(tiles.render_tile, rt.Path().setup().__class__))
    sampled = {kernel.__name__ for kernel, _ in linker.calls if kernel.__name__.startswith("pdf")}
    assert sampled == {f"pdf_{tables[0].lights.areas.kind[0]}"}
