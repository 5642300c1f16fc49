"""Geometry for comparisons: exact arithmetic, float32 error bounds, frames, a scene as primitives.

- `exact`: exact integer arithmetic, and what crossings of rays with shapes are made of.
- `flatten`: a scene as primitives, with groups, instances and solids expanded from its description
  (not from our tables, which are under test).
- `frame`: the error bound of a float32 hit, and the coordinates in which Mitsuba sees a scene.

Points are (n, 3) float64 in scene units; an index of -1 means none.
"""
