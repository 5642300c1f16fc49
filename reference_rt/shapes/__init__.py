"""Shapes: the geometry of a scene, down to rays against single primitives.

- `flat/`, `curved/`, `meshes/`, `box.py`: the primitives, one file each;
- `csg.py`: solids made of primitives; `instances.py`: copies of groups of shapes;
- `tables.py`: all tables of a scene; `dispatch.py`: the kernels for any primitive;
- `brute_force.py`: rays against all primitives of small scenes, type by type.

A file has a description (a `Shape`), its table (a NamedTuple of arrays, a row for each primitive,
with the columns of `placement.owners`), `bounds(table)` and kernels.  Contract of the kernels, in
world coordinates and scene units, for row i of the table or the row of a hit:

- `intersect(table, i, ray) -> Crossing`: the smallest t > 0 at which the ray meets the primitive,
  inf for a miss; u and v are two numbers that the following kernels need;
- `surface(table, ray, hit) -> SurfacePoint`: the point, its unit normals and a bound on its error,
  large enough that a ray that starts at this distance does not meet the same point again;
- `uv(table, ray, hit)` and `tangents(table, ray, hit)`: texture coordinates, dp/du and dp/dv;
- `sample(table, i, area, p, u0, u1) -> LightPoint` and `pdf(table, i, area, p, q)` of shapes that
  can be lights, with `areas(table)`: a density per solid angle at p; 0 means that no light arrives;
- `spans(table, i, ray) -> Spans` of solids: where the line, at all t, is inside; t = inf for none;
- `crossings(table, i, ray) -> Spans` of shapes that a ray can cross more than once: all crossings;
- `unit_normals(table)` (n, 3) of flat shapes that can be lights;
- `extent(table)`, the box around all rows, where it is quicker to find than all of `bounds`;
- `face_of(table, hit)` of shapes with several faces: the number of the face;
- `nearer` of shapes that `ray_simd.py` tests against several rays at once, with `arguments(table,
  i)`, what its `distance` takes of a row, and `found(table, i, ray, t)`, the crossing at t.

To add a shape: its file, and its lines in `tables.py`.  Step by step: docs/extending.md.
"""

from reference_rt.shapes.brute_force import nearest as nearest
from reference_rt.shapes.brute_force import nearest_of_rays as nearest_of_rays
from reference_rt.shapes.csg import Solid as Solid  # which completes the models of solids
from reference_rt.shapes.dispatch import colour as colour
from reference_rt.shapes.dispatch import enters as enters
from reference_rt.shapes.dispatch import face as face
from reference_rt.shapes.dispatch import intersect as intersect
from reference_rt.shapes.dispatch import owner as owner
from reference_rt.shapes.dispatch import pdf as pdf
from reference_rt.shapes.dispatch import sample as sample
from reference_rt.shapes.dispatch import sample_fixed as sample_fixed
from reference_rt.shapes.dispatch import spans as spans
from reference_rt.shapes.dispatch import surface as surface
from reference_rt.shapes.dispatch import surfaces as surfaces
from reference_rt.shapes.dispatch import tangents as tangents
from reference_rt.shapes.dispatch import uv as uv
from reference_rt.shapes.shape import Shape as Shape
from reference_rt.shapes.tables import *
