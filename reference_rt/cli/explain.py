"""What a scene needs, what was left out, and why."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from reference_rt.accel import bvh
from reference_rt.cli.limits import limits_of, told
from reference_rt.integrators import RayCast, Whitted
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.lights import Lights
from reference_rt.lights.emitters.environment_map import EnvironmentMaps
from reference_rt.materials import any_smooth
from reference_rt.materials.bsdfs.tables import TABLES as MATERIAL_TABLES
from reference_rt.materials.nested.flattened import Layers
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import Grid
from reference_rt.shapes import TABLES as SHAPE_TABLES
from reference_rt.shapes import Mesh, Shape
from reference_rt.shapes.csg import Solid
from reference_rt.shapes.shape import Place
from reference_rt.textures import TABLES as TEXTURE_TABLES

Lines = list[tuple[str, str]]

_METHODS = {
    "auto": "BVH by surface area heuristic",
    "sah": "BVH by surface area heuristic",
    "median": "BVH by median split",
    "spatial": "BVH with spatial splits",
    "none": "each shape in turn",
}


def explain(scene: Scene, tables: SceneTables) -> tuple[Lines, Lines]:
    """(what is used, what was left out), each a list of (what, how much or why)."""
    used: Lines = []
    left_out: Lines = []
    _shapes(tables, used, left_out)
    _meshes(scene, used, left_out)
    _hierarchy(scene, tables, used, left_out)
    _materials(tables, used, left_out)
    _textures(tables, used, left_out)
    _lights(scene, tables, used, left_out)
    _integration(scene, tables, used, left_out)
    left_out.append(("Mitsuba", "rendering never imports it; only comparing does"))
    return used, left_out


def margins(scene: Scene) -> tuple[Lines, Lines]:
    """(how near the scene comes to float64's limits, where it is beyond), each (law, what)."""
    found = limits_of(scene)
    near = [(limit.law, told(limit)) for limit in found if not limit.is_beyond]
    return near, [(limit.law, told(limit)) for limit in found if limit.is_beyond]


def _shapes(tables: SceneTables, used: Lines, left_out: Lines) -> None:
    for _, field, _, _ in SHAPE_TABLES:
        table = getattr(tables.geometry.shapes, field)
        if table is None:
            left_out.append((field, "the scene has none: their kernels are not compiled"))
        else:
            size = sum(a.nbytes for a in table if a is not None)
            used.append((field, f"{len(table.owner):,} ({_bytes(size)})"))
    triangles = tables.geometry.shapes.triangles
    if triangles is not None:
        for column, name, otherwise in (
            (triangles.normals, "vertex normals", "triangles are shaded flat"),
            (triangles.uvs, "texture coordinates", "a triangle's own are its barycentrics"),
            (triangles.colours, "vertex colours", "a triangle's is its material's"),
        ):
            if column is None:
                left_out.append((name, f"no mesh brings any: {otherwise}"))
    solids, instances = tables.geometry.solids, tables.geometry.instances
    if solids is None:
        left_out.append(("solids", "no union, intersection or difference"))
    else:
        used.append(("solids", f"{len(solids.first):,} of {len(solids.kind):,} operands"))
    if instances is None:
        left_out.append(("instances", "no group is drawn"))
    else:
        used.append(("instances", f"{len(instances.root):,} of {len(np.unique(instances.root)):,}"))


def _meshes(scene: Scene, used: Lines, left_out: Lines) -> None:
    """What of its meshes is left out, and what is made for them."""
    for name, mesh in _named_meshes(scene):

        def left(_: int, note: str, name: str = name) -> None:
            left_out.append((f"of {name}", note))

        mesh.tabulate(Place(folder=scene.folder, warn=left))
        if mesh.smooth and mesh.makes_normals(mesh.data(scene.folder)):
            used.append((f"smooth {name}", "its vertex normals are made, weighted by angle"))
        elif mesh.smooth:
            left_out.append((f"smooth {name}", "it has vertex normals of its own"))


def _named_meshes(scene: Scene) -> Iterator[tuple[str, Mesh]]:
    def of(name: str, shape: Shape) -> Iterator[tuple[str, Mesh]]:
        if isinstance(shape, Mesh):
            yield name, shape
        elif isinstance(shape, Solid):
            for k, operand in enumerate(shape.of):
                yield from of(f"{name}.of[{k}]", operand)

    for i, shape in enumerate(scene.shapes):
        yield from of(f"shapes[{i}]", shape)
    for group, shapes in scene.groups.items():
        for k, shape in enumerate(shapes):
            yield from of(f"groups.{group}[{k}]", shape)


def _hierarchy(scene: Scene, tables: SceneTables, used: Lines, left_out: Lines) -> None:
    hierarchy = tables.geometry.bvh
    shapes = tables.geometry.shapes
    count = sum(len(table.owner) for table in shapes if table is not None)
    if hierarchy is None:
        reason = f"{count} primitives: testing a few one after another is faster"
        left_out.append(("hierarchy", reason))
        return
    # The three views of the nodes are of the same memory.
    size = hierarchy.boxes.nbytes + hierarchy.references.nbytes
    if hierarchy.corners is not None:
        size += hierarchy.corners.nbytes
    found = bvh.of_wide(hierarchy)
    used.append(
        (
            "hierarchy",
            f"{_METHODS[scene.hierarchy]}: {found.nodes:,} nodes, {found.leaves:,} leaves of "
            f"{found.mean_leaf:.1f} references (at most {found.largest_leaf}), depth "
            f"{found.depth}, "
            f"expected tests {found.sah_cost:.3g}, {_bytes(size)}",
        )
    )
    total = size + sum(a.nbytes for table in shapes if table for a in table if a is not None)
    used.append(("memory", f"{total / count:.0f} bytes per primitive, hierarchy included"))


def _materials(tables: SceneTables, used: Lines, left_out: Lines) -> None:
    materials = tables.materials
    for _, field, _, _, _ in MATERIAL_TABLES:
        table = getattr(materials.leaves, field)
        if table is None:
            left_out.append((field, "no material of this kind: its kernels are not compiled"))
        else:
            used.append((field, f"{_rows(table):,}"))
    _layers(materials.layers, used, left_out)
    if materials.oriented is None:
        left_out.append(("tangents", "no material depends on where u and v point"))
    else:
        used.append(("tangents", "dp/du and dp/dv at every hit"))


def _layers(layers: Layers | None, used: Lines, left_out: Lines) -> None:
    if layers is None:
        left_out.append(("layers", "no material is made of others"))
        return
    used.append(("layers", f"{len(layers.kind):,}, of {len(layers.first):,} materials"))
    for name, table, what in (
        ("shares", layers.weights, "mask or blend"),
        ("bumps", layers.bumps, "bump"),
        ("normal maps", layers.normal_maps, "normal map"),
    ):
        if table is None:
            left_out.append((name, f"no material is a {what}"))
        else:
            used.append((name, f"{_rows(table):,}"))


def _textures(tables: SceneTables, used: Lines, left_out: Lines) -> None:
    if tables.textures is None:
        left_out.append(("textures", "the scene has none: surface coordinates are not found"))
        return
    for _, field, _, _ in TEXTURE_TABLES:
        table = getattr(tables.textures, field)
        if table is None:
            left_out.append((f"textures: {field}", "no texture of this kind"))
        else:
            size = _bytes(sum(column.nbytes for column in table))
            used.append((f"textures: {field}", f"{len(table[-1]):,} ({size})"))


def _rows(table: Any) -> int:
    """How many rows a table has, whose columns may be tables; 0 for one that is not there."""
    if table is None:
        return 0
    first = table
    while isinstance(first, tuple):
        first = first[0]
    return len(first)


def _lights(scene: Scene, tables: SceneTables, used: Lines, left_out: Lines) -> None:
    lights = tables.lights
    if isinstance(scene.integrator, RayCast):
        left_out.append(("lights", "ray casting shows surfaces as they are"))
        return
    for name, table in (
        ("point lights", lights.points),
        ("spots", lights.spots),
        ("directional lights", lights.directionals),
        ("emissive primitives", lights.areas),
    ):
        if table is None:
            left_out.append((name, "the scene has none"))
        else:
            used.append((name, f"{_rows(table):,}"))
    _surroundings(scene, lights, used, left_out)
    hidden = 0 if lights.areas is None else int(np.count_nonzero(lights.areas.area == np.inf))
    if hidden:
        reason = "of types that cannot be sampled, in groups or in solids: scattered rays find them"
        left_out.append((f"sampling of {hidden:,} emissive primitives", reason))
    _picking(tables, used, left_out)


def _surroundings(scene: Scene, lights: Lights, used: Lines, left_out: Lines) -> None:
    whitted = isinstance(scene.integrator, Whitted)
    environment = lights.environment
    if environment is None:
        left_out.append(("environment", "the scene has none: rays that miss are black"))
    elif isinstance(environment, EnvironmentMaps):
        height, width = environment.texels.shape[:2]
        size = _bytes(sum(column.nbytes for column in environment))
        used.append(("environment", f"a map of {width} x {height} pixels ({size})"))
    else:
        used.append(("environment", "constant"))
    if environment is not None and whitted:
        left_out.append(("light of the environment", "Whitted sees it, but does not gather it"))
    if lights.ambient is None:
        left_out.append(("ambient light", "the scene has none"))
    elif whitted:
        used.append(("ambient light", "added by materials with a k_a: those of type phong"))
    else:
        left_out.append(("ambient light", "Whitted alone knows it: it comes from nowhere"))


def _picking(tables: SceneTables, used: Lines, left_out: Lines) -> None:
    choice, tree = tables.lights.choice, tables.lights.tree
    if choice is None:
        left_out.append(("light sampling", "there is no light to sample"))
        return
    if not any_smooth(tables.materials):
        left_out.append(
            ("light sampling", "every material mirrors or refracts: it would find none")
        )
    if len(choice.kind) == 1:
        left_out.append(("picking a light", "there is one"))
    elif tree is None:
        left_out.append(("light tree", "few lights: they are picked by their power"))
    else:
        size = _bytes(sum(column.nbytes for column in tree))
        placed = np.count_nonzero(tree.light >= 0)
        used.append(("light tree", f"{placed:,} lights, by power, distance and direction ({size})"))


def _integration(scene: Scene, tables: SceneTables, used: Lines, left_out: Lines) -> None:
    integrator, sampler = scene.integrator, scene.resolved_sampler
    used.append(("camera", scene.camera.type))
    used.append(("integrator", integrator.type))
    film = scene.film
    used.append(("film", f"{film.width} x {film.height}, {film.filter.type} filter"))
    if isinstance(integrator, RayCast):
        left_out.append(("sampler", "one ray through each pixel's centre"))
    elif isinstance(sampler, Grid):
        left_out.append(("random numbers", "a deterministic integrator on a grid draws none"))
        used.append(("samples", f"{sampler.spp} fixed per pixel"))
    else:
        used.append(("samples", f"{sampler.spp} per pixel, {sampler.type}, seed {sampler.seed}"))
    if film.filter.type in ("box", "tent"):
        left_out.append(("filter weights", f"samples lie as dense as a {film.filter.type} weighs"))
    if isinstance(integrator, RayCast):
        left_out.append(("film layers", "ray casting writes its own"))
    elif not film.layers:
        left_out.append(("film layers", "none beside the colour is asked for"))
    else:
        used.append(("film layers", ", ".join(film.layers)))


def _bytes(n: int) -> str:
    for unit in ("B", "KiB", "MiB"):
        if n < 1024:
            return f"{n:.3g} {unit}"
        n /= 1024  # type: ignore[assignment]
    return f"{n:.3g} GiB"
