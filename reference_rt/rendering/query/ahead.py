"""The kernels of queries, to be compiled ahead of time (`warm_up.py`)."""

import numpy as np

from reference_rt.jit.kernel import signature_of
from reference_rt.jit.links import Link, Linker
from reference_rt.jit.parallel_compile import Call
from reference_rt.rendering.linking import EMPTY_SCENE
from reference_rt.rendering.query.bsdf import scatter_kernel
from reference_rt.rendering.query.camera import camera_kernel
from reference_rt.rendering.query.hits import (
    OCCLUDED,
    OCCLUDED_BY_BLOCKS,
    occluded_by_blocks,
    occluded_of_few,
)
from reference_rt.rendering.query.light import direct_kernel, pdf_kernel, sample_kernel
from reference_rt.rendering.query.linked import geometry_of
from reference_rt.rendering.query.radiance import cast_kernel
from reference_rt.rendering.query.solid_crossings import SOLIDS, crossings_kernel
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
from reference_rt.scene.build import BuiltScene

_VECTORS, _FLOATS, _INTEGERS = np.zeros((0, 3)), np.zeros(0), np.zeros(0, np.int64)
_NUMBERS = np.zeros((0, 0), np.int64)
_RAYS = _VECTORS, _VECTORS


def query_calls(scene: BuiltScene) -> list[Call]:
    """The linked kernels that queries of a scene need, besides those of its pictures."""
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
