"""Rays that both renderers trace, and the error bounds that their hits must keep.

- Which rays: `rays` (camera, random, secondary), `adversarial_rays` (aimed at edges), `camera`.
- Shadow rays: `any_hit`.
- How large an error float32 explains: `bounds`, `light_error`, `slopes`.
- What a difference means: `comparer` (error over bound), `arbiter` and `neighbours` (hits and
  radiance of neighbouring rays), `coincidence` (coincident surfaces), `judgement` (exact
  arithmetic).
- Direct light: `light_context`, `mitsuba_light`.  Mitsuba's precision as a whole: `resolution`.

Rays are arrays (n, 3) of float32 values held in float64, so that both tracers get the same numbers;
lengths are in scene units.  A ratio is an error over its bound: above 1 the hits differ.
"""
