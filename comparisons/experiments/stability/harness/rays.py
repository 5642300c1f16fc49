"""Rays, each at a row of a table of its own."""

from typing import Any, NamedTuple

import numpy as np

from comparisons.experiments.stability.harness.outcomes import FloatArray
from comparisons.geometry.exact.crossings import Row

_SHOWN = ("center", "radius", "to_local", "coefficients", "lower", "upper", "major", "minor")


class Rays(NamedTuple):
    """n rays, each with the table row of the shape that it is tested against.

    kind: a field of `reference_rt.shapes.Shapes`;  row: columns of n rows;  size (n,): the radius,
    or half the diagonal;  o, d (n, 3).
    """

    kind: str
    row: Row
    size: FloatArray
    o: FloatArray
    d: FloatArray

    def distance(self) -> FloatArray:
        """D (n,): of the origins from the shapes' centres."""
        return np.asarray(np.linalg.norm(self.o - self.row["center"], axis=1))

    def speed(self) -> FloatArray:
        return np.asarray(np.linalg.norm(self.d, axis=1))

    def columns(self) -> dict[str, FloatArray]:
        """The shapes and the rays, (n, k) each, as the examples of an outcome show them."""
        shown = {name: self.row[name] for name in _SHOWN if name in self.row}
        rows = shown | {"o": self.o, "d": self.d}
        return {name: np.reshape(column, (len(self.o), -1)) for name, column in rows.items()}

    def only(self, which: Any) -> "Rays":
        row = {name: np.asarray(column)[which] for name, column in self.row.items()}
        return Rays(self.kind, row, self.size[which], self.o[which], self.d[which])
