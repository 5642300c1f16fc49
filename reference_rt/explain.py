"""What a scene needs, what was left out, and why."""

import numpy as np

from reference_rt import bvh
from reference_rt.integrators import RayCast, Whitted
from reference_rt.materials import TABLES as MATERIAL_TABLES
from reference_rt.sampling import Grid
from reference_rt.scene import Scene
from reference_rt.shapes import TABLES as SHAPE_TABLES
from reference_rt.tables import SceneTables

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
    _hierarchy(scene, tables, used, left_out)
    _materials(tables, used, left_out)
    _lights(scene, tables, used, left_out)
    _integration(scene, tables, used, left_out)
    left_out.append(("Mitsuba", "rendering never imports it; only comparing does"))
    return used, left_out


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


def _hierarchy(scene: Scene, tables: SceneTables, used: Lines, left_out: Lines) -> None:
    hierarchy = tables.geometry.bvh
    shapes = tables.geometry.shapes
    count = sum(len(table.owner) for table in shapes if table is not None)
    if hierarchy is None:
        reason = f"{count} primitives: testing a few one after another is faster"
        left_out.append(("hierarchy", reason))
        return
    size = hierarchy.nodes.nbytes + hierarchy.references.nbytes
    nodes = hierarchy.nodes[: _nodes_of_the_scene(tables)]
    first, count_of = nodes[:, 6].astype(np.int64), nodes[:, 7].astype(np.int64)
    found = bvh.statistics(bvh.Nodes(nodes[:, :6], first, count_of))
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


def _nodes_of_the_scene(tables: SceneTables) -> int:
    """How many nodes the first of all hierarchies has: those of groups and meshes come after."""
    geometry = tables.geometry
    assert geometry.bvh is not None
    starts = [np.array([len(geometry.bvh.nodes), geometry.bvh.unbounded])]
    if geometry.instances is not None:
        starts.append(geometry.instances.root)
    if geometry.solids is not None:
        starts.append(geometry.solids.root)
    after = np.concatenate(starts)
    return int(after[after > 0].min())


def _materials(tables: SceneTables, used: Lines, left_out: Lines) -> None:
    for _, field, _, _ in MATERIAL_TABLES:
        table = getattr(tables.materials, field)
        if table is None:
            left_out.append((field, "no material of this kind: its kernels are not compiled"))
        else:
            used.append((field, f"{len(table[0])}"))


def _lights(scene: Scene, tables: SceneTables, used: Lines, left_out: Lines) -> None:
    lights = tables.lights
    if isinstance(scene.integrator, RayCast):
        left_out.append(("lights", "ray casting shows surfaces as they are"))
        return
    if lights.choice is None:
        left_out.append(("light sampling", "there is no light: the picture is black"))
        return
    for table, name in ((lights.points, "point lights"), (lights.areas, "emissive primitives")):
        if table is None:
            left_out.append((name, "the scene has none"))
        else:
            used.append((name, f"{len(table[0]):,}"))
    if lights.environment is None:
        left_out.append(("environment", "the scene has none: rays that miss are black"))
    else:
        used.append(("environment", "constant"))
    if tables.materials.diffuses is None:
        left_out.append(
            ("light sampling", "every material mirrors or refracts: it would find none")
        )
    if len(lights.choice.kind) == 1:
        left_out.append(("picking a light", "there is one"))


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
    if film.filter.type == "box":
        left_out.append(("filter weights", "a box filter's are all 1"))
    if isinstance(integrator, Whitted) and tables.lights.environment is not None:
        left_out.append(("light of the environment", "Whitted sees it, but does not gather it"))


def _bytes(n: int) -> str:
    for unit in ("B", "KiB", "MiB"):
        if n < 1024:
            return f"{n:.3g} {unit}"
        n /= 1024  # type: ignore[assignment]
    return f"{n:.3g} GiB"
