"""glTF 2.0 -> scene: reads .gltf and .glb files into our descriptions.

Contract: `read.read_file` is what the scene model calls for such a file (entry points in
pyproject.toml).  The file's JSON is checked against `document`; accessors and buffers are read by
`GltfFile` of `shapes.meshes.files.gltf`; materials and textures become ours in `surfaces`, nodes,
meshes, cameras and lights in `read`.  Meshes are arrays of the scene; images are files: those
within the file are written to the cache, by a digest of their content.  What our scenes lack is
collected in `Reading`, a line each: an error, or with `allow_missing` a warning.  Everything else
that is read otherwise is a note, a `SceneWarning`.

To read another extension: its keys in `document`, its name in `READ` there, and a test."""
