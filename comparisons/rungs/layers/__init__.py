"""The rung of layers: what is written beside the colour, against Mitsuba's hits.

- `centres`: layers of the rays through the pixels' centres (depth and id; all layers of ray
  casting), pixel by pixel, within float32's bound.
- `means`: layers that are means over camera rays (albedo, normal), with a test that needs no
  estimate of the noise.
- `variance`: the estimated variance of a pixel against the spread over independent pictures.
- `seen`: film points, camera rays and colours by Mitsuba.

Mitsuba's AOV integrator is not used: it measures depth from the near plane, writes 0 for misses,
numbers its own shapes, and its albedo is the diffuse part alone.  All layers here are made from
Mitsuba's hits instead, by the definitions of `reference_rt.cameras.film.Film` and of
`reference_rt.integrators.RayCast`.
"""

from comparisons.rungs.layers.rung import layers

__all__ = ["layers"]
