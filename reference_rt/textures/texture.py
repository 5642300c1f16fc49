"""What all textures share: the base description, and the uv map."""

import math
from typing import Annotated, Any, Self

import numpy as np
from pydantic import BeforeValidator, Field, WithJsonSchema, model_validator

from reference_rt.core.arrays import FloatArray
from reference_rt.core.model import Description
from reference_rt.jit.kernel import kernel


def _pair(value: Any) -> Any:
    if isinstance(value, int | float) and not isinstance(value, bool):
        value = (value, value)
    if isinstance(value, list):
        value = tuple(value)
    return value


_NUMBERS = {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2}

Pair = Annotated[
    tuple[float, float],
    BeforeValidator(_pair),
    Field(strict=False),
    WithJsonSchema({"anyOf": [{"type": "number"}, _NUMBERS]}),
]
"""Two numbers, or one for both."""


_Row = Annotated[tuple[float, float, float], Field(strict=False)]


class UvMap(Description):
    """The map from surface coordinates to texture coordinates: scaled, then rotated, then moved; or
    any affine map."""

    scale: Pair = (1.0, 1.0)
    """Factors of u and v: one number for both, or two.  Larger ones make the pattern smaller."""
    rotate: float = 0.0
    """Angle in degrees, counter-clockwise in (u, v), after scaling."""
    offset: Pair = (0.0, 0.0)
    """Added to u and v at last: one number for both, or two."""
    matrix: Annotated[tuple[_Row, _Row], Field(strict=False)] | None = None
    """Two rows of three in place of all these: u' = a u + b v + c, v' = d u + e v + f."""

    @model_validator(mode="after")
    def _one_of(self) -> Self:
        others = self.scale, self.rotate, self.offset
        if self.matrix is not None and others != ((1.0, 1.0), 0.0, (0.0, 0.0)):
            raise ValueError("has 'matrix' and others; expected it alone, or scale, rotate, offset")
        return self

    def coefficients(self) -> FloatArray:
        """(6,): u' = m0 u + m1 v + m2, v' = m3 u + m4 v + m5."""
        if self.matrix is not None:
            return np.array(self.matrix, dtype=np.float64).ravel()
        degrees = self.rotate % 360.0
        turn = math.radians(degrees)
        # Quarter turns are exact.
        c, s = (
            (round(math.cos(turn)), round(math.sin(turn)))
            if degrees % 90.0 == 0.0
            else (math.cos(turn), math.sin(turn))
        )
        (a, b), (du, dv) = self.scale, self.offset
        return np.array([c * a, -s * b, du, s * a, c * b, dv], dtype=np.float64)


class MayBeTexture:
    """Marks the fields of a description that may name a texture."""


class Texture(Description):
    """A colour, or through its luminance a number, for every point of a surface."""

    uv: UvMap = UvMap()
    """The map from the surface's coordinates (u, v) to the texture's.  Default: none."""
    uv_set: Annotated[int, Field(ge=0)] = 0
    """Which of a mesh's texture coordinates these are: 0 its `uv`, k the set k of `more_uv`."""

    def tabulate(self, folder: Any) -> Any:
        """One row of the texture's table.  Raises ValueError (what is wrong, what was expected)."""
        raise NotImplementedError


_FAR = 2.0**40


@kernel
def _near(x: float) -> float:
    """x; 0 for NaN and for |x| >= _FAR, where texel indices could overflow and x has few fractional
    bits left."""
    if not abs(x) < _FAR:
        return 0.0
    return x


@kernel
def map_uv(uv: FloatArray, k: int, u: float, v: float) -> tuple[float, float]:
    """(u, v) mapped by row k of the maps uv (n, 6); 0 for coordinates beyond 2^40."""
    return (
        _near(uv[k, 0] * u + uv[k, 1] * v + uv[k, 2]),
        _near(uv[k, 3] * u + uv[k, 4] * v + uv[k, 5]),
    )
