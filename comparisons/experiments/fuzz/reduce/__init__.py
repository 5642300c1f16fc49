"""A failing scene made small while it fails in the same rung with the same cause.

`edits.py` and `numbers.py` yield smaller scenes; `reducer.py` keeps one that still fails, and
starts over until none does.  Reduction is by structure (shapes, lights, materials, wrappers, steps
of transforms, triangles), then numbers, then the picture, as in C-Reduce (Regehr et al. 2012).
"""

from comparisons.experiments.fuzz.reduce.reducer import Found, reduce

__all__ = ["Found", "reduce"]
