"""POV-Ray 3.7 (double precision): a third renderer of solids and of Whitted's ray tracing.

- `translate`: Scene -> POV-Ray's scene language, for what POV-Ray computes as we do; what it has of
  a type stands in the type's file, as `to_povray`.
- `run`: finds the program, runs it, reads its pictures.
- `backend`: the renderer, and its first hits.

Its pictures have no noise: it traces the rays of our grid of samples.  Descriptions and files are
translated, never our tables.  Eligible is what was measured to be the same (docs/witness.md); the
rest raises NoCounterpartError with all reasons.  Without POV-Ray everything raises
ReferenceUnavailableError, which says how to get it.
"""
