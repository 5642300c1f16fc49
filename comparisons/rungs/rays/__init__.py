"""Rays that both renderers trace, and the error bounds that their hits must keep.

- Which rays: `rays` (camera, random, secondary), `camera`; those aimed at edges in `aimed`.
  `rungs/geometry.py`.
- Shadow rays: `any_hit`.
- How large an error float32 explains: `resolution`, `light_error`, and slopes in `coincidence`.
- What a difference means: `comparer` (error over bound), `arbiter` (hits of neighbouring rays),
  `coincidence` (coincident surfaces).
- Mitsuba's precision as a whole: `resolution`.

Rays are arrays (n, 3) of float32 values held in float64, so that both tracers get the same numbers;
lengths are in scene units.  A ratio is an error over its bound: above 1 the hits differ.
"""
