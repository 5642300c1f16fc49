"""Geometry for comparisons: exact hits, float32 error bounds, lengths of shapes, frames.

- `exact`: first hits by exact integer arithmetic, which decide which tracer is right.
- `flatten`: a scene as primitives, with groups, instances and solids expanded from its description
  (not from our tables, which are under test).
- `sizes`: lengths of each primitive, from which error bounds are made.
- `float32`, `frame`: the error bound of a float32 hit, and the coordinates in which Mitsuba sees a
  scene.

Points are (n, 3) float64 in scene units; an index of -1 means none; infinite lengths belong to
infinite planes.  To add a shape: its smallest length in `sizes._features`, its crossings in
`exact`.
"""
