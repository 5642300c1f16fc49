"""`reference-rt explain`: what a scene uses, what is left out because the scene lacks it, which
kernels its picture uses, and which of them are compiled already.
"""

import importlib.metadata
import re
from collections.abc import Iterable, Iterator
from typing import Any

import numba
import numpy as np
from numba import types
from rich.console import Console
from rich.table import Table

from reference_rt.accel import bvh
from reference_rt.cli.limits import in_words, limits_of
from reference_rt.cli.media_sides import contradictions
from reference_rt.integrators import RayCast, Whitted
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.jit.kernel import Signature, is_compiled
from reference_rt.lights import TABLES as LIGHT_TABLES
from reference_rt.lights import Lights
from reference_rt.lights.emitters.environment_map import EnvironmentMaps
from reference_rt.materials.bsdfs.tables import TABLES as MATERIAL_TABLES
from reference_rt.materials.nested.flattened import FlattenedMaterials
from reference_rt.rendering.kernels import operation_of
from reference_rt.rendering.scene import Scene
from reference_rt.rendering.warm_up import picture_calls
from reference_rt.sampling import Grid
from reference_rt.scene.likely_mistakes import likely_mistakes
from reference_rt.shapes import TABLES as SHAPE_TABLES
from reference_rt.shapes import Mesh, Shape
from reference_rt.shapes.csg import Solid
from reference_rt.shapes.shape import TabulationContext
from reference_rt.textures import TABLES as TEXTURE_TABLES
from reference_rt.textures.bitmap import Memory
from reference_rt.util.errors import UsageError, printable

Lines = list[tuple[str, str]]

_METHODS = {
    "auto": "BVH by surface area heuristic",
    "sah": "BVH by surface area heuristic",
    "median": "BVH by median split",
    "spatial": "BVH with spatial splits",
    "none": "brute force",
}


def explain(scene: Scene, tables: SceneTables) -> tuple[Lines, Lines]:
    """(what is used, what is left out), each a list of (what, how much or why)."""
    used: Lines = []
    pruned: Lines = []
    _shapes(tables, used, pruned)
    _meshes(scene, used, pruned)
    _hierarchy(scene, tables, used, pruned)
    _materials(tables, used, pruned)
    _media(scene, used, pruned)
    _textures(tables, used, pruned)
    _lights(scene, tables, used, pruned)
    _integration(scene, tables, used, pruned)
    pruned.append(("Mitsuba", "rendering never imports it; only comparing does"))
    return used, pruned


def margins(scene: Scene) -> tuple[Lines, Lines]:
    """(how close the scene is to float64's limits, where it exceeds them), each (limit, what)."""
    found = limits_of(scene)
    near = [(limit.law, in_words(limit)) for limit in found if not limit.is_beyond]
    return near, [(limit.law, in_words(limit)) for limit in found if limit.is_beyond]


def _shapes(tables: SceneTables, used: Lines, pruned: Lines) -> None:
    for _, field, _, _ in SHAPE_TABLES:
        table = getattr(tables.geometry.shapes, field)
        if table is None:
            pruned.append((field, "the scene has none: their kernels are not compiled"))
        else:
            size = sum(a.nbytes for a in table if a is not None)
            used.append((field, f"{len(table.face):,} ({_bytes(size)})"))
    triangles = tables.geometry.shapes.triangles
    if triangles is not None:
        for column, name, otherwise in (
            (triangles.normals, "vertex normals", "triangles are shaded flat"),
            (triangles.uvs, "texture coordinates", "triangles have their barycentrics"),
            (triangles.colours, "vertex colours", "triangles have their material's colour"),
        ):
            if column is None:
                pruned.append((name, f"no mesh has any: {otherwise}"))
    solids, instances = tables.geometry.solids, tables.geometry.instances
    if solids is None:
        pruned.append(("solids", "no union, intersection or difference"))
    else:
        used.append(("solids", f"{len(solids.first):,} of {len(solids.kind):,} operands"))
    if instances is None:
        pruned.append(("instances", "no group is drawn"))
    else:
        used.append(("instances", f"{len(instances.root):,} of {len(np.unique(instances.root)):,}"))


def _meshes(scene: Scene, used: Lines, pruned: Lines) -> None:
    """What mesh files have that is not used, and which vertex normals are computed."""
    for name, mesh in _named_meshes(scene):

        def left(_: int, note: str, name: str = name) -> None:
            pruned.append((f"of {name}", note))

        mesh.tabulate(TabulationContext(folder=scene.folder, warn=left))
        if mesh.smooth and mesh.makes_normals(mesh.data(scene.folder)):
            used.append((f"smooth {name}", "its vertex normals are made, weighted by angle"))
        elif mesh.smooth:
            pruned.append((f"smooth {name}", "it has vertex normals of its own"))


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


def _hierarchy(scene: Scene, tables: SceneTables, used: Lines, pruned: Lines) -> None:
    hierarchy = tables.geometry.bvh
    shapes = tables.geometry.shapes
    count = sum(len(table.face) for table in shapes if table is not None)
    if hierarchy is None:
        reason = f"{count} primitives: brute force is faster"
        pruned.append(("hierarchy", reason))
        return
    # The three arrays of nodes are views of the same memory.
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


def _materials(tables: SceneTables, used: Lines, pruned: Lines) -> None:
    materials = tables.materials
    for _, field, _, _, _ in MATERIAL_TABLES:
        table = getattr(materials.leaves, field)
        if table is None:
            pruned.append((field, "no material of this kind: its kernels are not compiled"))
        else:
            used.append((field, f"{_rows(table):,}"))
    _layers(materials.flat_leaves, used, pruned)
    if not materials.oriented.any():
        pruned.append(("tangents", "no material depends on the directions of u and v"))
    else:
        used.append(("tangents", "dp/du and dp/dv where a material depends on them"))


def _layers(layers: FlattenedMaterials | None, used: Lines, pruned: Lines) -> None:
    if layers is None:
        pruned.append(("layers", "no material is nested"))
        return
    used.append(("layers", f"{len(layers.kind):,}, of {len(layers.first):,} materials"))
    for name, table, what in (
        ("shares", layers.weights, "mask or blend"),
        ("bumps", layers.bumps, "bump"),
        ("normal maps", layers.normal_maps, "normal map"),
    ):
        if table is None:
            pruned.append((name, f"no material is a {what}"))
        else:
            used.append((name, f"{_rows(table):,}"))


def _media(scene: Scene, used: Lines, pruned: Lines) -> None:
    if not scene.has_media:
        pruned.append(("media", "the scene has none: paths go from surface to surface"))
    for name, medium in scene.media.items():
        sigma_t = [medium.scale * one for one in medium.sigma_t]
        free = ", ".join(f"{1.0 / one:.4g}" if one > 0.0 else "no end" for one in sigma_t)
        how = medium.phase.type if any(medium.albedo) else "only absorbs"
        used.append((f"medium {name}", f"{how}; mean free paths {free}"))
    if scene.has_media and isinstance(scene.integrator, RayCast):
        pruned.append(("light in media", "ray casting shows the first surfaces, boundaries too"))


def _textures(tables: SceneTables, used: Lines, pruned: Lines) -> None:
    if tables.textures is None:
        pruned.append(("textures", "the scene has none: surface coordinates are not computed"))
        return
    for _, field, _, _ in TEXTURE_TABLES:
        table = getattr(tables.textures, field)
        if table is None:
            pruned.append((f"textures: {field}", "no texture of this kind"))
        else:
            size = _bytes(_size(table))
            used.append((f"textures: {field}", f"{len(table[-1]):,} ({size})"))


def _size(table: Any) -> int:
    """The bytes of a table, whose columns may be tables."""
    if isinstance(table, Memory):
        return int(table.codes8.nbytes)  # the others are the same bytes
    return sum(map(_size, table)) if isinstance(table, tuple) else int(table.nbytes)


def _rows(table: Any) -> int:
    """The number of rows of a table, whose columns may be tables; 0 for None."""
    if table is None:
        return 0
    first = getattr(table, "face", table)  # of triangles the first column is of shared points
    while isinstance(first, tuple):
        first = first[0]
    return len(first)


def _lights(scene: Scene, tables: SceneTables, used: Lines, pruned: Lines) -> None:
    lights = tables.lights
    if isinstance(scene.integrator, RayCast):
        pruned.append(("lights", "ray casting shows surfaces without light"))
        return
    for name, table in (
        *((f"lights: {field}", getattr(lights, field)) for _, field, _, _ in LIGHT_TABLES),
        ("emissive primitives", lights.areas),
    ):
        if table is None:
            pruned.append((name, "the scene has none"))
        else:
            used.append((name, f"{_rows(table):,}"))
    _surroundings(scene, lights, used, pruned)
    hidden = 0 if lights.areas is None else int(np.count_nonzero(lights.areas.area == np.inf))
    if hidden:
        reason = "of types without sampling, in groups or in solids: BSDF sampling hits them"
        pruned.append((f"sampling of {hidden:,} emissive primitives", reason))
    _light_selection(tables, used, pruned)


def _surroundings(scene: Scene, lights: Lights, used: Lines, pruned: Lines) -> None:
    whitted = isinstance(scene.integrator, Whitted)
    environment = lights.environment
    if environment is None:
        pruned.append(("environment", "the scene has none: rays that miss are black"))
    elif isinstance(environment, EnvironmentMaps):
        height, width = environment.texels.shape[:2]
        size = _bytes(sum(column.nbytes for column in environment))
        used.append(("environment", f"a map of {width} x {height} pixels ({size})"))
    else:
        used.append(("environment", "constant"))
    if environment is not None and whitted:
        pruned.append(("light of the environment", "Whitted shows it, but does not sample it"))
    if lights.ambient is None:
        pruned.append(("ambient light", "the scene has none"))
    elif whitted:
        used.append(("ambient light", "added by materials with a k_a: those of type phong"))
    else:
        pruned.append(("ambient light", "only Whitted has it: it comes from no direction"))


def _light_selection(tables: SceneTables, used: Lines, pruned: Lines) -> None:
    choice, tree = tables.lights.choice, tables.lights.tree
    if choice is None:
        pruned.append(("light sampling", "there is no light to sample"))
        return
    if not tables.materials.smooth.any():
        pruned.append(("light sampling", "every BSDF is a delta lobe: it would contribute nothing"))
    if len(choice.kind) == 1:
        pruned.append(("light selection", "there is one light"))
    elif tree is None:
        pruned.append(("light tree", "few lights: they are selected by power"))
    else:
        size = _bytes(sum(column.nbytes for column in tree))
        placed = np.count_nonzero(tree.trail >= 0)
        used.append(("light tree", f"{placed:,} lights, by power, distance and direction ({size})"))


def _integration(scene: Scene, tables: SceneTables, used: Lines, pruned: Lines) -> None:
    integrator, sampler = scene.integrator, scene.resolved_sampler
    used.append(("camera", scene.camera.type))
    used.append(("integrator", integrator.type))
    film = scene.film
    used.append(("film", f"{film.width} x {film.height}, {film.filter.type} filter"))
    if isinstance(integrator, RayCast):
        pruned.append(("sampler", "one ray through each pixel's centre"))
    elif isinstance(sampler, Grid):
        pruned.append(("random numbers", "none are drawn on a grid"))
        used.append(("samples", f"{sampler.spp} fixed per pixel"))
    else:
        used.append(("samples", f"{sampler.spp} per pixel, {sampler.type}, seed {sampler.seed}"))
    if film.filter.type in ("box", "tent"):
        pruned.append(
            ("filter weights", f"samples are distributed as the {film.filter.type} filter")
        )
    if isinstance(integrator, RayCast):
        pruned.append(("film layers", "ray casting has its own"))
    elif not film.layers:
        pruned.append(("film layers", "none beside the colour is requested"))
    else:
        used.append(("film layers", ", ".join(film.layers)))


def _bytes(n: int) -> str:
    for unit in ("B", "KiB", "MiB"):
        if n < 1024:
            return f"{n:.3g} {unit}"
        n /= 1024  # type: ignore[assignment]
    return f"{n:.3g} GiB"


_OPERATIONS = {
    "any_hits": "shadow rays of blocks",
    "area_density": "light densities",
    "background": "radiance",
    "backgrounds": "radiance where a block's rays escape",
    "branches": "perfect reflection and refraction",
    "camera_ray": "camera rays",
    "closest_hit": "closest hits",
    "closest_hits": "closest hits of blocks",
    "complete": "surface coordinates of hits of blocks",
    "coordinates": "texture coordinates",
    "emitted": "emission",
    "environment_density": "light densities",
    "enters": "sides of crossings",
    "eval_pdf": "scattering and density",
    "evaluate": "colours",
    "face": "faces",
    "film_offset": "sample offsets",
    "gradient": "slopes",
    "holds": "which lights",
    "intersect": "crossings",
    "most": "most layers",
    "nearest_of_block": "hits of blocks",
    "nearest_of_type": "hits",
    "number": "layers",
    "occluded": "shadow rays",
    "owner": "ids",
    "pdf": "light densities",
    "prepare": "weights and frames",
    "sample": "samples",
    "sample_fixed": "light of fixed points",
    "samples": "light samples of blocks",
    "scatter": "scattering of blocks",
    "stratum_of": "signs of filters",
    "surface": "surface points",
    "surfaces": "surface points of blocks",
    "traversal_cost": "what rays cost",
    "uv": "texture coordinates",
}
"""Operations whose names say too little."""

_TABLES = {
    "Areas": "area lights",
    "BoxSetup": "filter",
    "Environment": "constant environment",
    "Tabulated": "filter",
    "TentSetup": "filter",
    "Panes": "thin dielectrics",
    "Transparents": "dielectrics",
}
"""Classes of tables, likewise."""

_INSIDE = {"MediaPathSetup": "path through media"}
_DRIVERS = {
    "render_tile": "driver of the picture",
    "first_hits_tile": "driver of albedo and normal",
    "aov_tile": "driver of ray casting",
    "cost_tile": "driver of what rays cost",
}


def kernels_of(scene: Scene) -> Lines:
    """(what, which kernels): those of a scene's picture."""
    if numba.config.DISABLE_JIT:
        return [("kernels", "NUMBA_DISABLE_JIT is set: they run as plain Python")]
    calls = picture_calls(scene)
    ready = sum(is_compiled(*call) for call in calls)
    lines = [("compiled", f"{ready} of {len(calls)}; all scenes share them")]
    found: dict[str, set[str]] = {}
    for compiled, signature in calls:
        what, operation = _named(operation_of(compiled), signature)
        found.setdefault(what, set()).add(operation)
    return lines + [(what, ", ".join(sorted(of_type))) for what, of_type in sorted(found.items())]


def _named(kernel: str, signature: Signature) -> tuple[str, str]:
    """(the table that a kernel works on, what it computes);  of a driver, which loops over pixels:
    (what it computes, the integrator and the sampler that it has inside)."""
    arguments = signature if isinstance(signature, tuple) else signature.args
    if not isinstance(arguments[0], types.CPointer):
        classes = [getattr(of, "instance_class", type(None)).__name__ for of in arguments]
        inside = [
            _INSIDE.get(name, name.removesuffix("Setup").lower())
            for name in classes
            if name.endswith("Setup")
        ]
        return _DRIVERS.get(kernel, _words(kernel)), ", ".join(inside) or "one ray per pixel"
    table = arguments[0].dtype.instance_class.__name__
    name = kernel.strip("_").removesuffix("_nested")
    return _TABLES.get(table, _words(table)), _OPERATIONS.get(name, _words(name))


def _words(name: str) -> str:
    """Of a name in either case: `RoughConductors` and `rough_conductors` become words."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])|_", " ", name).strip().lower()


def print_page(scene: Scene) -> None:
    """Print, on standard output, all that is known of a scene without rendering it.  Raises
    SceneError."""
    used, pruned = explain(scene, scene.tables)
    near, beyond = margins(scene)
    mistakes = [
        (str(scene.error("", *mistake.path)), mistake.message)
        for mistake in (*likely_mistakes(scene, scene.tables), *contradictions(scene))
    ]
    console = Console()
    for title, lines in (
        ("used", used),
        ("left out", _by_reason(pruned)),
        ("kernels", kernels_of(scene)),
        ("nearest to float64's limits", near),
        ("warning: beyond float64", beyond),
        ("warning: probably a mistake", mistakes),
    ):
        if not lines:
            continue
        table = Table(title=title, title_justify="left", show_header=False, box=None)
        for what, why in lines:
            table.add_row(printable(what), printable(why))
        console.print(table)
        console.print()


WITNESSES = "reference_rt.witnesses"
"""The group of entry points of other packages: functions of a scene that return the reasons why a
renderer may not vote on it."""


def print_witness(scene: Scene, name: str) -> None:
    """Print whether another renderer may vote on a scene's pictures.  Raises UsageError."""
    known = importlib.metadata.entry_points(group=WITNESSES)
    if name not in known.names:
        expected = ", ".join(sorted(known.names)) or "a package that adds one"
        raise UsageError(f"--witness: expected {expected}, got '{name}'")
    reasons = known[name].load()(scene)
    print(f"{name} does not vote:" if reasons else f"{name} votes")
    for reason in reasons:
        print(f"  {printable(reason)}")


def _by_reason(lines: Iterable[tuple[str, str]]) -> list[tuple[str, str]]:
    """The same with one line for each reason: a simple scene lacks thirty things for ten."""
    names: dict[str, list[str]] = {}
    for what, why in lines:
        names.setdefault(why, []).append(what)
    return [(", ".join(some), why) for why, some in names.items()]
