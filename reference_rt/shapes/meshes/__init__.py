"""Triangle meshes, and single triangles, which have the same table.

- `mesh.py`: the description of a mesh; `files/`: readers of mesh files;
- `triangle_table.py`: the table; `triangle.py`: the kernels; `watertight.py`: a triangle in ray
  space;
- `topology.py`: vertex normals for meshes without any; whether a mesh is closed.

The contract is that of `shapes`, except that `intersect` takes a `Shear`, which is made once per
ray.  A ray through a shared edge or vertex meets exactly those of the triangles around it that it
would meet a hair beside it.  A mesh's triangles are rows with one `owner` (the shape id) and their
number in the file as `face`; triangles without area are left out when the scene is built.

To add a property of vertices: a column, None if no triangle has any, in `Triangles`,
`table_of`, `facing` and `align`, and an array in `MeshData`.
"""
