"""Scenes: the description, reading and checking of scene files, and the kernels' tables.

`model` is the description (pydantic) with its checks, YAML and JSON.  `build` makes `SceneTables`
from a description: textures, materials and lights itself, the rest in `build_geometry` and
`build_hierarchies`.  `likely_mistakes` finds valid scenes that probably are not what was meant.

Contract: a description is checked when it is made; every error is a SceneError with file, line, key
path and what was expected.  Tables are C-contiguous arrays, nearly all of float64 or int64; a
feature that the scene lacks is None, and its kernel branches are not compiled.  To add a field: in
`SceneModel`, with its check, and in the `build_...` file whose table it changes.
"""
