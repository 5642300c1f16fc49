"""F3: rays in closed surfaces find their way out through no edge and no vertex.

Law.  From inside a closed mesh every ray hits, and crosses an odd number of triangles, once more
out than in; from outside it crosses an even number, as often in as out.  From inside other closed
surfaces (boxes, capped cylinders and cones, spheres, tori, solids of set operations) every ray
hits, at their edges and seams too.

Range.  Meshes of radius 1 to 6 (an icosphere, a cube, pbrt's noisy globe, a knot) at offsets of 1
to 1e9, where vertices are rounded, but faces share them; 20 to 81,920 triangles at the origin;
sizes of 1e-70 (smaller meshes are refused: the squares of their areas are no floats) to 1e150,
where products of two coordinates end.

Counts.  Every vertex, every edge's middle, random points of edges and random directions: quick some
8,000 rays a point, full 1,000,000, a tenth of them counted triangle by triangle.

Passes.  No leak, no odd count.

Mitsuba gets vertices and rays rounded to float32, as long as float32's spacing there is below 0.1:
the mesh stays closed, the rays' origins inside.  It takes part with Embree's robust flag, without
it, and in an instance, where Mitsuba does not pass the flag on.

`tracers`: who traces; `seams`: surfaces that are no meshes; `shots`: a leaking room from inside.
"""
