"""Rungs: the tests of one scene, from the camera's rays up to the finished pictures.

A rung is one test of the ladder `comparisons.results.rungs.RUNGS`.  `files` holds our tables
against second sources of what the scene's files and descriptions say.  `film`, `geometry`, `direct`
and `whitted` compare without noise, ray by ray, and so does `solids`, with raysect; `sampling`
holds our samples of lights and materials against their densities, and counts Russian roulette;
`transport` holds our paths from the camera against particles from the lamps;
`layers` compares what is written beside the colour; `input` checks the pictures themselves,
`images` compares them by metrics, `comparisons.statistics` their means; `witness` asks a third
renderer.  `limited` changes `differ` to `reference-limited` above a rung that shows that Mitsuba's
precision is too low, where that explains what differs.

Contract: a rung takes the scene, our tables and Mitsuba's counterpart (or pictures, or nothing else
but the scene), and returns a
`RungResult`: its name, a status, one sentence why, and the numbers behind it (lengths in scene
units, radiance in W/sr/m²).  `differ` means a difference that float32 and Mitsuba's ray epsilons do
not explain: for every ray that differs our float64 tracer first traces its neighbours
(`comparisons.rungs.rays.arbiter`).

To add one: such a function, its name in `RUNGS`, its call in `comparisons.compare`, a test that a
planted fault breaks it.
"""

from comparisons.rungs.direct import direct
from comparisons.rungs.files import files
from comparisons.rungs.film import film
from comparisons.rungs.geometry import geometry
from comparisons.rungs.layers import layers
from comparisons.rungs.sampling import sampling
from comparisons.rungs.solids import solids
from comparisons.rungs.transport import transport
from comparisons.rungs.whitted import whitted

__all__ = [
    "direct",
    "files",
    "film",
    "geometry",
    "layers",
    "sampling",
    "solids",
    "transport",
    "whitted",
]
