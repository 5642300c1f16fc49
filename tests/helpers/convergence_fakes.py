"""Fake renderers of known noise and speed."""

import math

import numpy as np

from comparisons.experiments.convergence.methods import Climb, Shot
from comparisons.experiments.convergence.store import Reference

SHAPE = (12, 16, 3)
TRUE = np.random.default_rng(0).uniform(0.2, 2.0, SHAPE)
EXACT = Reference(TRUE, np.full(SHAPE, 1e-8), 16, 1024)


class Fake:
    """A renderer of known noise and speed, which counts its pictures and may be interrupted."""

    def __init__(self, noise: float = 1.0, speed: float = 1e-3, breaks_after: int = 10**9) -> None:
        self.noise, self.speed, self.left, self.asked = noise, speed, breaks_after, []

    def __call__(self, spp: int, replicate: int) -> Shot:
        if self.left == 0:
            raise KeyboardInterrupt
        self.left -= 1
        self.asked.append((spp, replicate))
        rng = np.random.default_rng([spp, replicate])
        picture = TRUE + self.noise / math.sqrt(spp) * rng.standard_normal(SHAPE)
        return Shot(picture, spp, self.speed * spp)


def climbs(**fakes: Fake) -> dict[str, Climb]:
    return {name: Climb(lambda fake=fake: fake, (4, 8, 16), 100.0) for name, fake in fakes.items()}
