"""Russian roulette: paths that go on carry the light of those that end.

In a closed box whose walls all emit and reflect alike, a path that samples materials alone brings
the same light whatever its directions: with emission 1 and a reflectance r, the sum of r^k over its
edges.  Roulette ends some paths and makes the others heavier, and each path still has one of a few
values, by the edge at which it ended.  So the chance to survive an edge, and the weight for it, are
seen one by one, and their product must be 1.  The same code ends the paths of every scene.
"""

from collections.abc import Callable
from functools import cache

import numpy as np
from scipy import special

from comparisons.results.case import RungResult
from reference_rt.core.arrays import FloatArray
from reference_rt.integrators import Path
from reference_rt.rendering.scene import Scene

EDGES = 10
"""Of the longest path: roulette may end it after any."""

WALLS = (((0.9, 0.5, 0.2), 1 << 14), ((0.1, 0.4, 0.5), 1 << 14), ((1.0, 1.0, 1.0), 1 << 14))
"""Reflectances of the walls, and the number of paths: they survive an edge with a probability of
0.9, of 0.5, and of the greatest that roulette allows.  There a weight that is 1 % too large is off
by 1 % at the second edge, where the count has an error of 0.03 %.  Where paths end at each edge, as
16 of these do on average, the sums of their light tell the edges apart."""

LEVEL = 1e-9
"""The chance of a false alarm of a side of a count, of which there are 60."""

FEWEST = 64
"""Paths of a count, or it is left out: too few show nothing."""

SAME = 1e-9
"""Of two values, relatively: sums of a dozen products are exact to 1e-14."""

Values = Callable[[Scene, Path, int], FloatArray]
"""The radiance of n paths of a scene, one sample each: (n, 3)."""


@cache
def check() -> RungResult:
    """Check the roulette of our path tracer: once, since it is that of every scene."""
    return of_values(traced)


def of_values(values: Values) -> RungResult:
    """Check the roulette of a path tracer by the radiance of its paths."""
    tried = Path(max_depth=EDGES, rr_depth=1, sampling="bsdf")
    for reflectance, count in WALLS:
        fault = _fault(values(furnace(reflectance), tried, count), np.array(reflectance))
        if fault:
            return RungResult("sampling", "differ", fault)
    return RungResult("sampling", "agree", "roulette keeps the light of the paths that it ends")


def furnace(reflectance: tuple[float, float, float]) -> Scene:
    """A cube from -1 to 1 whose walls emit 1 inwards, and reflect."""
    x, y = [1, 0, 0], [0, 1, 0]
    turns = [(x, 0), (x, 90), (x, 180), (x, 270), (y, 90), (y, 270)]
    walls = [
        {
            "type": "rectangle",
            "material": "wall",
            "transform": [{"translate": [0, 0, -1]}, {"rotate": {"axis": axis, "degrees": angle}}],
        }
        for axis, angle in turns
    ]
    return Scene.model_validate(
        {
            "materials": {
                "paint": {"type": "diffuse", "reflectance": reflectance},
                "wall": {"type": "emissive", "radiance": 1.0, "base": "paint"},
            },
            "shapes": walls,
        }
    )


def traced(scene: Scene, integrator: Path, count: int, seed: int = 17) -> FloatArray:
    """Paths from the middle of a scene, in directions that meet no edge of the walls."""
    direction = np.broadcast_to([0.31, -0.47, 1.0], (count, 3))
    return scene.radiance(np.zeros(3), direction, spp=1, seed=seed, integrator=integrator).mean


def _likely(count: int, of: int, chance: float) -> bool:
    """Whether so many of `of` paths may have come, each with this chance."""
    if chance > 1.0 - SAME:
        return chance < 1.0 + SAME and count == of
    tails = special.bdtr(count, of, chance), special.bdtrc(count - 1, of, chance)
    return bool(min(tails) >= LEVEL)


def _fault(values: FloatArray, reflectance: FloatArray) -> str:
    """What is wrong with the values of paths; empty: nothing."""
    brightest = np.argmax(reflectance)
    values = values[np.argsort(values[:, brightest])]
    key = values[:, brightest]
    begins = np.concatenate([[0], 1 + np.flatnonzero(np.diff(key) > SAME * key[1:])])
    weights = np.diff(values[begins], axis=0, prepend=0.0)
    for k, (begin, weight) in enumerate(zip(begins.tolist(), weights, strict=True)):
        count = len(values) - begin
        if count < FEWEST:
            break
        chances = reflectance**k / weight  # with which paths of this weight must come here
        if (np.abs(np.log(chances / chances[0])) > SAME).any() or not _likely(
            count, len(values), float(chances[0])
        ):
            return (
                f"roulette does not keep the light of edge {k + 1} of paths: "
                f"{count / len(values):.4f} of them reach it, with weights for "
                f"{np.round(chances, 4).tolist()}"
            )
    # All of the tenth edge, or so few that the counts above end before it.
    if len(begins) < EDGES and len(values) - begins[-1] >= FEWEST:
        return f"no path in a closed box has more than {len(begins)} edges"
    return ""
