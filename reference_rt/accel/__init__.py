"""Acceleration structures, and the four ways in which a ray finds what it hits.

All four find the same hits, to the last bit; only their speed differs:

- brute force (no BVH), `shapes/brute_force.py`: one type of shape after another.  Of a block of
  rays VECTOR_WIDTH = 8 at once are tested against a sphere, a rectangle, a box, a disk or a quadric
  (`shapes/ray_simd.py`); all others, and single rays, one primitive at a time;
- single-ray traversal: the loop is in `geometry.py`, its steps are in `single_ray.py`;
- stream traversal, `stream.py`: a block of up to BLOCK = 64 rays, each one step at a time;
- packet traversal, `packet_traversal.py`: 16 coherent rays that share their box tests.

Who calls what, and which way it takes:

    path: camera rays, bounces      block_query.closest_hits ------.
    path: shadow rays               block_query.any_hits ----------'-> no BVH:    brute force
                                        ^                              instances: single ray
                                        |                              else:      stream
                                        | rays that are not coherent, instances, no BVH
    query.intersect, first_hits,        |
      more than FEW = 4096 rays     array_query.trace_packet --------> else:      packet
    query.occluded, more than FEW   array_query.occluded_rays -------> block_query.any_hits
      at most FEW rays,             array_query.closest_one_by_one
      and of query.occluded         array_query.occluded_one_by_one
                                        v
    direct, whitted, ray_cast,      geometry.closest_hit ----------+-> no BVH:    brute force
      layers, other queries         geometry.occluded -------------'   else:      single ray

    query.crossings, t_min > 0      next_crossing -------------------> no BVH:    brute force
                                                                       else:      single ray
    query.solid_crossings           csg.surface_along                  only one solid, no search

`closest_hit`, `closest_hits`, `occluded`, `any_hits` and `next_crossing` are operations: their
callers have the tables of a geometry, or a link to it (`geometries` in `geometry.py`).  A linked
operation is compiled once for all geometries with the same types of BVH, solids and instances.  In
it the shapes are behind a link too, so each primitive of a leaf, except triangles, is a call.

Who decides:

- `scene/build_hierarchies.py`: whether there is a BVH.  With `hierarchy: auto` there is none below
  BVH_FROM = 40 primitives without solids and instances (a quadric, or one that has no SIMD test,
  counts for ONE_BY_ONE = 10); with the other methods there always is.
- `block_query.py`, `array_query.py`: block, packet or single ray, as in the diagram.  What a scene
  lacks is None, so all but "coherent" is decided while the caller is compiled.
- `rendering/query/tracing.py`: FEW, because packets and streams take longer to compile.  All
  queries call operations on a geometry through a link (`rendering/kept_links.py`).
- `rendering/linking.py`: which operations are linked; a call of another one stops the process.

Solids and instances are references in leaves of the BVH (kinds SOLID and INSTANCE, see `leaf.py`).
A solid is evaluated in its leaf, whichever traversal reaches it; its mesh operands have BVHs of
their own, which `csg.py` traverses ray by ray.  At an instance the ray is transformed and
goes on at the root of the group's BVH: only single-ray traversal does that.  What has no finite box
(planes, some solids) is in a tree of its own, `Bvh.unbounded`, which all traversals visit.

Why all ways find the same bits:

1. They test a primitive by the same IEEE operations in the same order.  Scalar and SIMD code are
   generated from one function (`jit/simd.py`) or tested to agree (triangles: `test_simd`).
2. No traversal misses a hit: boxes only cull, and rounding only enlarges them (`slab_ray_of`,
   float32 planes rounded outwards, FAR_SLACK).  A box that the ray meets is skipped only where it
   begins beyond the closest hit so far, never at the same t.
3. Of the hits found the choice does not depend on their order: the smallest t, and at equal t the
   first by `crossing_order.precedes`, a total order (instance, kind, shape, face).  Finding a
   primitive twice, in two leaves, changes nothing.  Brute force visits primitives in that order
   and accepts only a smaller t.
4. Any-hit queries return only whether there is a hit.

Tests, all bit for bit: `test_ways` (every way, every kind of BVH and none) and `test_crossings`.

To add a way: a branch in `block_query` or `array_query`, leaves by `leaf.nearest_of_leaf`, and a
line in the table of `test_ways`.
"""

# Operations are numbered as they are defined, and cached kernels contain the numbers: whatever is
# imported first, these modules are imported in this order.
from reference_rt.accel import block_query as block_query
from reference_rt.accel import geometry as geometry
from reference_rt.accel import next_crossing as next_crossing
from reference_rt.accel import packet_traversal as packet_traversal
