"""Affine maps: identity, translate, rotate, scale, look_at, compose, invert; and their YAML form.

An affine map is a (3, 4) float64 array [A | b]: p -> A p + b for points, v -> A v for vectors,
n -> A^-T n for normals.
"""

import math
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt
from pydantic import BeforeValidator, Discriminator, Field, Tag, WithJsonSchema

from reference_rt.core.model import Description, Direction, Vector

Affine = npt.NDArray[np.float64]


IDENTITY: Affine = np.eye(3, 4)

FLAT = "the transform is singular: it flattens space; expected one that can be undone"
"""The error message for a map that has no inverse."""


def identity() -> Affine:
    return IDENTITY.copy()


def translate(offset: Vector) -> Affine:
    return np.column_stack([np.eye(3), offset])


def scale(factors: Vector) -> Affine:
    return np.column_stack([np.diag(factors), np.zeros(3)])


def rotate(axis: Direction, degrees: float) -> Affine:
    """Rotation about `axis` through the origin, counter-clockwise if the axis points at the viewer
    (Rodrigues' formula).

    Quarter turns are exact: their sines and cosines are integers.
    """
    k = np.asarray(axis) / math.hypot(*axis)
    quarter, rest = divmod(degrees, 90.0)
    if rest == 0.0:
        c, s = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[int(quarter) % 4]
    else:
        c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    cross = np.array([[0.0, -k[2], k[1]], [k[2], 0.0, -k[0]], [-k[1], k[0], 0.0]])
    matrix = c * np.eye(3) + s * cross + (1.0 - c) * np.outer(k, k)
    return np.column_stack([matrix, np.zeros(3)])


def look_at(eye: Vector, target: Vector, up: Direction) -> Affine:
    """The map whose columns are right, up, back, eye: the textbook's camera basis u, v, w at e.

    w = -(target - eye) normalised, u = up x w normalised, v = w x u.  Raises ValueError where
    these are not defined.
    """
    w = np.array([e - t for e, t in zip(eye, target, strict=True)], np.float64)
    distance = math.hypot(*w)
    if distance == 0.0:
        raise ValueError("eye and target are the same point; expected two")
    if distance == math.inf:
        raise ValueError("eye and target are too far apart; expected a finite distance")
    w /= distance
    u = np.cross(np.asarray(up) / math.hypot(*up), w)
    # The sine of the angle between up and w: below this its direction is rounding error alone.
    sine = math.hypot(*u)
    if sine < 16.0 * np.finfo(float).eps:
        raise ValueError("up is parallel to the view direction; expected another direction")
    u /= sine
    return np.column_stack([u, np.cross(w, u), w, eye])


def compose(*maps: Affine) -> Affine:
    """The map that applies `maps` in the order given: the first one first."""
    total = identity()
    for m in maps:
        total = np.column_stack([m[:, :3] @ total[:, :3], m[:, :3] @ total[:, 3] + m[:, 3]])
    return total


_REGULAR = 2.0**-40
"""A matrix of entries up to 1 whose determinant is computed as more than this has a condition
number below 2^52: rounding changes the determinant by less than 2^-47, and the number is at most
the product of the Frobenius norms of the matrix, 3, and of its adjugate, 6, over the
determinant."""


def singular(maps: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
    """Which of the maps (n, 3, 4) flatten space, or are not finite: (n,)."""
    linear = maps[:, :, :3]
    # Row scaling removes the units of each axis: a condition number above 1/u then means that the
    # rows are linearly dependent to within float64's rounding.
    norms = np.abs(linear).max(axis=2)
    found: npt.NDArray[np.bool_]
    found = ~(np.isfinite(maps).all(axis=(1, 2)) & (norms > 0.0).all(axis=1))
    norms[found] = 1.0
    with np.errstate(invalid="ignore", over="ignore"):
        scaled = linear / norms[:, :, None]
        doubtful = ~found & ~(np.abs(_determinant(np.moveaxis(scaled, 0, 2))) > _REGULAR)
    if doubtful.any():
        found[doubtful] = np.linalg.cond(scaled[doubtful]) > 2.0**52
    return found


def flattens(m: Affine) -> bool:
    """Whether one map flattens space, or is not finite: as `singular`, in a tenth of the time."""
    scaled = []
    for x, y, z, offset in m.tolist():
        norm = max(abs(x), abs(y), abs(z))
        if not (0.0 < norm < math.inf and math.isfinite(x + y + z) and math.isfinite(offset)):
            return bool(singular(m[None])[0])
        scaled.append((x / norm, y / norm, z / norm))
    return not abs(_determinant(scaled)) > _REGULAR and bool(singular(m[None])[0])


def _determinant(rows: Any) -> Any:
    """Of a matrix, or of many: rows of numbers, or of arrays of them."""
    (a, b, c), (d, e, f), (g, h, i) = rows
    return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)


def invert(m: Affine) -> Affine:
    """The inverse map.  Raises ValueError where the map flattens space."""
    if flattens(m):
        raise ValueError(FLAT)
    inverse = np.linalg.inv(m[:, :3])
    return np.column_stack([inverse, -inverse @ m[:, 3]])


_SIMILAR = 32e-16
"""Relative: each entry of the product of three columns rounds at most 8 times, and so do those of
maps that are composed of a few rotations."""


def is_similarity(linear: npt.NDArray[np.float64]) -> bool:
    """Whether a linear map A (3, 3) scales all lengths alike, to rounding: A^T A = s² 1."""
    linear = linear / np.abs(linear).max()  # squares of extreme scales overflow
    products = linear.T @ linear
    square = float(np.trace(products)) / 3.0
    return bool(np.abs(products - square * np.eye(3)).max() <= _SIMILAR * square)


def flips_orientation(m: Affine) -> bool:
    """Whether the map flips orientation: right-handed becomes left-handed."""
    return bool(np.linalg.slogdet(m[:, :3])[0] < 0.0)  # determinants of extreme scales overflow


def apply_points(m: Affine, points: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """(n, 3) points, mapped: each by the same operations, so that equal points stay equal.

    The rounding of NumPy's matrix product may depend on a point's place in the array.
    """
    mapped = np.empty(points.shape)
    for begin in range(0, len(points), _TOGETHER):
        here = slice(begin, begin + _TOGETHER)
        x, y, z = points[here, :1], points[here, 1:2], points[here, 2:]
        mapped[here] = x * m[:, 0] + y * m[:, 1] + z * m[:, 2] + m[:, 3]
    return mapped


_TOGETHER = 1 << 15
"""Points that are mapped together: more only take more memory."""


def apply_normals(m: Affine, normals: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """(n, 3) unit normals, mapped by the inverse transpose and made unit again."""
    mapped = normals @ invert(m)[:, :3]
    mapped /= np.abs(mapped).max(axis=1, keepdims=True)  # squares of extreme scales overflow
    return np.asarray(mapped / np.linalg.norm(mapped, axis=1, keepdims=True))


# ---- the YAML form ------------------------------------------------------------------------------


class Translate(Description):
    """Moves by [x, y, z]."""

    translate: Vector
    """The offset [x, y, z] in scene units."""

    def matrix_of(self) -> Affine:
        return translate(self.translate)


def _factors(value: Any) -> Any:
    return (value,) * 3 if isinstance(value, int | float) else value


class Scale(Description):
    """Scales by one factor, or by three along the axes."""

    scale: Annotated[
        Vector,
        BeforeValidator(_factors),
        WithJsonSchema({"anyOf": [{"type": "number"}, {"type": "array"}]}),
    ]
    """One factor for all axes, or three [x, y, z].  Negative ones mirror; 0 is an error."""

    def matrix_of(self) -> Affine:
        return scale(self.scale)


class Turn(Description):
    """An axis and an angle in degrees, counter-clockwise if the axis points at the viewer."""

    axis: Direction
    """The axis through the origin: a direction [x, y, z] of any length but 0."""
    degrees: float
    """The angle in degrees, counter-clockwise if the axis points at the viewer."""


class Rotate(Description):
    """Rotates about an axis through the origin."""

    rotate: Turn
    """The axis and the angle: `{axis: [x, y, z], degrees: a}`."""

    def matrix_of(self) -> Affine:
        return rotate(self.rotate.axis, self.rotate.degrees)


def _rows(value: Any) -> Any:
    """The three rows of a matrix (3, 4), or of an affine one (4, 4)."""
    rows = list(value) if isinstance(value, list | tuple) else []
    if len(rows) not in (3, 4) or not all(map(_is_row, rows)):
        raise ValueError("expected three rows of four numbers, or four of an affine matrix")
    if len(rows) == 4 and list(rows.pop()) != [0.0, 0.0, 0.0, 1.0]:
        raise ValueError("expected an affine matrix, whose last row is [0, 0, 0, 1]")
    return tuple(map(tuple, rows))


def _is_row(value: Any) -> bool:
    return isinstance(value, list | tuple) and len(value) == 4


Row = tuple[float, float, float, float]


class Matrix(Description):
    """Applies a (3, 4) matrix [A | b], given by rows; or a (4, 4) one with the last row 0 0 0 1."""

    matrix: Annotated[
        tuple[Row, Row, Row], BeforeValidator(_rows), WithJsonSchema({"type": "array"})
    ]
    """The rows of an invertible affine map: three rows of four numbers, the fourth being the offset
    in scene units; or four rows, the last being [0, 0, 0, 1]."""

    def matrix_of(self) -> Affine:
        return np.array(self.matrix)


def _kind_of_step(step: Any) -> str | None:
    keys = list(step if isinstance(step, dict) else getattr(type(step), "__pydantic_fields__", ()))
    return str(keys[0]) if len(keys) == 1 else None


Step = Annotated[
    Annotated[Translate, Tag("translate")]
    | Annotated[Scale, Tag("scale")]
    | Annotated[Rotate, Tag("rotate")]
    | Annotated[Matrix, Tag("matrix")],
    Discriminator(
        _kind_of_step,
        custom_error_type="transform_step",
        custom_error_message="expected one of 'translate', 'scale', 'rotate', 'matrix'",
    ),
]


def _steps(value: Any) -> Any:
    """A matrix alone as a list of one step."""
    if isinstance(value, list | tuple) and value and all(map(_is_row, value)):
        return ({"matrix": value},)
    return value


Transform = Annotated[tuple[Step, ...], Field(strict=False), BeforeValidator(_steps)]
"""A list of steps, applied in the order written: the first one first; or one matrix, as in
`Matrix`."""


def affine(steps: Transform) -> Affine:
    """The map of a description's transform."""
    return compose(*(step.matrix_of() for step in steps))
