"""Affine maps of descriptions by other code than ours: SciPy's rotations, NumPy's inverse.

The counterpart and the exact referee are placed by these maps, so that a fault in
`reference_rt.core.transform` is in one of the two renderers only.  A map is a (3, 4) float64 array
[A | b]: p -> A p + b for points, n -> A^-T n for normals.
"""

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from reference_rt.core.arrays import FloatArray
from reference_rt.core.transform import Matrix, Rotate, Scale, Step, Translate
from reference_rt.shapes.shape import Shape, TabulationContext
from reference_rt.textures.texture import UvMap

Affine = FloatArray

IDENTITY: Affine = np.eye(3, 4)


def _rotate(axis: Sequence[float], degrees: float) -> Affine:
    unit = np.array(axis) / np.abs(axis).max()  # squares of extreme lengths overflow
    unit /= np.linalg.norm(unit)
    matrix = Rotation.from_rotvec(degrees * unit, degrees=True).as_matrix()
    # Zeros and ones of quarter turns are exact: a product of two rounded sines is within 2 u.
    whole = np.rint(matrix)
    matrix = np.where(np.abs(matrix - whole) < 2.0**-51, whole, matrix)
    return np.hstack([matrix, np.zeros((3, 1))])


def of_steps(steps: Sequence[Step]) -> Affine:
    """The map of a description's `transform`: the first step first."""
    total = IDENTITY
    for step in steps:
        match step:
            case Translate(translate=offset):
                one = np.column_stack([np.eye(3), offset])
            case Scale(scale=factors):
                one = np.diag([*factors, 0.0])[:3]
            case Rotate(rotate=turn):
                one = _rotate(turn.axis, turn.degrees)
            case Matrix(matrix=rows):
                one = np.array(rows)
        total = compose(total, one)
    return total


def of_uv(uv: UvMap) -> FloatArray:
    """The map (3, 3) of a texture's coordinates, homogeneous: scaled, turned, moved."""
    if uv.matrix is not None:
        return np.vstack([uv.matrix, [0.0, 0.0, 1.0]])
    turn = _rotate((0.0, 0.0, 1.0), uv.rotate)[:2, :2]
    return np.vstack([np.column_stack([turn @ np.diag(uv.scale), uv.offset]), [0.0, 0.0, 1.0]])


def map_in(shape: Shape, place: TabulationContext) -> Affine:
    """From a shape's own coordinates to those of its place."""
    return compose(of_steps(shape.transform), place.outer)


def compose(first: Affine, then: Affine) -> Affine:
    """The map that applies the two in this order."""
    if first is IDENTITY:
        return then
    return np.asarray(then @ np.vstack([first, [0.0, 0.0, 0.0, 1.0]]))


def invert(m: Affine) -> Affine:
    return np.asarray(np.linalg.inv(np.vstack([m, [0.0, 0.0, 0.0, 1.0]]))[:3])


def apply_points(m: Affine, points: FloatArray) -> FloatArray:
    """(n, 3) points, mapped."""
    # Not a matrix product, whose rounding may depend on a row's place: equal points stay equal.
    return np.asarray(np.einsum("ij,nj->ni", m[:, :3], points) + m[:, 3])


def apply_normals(m: Affine, normals: FloatArray) -> FloatArray:
    """(n, 3) unit normals, mapped, and unit again."""
    mapped = np.linalg.solve(m[:, :3].T, normals.T).T
    mapped /= np.abs(mapped).max(axis=1, keepdims=True)  # squares of extreme scales overflow
    return np.asarray(mapped / np.linalg.norm(mapped, axis=1, keepdims=True))


def mirrors(m: Affine) -> bool:
    """Whether right-handed becomes left-handed."""
    return bool(np.linalg.slogdet(m[:, :3])[0] < 0.0)


def is_similarity(linear: FloatArray) -> bool:
    """Whether a linear map (3, 3) scales all lengths alike: A^T A = s² 1, to the rounding of a few
    products of rotations."""
    linear = linear / np.abs(linear).max()
    gram = linear.T @ linear
    square = np.trace(gram) / 3.0
    return bool(np.abs(gram - square * np.eye(3)).max() <= 2.0**-48 * square)


def unit_vectors(rng: np.random.Generator, n: int) -> FloatArray:
    """(n, 3), uniformly distributed on the sphere."""
    v = rng.normal(size=(n, 3))
    return np.asarray(v / np.linalg.norm(v, axis=1, keepdims=True))


def across(rng: np.random.Generator, v: FloatArray) -> FloatArray:
    """Random unit vectors (n, 3) perpendicular to the vectors v (n, 3)."""
    return unit_rows(np.cross(v, unit_vectors(rng, len(v))))


def unit_rows(v: FloatArray) -> FloatArray:
    """v (..., 3), normalised."""
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))
