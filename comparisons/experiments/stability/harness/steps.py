"""In short: steps of transforms, rays at rows of tables, and scenes in Mitsuba as they are."""

from typing import Any, NamedTuple

import numpy as np

import reference_rt as rt
from comparisons.experiments.stability.harness.core import FloatArray
from comparisons.geometry import frame
from comparisons.geometry.exact.crossings import Row
from comparisons.geometry.vectors import unit_vectors
from comparisons.mitsuba import counterpart, translate
from comparisons.mitsuba.hits import MitsubaHits
from comparisons.mitsuba.scene import picture
from reference_rt.core.transform import Matrix, Rotate, Scale, Translate, Turn

# ---- rays, each at a row of a table of its own ---------------------------------------------------


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


def vector(v: Any) -> tuple[float, float, float]:
    """Three numbers of any kind as floats."""
    x, y, z = np.asarray(v, np.float64).tolist()
    return x, y, z


def at(x: float, y: float, z: float) -> Translate:
    return Translate(translate=(x, y, z))


def scaled(*factors: float) -> Scale:
    """By three factors, or by one in all directions."""
    x, y, z = factors * 3 if len(factors) == 1 else factors
    return Scale(scale=(x, y, z))


def turned(degrees: float, axis: tuple[float, float, float] = (1.0, 0.0, 0.0)) -> Rotate:
    return Rotate(rotate=Turn(axis=axis, degrees=degrees))


def any_turn(rng: np.random.Generator) -> Rotate:
    """By any angle about any axis."""
    axis = vector(unit_vectors(rng, 1)[0])
    return turned(float(rng.uniform(0.0, 360.0)), axis)


def matrix(linear: FloatArray, center: FloatArray) -> tuple[Matrix]:
    """The one step p -> linear p + center."""
    x, y, z = (tuple(row) for row in np.column_stack([linear, center]).tolist())
    return (Matrix(matrix=(x, y, z)),)


# ---- scenes and rays in Mitsuba as they are: not moved to where float32 is most precise ----------


def loaded(scene: rt.Scene) -> Any:
    """Mitsuba's scene, in the variant that is set."""
    return translate.load(scene, frame.OURS).mi_scene


def traced(scene: rt.Scene, o: FloatArray, d: FloatArray) -> MitsubaHits:
    """The closest hits of rays (n, 3) in it."""
    return counterpart.trace(translate.load(scene, frame.OURS), o, d)


def rendered(scene: rt.Scene, spp: int, seed: int) -> FloatArray:
    """(height, width, 3)."""
    return picture(loaded(scene), spp, seed)
