"""The kernels of queries for hits, to be compiled ahead of time (`warm_up.py`)."""

import numpy as np

from reference_rt.jit.kernel import signature_of
from reference_rt.jit.links import Link, Linker
from reference_rt.jit.parallel_compile import Call
from reference_rt.rendering.query.hits import (
    OCCLUDED,
    OCCLUDED_BY_BLOCKS,
    occluded_by_blocks,
    occluded_of_few,
)
from reference_rt.rendering.query.linked import geometry_of
from reference_rt.rendering.query.tracing import (
    BLOCKS,
    CROSSING,
    ONE_BY_ONE,
    closest,
    closest_of_few,
    cross,
    describe,
    empty_hits,
    empty_primitives,
)
from reference_rt.scene.build import BuiltScene

_VECTORS, _FLOATS, _INTEGERS = np.zeros((0, 3)), np.zeros(0), np.zeros(0, np.int64)


def query_calls(scene: BuiltScene) -> list[Call]:
    """The linked kernels that `intersect`, `first_hits`, `occluded` and `crossings` need for a
    scene."""
    linker = Linker()
    for operations in (ONE_BY_ONE, BLOCKS, CROSSING, OCCLUDED, OCCLUDED_BY_BLOCKS):
        geometry_of(linker, scene.tables.geometry, operations)
    rays = Link(0), _VECTORS, _VECTORS
    found, hits, flags = empty_primitives(0), empty_hits(0, True), np.zeros(0, np.bool_)
    given = (
        (closest_of_few, (*rays, found)),
        (closest, (*rays, _FLOATS, found, _INTEGERS, hits)),
        (describe, (*rays, _INTEGERS, _FLOATS, found, hits)),
        (cross, (*rays, _FLOATS, _FLOATS, 0, 0, _INTEGERS, _INTEGERS, found)),
        (occluded_of_few, (*rays, _FLOATS, flags)),
        (occluded_by_blocks, (*rays, _FLOATS, flags)),
    )
    return [(kernel, signature_of(*arguments)) for kernel, arguments in given] + [*linker.calls]
