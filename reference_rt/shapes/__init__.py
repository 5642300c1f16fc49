"""Shapes: the geometry of a scene, down to rays against single primitives.

- `flat/`, `curved/`, `meshes/`, `box.py`: the primitives, one file each;
- `csg.py`: solids made of primitives; `instances.py`: copies of groups of shapes;
- `tables.py`: all tables of a scene; `dispatch.py`: the kernels for any primitive;
- `brute_force.py`: rays against all primitives of small scenes.

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
- `face_of(table, hit)` of shapes with several faces: the number of the face;
- `nearer` of shapes that `ray_simd.py` tests against several rays at once, with `arguments(table,
  i)`, what its `distance` takes of a row, and `found(table, i, ray, t)`, the crossing at t.

To add a shape: its file; what `tables.py` says; a translator in `comparisons.translator`; a
scene; a row in the tests' tuple.  Step by step: docs/extending.md.
"""

from reference_rt.core.arrays import IntArray
from reference_rt.shapes.box import Box
from reference_rt.shapes.brute_force import Packets, nearest, nearest_of_ray, nearest_of_rays
from reference_rt.shapes.curved.quadric import Cone, Cylinder, Quadric
from reference_rt.shapes.curved.sphere import Sphere
from reference_rt.shapes.curved.torus import Torus
from reference_rt.shapes.dispatch import (
    colour,
    enters,
    face,
    intersect,
    owner,
    pdf,
    sample,
    sample_fixed,
    spans,
    surface,
    tangents,
    uv,
)
from reference_rt.shapes.flat.disk import Disk
from reference_rt.shapes.flat.plane import Plane
from reference_rt.shapes.flat.polygon import Polygon
from reference_rt.shapes.flat.rectangle import Rectangle
from reference_rt.shapes.meshes.mesh import Mesh
from reference_rt.shapes.meshes.triangle import Triangle
from reference_rt.shapes.shape import Shape
from reference_rt.shapes.tables import (
    BOX,
    DISK,
    PLANE,
    POLYGON,
    QUADRIC,
    RECTANGLE,
    SPHERE,
    TABLES,
    TORUS,
    TRIANGLE,
    Primitive,
    Shapes,
)

__all__ = [
    "BOX",
    "DISK",
    "PLANE",
    "POLYGON",
    "QUADRIC",
    "RECTANGLE",
    "SPHERE",
    "TABLES",
    "TORUS",
    "TRIANGLE",
    "Box",
    "Cone",
    "Cylinder",
    "Disk",
    "IntArray",
    "Mesh",
    "Packets",
    "Plane",
    "Polygon",
    "Primitive",
    "Quadric",
    "Rectangle",
    "Shape",
    "Shapes",
    "Sphere",
    "Torus",
    "Triangle",
    "colour",
    "enters",
    "face",
    "intersect",
    "nearest",
    "nearest_of_ray",
    "nearest_of_rays",
    "owner",
    "pdf",
    "sample",
    "sample_fixed",
    "spans",
    "surface",
    "tangents",
    "uv",
]
