"""Rays that both renderers trace, and the error bounds that their hits must keep.

- Which rays: `rays` (camera, random, secondary), `camera`, `aimed` (at edges).
- Shadow rays: `any_hit`.
- How large an error float32 explains: `slide` (of a hit), `slopes` (of radiance), `light_error`.
- What a difference means: `comparer` (error over bound), `arbiter` (hits of neighbouring rays),
  `neighbours` (their radiance), `coincidence` (coincident surfaces), `judgement` (exactly).
- Mitsuba's precision as a whole: `resolution`.

Rays are arrays (n, 3) of float32 values held in float64, so that both tracers get the same numbers;
lengths are in scene units.  A ratio is an error over its bound: above 1 the hits differ.
"""
