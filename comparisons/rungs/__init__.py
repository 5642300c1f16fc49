"""Rungs: the tests of one scene, from the camera's rays up to the finished pictures.

A rung is one test of the ladder `comparisons.results.case.RUNGS`.  Five are functions of this
folder that compare without noise: `film`, `geometry`, `direct`, `whitted`, and `input`, which
checks the pictures themselves.  `images` compares whole pictures, `comparisons.statistics` their
means; `limited` excuses rungs above one at which Mitsuba's precision proves too low.

Contract: a rung takes the scene, our tables and Mitsuba's counterpart (or pictures), and returns a
`RungResult`: its name, a status, one sentence why, and the numbers behind it (lengths in scene
units, radiance in W/sr/m²).  `differ` means a difference that float32 and Mitsuba's ray epsilons do
not explain: every ray that differs is first repeated next to it by our float64 tracer
(`comparisons.rungs.rays.arbiter`).

To add one: such a function, its name in `RUNGS`, its call in `comparisons.compare`, a test that a
planted fault breaks it.
"""

from comparisons.rungs.direct import direct
from comparisons.rungs.film import film
from comparisons.rungs.geometry import geometry
from comparisons.rungs.whitted import whitted

__all__ = ["direct", "film", "geometry", "whitted"]
