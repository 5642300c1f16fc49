"""Checker texture: two alternating colours, 2 x 2 squares in each unit square of (u, v)."""

import math
from pathlib import Path
from typing import ClassVar, Literal, NamedTuple

import numpy as np

from reference_rt.core.arrays import FloatArray
from reference_rt.core.model import Colour, Examples
from reference_rt.core.vec3 import Vec3, row
from reference_rt.jit.kernel import kernel
from reference_rt.textures.texture import Texture


class Checker(Texture):
    """Two colours in squares: `first` where u and v lie in the same half of their unit intervals,
    `second` elsewhere."""

    EXAMPLES: ClassVar[Examples] = (
        {},
        {
            "first": (0.8, 0.7, 0.2),
            "second": 0.3,
            "uv": {"scale": (6.0, 4.0), "rotate": 20.0, "offset": (0.2, 0.1)},
        },
        {"uv": {"matrix": ((4.0, 1.0, 0.0), (0.5, 3.0, 0.1))}},
    )
    type: Literal["checker"] = "checker"
    first: Colour = (0.4, 0.4, 0.4)
    """Colour where u and v are in the same half of their unit intervals: linear sRGB of at least 0.
    """
    second: Colour = (0.2, 0.2, 0.2)
    """Colour of the other fields: linear sRGB of at least 0."""

    def tabulate(self, folder: Path) -> "Checkers":
        return Checkers(np.array([self.first, self.second]))


class Checkers(NamedTuple):
    """colours (2 n, 3): `first` and `second` of each, linear sRGB."""

    colours: FloatArray


def greatest(checkers: Checkers) -> float:
    """The largest value of any channel."""
    return float(checkers.colours.max())


@kernel
def lookup(checkers: Checkers, i: int, u: float, v: float) -> Vec3:
    """The colour at texture coordinates (u, v).

    Without a branch, which processors cannot predict (measured: 3 to 6 % of a picture's time).
    """
    is_low_u = u - math.floor(u) < 0.5
    is_low_v = v - math.floor(v) < 0.5
    return row(checkers.colours, 2 * i + int(is_low_u != is_low_v))
