"""The rung `files`: whether our tables hold what the scene's files and descriptions say.

The other rungs compare two renderers that are fed from our readers and our tables: a mesh that we
read 5 % too large is too large in both.  Here each shape and image is held against sources that
share nothing with them:

- files of meshes (`meshes`): Mitsuba's own loader (.obj, .ply), trimesh (.stl, .off, .gltf,
  .glb) or lib3mf (.3mf), for corners, faces, normals and uv; smooth normals by their formula;
- images (`images`): Mitsuba's own loader, and its conversion to linear values; between texels, at
  the seams of repeated images and skies and beyond borders, that loader's texels by the formula in
  NumPy;
- transforms and maps of instances: SciPy's rotations and NumPy's inverse, for normals too;
- spheres, boxes, cylinders, ... (`equations`): the equation of the description's own numbers, at
  the points and for the normals that our tracer finds;
- the description itself (`description`): its text by ruamel.yaml, and what it leaves out by
  `documented.toml`, a table of the documented fields and defaults; a glTF file's numbers by its
  JSON and glTF's defaults (`gltf`).

What no second source reads is counted, and named.
"""

from comparisons.rungs.files.rung import files, misread

__all__ = ["files", "misread"]
