"""F7: the laws of sets hold for CSG solids, and coincident faces leave no film.

Law.  Along each ray:
- a tree of set operations and any other that is the same set (idempotence, absorption,
  commutativity, associativity, distribution, De Morgan, complements) have the same list of
  crossings, bit for bit: the operands' crossings are the same numbers.  A - A, A - (A | B) and
  (A & B) - A have none;
- crossings of operands further apart than the sum of the widths that the query states
  (the error of the surface and of the ray's arithmetic, over the cosine) are told apart: between
  them the list says inside where exact arithmetic on the tables does.  No narrower stretch is
  reported;
- the mean of chord lengths is the volume over the area of the beam: within 4 standard errors of
  manifold3d's.

Range.  Depth 1 to 64, of spheres, ellipsoids, boxes, cylinders, cones, quadrics, tori and closed
meshes; faces shifted by 1e-3 to 2^-53 of the size, and by nothing; offsets to 1e9 sizes; 2 to 64
operands.

Counts.  2 x 10^4 rays a depth, 3000 a shift and an offset, with the exact arbiter.

Passes.  No failure.

Contestants. Ours: the query of all crossings; the textbook's: interval lists (Roth 1982), inside
tests (Tilove 1980), which give the first crossing alone. Mitsuba has no solids and takes no part:
what stands in for it elsewhere (`comparisons/mitsuba/csg.py`) is a program of this project on
Mitsuba's hits.

`faces`, `laws` and `volumes` have the cases, `trees` draws and rewrites trees; crossings and the
exact truth are in `harness.solids`."""

from comparisons.experiments.stability.harness.series import Family
from comparisons.experiments.stability.solids import faces, laws, volumes

__all__ = ["faces", "laws", "volumes"]

FAMILY = Family(
    "F7",
    "set operations",
    "Trees of set operations that are the same set have the same crossings, bit for bit; faces "
    "that coincide, or nearly, leave nothing narrower than rounding, and lose nothing wider.",
    "POV-Ray's issues on coincident surfaces (#125, #139, #209) are open; Embree, pbrt and Mitsuba "
    "have no solids.",
)
