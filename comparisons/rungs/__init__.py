"""The deterministic rungs: the film's filter; geometry, direct light, the Whitted tree.

Each but the first takes the scene, our tables of it and Mitsuba's scene.  `differ` means a
difference that float32 and Mitsuba's own epsilons do not explain; every ray that differs is first
put to our float64 tracer as the arbiter (`comparisons.rungs.rays.arbiter`).
"""

from comparisons.rungs.direct import direct
from comparisons.rungs.film import film
from comparisons.rungs.geometry import geometry
from comparisons.rungs.whitted import whitted

__all__ = ["direct", "film", "geometry", "whitted"]
