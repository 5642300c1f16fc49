"""The finite set of all kernels, to be compiled ahead of time.

Kernels (`kernels.py`) are compiled for types of tables, not for scenes, so that a few small
scenes which together have every type reach all of them.  These scenes are never rendered: their
tables are linked, and what the linker asks for is collected.  To build the tables compiles the few
kernels that build hierarchies and light trees.

To add kernels of another kind, such as those of a query: a function that returns the calls of one
scene, and its place in `all_calls`.
"""

from collections.abc import Iterable, Iterator
from itertools import cycle, product
from pathlib import Path
from typing import Any

import numpy as np

from reference_rt.cameras import AnyCamera
from reference_rt.cameras.film import AnyFilter, Film, LayerName
from reference_rt.core.model import name_of, types_of
from reference_rt.integrators import Direct, Light, RayCast, Whitted
from reference_rt.integrators import Path as PathTracing
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.jit.kernel import signature_of
from reference_rt.jit.links import Link, Linker
from reference_rt.jit.parallel_compile import Call
from reference_rt.lights import TABLES as LIGHTS
from reference_rt.lights import Constant, EnvironmentMap, Point
from reference_rt.lights.emission import no_emission
from reference_rt.lights.selection.choice import FEW
from reference_rt.materials import (
    Blend,
    Bsdf,
    Bump,
    Diffuse,
    Emissive,
    Mirror,
    NormalMap,
    RoughConductor,
    TwoSided,
)
from reference_rt.rendering.accumulation import Job, jobs_of, splat_job
from reference_rt.rendering.kernels import calls_for, cost
from reference_rt.rendering.linking import EMPTY_SCENE, geometry_of
from reference_rt.rendering.query.bsdf import scatter_kernel
from reference_rt.rendering.query.crossings import SOLIDS, crossings_kernel
from reference_rt.rendering.query.hits import (
    OCCLUDED,
    OCCLUDED_BY_BLOCKS,
    occluded_by_blocks,
    occluded_of_few,
)
from reference_rt.rendering.query.light import direct_kernel, pdf_kernel, sample_kernel
from reference_rt.rendering.query.radiance import cast_kernel
from reference_rt.rendering.query.rays import camera_kernel
from reference_rt.rendering.query.tracing import (
    BLOCKS,
    CROSSING,
    ONE_BY_ONE,
    SURFACES,
    closest,
    closest_of_few,
    cross,
    describe,
    empty_hits,
    empty_primitives,
)
from reference_rt.sampling import AnySampler, Grid
from reference_rt.scene.build import BuiltScene
from reference_rt.scene.examples import NAMED, examples, write_files
from reference_rt.shapes import Mesh, Primitive, Sphere, Triangle
from reference_rt.shapes.csg import Union
from reference_rt.shapes.instances import Instance
from reference_rt.shapes.meshes.files.obj_scanner import scan_call
from reference_rt.textures import AnyTexture, Product
from reference_rt.util.files import temporary_folder


def all_calls() -> list[Call]:
    """All kernels and the scanner of .obj files, without duplicates, those that take longest
    to compile first."""
    found: dict[Call, None] = {scan_call(): None}
    for scene in scenes():
        for calls in (_pictures, query_calls):
            found |= dict.fromkeys(calls(scene))
    return sorted(found, key=cost, reverse=True)


def picture_calls(scene: BuiltScene) -> list[Call]:
    """The kernels of a scene's picture."""
    return calls_for(*_picture(scene))


def _picture(scene: BuiltScene) -> tuple[list[Job], SceneTables, Any, Any]:
    # Of one pixel: the number of pixels changes no type.
    film = scene.film.model_copy(update={"width": 1, "height": 1})
    small = scene.model_copy(update={"film": film})
    jobs = jobs_of(small)
    if isinstance(scene.integrator, Light):
        jobs.append(splat_job(small, no_emission(0)))
    return jobs, scene.tables, scene.camera.setup(1, 1), film.filter.setup()


_INTEGRATORS = PathTracing(), Light(), Direct(light_samples=2), Whitted(), RayCast()
"""Of `Direct` one that is not rendered as paths (`Direct.as_path`)."""


def _pictures(scene: BuiltScene) -> Iterator[Call]:
    """The kernels of its pictures by all integrators that can render it, with its sampler where
    that fits."""
    for integrator in (PathTracing(),) if scene.has_media else _INTEGRATORS:
        fits = integrator.deterministic or not isinstance(scene.sampler, Grid)
        samplers = [scene.sampler if fits else None]
        if isinstance(integrator, Direct) and not fits:
            samplers.append(scene.sampler)
        for sampler in samplers:
            changes = {"integrator": integrator, "sampler": sampler}
            yield from picture_calls(scene.model_copy(update=changes))


# ---- queries -------------------------------------------------------------------------------------

_VECTORS, _FLOATS, _INTEGERS = np.zeros((0, 3)), np.zeros(0), np.zeros(0, np.int64)
_NUMBERS = np.zeros((0, 0), np.int64)
_RAYS = _VECTORS, _VECTORS


def query_calls(scene: BuiltScene) -> list[Call]:
    """The kernels that queries of a scene need, besides those of its pictures."""
    linker, geometry = Linker(), scene.tables.geometry
    wanted = [ONE_BY_ONE, BLOCKS, CROSSING, OCCLUDED, OCCLUDED_BY_BLOCKS, SURFACES]
    if geometry.solids is not None:  # else the operation does not compile
        wanted.append(SOLIDS)
    for operations in wanted:
        geometry_of(linker, geometry, operations)
    rays = Link(0), *_RAYS
    materials, textures = EMPTY_SCENE.materials, EMPTY_SCENE.textures
    lights = EMPTY_SCENE.lights, EMPTY_SCENE.shapes
    found, hits, flags = empty_primitives(0), empty_hits(0, True), np.zeros(0, np.bool_)
    given = (
        (closest_of_few, (*rays, found)),
        (closest, (*rays, _FLOATS, found, _INTEGERS, hits)),
        (describe, (*rays, _INTEGERS, _FLOATS, found, hits)),
        (cross, (*rays, _FLOATS, _FLOATS, 0, 0, _INTEGERS, _INTEGERS, found)),
        (occluded_of_few, (*rays, _FLOATS, flags)),
        (occluded_by_blocks, (*rays, _FLOATS, flags)),
        (crossings_kernel, (Link(0), 0, *_RAYS, _VECTORS, _VECTORS, _NUMBERS, _INTEGERS)),
        (camera_kernel, (scene.camera.setup(1, 1), _FLOATS, _FLOATS, _VECTORS, *_RAYS)),
        (cast_kernel, (EMPTY_SCENE, *_RAYS, _VECTORS)),
        (scatter_kernel, (materials, textures, 0, *_RAYS, _VECTORS, _VECTORS, _VECTORS)),
        (sample_kernel, (*lights, textures, *_RAYS, _VECTORS, _INTEGERS, _VECTORS)),
        (pdf_kernel, (Link(0), *lights, *_RAYS, _VECTORS, found, _FLOATS)),
        (direct_kernel, (EMPTY_SCENE, *_RAYS, 0, 0.0, 0.0, _VECTORS)),
    )
    return [(kernel, signature_of(*arguments)) for kernel, arguments in given] + [*linker.calls]


# ---- small scenes that have, together, every type of table ---------------------------------------
# A table's type depends on which of its optional arrays it has.  So there is a scene for each such
# combination that descriptions can reach: shapes in a hierarchy and without one, triangles with
# each choice of normals, texture coordinates and colours, and so on.  All other parts of a scene
# are kept as rich as possible, since a kernel is needed only if the scene asks for it: tangents,
# for example, if a material is anisotropic.

_LAYERS: tuple[LayerName, ...] = ("albedo", "depth")  # each is written by a kernel of its own

_TEXTURES = {
    name: first
    for of in types_of(AnyTexture)
    if (name := name_of(of)) != "product"
    for first in examples(of)[:1]
}
"""One of each type that has a table of its own for lookups."""

_FEW = {
    "diffuse": Diffuse(),
    "mirror": Mirror(),
    "brushed": RoughConductor(eta=(0.2, 0.2, 0.2), k=(3.0, 3.0, 3.0), alpha=(0.1, 0.4)),
    "lamp": Emissive(radiance=(1.0, 1.0, 1.0)),
}
"""A few BSDFs.  "brushed" is anisotropic: with it kernels for tangents are needed."""

_LEAVES = {
    **_FEW,
    **{name_of(of): examples(of)[0] for of in types_of(Bsdf)},
}
"""Every BSDF."""

_NESTED = {
    "blend": Blend(first="diffuse", second="mirror"),
    "bump": Bump(base="diffuse", height="bitmap"),
    "normal map": NormalMap(base="diffuse", normals="bitmap"),
}
"""Each has a table of its own, which a scene without such materials lacks."""

_LAMPS = (
    *(examples(description)[0] for _, _, description, _ in LIGHTS),
    *examples(Point) * FEW,
)
"""With a lamp of any other type more than FEW lights: a tree picks among them."""

_SKIES = *examples(Constant), examples(EnvironmentMap)[0]

_SAMPLERS = [examples(of)[-1] for of in types_of(AnySampler)]
_CAMERAS = [examples(of)[0] for of in types_of(AnyCamera)]
_FILTERS = [examples(of)[0] for of in types_of(AnyFilter)]


def _mesh(normals: bool, uv: bool, colours: bool) -> Mesh:
    """A triangle whose table has the optional columns that are asked for."""
    return Mesh(
        vertices=np.eye(3),
        faces=np.array([[0, 1, 2]]),
        normals=np.tile((0.0, 0.0, 1.0), (3, 1)) if normals else None,
        uv=np.eye(3)[:, :2] if uv else None,
        colours=np.eye(3) if colours else None,
        material="lamp",
    )


_SHAPES = tuple(
    examples(of)[0].model_copy(update={"material": "lamp"})
    for of in types_of(Primitive)
    if of not in (Triangle, Mesh)
)
"""One of each type but triangles."""

_SOLID = Union(of=(Sphere(), Sphere(center=(1.0, 0.0, 0.0))))
_COPY = Instance(group="group")


def scenes() -> Iterator[BuiltScene]:
    """Scenes that have, together, every type of table, and their tables are built."""
    with temporary_folder() as folder:
        write_files(folder)
        for scene in _scenes(folder):
            assert scene.tables
            yield scene


def _scenes(folder: Path) -> Iterator[BuiltScene]:
    """folder: has the files that examples name."""

    def scene(**parts: Any) -> BuiltScene:
        rich = {
            "film": Film(width=1, height=1, layers=_LAYERS),
            "textures": _TEXTURES,
            "materials": {**_FEW, **_NESTED},
            "shapes": (_mesh(True, True, True),),
            "lights": (*_LAMPS, _SKIES[0]),
        }
        made = BuiltScene(**{**rich, **parts})
        made._folder = folder
        return made

    for k in range(0, len(_SHAPES), 3):  # so few that there is no hierarchy
        yield scene(shapes=_SHAPES[k : k + 3])
    yield scene(shapes=(*_SHAPES, _SOLID), hierarchy="sah")
    # Triangles and nested materials: their choices are independent, and share scenes.
    for columns, names in zip(product((False, True), repeat=3), _subsets(_NESTED), strict=True):
        # A sheet is nested, but has no table of its own.
        nested = {"sheet": TwoSided(base="diffuse"), **{name: _NESTED[name] for name in names}}
        parts = {"materials": _FEW | nested, "shapes": (_mesh(*columns),)}
        yield scene(**parts)
        yield scene(**{**parts, "shapes": (*parts["shapes"], _SOLID), "hierarchy": "sah"})
    for triangles, solids, copies in product((0, 1), repeat=3):
        yield scene(
            shapes=(
                Sphere(),
                *(examples(Mesh)[0],) * triangles,
                *(_SOLID,) * solids,
                *(_COPY,) * copies,
            ),
            groups={"group": (Sphere(),)},
            hierarchy="sah",
        )
    for method in ("median", "spatial"):
        yield scene(hierarchy=method)
    for names in _subsets(_TEXTURES):
        textures = {name: _TEXTURES[name] for name in names}
        yield scene(textures=textures, materials=_FEW)
        if names:
            yield scene(textures=textures | {"product": Product(of=(*names,))}, materials=_FEW)
    yield scene(materials=_LEAVES)
    for sampler in _SAMPLERS:
        if not isinstance(sampler, Grid):
            yield scene(materials=_FEW | _NESTED, media=NAMED["media"], sampler=sampler)
    cycled = zip(_FILTERS, cycle(_CAMERAS), cycle(_SAMPLERS), cycle(_SKIES), strict=False)
    for of_film, camera, sampler, sky in cycled:
        yield scene(
            film=Film(width=1, height=1, filter=of_film, layers=_LAYERS),
            camera=camera,
            integrator=Whitted(),  # the only one for which all samplers may be
            sampler=sampler,
            lights=(*_LAMPS, sky),
        )


def _subsets(names: Iterable[str]) -> Iterator[list[str]]:
    kept = [*names]
    for chosen in product((False, True), repeat=len(kept)):
        yield [name for name, is_chosen in zip(kept, chosen, strict=True) if is_chosen]
