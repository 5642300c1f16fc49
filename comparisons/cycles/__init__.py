"""Cycles, a third renderer: scenes translated to it, and its pictures.

- `translate`: Scene -> plain data, for what Cycles computes as we do; `surfaces`: shapes as
  triangles.
- `worker`: builds and renders that data in Blender's Python; `backend`: finds it, and runs it as
  a process.

Eligible is what Cycles computes to 0.1 % of the image mean or better (measured: docs/verdict.md);
the rest raises NoCounterpartError with all reasons, and does not vote.  Descriptions and files are
translated, never our tables.  Pictures are (height, width, 3) linear radiance in float64.  Without
Blender everything raises ReferenceUnavailableError, which says how to get it.
"""
