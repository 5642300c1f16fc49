"""F5: every hierarchy finds what testing every primitive finds.

Law.  The same shape, the same face, the same bits of t and of the coordinates there, whichever of
the four hierarchies (sah, median, spatial, none) is traversed; and the any-hit query says that
something is there before infinity and just beyond t, and nothing before t.

Range.  1 to 1e6 triangles, a third of them on a lattice; 1 to 1e4 copies in one place; slivers of
aspect 1 to 1e15, with rays in their planes; assorted shapes at offsets of 1 to 1e15 and of sizes of
1e-70 to 1e300 (spheres and triangles alone from 1e80 on, where the others are refused; from 1e160
on nothing is hit); and a scene with everything, which the quick run leaves out, as its kernels take
half a minute to compile.  Rays: anywhere, through vertices, along axes and diagonals with both
zeros in the planes of boxes, from vertices.

Counts.  Quick 4,000 rays, full 1,000,000, fewer where rays times primitives exceed 2e7, eight at
once 2e8.  Each ray is a case for each hierarchy.

Passes.  No difference.

Above 2,000 primitives "none" stands for all of them: it tests every triangle, eight at once, and is
itself compared with single tests below that.  Mitsuba does not take part: it cannot trace without
Embree's hierarchy.

`scenes` draws scenes and rays; `every` tests every primitive and compares.
"""
