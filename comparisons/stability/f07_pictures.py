"""What films look like: a turned box without a half of it."""

import numpy as np

from comparisons.stability.family import OURS, Shot


def shoot(contestant: str, x: float) -> Shot:
    raise NotImplementedError
