"""The links of a scene: which operations a kernel needs, on which of the scene's tables."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from reference_rt.accel.geometry import Geometry, geometries
from reference_rt.cameras import views
from reference_rt.cameras.film import film_filters
from reference_rt.cameras.thin_lens import ThinLensView
from reference_rt.integrators.scene_tables import LinkedScene, SceneTables
from reference_rt.jit.links import Link, Linker
from reference_rt.lights import Lights, LightSampler, LinkedLights
from reference_rt.lights import tables as light_tables
from reference_rt.lights.emitters.area import Areas
from reference_rt.lights.selection.choice import light_trees
from reference_rt.materials import Materials
from reference_rt.materials.bsdfs import tables as bsdfs
from reference_rt.materials.nested.flattened import flattened_materials
from reference_rt.materials.textured import Textured
from reference_rt.rendering.tiles import GivenRays, LinkedView
from reference_rt.shapes import TABLES as SHAPES
from reference_rt.shapes import Shapes
from reference_rt.shapes import tables as shape_tables
from reference_rt.textures import Textures
from reference_rt.textures.lookup import textures_operations
from reference_rt.textures.parameter import Colours, Numbers

_NO_INTEGERS = np.zeros(0, np.int64)
_NO_FLOATS = np.zeros(0)
_NOTHING: Any = Link(0)
_NO_LIGHTS = LightSampler(_NO_INTEGERS, _NO_INTEGERS, _NO_FLOATS, _NO_FLOATS, np.zeros(1))

EMPTY_VIEW = LinkedView(Link(0), 0, GivenRays(np.zeros((0, 3)), np.zeros((0, 3))))

EMPTY_SCENE = LinkedScene(
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
    lights=LinkedLights(Link(0), _NO_LIGHTS, Link(0), np.zeros((1, 3))),
    textures=Link(0),
)
"""Nothing, of the type of every linked scene."""


def linked_view(linker: Linker, view: Any) -> LinkedView:
    """A camera's view, or `GivenRays`, behind a link."""
    if isinstance(view, GivenRays):
        return LinkedView(Link(0), 0, view)
    link = linker.link(views.operations, views.operations, {0: view})
    nothing: Any = np.zeros((0, 3))
    return LinkedView(link, int(isinstance(view, ThinLensView)), GivenRays(nothing, nothing))


def linked_filter(linker: Linker, setup: Any) -> Link:
    """A filter's setup behind a link."""
    return linker.link(film_filters.operations, film_filters.operations, {0: setup})


def linked_scene(linker: Linker, tables: SceneTables, integrator: str) -> LinkedScene:
    """A scene behind links.  integrator: `path`, `direct`, `whitted`, `first_hits`, `ray_cast`
    or `cost`: whose kernel takes it."""
    geometry, materials, lights = tables.geometry, tables.materials, tables.lights
    is_textured = tables.textures is not None and integrator != "cost"
    is_oriented = materials.oriented is not None and integrator in ("path", "direct", "whitted")
    textures = linked_textures(linker, tables.textures if is_textured else None, is_oriented)
    shapes = _shapes(linker, tables, integrator, is_textured, is_oriented)
    return LinkedScene(
        geometry=_geometry(linker, geometry, shapes, integrator, is_textured, is_oriented),
        shapes=shapes,
        is_placed=int(geometry.parts is not None or geometry.instances is not None),
        materials=linked_materials(linker, materials, integrator, is_textured),
        lights=linked_lights(linker, lights, integrator),
        textures=textures,
    )


def linked_textures(linker: Linker, textures: Textures | None, is_oriented: bool) -> Link:
    """Textures behind a link; None has a link to nothing.  is_oriented: whether materials are,
    which alone take gradients."""
    if textures is None:
        return Link(0)
    wanted = {"evaluate", "gradient"} if is_oriented else {"evaluate"}
    return linker.link(textures_operations, wanted, {0: textures})


def _shapes(
    linker: Linker, tables: SceneTables, integrator: str, is_textured: bool, is_oriented: bool
) -> Link:
    geometry = tables.geometry
    blocks = integrator in ("path", "direct")
    wanted = {"surface"}
    if integrator == "cost":
        wanted = {"primitive_count", "intersect", "owner", "face"}
    elif geometry.bvh is None:
        wanted |= {"nearest_of_block", "found"} if blocks else {"nearest_of_type"}
    else:
        wanted |= {"intersect", "owner", "face"}
    if geometry.parts is not None:
        wanted |= {"owner"}
    if geometry.solids is not None:
        wanted |= {"spans", "enters", "intersect", "surface"}
    if is_textured or integrator == "ray_cast":
        wanted |= {"uv", "colour"}
    if integrator == "ray_cast":
        wanted |= {"owner", "face"}
    if is_oriented:
        wanted |= {"tangents"}
    if tables.lights.areas is not None:
        others = {"whitted": {"sample_fixed", "sample"}}
        others |= {name: set() for name in ("ray_cast", "first_hits", "cost")}
        wanted |= others.get(integrator, {"sample", "pdf"})
    return linked_shapes(linker, geometry.shapes, wanted, tables.lights.areas)


def linked_shapes(
    linker: Linker, shapes: Shapes, wanted: Iterable[str], areas: Areas | None = None
) -> Link:
    """Shapes behind a link, with the operations `wanted`.  areas: the area lights, whose types of
    shape alone are sampled."""
    found = {
        code: table for code, field, _, _ in SHAPES if (table := getattr(shapes, field)) is not None
    }
    kinds: set[int] = set() if areas is None else set(areas.kind.tolist())
    only = dict.fromkeys(("sample", "sample_fixed", "pdf"), kinds)
    return linker.link(shape_tables.by_code.operations, wanted, found, only)


def _geometry(
    linker: Linker,
    geometry: Geometry,
    shapes: Link,
    integrator: str,
    is_textured: bool,
    is_oriented: bool,
) -> Link:
    blocks = integrator in ("path", "direct")
    wanted = {"closest_hits", "any_hits"} if blocks else {"closest_hit"}
    if integrator == "whitted":
        wanted |= {"occluded"}
    if integrator == "ray_cast":
        wanted |= {"owner", "coordinates"}
    if integrator == "cost":
        wanted = {"traversal_cost"}
    elif geometry.parts is not None or geometry.instances is not None:
        wanted |= {"surface"}
    if is_textured:
        wanted |= {"coordinates"}
    if is_oriented:
        wanted |= {"tangents"}
    return linked_geometry(linker, geometry, shapes, wanted)


def linked_geometry(linker: Linker, geometry: Geometry, shapes: Any, wanted: Iterable[str]) -> Link:
    """A geometry behind a link, with the operations `wanted`.  shapes: the link to its shapes."""
    bvh = geometry.bvh
    if bvh is not None and bvh.corners is None:  # one type less: without triangles none are read
        bvh = bvh._replace(corners=_NO_FLOATS)
    table = geometry._replace(shapes=shapes, bvh=bvh, tracer=None)
    return linker.link(geometries.operations, wanted, {0: table})


def _present(array: Any, n: int, value: int) -> Any:
    return np.full(n, value, np.int64) if array is None else array


def _always_textured(table: Any) -> Any:
    """A table whose columns of parameters all have `texture`."""
    if not isinstance(table, tuple):
        return table
    if isinstance(table, Colours | Numbers):
        return table._replace(texture=_present(table.texture, len(table.value), -1))
    return type(table)(*(_always_textured(part) for part in table))


def linked_materials(
    linker: Linker, materials: Materials, integrator: str, is_textured: bool
) -> Materials:
    """Materials whose tables are behind links.  integrator: see `linked_scene`."""
    n = len(materials.shown.value)
    tables = {
        code: _always_textured(table)
        for code, field, _, _, _ in bsdfs.TABLES
        if (table := getattr(materials.leaves, field)) is not None
    }
    wanted = {
        "path": {"eval_pdf", "sample", "branches"},
        "direct": {"eval_pdf", "sample", "branches"},
        "whitted": {"eval_pdf", "branches", "ambient"},
    }.get(integrator, set())
    leaves: Any = linker.link(bsdfs.by_code.operations, wanted, tables)
    flat = _NOTHING
    if materials.flat_leaves is not None and wanted:
        nested = {
            "path": {"eval_pdf_nested", "sample_nested"},
            "direct": {"eval_pdf_nested", "sample_nested"},
            "whitted": {"eval_pdf_nested", "branches_nested", "ambient_nested", "leaf_count"},
        }[integrator] | {"_most", "_prepare"}
        flat = linker.link(
            flattened_materials.operations,
            nested,
            {0: _always_textured(materials.flat_leaves)},
        )
    only = list(tables)
    kind = materials.kind if materials.kind is not None else np.full(n, only[0] if only else -1)
    row = materials.row if materials.row is not None else np.arange(n)
    textured = materials.textured
    if textured is None:
        textured = Textured(np.zeros(n, np.int64), np.zeros(n, np.int64), _NO_INTEGERS, 0)
    return Materials(
        kind=kind,
        row=row,
        smooth=_present(materials.smooth, n, 1),
        uses_u_lobe=_present(materials.uses_u_lobe, n, 0),
        behind=_present(materials.behind, n, 0),
        shown=_always_textured(materials.shown),
        oriented=_present(materials.oriented, n, 0),
        asks=_present(materials.asks, n, int(is_textured)),
        textured=textured,
        flat_leaves=flat,
        leaves=leaves,
    )


def linked_lights(linker: Linker, lights: Lights, integrator: str) -> LinkedLights:
    """Lights behind links.  integrator: see `linked_scene`."""
    wanted = {
        "path": {"_background", "_environment_density", "_emitted", "_area_density", "_sample"},
        "direct": {"_background", "_environment_density", "_emitted", "_area_density", "_sample"},
        "whitted": {"_background", "_emitted", "_sample_fixed", "_sample"},
    }.get(integrator, set())
    emitters = linker.link(
        light_tables.by_code.operations,
        wanted,
        {
            code: _always_textured(table)
            for code, field, _ in light_tables.TABLES
            if (table := getattr(lights, field)) is not None
        },
    )
    choice = lights.choice
    if choice is None:
        choice = _NO_LIGHTS
    if choice.cumulative is None:
        choice = choice._replace(cumulative=np.ones(1))
    tree = Link(0)
    if lights.tree is None:
        choice = choice._replace(bounded=np.zeros(1))
    elif integrator in ("path", "direct"):  # the others pick no light
        tree = linker.link(light_trees.operations, light_trees.operations, {0: lights.tree})
    ambient = np.zeros((1, 3)) if lights.ambient is None else lights.ambient
    return LinkedLights(emitters, choice, tree, ambient)
