"""The links of a scene: which operations a kernel needs, on which of the scene's tables."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from reference_rt.accel.geometry import Geometry, geometries
from reference_rt.cameras import has_lens, views
from reference_rt.cameras.film import film_filters
from reference_rt.cameras.thin_lens import ThinLensView
from reference_rt.core.vec3 import Vec3, cross
from reference_rt.integrators.scene_tables import KernelScene, SceneTables
from reference_rt.jit.called import called
from reference_rt.jit.links import Group, Link, Linker, Operation
from reference_rt.lights import Lights, LightSampler, LightTables
from reference_rt.lights import tables as light_tables
from reference_rt.lights.emitters.area import Areas
from reference_rt.lights.selection.choice import light_trees
from reference_rt.materials import Materials
from reference_rt.materials.bsdfs import tables as bsdfs
from reference_rt.materials.nested.flattened import flattened_materials
from reference_rt.materials.textured import Textured
from reference_rt.rendering.tiles import GivenRays, View
from reference_rt.shapes import Shapes
from reference_rt.shapes import tables as shape_tables
from reference_rt.textures import Textures
from reference_rt.textures.lookup import lookups
from reference_rt.textures.parameter import Colours

_NO_INTEGERS = np.zeros(0, np.int64)
_NO_FLOATS = np.zeros(0)
_NOTHING: Any = Link(0)
_NO_LIGHTS = LightSampler(_NO_INTEGERS, _NO_INTEGERS, _NO_FLOATS, _NO_FLOATS, np.zeros(1))

_NO_RAYS = GivenRays(np.zeros((0, 3)), np.zeros((0, 3)))

EMPTY_VIEW = View(Link(0), 0, 0.0, Vec3(0.0, 0.0, 0.0), _NO_RAYS)

EMPTY_SCENE = KernelScene(
    geometry=Link(0),
    shapes=Link(0),
    is_placed=0,
    materials=Materials(
        kind=_NO_INTEGERS,
        row=_NO_INTEGERS,
        smooth=_NO_INTEGERS,
        uses_u_lobe=_NO_INTEGERS,
        behind=_NO_INTEGERS,
        shown=Colours(np.zeros((0, 3)), _NO_INTEGERS),
        oriented=_NO_INTEGERS,
        asks=_NO_INTEGERS,
        textured=Textured(_NO_INTEGERS, _NO_INTEGERS, _NO_INTEGERS, 0),
        flat_leaves=_NOTHING,
        leaves=_NOTHING,
    ),
    lights=LightTables(Link(0), _NO_LIGHTS, Link(0), np.zeros((1, 3))),
    textures=Link(0),
)
"""Nothing, of the type of every linked scene."""


def linked_view(linker: Linker, view: Any, calls: "Calls") -> View:
    """A camera's view, or `GivenRays`, as kernels take it, with those operations of `calls` that
    are a view's."""
    if isinstance(view, GivenRays):
        return EMPTY_VIEW._replace(link=linker.nothing, given=view)
    link = linker.link(views, _names(calls, views), view)
    exposure, forward = 0.0, EMPTY_VIEW.forward
    if isinstance(view, ThinLensView):
        exposure, forward = view.exposure, cross(view.v, view.u)
    return View(link, int(has_lens(view)), exposure, forward, _NO_RAYS)


def linked_filter(linker: Linker, setup: Any, calls: "Calls") -> Any:
    """A filter's setup behind a link, likewise."""
    return linker.link(film_filters, _names(calls, film_filters), setup)


# ---- what is called ------------------------------------------------------------------------------

Calls = frozenset[Operation]
"""Operations that kernels call."""


def calls_of(kernel: Any, setup: type | None = None) -> Calls:
    """The operations that a kernel calls through links.  setup: the class of its integrator's."""
    return called(kernel, _CLASSES if setup is None else _CLASSES | {setup})


def calls_of_geometry(names: Iterable[str]) -> Calls:
    """Operations on a geometry, and the operations on shapes that they call."""
    found = frozenset(geometries.operations[name] for name in names)
    rows = (row for operation in found for row in operation.rows.values())
    return found.union(*(called(row, _CLASSES, geometries) for row in rows))


_CLASSES = frozenset((Link,))


def _names(calls: Calls, group: Group) -> set[str]:
    return {operation.name for operation in calls if operation.group is group}


# What a scene does not call, though it is in the code of kernels: so that it is not compiled.  What
# is missing here costs time, and nothing else.


def _without(calls: Calls, group: Group, *names: str) -> Calls:
    return calls - {group.operations[name] for name in names}


def _of_geometry(calls: Calls, geometry: Geometry) -> Calls:
    """Of the operations those that are called for a geometry."""
    shapes, others = shape_tables.by_code, _names(calls, geometries)
    if geometry.solids is None:
        calls = _without(calls, shapes, "spans", "enters")
    if geometry.bvh is not None:
        return _without(calls, shapes, "nearest_of_type", "nearest_of_block", "complete")
    if not others & {"closest_hit", "occluded"}:
        calls = _without(calls, shapes, "nearest_of_type")
    if others & _QUERIES or geometry.solids is not None:
        return calls
    if "owner" not in others:
        calls = _without(calls, shapes, "face")
        if geometry.parts is None:
            calls = _without(calls, shapes, "owner")
    return _without(calls, shapes, "intersect")


_QUERIES = {"next_crossing", "crossings_of_solid", "traversal_cost"}
"""Operations on a geometry that need those on single shapes without a hierarchy, too."""


def _of_scene(calls: Calls, tables: SceneTables) -> Calls:
    """Of the operations those that are called for a scene."""
    shapes, geometry = shape_tables.by_code, tables.geometry
    calls = _of_geometry(calls, geometry)
    if geometry.parts is None and geometry.instances is None:  # as `KernelScene.is_placed`
        calls = _without(calls, geometries, "surface")
    if tables.textures is None and geometries.operations["owner"] not in calls:  # as ray casting
        calls = _without(calls, geometries, "coordinates")
        calls = _without(calls, shapes, "uv", "colour")
    if not tables.materials.oriented.any():
        calls = _without(calls, geometries, "tangents")
        calls = _without(calls, shapes, "tangents")
        calls = _without(calls, lookups, "gradient")
    if tables.lights.areas is None:
        calls = _without(calls, shapes, "sample", "sample_fixed", "pdf")
    return calls


# ---- tables behind links -------------------------------------------------------------------------


def linked_scene(linker: Linker, tables: SceneTables, calls: Calls) -> KernelScene:
    """A scene as kernels take it, with the operations of `calls` that it needs."""
    calls = _of_scene(calls, tables)
    geometry, lights = tables.geometry, tables.lights
    shapes = linked_shapes(linker, geometry.shapes, calls, lights.areas)
    return KernelScene(
        geometry=linked_geometry(linker, geometry, shapes, calls),
        shapes=shapes,
        is_placed=int(geometry.parts is not None or geometry.instances is not None),
        materials=linked_materials(linker, tables.materials, calls),
        lights=linked_lights(linker, lights, calls),
        textures=linked_textures(linker, tables.textures, calls),
    )


def geometry_of(linker: Linker, geometry: Geometry, names: Iterable[str]) -> Any:
    """A geometry behind a link that has these operations, and what they call."""
    calls = _of_geometry(calls_of_geometry(names), geometry)
    shapes = linked_shapes(linker, geometry.shapes, calls)
    return linked_geometry(linker, geometry, shapes, calls)


def linked_textures(linker: Linker, textures: Textures | None, calls: Calls) -> Any:
    """Textures behind a link; None, and those that nothing looks up, have a link to nothing."""
    wanted = _names(calls, lookups)
    if textures is None or not wanted:
        return linker.nothing
    return linker.link(lookups, wanted, textures)


def linked_shapes(linker: Linker, shapes: Shapes, calls: Calls, areas: Areas | None = None) -> Any:
    """Shapes behind a link.  areas: the area lights, whose types of shape alone are sampled."""
    group = shape_tables.by_code
    kinds: set[int] = set() if areas is None else set(areas.kind.tolist())
    only = dict.fromkeys(("sample", "sample_fixed", "pdf"), kinds)
    return linker.link(group, _names(calls, group), shapes, only)


def linked_geometry(linker: Linker, geometry: Geometry, shapes: Any, calls: Calls) -> Any:
    """A geometry behind a link.  shapes: the link to its shapes."""
    bvh = geometry.bvh
    if bvh is not None and bvh.corners is None:  # one type less: without triangles none are read
        bvh = bvh._replace(corners=_NO_FLOATS)
    table = geometry._replace(shapes=shapes, bvh=bvh)
    return linker.link(geometries, _names(calls, geometries), table)


def linked_materials(linker: Linker, materials: Materials, calls: Calls) -> Materials:
    """Materials whose tables are behind links."""
    group, flat, nested = bsdfs.by_code, linker.nothing, _names(calls, flattened_materials)
    if materials.flat_leaves is not None and nested:
        flat = linker.link(flattened_materials, nested, materials.flat_leaves)
    leaves = linker.link(group, _names(calls, group), materials.leaves)
    return materials._replace(flat_leaves=flat, leaves=leaves)


def linked_lights(linker: Linker, lights: Lights, calls: Calls) -> LightTables:
    """Lights as kernels take them."""
    group, tree, picked = light_tables.by_code, linker.nothing, _names(calls, light_trees)
    choice = _NO_LIGHTS if lights.choice is None else lights.choice
    if lights.tree is None:
        choice = choice._replace(bounded=np.zeros(1))
    elif picked:
        tree = linker.link(light_trees, picked, lights.tree)
    ambient = np.zeros((1, 3)) if lights.ambient is None else lights.ambient
    emitters = linker.link(group, _names(calls, group), lights)
    return LightTables(emitters, choice, tree, ambient)
